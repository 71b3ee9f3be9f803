// SPDX-License-Identifier: MIT
// One press and one release of the e-stop, seen through the same input that will stop the wheels.
#include "doctor.h"
#include "text/text.h"

#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#define WAIT_US 20000000
#define LOOK_MS 20

/// True once the e-stop is at that level, false if the time is over or a key was pressed.
static bool await_level(doctor_t *self, bool pressed, bool *out_skipped) {
    const int64_t end_us = client_now_us() + WAIT_US;
    while (client_now_us() < end_us) {
        if (self->gateway.result == NEAR_FOUND) {
            json_decref(self->gateway.status);
            self->gateway.status = near_ask(self->ctl, json_pack("{s:s}", "cmd", "status"));
        }
        const inspect_estop_t estop = doctor_estop(self);
        if (estop.level >= 0 && (estop.level > 0) == pressed) {
            return true;
        }
        struct pollfd key = {.fd = STDIN_FILENO, .events = POLLIN};
        if (poll(&key, 1, LOOK_MS) > 0) {
            char line[64];
            *out_skipped = true;
            (void)!read(STDIN_FILENO, line, sizeof line);
            return false;
        }
    }
    return false;
}

static void say_unseen(doctor_t *self, bool skipped, const char *what) {
    if (skipped) {
        inspect_say(&self->findings, "estop_press", INSPECT_WARN, "e-stop: %s was not tried", what);
        inspect_cure(&self->findings, "run doctor again and press the button when asked");
    } else {
        inspect_say(&self->findings, "estop_press", INSPECT_FAIL, "e-stop: no %s was seen within 20 s", what);
        inspect_cure(&self->findings, "check the button's wire, [estop] line and [estop] active");
    }
}

void doctor_press(doctor_t *self) {
    bool skipped = false;
    const inspect_estop_t before = doctor_estop(self);
    const char *state = text_word(self->gateway.status, "state");
    if (!before.present || before.level != 0) {
        return;
    }
    if (self->gateway.result == NEAR_FOUND && (strcmp(state, "armed") == 0 || strcmp(state, "stopping") == 0)) {
        inspect_say(&self->findings, "estop_press", INSPECT_WARN, "e-stop: not tried, because somebody drives");
        inspect_cure(&self->findings, "iwheelctl stop, then run doctor again");
        return;
    }
    (void)fputs("\nPress the e-stop button now (Enter skips this) ... ", stdout);
    (void)fflush(stdout);
    if (!await_level(self, true, &skipped)) {
        (void)fputs("\n", stdout);
        say_unseen(self, skipped, "press");
        return;
    }
    (void)fputs("seen. Release it ... ", stdout);
    (void)fflush(stdout);
    const bool released = await_level(self, false, &skipped);
    (void)fputs(released ? "seen.\n\n" : "\n\n", stdout);
    if (!released) {
        say_unseen(self, skipped, "release");
        return;
    }
    inspect_say(&self->findings, "estop_press", INSPECT_OK, "e-stop: press and release were seen%s",
                (self->gateway.result == NEAR_FOUND) ? "; the gateway is latched now, as it must be" : "");
    if (self->gateway.result == NEAR_FOUND) {
        inspect_cure(&self->findings, "iwheelctl reset");
    }
}
