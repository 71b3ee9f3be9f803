// SPDX-License-Identifier: MIT
/// Status lines on the console: one line at the start, one for each change, and both again when a character is
/// received.
///
///     iwheel 0.3.0 on STM32F103 (Blue Pill): clock 64 MHz from a crystal of 8000 kHz; CAN on PB8 PB9 at 1000000 bit/s,
///     sampled at 62.5 %, BTR 0x03590001; e-stop on PB0: released; holds both wheels at zero
///     latched by send_stalled; bus active; e-stop released; to reset: fix the cause, release the e-stop, then press
///     the button on PA1
#ifndef BRD_REPORT_H
#define BRD_REPORT_H

#include "iwheel/snapshot.h"

void brd_report_no_crystal(void);

/// Prints the first line. `restarted`: the previous run was sending when it ended, so this run begins with zeros.
void brd_report_start(bool restarted);

/// Returns the snapshot that the loop fills after each step. A module that reports needs one anyway, so it owns this
/// one.
iw_snapshot_t *brd_report_room(void);

/// Call it after each step. Prints a line if state, cause, bus or e-stop has changed, or if a character was received.
void brd_report_step(const iw_snapshot_t *seen, bool estop_pressed);

/// Prints the result of a reset that a press of the button requested.
void brd_report_reset(iw_refusal_t refusal);

#endif
