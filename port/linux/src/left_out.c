// SPDX-License-Identifier: MIT
// What this build cannot do, because a library is missing: each is then NULL, and programs say so and tell the cure.
#include "bus.h"

#include <errno.h>

#ifdef IW_WITHOUT_LIBMNL // Without it the bus timing could not be verified.
const iw_bus_kind_t *const iw_socketcan_kind = NULL;
#endif
#ifdef IW_WITHOUT_LIBGPIOD
const iw_estop_ops_t *const iw_gpio_estop_ops = NULL;

int iw_estop_see(const char *name, iw_estop_seen_t *out_seen) {
    (void)name;
    (void)out_seen;
    return ENOTSUP;
}
#endif
