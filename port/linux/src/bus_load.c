// SPDX-License-Identifier: MIT
#include "bus_load.h"

#define US_PER_S 1000000U
/// The wheels' bit rate, where the kernel reports none.
#define BITRATE_ASSUMED_HZ 1000000U

void iw_bus_load_begin(iw_bus_load_t *self, iw_time_us_t now_us) {
    *self = (iw_bus_load_t){.since_us = now_us};
}

bool iw_bus_load_take(iw_bus_load_t *self, iw_time_us_t now_us, uint32_t bitrate_hz, uint32_t *out_permille) {
    const iw_time_us_t span_us = now_us - self->since_us;
    if (span_us < US_PER_S) {
        return false;
    }
    const uint64_t rate_hz = (bitrate_hz != 0U) ? bitrate_hz : BITRATE_ASSUMED_HZ;
    *out_permille = (uint32_t)(self->bits * US_PER_S / rate_hz * 1000U / span_us);
    iw_bus_load_begin(self, now_us);
    return true;
}
