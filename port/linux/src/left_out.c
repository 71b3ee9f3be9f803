// SPDX-License-Identifier: MIT
// Replaces the parts of a build without some libraries: each is NULL, and programs report it with the fix.
#include "bus.h"

#include <errno.h>

#ifdef IWL_WITHOUT_LIBMNL // Without libmnl the bus timing cannot be verified.
const iwl_bus_kind_t *const iwl_socketcan_kind = NULL;
#endif
#ifdef IWL_WITHOUT_LIBGPIOD
const iwl_estop_ops_t *const iwl_gpio_estop_ops = NULL;

int iwl_estop_see(const char *name, iwl_estop_seen_t *out_seen) {
    (void)name;
    (void)out_seen;
    return ENOTSUP;
}
#endif
