// SPDX-License-Identifier: MIT
/// Bit timing of the iWheel bus: exactly 1 Mbit/s with the sample point at 62.5 %. The compiler computes it from the
/// board's APB1 clock, which is the clock of both controllers.
///
/// 62.5 % is 5/8, so a bit must have a multiple of 8 quanta, and a bit of bxCAN has at most 25 (bxCAN 7.7: 1 + 16 + 8).
/// 24 quanta would need 14 before and 9 after the sample point, one more than bxCAN allows. 8 and 16 remain, so APB1
/// must be a multiple of 8 MHz; another clock does not compile. A bit has 16 quanta if the clock allows it, because
/// finer quanta make the resynchronisation finer. A bit of FDCAN has up to 385 quanta (RM0440 44.4), so that its
/// prescaler is 1: at 80 MHz a bit has 80 quanta, and the sample point is after 50 of them.
#ifndef BRD_BIT_RATE_H
#define BRD_BIT_RATE_H

#include "board.h"
#include "iwheel/bit_timing.h"

#include <assert.h>

#ifdef BRD_FDCAN_ADDRESS
#define BRD_BIT_QUANTA   (BRD_APB1_HZ / IW_BUS_BITRATE_HZ)
#define BRD_BIT_SJW_MAX  128U
#define BRD_BIT_BS1_MAX  256U
#define BRD_BIT_BS2_MAX  128U
#define BRD_BIT_REGISTER "NBTP" ///< Name of the register with the bit timing.
#else
#define BRD_BIT_QUANTA   ((BRD_APB1_HZ % (16U * IW_BUS_BITRATE_HZ) == 0U) ? 16U : 8U)
#define BRD_BIT_SJW_MAX  4U
#define BRD_BIT_BS1_MAX  16U
#define BRD_BIT_BS2_MAX  8U
#define BRD_BIT_REGISTER "BTR"
#endif
#define BRD_BIT_PRESCALER (BRD_APB1_HZ / IW_BUS_BITRATE_HZ / BRD_BIT_QUANTA)
#define BRD_BIT_BS1       (BRD_BIT_QUANTA * 5U / 8U - 1U)
#define BRD_BIT_BS2       (BRD_BIT_QUANTA * 3U / 8U)
/// Resynchronisation jump width: as wide as possible, to tolerate different oscillators on the wheels and on the board.
#define BRD_BIT_SJW ((BRD_BIT_BS2 < BRD_BIT_SJW_MAX) ? BRD_BIT_BS2 : BRD_BIT_SJW_MAX)

/// Value of BTR (bxCAN 9.2) or NBTP (RM0440 44.4): each field contains its number minus one.
#ifdef BRD_FDCAN_ADDRESS
#define BRD_BIT_BTR                                                                                                    \
    (((BRD_BIT_SJW - 1U) << 25) | ((BRD_BIT_PRESCALER - 1U) << 16) | ((BRD_BIT_BS1 - 1U) << 8) | (BRD_BIT_BS2 - 1U))
#else
#define BRD_BIT_BTR                                                                                                    \
    (((BRD_BIT_SJW - 1U) << 24) | ((BRD_BIT_BS2 - 1U) << 20) | ((BRD_BIT_BS1 - 1U) << 16) | (BRD_BIT_PRESCALER - 1U))
#endif

static_assert(BRD_APB1_HZ != 0U && BRD_APB1_HZ % 8000000U == 0U,
              "this APB1 clock cannot produce 1 Mbit/s sampled at exactly 62.5 %: change the board's clock tree so "
              "that APB1 is a "
              "multiple of 8 MHz (8, 16, 24, 32, 40 or 48 MHz can; 36, 42, 45, 54 and 170 MHz cannot)");
static_assert(BRD_BIT_PRESCALER <= 512U && BRD_BIT_BS1 <= BRD_BIT_BS1_MAX && BRD_BIT_BS2 <= BRD_BIT_BS2_MAX,
              "the controller has no such segments");
static_assert(BRD_BIT_PRESCALER * BRD_BIT_QUANTA * IW_BUS_BITRATE_HZ == BRD_APB1_HZ, "not exactly 1 Mbit/s");
static_assert((1U + BRD_BIT_BS1) * 1000U == IW_BUS_SAMPLE_POINT_PERMILLE * BRD_BIT_QUANTA, "not exactly 62.5 %");
static_assert(1U + BRD_BIT_BS1 + BRD_BIT_BS2 == BRD_BIT_QUANTA, "the segments do not make a bit");

#endif
