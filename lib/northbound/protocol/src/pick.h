// SPDX-License-Identifier: MIT
/// Returns one word of a table; "unknown" beyond its end and for its gaps.
#ifndef IWHEEL_NORTHBOUND_PICK_H
#define IWHEEL_NORTHBOUND_PICK_H

#include "iwheel_northbound/words.h"

#define PICK(table, index) iwn_pick((table), sizeof(table) / sizeof((table)[0]), (size_t)(index))
const char *iwn_pick(const char *const *table, size_t size, size_t index);

#endif
