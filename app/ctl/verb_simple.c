// SPDX-License-Identifier: MIT
// Verbs that are one request and one answer.
#include "ctl.h"
#include "text.h"

#include <stdio.h>
#include <string.h>
#include <time.h>

static void print_line(const char *text) {
    text_safe(text, stdout);
    (void)putchar('\n');
}

/// Asks; unless --json is given, prints the state the gateway is in now and what it means.
static int ask_and_tell_state(ctl_t *self, json_t *request) {
    static const struct {
        const char *state;
        const char *meaning;
    } meanings[] = {
        {"listening", "listening: nothing is sent; in silence the wheels may roll"},
        {"armed", "armed: somebody drives"},
        {"stopping", "stopping: ramp to zero, zeros until both wheels are at rest, then silence"},
        {"latched", "latched: zero; only a reset leaves this state (see: iwheelctl status)"},
    };
    json_t *reply = NULL;
    const int code = ctl_ask(self, request, &reply);
    if (code == CTL_OK && !self->json) {
        const char *state = text_word(reply, "state");
        const char *text = state;
        for (size_t i = 0; i < sizeof(meanings) / sizeof(meanings[0]); i++) {
            text = strcmp(meanings[i].state, state) == 0 ? meanings[i].meaning : text;
        }
        print_line(text);
    }
    json_decref(reply);
    return code;
}

int verb_stop(ctl_t *self, int count, char **words) {
    if (!ctl_words_at_most("stop", count, 0, words)) {
        return CTL_USAGE;
    }
    return ask_and_tell_state(self, json_pack("{s:s}", "cmd", "stop"));
}

int verb_estop(ctl_t *self, int count, char **words) {
    char reason[201] = "";
    size_t used = 0;
    for (int i = 0; i < count; i++) {
        const int n = snprintf(reason + used, sizeof(reason) - used, "%s%s", i > 0 ? " " : "", words[i]);
        used += n > 0 && (size_t)n < sizeof(reason) - used ? (size_t)n : sizeof(reason) - used - 1U;
    }
    json_t *request = json_pack("{s:s}", "cmd", "estop");
    json_t *text = json_string(reason);
    if (used > 0 && text != NULL) {
        (void)json_object_set(request, "reason", text);
    }
    json_decref(text);
    return ask_and_tell_state(self, request);
}

int verb_reset(ctl_t *self, int count, char **words) {
    if (!ctl_words_at_most("reset", count, 0, words)) {
        return CTL_USAGE;
    }
    return ask_and_tell_state(self, json_pack("{s:s}", "cmd", "reset"));
}

static void print_offset(const json_t *status, const char *side) {
    char offset[TEXT_CELL];
    const json_t *wheel = json_object_get(status, side);
    text_decimal(json_object_get(wheel, "force_offset_mN"), 3, "N", offset);
    (void)printf("%s: the present force is zero now; offset %s\n", side, offset);
}

int verb_tare(ctl_t *self, int count, char **words) {
    json_t *reply = NULL;
    json_t *status = NULL;
    const char *side = count > 0 ? words[0] : NULL;
    if (!ctl_words_at_most("tare", count, 1, words)) {
        return CTL_USAGE;
    }
    if (side != NULL && strcmp(side, "left") != 0 && strcmp(side, "right") != 0) {
        return ctl_fail(CTL_USAGE, "tare \"%s\": no such wheel; write left, right, or nothing for both", side);
    }
    json_t *request =
        side != NULL ? json_pack("{s:s,s:s}", "cmd", "tare", "side", side) : json_pack("{s:s}", "cmd", "tare");
    int code = ctl_ask(self, request, &reply);
    json_decref(reply);
    if (code != CTL_OK || self->json) {
        return code;
    }
    code = ctl_ask(self, json_pack("{s:s}", "cmd", "status"), &status);
    if (code == CTL_OK) {
        for (size_t i = 0; i < 2; i++) {
            const char *each = i == 0 ? "left" : "right";
            if (side == NULL || strcmp(side, each) == 0) {
                print_offset(status, each);
            }
        }
    }
    json_decref(status);
    return code;
}

static void print_when(const json_t *reply) {
    char wall[TEXT_CELL] = "--";
    char age[TEXT_CELL];
    struct tm local;
    const json_t *wall_us = json_object_get(reply, "wall_us");
    if (json_is_integer(wall_us)) {
        const time_t seconds = (time_t)(json_integer_value(wall_us) / 1000000);
        if (localtime_r(&seconds, &local) != NULL) {
            (void)strftime(wall, sizeof(wall), "%Y-%m-%d %H:%M:%S", &local);
        }
    }
    text_decimal(json_object_get(reply, "age_ms"), 3, "s", age);
    (void)printf("at %s, %s ago; ", wall, age);
    (void)printf("%s\n", json_is_true(json_object_get(reply, "latched")) ? "it latched" : "it did not latch");
}

int verb_why(ctl_t *self, int count, char **words) {
    json_t *reply = NULL;
    if (!ctl_words_at_most("why", count, 0, words)) {
        return CTL_USAGE;
    }
    const int code = ctl_ask(self, json_pack("{s:s}", "cmd", "why"), &reply);
    if (code == CTL_OK && !self->json) {
        const char *sentence = json_string_value(json_object_get(reply, "sentence"));
        if (sentence == NULL || sentence[0] == '\0') {
            (void)puts("no stop since the gateway's start");
        } else {
            print_line(sentence);
            print_when(reply);
        }
    }
    json_decref(reply);
    return code;
}
