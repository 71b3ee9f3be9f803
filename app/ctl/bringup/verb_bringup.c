// SPDX-License-Identifier: MIT
#include "bringup.h"
#include "talk/ctl_words.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define CURRENT_MIN_mA 300 // Bounds of max_current_mA.
#define CURRENT_MAX_mA 2000

typedef struct {
    const char *out;
    const char *can;
    const char *estop;
    const char *from;
    const char *gateway;
    const char *current;
    const char *learn;
} words_t;

/// Reads the words. Returns an exit code.
static int parse_words(int count, char **words, words_t *out_words) {
    memset(out_words, 0, sizeof(*out_words));
    const option_t options[] = {
        {OPTION("--can", option_text, &out_words->can)},
        {OPTION("--estop", option_text, &out_words->estop)},
        {OPTION("--from", option_text, &out_words->from)},
        {OPTION("--gateway", option_text, &out_words->gateway)},
        {OPTION("--current", option_text, &out_words->current)},
        {OPTION("--learn", option_text, &out_words->learn)},
        {.name = NULL},
    };
    const words_syntax_t syntax = {"bringup", options, words_is_name, &out_words->out};
    return words_read(&syntax, count, words);
}

static bool parse_current(const char *text, int *out_mA) {
    char *end = NULL;
    const long current = strtol(text, &end, 10);
    if (end == text || (*end != '\0' && strcmp(end, "mA") != 0) || current < CURRENT_MIN_mA ||
        current > CURRENT_MAX_mA) {
        (void)ctl_fail(CTL_USAGE, "--current needs mA, %d to %d", CURRENT_MIN_mA, CURRENT_MAX_mA);
        return false;
    }
    *out_mA = (int)current;
    return true;
}

/// Sets the initial configuration: a file, the installed one or the defaults; then the words. Returns an exit code.
static int configure(bringup_t *self, const words_t *words) {
    const doctor_named_t bus = {"--can", words->can};
    const int code = doctor_configure(&self->config, words->from, &bus, words->estop);
    if (code != CTL_OK) {
        return code;
    }
    bringup_forget_wiring(self);
    self->recording = words->learn;
    if (words->learn != NULL && access(words->learn, R_OK) != 0) {
        return ctl_fail(CTL_USAGE, "--learn %s: %s; use a recording in candump's form", words->learn, strerror(errno));
    }
    self->out_path = (words->out != NULL) ? words->out : "gateway.conf";
    self->current_mA = BRINGUP_CURRENT_mA;
    if (words->gateway != NULL) {
        (void)snprintf(self->trial.program, sizeof self->trial.program, "%.500s", words->gateway);
    }
    return (words->current != NULL && !parse_current(words->current, &self->current_mA)) ? CTL_USAGE : CTL_OK;
}

/// Explains bringup and its conditions. Ends bringup if the operator does not agree.
static void introduce(bringup_t *self) {
    talk_say("iwheelctl bringup: from unknown wheels to a configuration that you have tested.");
    talk_say(" ");
    talk_say(
        "Bus %s, e-stop %s. Ten steps; in three of them WHEELS TURN. Both wheels must hang in the air, free to "
        "turn, and no person or thing may touch them. Keep a finger on the e-stop. They turn only directly after a "
        "question, with at most %d mm/s and %d mA, for two seconds at most; the e-stop and any key stop them "
        "immediately.",
        self->config.bus.interface, self->config.estop.line, 2 * BRINGUP_SPEED_MM_S, self->current_mA);
    talk_say("The word in [brackets] stands for an empty answer; q ends bringup. Nothing is written before the last "
             "step.");
    if (!talk_yes(self, "Wheels in the air, finger on the e-stop?", false)) {
        bringup_quit(self);
    }
}

_Noreturn static void end(bringup_t *self, const char *told) {
    trial_close(self);
    talk_say("%s", told);
    exit(ctl_finish(CTL_NO));
}

void bringup_quit(bringup_t *self) {
    end(self, "Ended. Nothing was written.");
}

void bringup_fail(bringup_t *self) {
    end(self, "Nothing was written.");
}

int verb_bringup(ctl_t *self, int count, char **words) {
    static void (*const steps[])(bringup_t *) = {
        introduce,     bringup_checks, bringup_estop,  bringup_gear,  bringup_type,  bringup_role,
        bringup_signs, bringup_force,  bringup_radius, bringup_track, bringup_write,
    };
    static bringup_t bringup;
    words_t parsed;
    bringup.ctl = self;
    int code = parse_words(count, words, &parsed);
    if (code == CTL_OK) {
        code = configure(&bringup, &parsed);
    }
    if (code == CTL_OK) {
        signals_catch();
        for (size_t i = 0; i < sizeof steps / sizeof steps[0]; i++) {
            steps[i](&bringup);
        }
        trial_close(&bringup);
    }
    return code;
}
