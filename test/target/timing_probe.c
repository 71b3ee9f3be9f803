// SPDX-License-Identifier: MIT
// Compiled for one clock of the bus controller after the other: the constants of bit_rate.h must be valid and equal the result of the
// core's solver.
#include "bit_rate.h"

#include <stdio.h>

static bool is_exact(const iw_bit_timing_t *timing) {
    const iw_bit_timing_achieved_t achieved = iw_bit_timing_achieved(BRD_APB1_HZ, timing);
    return achieved.bitrate_hz == IW_BUS_BITRATE_HZ && achieved.sample_point_permille == IW_BUS_SAMPLE_POINT_PERMILLE;
}

#ifdef BRD_FDCAN_ADDRESS
#define LIMITS   ((iw_bit_timing_limits_t){512U, 2U, 256U, 2U, 128U}) // RM0440 44.4: NBTP.
#define JUMP     (((BRD_BIT_BTR >> 25) & 0x7FU) + 1U)
#define JUMP_MAX 128U

/// Decodes NBTP as in the reference manual: every field is one less than its value.
static iw_bit_timing_t decode(uint32_t nbtp) {
    return (iw_bit_timing_t){(uint16_t)(((nbtp >> 16) & 0x1FFU) + 1U), (uint16_t)(((nbtp >> 8) & 0xFFU) + 1U),
                             (uint16_t)((nbtp & 0x7FU) + 1U)};
}
#else
#define LIMITS   IW_BIT_TIMING_BXCAN
#define JUMP     (((BRD_BIT_BTR >> 24) & 3U) + 1U)
#define JUMP_MAX 4U

/// Decodes BTR as in the reference manual: every field is one less than its value.
static iw_bit_timing_t decode(uint32_t btr) {
    return (iw_bit_timing_t){(uint16_t)((btr & 0x3FFU) + 1U), (uint16_t)(((btr >> 16) & 0xFU) + 1U),
                             (uint16_t)(((btr >> 20) & 0x7U) + 1U)};
}
#endif

int main(void) {
    const iw_bit_timing_limits_t limits = LIMITS;
    const iw_bit_timing_achieved_t wanted = {IW_BUS_BITRATE_HZ, IW_BUS_SAMPLE_POINT_PERMILLE};
    const iw_bit_timing_t ours = decode(BRD_BIT_BTR);
    const uint32_t jump = JUMP;
    iw_bit_timing_t solved = {0, 0, 0};
    const bool is_solved = iw_bit_timing_solve(&limits, BRD_APB1_HZ, &wanted, &solved) == IW_OK;
    const bool same = ours.prescaler == solved.prescaler && ours.tseg1 == solved.tseg1 && ours.tseg2 == solved.tseg2;
    (void)printf("%u Hz: BTR 0x%08X\n", (unsigned)BRD_APB1_HZ, (unsigned)BRD_BIT_BTR);
    return (is_exact(&ours) && is_solved && same && jump <= ours.tseg2 && jump <= JUMP_MAX) ? 0 : 1;
}
