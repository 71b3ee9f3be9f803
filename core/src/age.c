// SPDX-License-Identifier: MIT
#include "arithmetic.h"

uint32_t iw_age_us(iw_time_us_t then_us, iw_time_us_t now_us) {
    const iw_time_us_t age_us = now_us - then_us;
    if (then_us > now_us || age_us > UINT32_MAX) {
        return UINT32_MAX;
    }
    return (uint32_t)age_us;
}
