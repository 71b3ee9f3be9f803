// SPDX-License-Identifier: MIT
/// @file
/// Bit timing of a CAN controller: from clock, bit rate and sample point to segments, and back.
///
/// A bit is 1 + tseg1 + tseg2 quanta of `prescaler` clock periods; it is sampled after 1 + tseg1 of them. tseg1 is
/// the propagation segment and phase segment 1 together (bxCAN: BS1; Linux: prop_seg + phase_seg1), tseg2 is phase
/// segment 2 (BS2). Pure functions.
#ifndef IW_BIT_TIMING_H
#define IW_BIT_TIMING_H

#include "iwheel/types.h"

/// The iWheel's bus, from its document: 1 Mbit/s, sampled at 62.5 % of the bit.
#define IW_BUS_BITRATE_HZ            1000000U
#define IW_BUS_SAMPLE_POINT_PERMILLE 625U ///< Of the bit.

/// What a controller can be set to, inclusive.
typedef struct {
    uint16_t prescaler_max; ///< From 1.
    uint16_t tseg1_min;     ///< A tseg1 of 0 is never chosen.
    uint16_t tseg1_max;     ///< Quanta.
    uint16_t tseg2_min;     ///< Quanta.
    uint16_t tseg2_max;     ///< Quanta.
} iw_bit_timing_limits_t;

/// bxCAN (STM32F1/F4 reference manuals, CAN_BTR): prescaler 1..1024, BS1 1..16, BS2 1..8.
#define IW_BIT_TIMING_BXCAN ((iw_bit_timing_limits_t){1024U, 1U, 16U, 1U, 8U})

/// A setting of the controller.
typedef struct {
    uint16_t prescaler; ///< Clock periods in a quantum.
    uint16_t tseg1;     ///< Quanta between the first one and the sample point.
    uint16_t tseg2;     ///< Quanta from the sample point to the end of the bit.
} iw_bit_timing_t;

/// What a setting comes to on a clock.
typedef struct {
    uint32_t bitrate_hz;            ///< Rounded to the nearest.
    uint16_t sample_point_permille; ///< Rounded to the nearest.
} iw_bit_timing_achieved_t;

/// Finds segments that give `bitrate_hz` exactly and the sample point nearest to the wanted one; of equals, the one
/// with the most quanta, and of these the one that samples later. IW_ERR_RANGE, `*out_timing` untouched, if no setting
/// gives that rate exactly or an argument is 0. The caller judges the sample point with `iw_bit_timing_achieved`.
iw_status_t iw_bit_timing_solve(const iw_bit_timing_limits_t *limits, uint32_t clock_hz,
                                const iw_bit_timing_achieved_t *wanted, iw_bit_timing_t *out_timing);

/// What the given segments do on that clock. A prescaler of 0 gives {0, 0}, and so does a bit of
/// more than UINT32_MAX clock periods.
iw_bit_timing_achieved_t iw_bit_timing_achieved(uint32_t clock_hz, const iw_bit_timing_t *timing);

#endif
