// SPDX-License-Identifier: MIT
// What this build cannot do, because a library is missing: each is then NULL, and programs say so and tell the cure.
#include "bus.h"

#include <errno.h>

#ifdef IWL_WITHOUT_LIBMNL // Without it the bus timing could not be verified.
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
