// SPDX-License-Identifier: MIT
// Built in place of SocketCAN where libmnl is missing: without it the bus timing could not be verified.
#include "iwheel_linux/backend.h"

const iw_bus_ops_t *const iw_socketcan_ops = NULL;
