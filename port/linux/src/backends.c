// SPDX-License-Identifier: MIT
#include "iwheel_linux/backend.h"

#include "unix_link.h"

#include <string.h>

const iw_bus_ops_t *iw_bus_backend(const char *name) {
    return iw_unix_link_is_name(name) ? &iw_local_bus_ops : NULL;
}

const iw_estop_ops_t *iw_estop_backend(const char *name) {
    if (iw_unix_link_is_name(name)) {
        return &iw_unix_estop_ops;
    }
    return strcmp(name, "none") == 0 ? &iw_no_estop_ops : NULL;
}
