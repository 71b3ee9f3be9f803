// SPDX-License-Identifier: MIT
#include "iwheel_linux/backend.h"

#include "unix_link.h"

#include <net/if.h>
#include <string.h>

/// The name alone decides. A name too long for an interface is refused here: cut off, it could name another one.
const iw_bus_ops_t *iw_bus_backend(const char *name) {
    if (iw_unix_link_is_name(name)) {
        return &iw_local_bus_ops;
    }
    return (name[0] != '\0' && strlen(name) < IFNAMSIZ) ? iw_socketcan_ops : NULL;
}

const iw_estop_ops_t *iw_estop_backend(const char *name) {
    if (iw_unix_link_is_name(name)) {
        return &iw_unix_estop_ops;
    }
    return (strcmp(name, "none") == 0) ? &iw_no_estop_ops : iw_gpio_estop_ops;
}
