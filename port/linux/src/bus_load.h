// SPDX-License-Identifier: MIT
/// How much of its time the bus is taken, second by second.
#ifndef BUS_LOAD_H
#define BUS_LOAD_H

#include "iwheel/types.h"

typedef struct {
    iw_time_us_t since_us;
    uint64_t bits; ///< Of the frames since then.
} iw_bus_load_t;

/// Begins a new second.
void iw_bus_load_begin(iw_bus_load_t *self, iw_time_us_t now_us);

/// The load in thousandths, once the second is over; then the next one begins. False before, output untouched. A bit
/// rate of 0 is not known: it is taken for that of the wheels.
bool iw_bus_load_take(iw_bus_load_t *self, iw_time_us_t now_us, uint32_t bitrate_hz, uint32_t *out_permille);

#endif
