// SPDX-License-Identifier: MIT
// Verbs with one request and one answer.
#include "talk/ctl.h"
#include "talk/ctl_words.h"
#include "text/ctl_text.h"

#include "iwheel_northbound/text.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static void print_line(const char *text) {
    text_safe(text, stdout);
    (void)putchar('\n');
}

/// Prints the present state of the gateway and its meaning. With --json it prints nothing.
static void report_state(const ctl_t *self, const json_t *reply) {
    static const struct {
        const char *state;
        const char *meaning;
    } meanings[] = {
        {"listening", "listening: nothing is sent; without setpoints the wheels may roll"},
        {"armed", "armed: a client drives"},
        {"stopping",
         "stopping: ramp to zero, then zeros until both wheels are at standstill; after that nothing is sent "
         "(after_stop = hold: the zeros continue)"},
        {"latched", "latched: zero; only a reset leaves this state (see: iwheelctl status)"},
    };
    if (!self->json) {
        const char *state = text_word(reply, "state");
        const char *text = state;
        for (size_t i = 0; i < sizeof meanings / sizeof meanings[0]; i++) {
            if (strcmp(meanings[i].state, state) == 0) {
                text = meanings[i].meaning;
            }
        }
        print_line(text);
    }
}

/// Prints the state of the reply if there is one, releases the reply, and returns `code`.
static int finish(ctl_t *self, int code, json_t *reply) {
    if (code == CTL_OK) {
        report_state(self, reply);
    }
    json_decref(reply);
    return code;
}

static int ask_and_report_state(ctl_t *self, json_t *request) {
    json_t *reply = NULL;
    const int code = ctl_ask(self, request, &reply);
    return finish(self, code, reply);
}

static void report_stopped(const ctl_t *self, const char *path, const json_t *reply) {
    if (path != NULL && !self->json) {
        text_safe(path, stdout);
        (void)fputs(": ", stdout);
    }
    report_state(self, reply);
}

/// The verbs `stop` and `disarm` send the same request; an error names the verb that the user typed. A superfluous word
/// is reported after the stop and does not prevent it.
static int stop_as(const char *verb, ctl_t *self, int count, char **words) {
    const int code = ctl_stop(self, &(ctl_stop_t){.latches = false}, report_stopped);
    return (words_at_most(verb, count, 0, words) || code != CTL_OK) ? code : CTL_USAGE;
}

int verb_stop(ctl_t *self, int count, char **words) {
    return stop_as("stop", self, count, words);
}

int verb_disarm(ctl_t *self, int count, char **words) {
    return stop_as("disarm", self, count, words);
}

int verb_estop(ctl_t *self, int count, char **words) {
    char reason[201];
    iwn_text_t text = iwn_text_begin(reason, sizeof reason);
    for (int i = 0; i < count; i++) {
        IWN_TEXT_JOIN(&text, (i > 0) ? " " : "", words[i]);
    }
    return ctl_stop(self, &(ctl_stop_t){.latches = true, .reason = (text.length > 0U) ? reason : NULL}, report_stopped);
}

int verb_reset(ctl_t *self, int count, char **words) {
    if (!words_at_most("reset", count, 0, words)) {
        return CTL_USAGE;
    }
    return ask_and_report_state(self, json_pack("{s:s}", "cmd", "reset"));
}

int verb_release(ctl_t *self, int count, char **words) {
    if (!words_at_most("release", count, 0, words)) {
        return CTL_USAGE;
    }
    return ask_and_report_state(self, json_pack("{s:s}", "cmd", "release"));
}

/// Prints the new zero of a wheel, its samples and noise, and the former zero with its source.
static void print_tare(const json_t *reply, const char *side) {
    char offset[TEXT_CELL];
    char noise[TEXT_CELL];
    char samples[TEXT_CELL];
    char before[TEXT_CELL];
    const json_t *tare = json_object_get(reply, side);
    if (tare == NULL) {
        return;
    }
    text_decimal(json_object_get(tare, "offset_mN"), 3, "N", offset);
    text_decimal(json_object_get(tare, "deviation_mN"), 3, "N noise", noise);
    text_integer(json_object_get(tare, "samples"), "samples", samples);
    text_decimal(json_object_get(tare, "before_mN"), 3, "N", before);
    (void)printf("%s: the present force is zero now, %s (%s, %s); it was %s (", side, offset, samples, noise, before);
    text_safe(text_word(tare, "before_provenance"), stdout);
    (void)puts(")");
}

int verb_tare(ctl_t *self, int count, char **words) {
    json_t *reply = NULL;
    const char *side = (count > 0) ? words[0] : NULL;
    if (!words_at_most("tare", count, 1, words)) {
        return CTL_USAGE;
    }
    if (side != NULL && strcmp(side, "left") != 0 && strcmp(side, "right") != 0) {
        return ctl_fail(CTL_USAGE, "tare \"%s\": unknown wheel; write left, right, or nothing for both", side);
    }
    json_t *request =
        (side != NULL) ? json_pack("{s:s,s:s}", "cmd", "tare", "side", side) : json_pack("{s:s}", "cmd", "tare");
    const int code = ctl_ask(self, request, &reply);
    if (code == CTL_OK && !self->json) {
        print_tare(reply, "left");
        print_tare(reply, "right");
    }
    json_decref(reply);
    return code;
}

/// Starts the program of another package in place of this one, because that program has its own configuration and output.
static int become(char **words, const char *package) {
    (void)execvp(words[0], words);
    return ctl_fail(CTL_UNAVAILABLE, "%s cannot be started (%s); install it: apt-get install ./%s_*.deb", words[0],
                    strerror(errno), package);
}

int verb_web(ctl_t *self, int count, char **words) {
    char program[] = "iwheel-web";
    char option[] = "--url";
    char *all[] = {program, option, NULL};
    (void)self;
    return words_at_most("web", count, 0, words) ? become(all, "iwheel-web") : CTL_USAGE;
}

int verb_fleet(ctl_t *self, int count, char **words) {
    char program[] = "iwheel-fleet";
    char json[] = "--json";
    char **all = (char **)calloc((size_t)count + 3U, sizeof *all);
    if (all == NULL) {
        return ctl_fail(CTL_INTERNAL, "out of memory");
    }
    all[0] = program;
    memcpy((void *)&all[1], (const void *)words, (size_t)count * sizeof *all);
    all[count + 1] = self->json ? json : NULL;
    const int code = become(all, "iwheel-mqtt");
    free((void *)all);
    return code;
}
