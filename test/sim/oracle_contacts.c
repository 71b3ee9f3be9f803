// SPDX-License-Identifier: MIT
// Two contacts of the e-stop: either presses, both release, and a lasting difference is reported until it is fixed.
#include "oracle_parts.h"

void oracle_contacts(oracle_t *self, iw_time_us_t now_us, const int reading[2], int result) {
    const bool readable = reading[0] >= 0 && reading[1] >= 0;
    const unsigned pressed = ((reading[0] > 0) ? 1U : 0U) + ((reading[1] > 0) ? 1U : 0U);
    if (result == 0 && (!readable || pressed > 0U)) {
        oracle_break(self, now_us, 815, "released although a contact is pressed or unreadable");
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

/// A contact that cannot be read makes the e-stop unreadable, which is another cause.
void oracle_judge_contacts(oracle_t *self, iw_time_us_t now_us) {
    const uint32_t present = iw_permit_present(&self->gateway->permit, now_us);
    const bool reported = (present & (1U << IW_CAUSE_ESTOP_DISAGREES)) != 0U;
    if (self->estop >= 0 && reported != self->quarrel) {
        oracle_break(self, now_us, 816, "contacts that %s",
                     reported ? "agree are reported to disagree" : "disagree are not reported");
    }
}

void oracle_judge_quarrel(oracle_t *self, iw_time_us_t now_us) {
    if (self->quarrel) {
        oracle_break(self, now_us, 817, "reset before both contacts were seen pressed, then released");
    }
}
