// SPDX-License-Identifier: MIT
#include "marker.h"

#define SENDING 0x5E4D146BU // Two words, one the other's inverse: RAM after power-on does not look like this.

__attribute__((section(".noinit"))) static volatile uint32_t word, inverse;

static iw_time_us_t zeros_us; // Since when nothing but zeros is demanded; 0: something else is, or nothing.
static bool zeros_proven;     // Both wheels' zeros of this hold have been acknowledged.

static void set(bool sending) {
    word = sending ? SENDING : 0U;
    inverse = sending ? ~SENDING : 0U;
}

/// Not cleared here when set: a run that dies before its zeros are acknowledged must find it again.
bool brd_marker_take(bool power_on) {
    const bool was_sending = !power_on && word == SENDING && inverse == ~SENDING;
    if (!was_sending) {
        set(false);
    }
    return was_sending;
}

/// A zero that was only handed over proves nothing; the marker goes with the first zeros that both wheels acknowledged.
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
