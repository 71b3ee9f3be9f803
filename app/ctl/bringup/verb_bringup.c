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
    bringup_read_saved(self, words->from);
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
    talk_print("iwheelctl bringup: from unknown wheels to a configuration that you have tested.");
    talk_print(" ");
    talk_print(
        "Bus %s, e-stop %s. Ten steps; in three of them WHEELS TURN. Both wheels must hang in the air, free to "
        "turn, and no person or thing may touch them. Keep a finger on the e-stop. They turn only directly after a "
        "question, with at most %d mm/s and %d mA, for two seconds at most; the e-stop and any key stop them "
        "immediately.",
        self->config.bus.interface, self->config.estop.line, 2 * BRINGUP_SPEED_MM_S, self->current_mA);
    talk_print("An empty answer means the word in [brackets]; q ends bringup. Nothing is written before the last "
               "step.");
    if (!talk_yes(self, "Wheels in the air, finger on the e-stop?", false)) {
        bringup_quit(self);
    }
}

_Noreturn static void end(bringup_t *self, const char *message) {
    trial_close(self);
    talk_forget(); // A key that stopped the wheels is not for the shell.
    talk_print("%s", message);
    exit(ctl_finish(CTL_NO));
}

void bringup_abandon(bringup_t *self) {
    end(self, "Ended. Nothing was written.");
}

static unsigned count_confirmed(const bringup_t *self) {
    unsigned count = 0;
    for (unsigned i = 0; i < self->notes; i++) {
        count += (self->note[i].item != NULL) ? 1U : 0U;
    }
    return count;
}

/// Saves the confirmed results if there are any and the operator wants it, and ends the program.
_Noreturn static void end_with_offer(bringup_t *self) {
    char path[BRINGUP_ANSWER_SIZE];
    char question[2U * BRINGUP_ANSWER_SIZE];
    const unsigned count = self->ending ? 0U : count_confirmed(self);
    self->ending = true;
    self->repeats = false;
    trial_stop(self); // No wheel turns during the question.
    (void)snprintf(path, sizeof path, "%.100s.part", self->out_path);
    (void)snprintf(question, sizeof question, "Save the %u confirmed results to %s, to continue later?", count, path);
    if (count == 0U || !talk_yes(self, question, true) || !bringup_write_file(self, path, true)) {
        bringup_abandon(self);
    }
    talk_print("Saved. To continue:");
    (void)printf("  iwheelctl bringup %s --from %s\n", self->out_path, path);
    end(self, "Ended. The configuration is not complete, and was not written.");
}

void bringup_quit(bringup_t *self) {
    if (signals_count() > 0U) {
        bringup_abandon(self);
    }
    end_with_offer(self);
}

void bringup_fail(bringup_t *self) {
    talk_keys_end();
    if (signals_count() > 0U) {
        bringup_abandon(self);
    }
    if (self->repeats && talk_yes(self, "This step was disturbed. Do it again?", true)) {
        longjmp(self->disturbed, 1);
    }
    end_with_offer(self);
}

/// A step, and its number; 0: it has none.
typedef struct {
    void (*run)(bringup_t *self);
    unsigned number;
} step_t;

/// Runs the step until it is done. bringup_fail leads back to its begin if the operator wants to repeat it.
static void run_step(bringup_t *self, const step_t *step) {
    if (bringup_is_restored(self, step->number)) {
        talk_step(step->number, "confirmed by the earlier bringup; skipped");
        return;
    }
    (void)setjmp(self->disturbed);
    self->repeats = step->number > 1U && step->number < BRINGUP_STEPS;
    step->run(self);
    self->repeats = false;
}

int verb_bringup(ctl_t *self, int count, char **words) {
    static const step_t steps[] = {
        {introduce, 0},     {bringup_resume, 0}, {bringup_checks, 1}, {bringup_estop, 2},
        {bringup_gear, 3},  {bringup_type, 4},   {bringup_role, 5},   {bringup_signs, 6},
        {bringup_force, 7}, {bringup_radius, 8}, {bringup_track, 9},  {bringup_write, BRINGUP_STEPS},
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
            run_step(&bringup, &steps[i]);
        }
        trial_close(&bringup);
    }
    return code;
}
