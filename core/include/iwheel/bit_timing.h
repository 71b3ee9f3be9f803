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

#ifdef __cplusplus
extern "C" {
#endif

/// The iWheel's bus, from its document: 1 Mbit/s, sampled at 62.5 % of the bit.
#define IW_BUS_BITRATE_HZ            1000000U
#define IW_BUS_SAMPLE_POINT_PERMILLE 625U ///< Sample point in permille of the bit.

/// Limits of a controller, inclusive.
typedef struct {
    uint16_t prescaler_max; ///< Largest prescaler. The smallest is 1.
    uint16_t tseg1_min;     ///< Smallest tseg1 in quanta. The solver never chooses 0.
    uint16_t tseg1_max;     ///< Largest tseg1 in quanta.
    uint16_t tseg2_min;     ///< Smallest tseg2 in quanta.
    uint16_t tseg2_max;     ///< Largest tseg2 in quanta.
} iw_bit_timing_limits_t;

/// bxCAN (STM32F1/F4 reference manuals, CAN_BTR): prescaler 1..1024, BS1 1..16, BS2 1..8.
#define IW_BIT_TIMING_BXCAN ((iw_bit_timing_limits_t){1024U, 1U, 16U, 1U, 8U})

/// Bit timing of a controller.
typedef struct {
    uint16_t prescaler; ///< Clock periods in a quantum.
    uint16_t tseg1;     ///< Quanta between the first one and the sample point.
    uint16_t tseg2;     ///< Quanta from the sample point to the end of the bit.
} iw_bit_timing_t;

/// Bit rate and sample point of a bit timing on a clock.
typedef struct {
    uint32_t bitrate_hz;            ///< Rounded to the nearest.
    uint16_t sample_point_permille; ///< Rounded to the nearest.
} iw_bit_timing_achieved_t;

/// Finds the bit timing with exactly the wanted bit rate and the nearest sample point. Among equally good ones it
/// returns the one with the most quanta, then the one that samples later. Returns IW_ERR_RANGE and leaves `*out_timing`
/// unchanged if there is none or an argument is 0. The caller checks the sample point with `iw_bit_timing_achieved`.
iw_status_t iw_bit_timing_solve(const iw_bit_timing_limits_t *limits, uint32_t clock_hz,
                                const iw_bit_timing_achieved_t *wanted, iw_bit_timing_t *out_timing);

/// Returns the bit rate and the sample point of a bit timing. Returns {0, 0} if the prescaler is 0, or if a bit has
/// more than UINT32_MAX clock periods.
iw_bit_timing_achieved_t iw_bit_timing_achieved(uint32_t clock_hz, const iw_bit_timing_t *timing);

#ifdef __cplusplus
}
#endif
#endif
