// SPDX-License-Identifier: MIT
#include "tally.h"

#include "iwheel_northbound/words.h"

#include <string.h>

_Static_assert((unsigned)IW_CAUSES <= WEB_CAUSES, "a place for each cause");

static unsigned cause_of(const iwc_message_t *stop) {
    char name[32];
    (void)iwc_text(stop, "cause", name, sizeof name);
    for (unsigned cause = IW_CAUSE_NONE + 1U; cause < IW_CAUSES; cause++) {
        if (strcmp(name, iwn_cause_name((iw_cause_t)cause)) == 0) {
            return cause;
        }
    }
    return IW_CAUSE_NONE;
}

/// Returns the number of stops between the last one and this one. After a restart the gateway counts from 1.
static uint64_t count_missed(const web_tally_t *self, int64_t number) {
    return (uint64_t)((number > self->number) ? number - self->number - 1 : number - 1);
}

void web_tally_take(web_tally_t *self, const iwc_message_t *stop, bool is_event) {
    const int64_t number = iwc_integer(stop, "number").value;
    const int64_t at_us = iwc_integer(stop, "at_us").value;
    const bool is_counted = self->begun || is_event;
    const bool is_same = self->begun && number == self->number && at_us == self->at_us;
    const bool has_missed = self->begun && number > 0;
    if (is_same || number < 0) {
        return;
    }
    if (number > 0) {
        self->by_cause[IW_CAUSE_NONE] += has_missed ? count_missed(self, number) : 0U;
        self->by_cause[cause_of(stop)] += is_counted ? 1U : 0U;
        self->wall_us = iwc_integer(stop, "wall_us").value;
        self->at_us = at_us;
    }
    self->number = number;
    self->begun = true;
}
