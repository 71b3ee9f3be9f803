// SPDX-License-Identifier: MIT
#include "marker.h"

#define SENDING 0x5E4D146BU // Stored with its inverse: RAM that has lost its contents does not have such a pair.

__attribute__((section(".noinit"))) static volatile uint32_t word, inverse;

static iw_time_us_t zeros_us; // Time since which only zeros are demanded; 0: something else is demanded, or nothing.
static bool zeros_proven;     // Both wheels have acknowledged zeros in this hold.

static void set(bool sending) {
    word = sending ? SENDING : 0U;
    inverse = sending ? ~SENDING : 0U;
}

/// Does not clear a set marker: if this run ends before its zeros are acknowledged, the next run must find it.
/// A brown-out of the board alone counts as power-on, but RAM often survives it, and the wheels continue. A start then
/// begins with zeros too.
bool brd_marker_take(void) {
    const bool was_sending = word == SENDING && inverse == ~SENDING;
    if (!was_sending) {
        set(false);
    }
    return was_sending;
}

/// A zero that was only passed to the bus proves nothing. Only zeros that both wheels acknowledged clear the marker.
void brd_marker_step(const iw_snapshot_t *seen) {
    const bool silent = seen->demand == IW_DEMAND_SILENCE;
    if (!silent) {
        set(true);
    } else if (zeros_proven) {
        set(false);
    }
    if (silent || !seen->output_zero) {
        zeros_us = 0;
        zeros_proven = false;
    } else if (zeros_us == 0U) {
        zeros_us = seen->at_us;
    } else {
        zeros_proven = zeros_proven || seen->confirmed_us >= zeros_us;
    }
}
