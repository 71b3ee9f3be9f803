// SPDX-License-Identifier: MIT
#include "screen.h"
#include "talk/ctl.h"
#include "text/text.h"

#include <stdio.h>

int verb_status(ctl_t *self, int count, char **words) {
    json_t *status = NULL;
    json_t *why = NULL;
    if (!ctl_words_at_most("status", count, 0, words)) {
        return CTL_USAGE;
    }
    const int code = ctl_ask(self, json_pack("{s:s}", "cmd", "status"), &status);
    if (code != CTL_OK || self->json) {
        json_decref(status);
        return code;
    }
    if (ctl_ask(self, json_pack("{s:s}", "cmd", "why"), &why) == CTL_OK) {
        screen_status(status, why, text_wants_colour(stdout), stdout);
    }
    json_decref(status);
    json_decref(why);
    return (why != NULL) ? CTL_OK : CTL_UNAVAILABLE;
}
