// SPDX-License-Identifier: MIT
#include "bringup.h"
#include "talk/signals.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define CURRENT_MIN_mA 50
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

static const char **option_of(const char *word, words_t *words) {
    const struct {
        const char *name;
        const char **value;
    } options[] = {
        {"--can", &words->can},         {"--estop", &words->estop},     {"--from", &words->from},
        {"--gateway", &words->gateway}, {"--current", &words->current}, {"--learn", &words->learn},
    };
    for (size_t i = 0; i < sizeof options / sizeof options[0]; i++) {
        if (strcmp(word, options[i].name) == 0) {
            return options[i].value;
        }
    }
    return NULL;
}

static bool parse_words(int count, char **words, words_t *out_words) {
    memset(out_words, 0, sizeof(*out_words));
    for (int i = 0; i < count; i++) {
        const char **value = option_of(words[i], out_words);
        if (value != NULL && i + 1 == count) {
            (void)ctl_fail(CTL_USAGE, "%s wants a value; see: iwheelctl bringup --help", words[i]);
            return false;
        }
        if (value != NULL) {
            *value = words[++i];
        } else if (words[i][0] != '-' && out_words->out == NULL) {
            out_words->out = words[i];
        } else {
            return ctl_words_at_most("bringup", count - i, 0, &words[i]);
        }
    }
    return true;
}

static bool parse_current(const char *text, int *out_mA) {
    char *end = NULL;
    const long current = strtol(text, &end, 10);
    if (end == text || (*end != '\0' && strcmp(end, "mA") != 0) || current < CURRENT_MIN_mA ||
        current > CURRENT_MAX_mA) {
        (void)ctl_fail(CTL_USAGE, "--current wants mA, %d to %d", CURRENT_MIN_mA, CURRENT_MAX_mA);
        return false;
    }
    *out_mA = (int)current;
    return true;
}

/// Where it begins: a file, the installed one, the defaults; then the words. An exit code.
static int configure(bringup_t *self, const words_t *words) {
    gateway_config_t *config = &self->config;
    const char *path = (words->from != NULL) ? words->from : GATEWAY_CONFIG_PATH;
    gateway_config_default(config);
    if ((words->from != NULL || access(path, F_OK) == 0) && gateway_config_load(path, config, stderr) != 0) {
        return GATEWAY_CONFIG_ERROR;
    }
    if (words->can != NULL && gateway_config_override(config, "bus.interface", words->can, "--can", stderr) != 0) {
        return CTL_USAGE;
    }
    if (words->estop != NULL && gateway_config_override(config, "estop.line", words->estop, "--estop", stderr) != 0) {
        return CTL_USAGE;
    }
    self->recording = words->learn;
    if (words->learn != NULL && access(words->learn, R_OK) != 0) {
        return ctl_fail(CTL_USAGE, "--learn %s: %s; name a recording in candump's form", words->learn, strerror(errno));
    }
    self->out_path = (words->out != NULL) ? words->out : "gateway.conf";
    self->current_mA = BRINGUP_CURRENT_mA;
    if (words->gateway != NULL) {
        (void)snprintf(self->trial.program, sizeof self->trial.program, "%.500s", words->gateway);
    }
    return (words->current != NULL && !parse_current(words->current, &self->current_mA)) ? CTL_USAGE : CTL_OK;
}

/// What it is and what it needs. False if the operator does not agree.
static bool introduce(const bringup_t *self) {
    bool ready = false;
    talk_say("iwheelctl bringup: from wheels that nobody knows to a configuration that somebody has seen to be right.");
    talk_say(" ");
    talk_say("Bus %s, e-stop %s. Ten steps; in three of them WHEELS TURN. Both wheels must hang in the air, free to "
             "turn, and nobody and nothing may touch them. Keep a finger on the e-stop. They turn only right after a "
             "question, with at most %d mm/s and %d mA, for two seconds at most; the e-stop and any key stop them at "
             "once.",
             self->config.bus.interface, self->config.estop.line, 2 * BRINGUP_SPEED_MM_S, self->current_mA);
    talk_say("The word in [brackets] stands for an empty answer; q ends bringup. Nothing is written before the last "
             "step.");
    return talk_yes("Wheels in the air, finger on the e-stop?", false, &ready) && ready;
}

static bringup_result_t guide(bringup_t *self) {
    static bringup_result_t (*const steps[])(bringup_t *) = {
        bringup_checks, bringup_estop, bringup_gear,   bringup_type,  bringup_role,
        bringup_signs,  bringup_force, bringup_radius, bringup_track, bringup_write,
    };
    bringup_result_t result = BRINGUP_ON;
    for (size_t i = 0; i < sizeof steps / sizeof steps[0] && result == BRINGUP_ON; i++) {
        result = steps[i](self);
    }
    return result;
}

int verb_bringup(ctl_t *self, int count, char **words) {
    words_t parsed;
    if (!parse_words(count, words, &parsed)) {
        return CTL_USAGE;
    }
    bringup_t *bringup = calloc(1, sizeof(*bringup));
    if (bringup == NULL) {
        return ctl_fail(CTL_INTERNAL, "out of memory");
    }
    bringup->ctl = self;
    int code = configure(bringup, &parsed);
    if (code == CTL_OK) {
        signals_catch();
        const bringup_result_t result = introduce(bringup) ? guide(bringup) : BRINGUP_QUIT;
        trial_close(bringup);
        if (result != BRINGUP_ON) {
            talk_say((result == BRINGUP_QUIT) ? "Ended. Nothing was written." : "Nothing was written.");
        }
        code = (result == BRINGUP_ON) ? CTL_OK : CTL_NO;
    }
    free(bringup);
    return code;
}
