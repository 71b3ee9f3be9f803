// SPDX-License-Identifier: MIT
// Built in place of SocketCAN where libmnl is missing: without it the bus timing could not be verified.
#include "bus.h"

const iw_bus_kind_t *const iw_socketcan_kind = NULL;
