// SPDX-License-Identifier: MIT
// Two contacts of the e-stop: pressed by either, released by both, and a difference that lasts is told until it is mended.
#include "oracle_parts.h"

void oracle_contacts(oracle_t *self, iw_time_us_t now_us, const int said[2], int result) {
    const bool readable = said[0] >= 0 && said[1] >= 0;
    const unsigned pressed = ((said[0] > 0) ? 1U : 0U) + ((said[1] > 0) ? 1U : 0U);
    if (result == 0 && (!readable || pressed > 0U)) {
        oracle_break(self, now_us, 815, "released although a contact says otherwise");
    }
    if (readable && pressed == 1U) {
        self->apart_us = self->apart ? self->apart_us : now_us;
        if (now_us - self->apart_us > ORACLE_CONTACTS_US) {
            self->quarrel = true;
            self->both_pressed = false;
        }
    }
    self->apart = readable && pressed == 1U;
    if (!readable) {
        self->both_pressed = false;
    } else if (self->quarrel && pressed == 2U) {
        self->both_pressed = true;
    } else if (self->both_pressed && pressed == 0U) {
        self->quarrel = false;
        self->both_pressed = false;
    }
}

/// A contact that cannot be read makes the whole unreadable, which is another cause.
void oracle_judge_contacts(oracle_t *self, iw_time_us_t now_us) {
    const uint32_t present = iw_permit_present(&self->gateway->permit, now_us);
    const bool told = (present & (1U << IW_CAUSE_ESTOP_DISAGREES)) != 0U;
    if (self->estop >= 0 && told != self->quarrel) {
        oracle_break(self, now_us, 816, "contacts that %s", told ? "agree are told to disagree" : "disagree unseen");
    }
}

void oracle_judge_quarrel(oracle_t *self, iw_time_us_t now_us) {
    if (self->quarrel) {
        oracle_break(self, now_us, 817, "reset before both contacts were seen pressed, then released");
    }
}
