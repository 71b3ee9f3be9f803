// SPDX-License-Identifier: MIT
/// What the image tells on the console: one line at the start, one for each change, and both again when somebody types
/// anything.
///
///     iwheel 0.3.0 on STM32F103 (Blue Pill): clock 64 MHz from a crystal of 8000 kHz; CAN on PB8 PB9 at 1000000 bit/s,
///     sampled at 62.5 %, BTR 0x03590001; e-stop on PB0: released; holds both wheels at zero
///     latched by send_stalled; bus active; e-stop released; to reset: mend the cause, release the e-stop, then press
///     the button on PA1
#ifndef BRD_REPORT_H
#define BRD_REPORT_H

#include "iwheel/snapshot.h"

void brd_report_no_crystal(void);

/// The first line. `restarted`: the run before was sending, so zeros come first.
void brd_report_start(bool restarted);

/// Where the loop puts the snapshot after each step: whoever reports has one anyway.
iw_snapshot_t *brd_report_room(void);

/// After each step: a line when state, cause, bus or e-stop changed, or somebody asks.
void brd_report_step(const iw_snapshot_t *seen, bool estop_pressed);

/// How a press of the button that should reset was answered.
void brd_report_reset(iw_refusal_t refusal);

#endif
