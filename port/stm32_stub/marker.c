// SPDX-License-Identifier: MIT
#include "marker.h"

#define SENDING 0x5E4D146BU // Two words, one the other's inverse: RAM after power-on does not look like this.

__attribute__((section(".noinit"))) static volatile uint32_t word, inverse;

bool iw_marker_take(bool power_on) {
    const bool was_sending = !power_on && word == SENDING && inverse == ~SENDING;
    iw_marker_set(false);
    return was_sending;
}

void iw_marker_set(bool sending) {
    word = sending ? SENDING : 0U;
    inverse = sending ? ~SENDING : 0U;
}
