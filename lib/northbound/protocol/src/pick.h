// SPDX-License-Identifier: MIT
/// One word out of a table; "unknown" beyond its end and for its gaps.
#ifndef IWHEEL_NORTHBOUND_PICK_H
#define IWHEEL_NORTHBOUND_PICK_H

#include "iwheel_northbound/words.h"

#define PICK(table, index)                                                                                             \
    (((size_t)(index) < sizeof(table) / sizeof((table)[0]) && (table)[index] != NULL) ? (table)[index] : "unknown")

#endif
