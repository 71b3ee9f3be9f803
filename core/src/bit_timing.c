// SPDX-License-Identifier: MIT
#include "iwheel/bit_timing.h"

static uint32_t divide_rounded(uint32_t numerator, uint32_t denominator) {
    const uint32_t quotient = numerator / denominator;
    return quotient + ((numerator % denominator >= denominator - denominator / 2U) ? 1U : 0U);
}

iw_bit_timing_achieved_t iw_bit_timing_achieved(uint32_t clock_hz, const iw_bit_timing_t *timing) {
    iw_bit_timing_achieved_t achieved = {0, 0};
    const uint32_t quanta = 1U + timing->tseg1 + timing->tseg2;
    const uint32_t clocks = timing->prescaler * quanta;
    if (clocks > 0U && clocks / quanta == timing->prescaler) {
        achieved.bitrate_hz = divide_rounded(clock_hz, clocks);
        achieved.sample_point_permille = (uint16_t)divide_rounded(1000U * (1U + timing->tseg1), quanta);
    }
    return achieved;
}

/// Finds the split of `quanta` that is nearest to the wanted sample point. Returns its error in permille, or UINT32_MAX
/// if there is none.
static uint32_t split(const iw_bit_timing_limits_t *limits, uint32_t quanta, uint32_t permille,
                      iw_bit_timing_t *out_timing) {
    uint32_t best = UINT32_MAX;
    for (uint32_t tseg2 = limits->tseg2_min; tseg2 <= limits->tseg2_max && tseg2 + 1U < quanta; tseg2++) {
        const uint32_t tseg1 = quanta - 1U - tseg2;
        const uint32_t sample = divide_rounded(1000U * (1U + tseg1), quanta);
        const uint32_t error = (sample > permille) ? sample - permille : permille - sample;
        if (tseg1 >= limits->tseg1_min && tseg1 <= limits->tseg1_max && error < best) {
            best = error;
            out_timing->tseg1 = (uint16_t)tseg1;
            out_timing->tseg2 = (uint16_t)tseg2;
        }
    }
    return best;
}

iw_status_t iw_bit_timing_solve(const iw_bit_timing_limits_t *limits, uint32_t clock_hz,
                                const iw_bit_timing_achieved_t *wanted, iw_bit_timing_t *out_timing) {
    const uint32_t rate = wanted->bitrate_hz;
    uint32_t best = UINT32_MAX;
    if (rate == 0U || wanted->sample_point_permille == 0U || clock_hz % rate != 0U) {
        return IW_ERR_RANGE;
    }
    const uint32_t clocks = clock_hz / rate;
    for (uint32_t prescaler = 1; prescaler <= limits->prescaler_max; prescaler++) {
        iw_bit_timing_t candidate = {.prescaler = (uint16_t)prescaler};
        const uint32_t quanta = (clocks % prescaler == 0U) ? clocks / prescaler : 0U;
        const uint32_t error = split(limits, quanta, wanted->sample_point_permille, &candidate);
        if (error < best) {
            best = error;
            *out_timing = candidate;
        }
    }
    return (best != UINT32_MAX) ? IW_OK : IW_ERR_RANGE;
}
