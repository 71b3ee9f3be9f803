// SPDX-License-Identifier: MIT
// Steps before a wheel turns: the checks of doctor, and the e-stop.
#include "bringup.h"

#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define PRESS_US    60000000
#define RELEASED_US 500000
#define POLL_NS     20000000L

void bringup_checks(bringup_t *self) {
    doctor_t *doctor = calloc(1, sizeof(*doctor));
    if (doctor == NULL) {
        (void)ctl_fail(CTL_INTERNAL, "out of memory");
        bringup_fail(self);
    }
    talk_step(1, "checks (nothing is sent)");
    doctor->ctl = self->ctl;
    doctor->listen_ms = DOCTOR_LISTEN_MS;
    doctor->config = self->config;
    doctor->bus = self->config.bus.interface;
    inspect_begin(&doctor->findings);
    near_find(self->ctl, doctor->bus, &doctor->gateway);
    bool good = doctor->gateway.result != NEAR_FOUND;
    if (!good) {
        talk_print("A gateway already runs on this bus (%s). Two cannot drive the same wheels: stop it "
                   "(systemctl stop iwheel-gateway, or end its terminal), then start bringup again.",
                   doctor->gateway.path);
    } else if (doctor_check_machine(doctor)) {
        doctor_check_bus(doctor);
    }
    doctor_print(doctor, 0);
    if (good && doctor->findings.total[INSPECT_FAIL] > 0U) {
        talk_print("Fix the failed checks (each line has the fix), then start bringup again.");
        good = false;
    }
    doctor_close(doctor);
    client_close(&self->ctl->client);
    free(doctor);
    if (!good) {
        bringup_fail(self);
    }
}

/// Waits until the gateway reports this state of the e-stop. Returns false if it does not within `for_us`, or a key is
/// pressed.
static bool await_estop(bringup_t *self, const char *wanted, int64_t for_us) {
    const int64_t end_us = client_now_us() + for_us;
    const unsigned signals = signals_count();
    const struct timespec pause = {0, POLL_NS};
    bool there = false;
    talk_forget();
    talk_keys_begin();
    while (!there && client_now_us() < end_us && !talk_key_pressed() && signals_count() == signals) {
        json_t *status = trial_status(self);
        there = strcmp(text_word(json_object_get(status, "estop"), "state"), wanted) == 0;
        json_decref(status);
        (void)ppoll(NULL, 0, &pause, signals_let_in());
    }
    talk_keys_end();
    if (signals_count() != signals) {
        bringup_quit(self);
    }
    return there;
}

static void go_without(bringup_t *self) {
    talk_print("There is NO e-stop line. Only the keyboard, the wheels' own one-second watchdog and their power switch "
               "stop them. Better: wire a button, name it with --estop LINE, and begin again.");
    if (!talk_yes(self, "Continue without an e-stop?", false)) {
        bringup_quit(self);
    }
    bringup_note(self, "estop", "line", NULL, "there was no e-stop");
}

/// Waits for this edge, and ends bringup without it.
static void need_edge(bringup_t *self, const char *wanted, const char *edge, const char *also) {
    if (!await_estop(self, wanted, PRESS_US)) {
        talk_print("No %s was seen on %s. Check its wire, %s[estop] active; then begin again.", edge,
                   self->config.estop.line, also);
        bringup_fail(self);
    }
}

void bringup_estop(bringup_t *self) {
    talk_step(2, "the e-stop (nothing is sent)");
    if (strcmp(self->config.estop.line, "none") == 0) {
        go_without(self);
        return;
    }
    trial_start(self, &self->config);
    // A press counts only if the button was not pressed before.
    if (!await_estop(self, "released", RELEASED_US)) {
        talk_print(
            "The e-stop reads as pressed already. Release it now; if it is not pressed, its wire is cut or [estop] "
            "active has the wrong value ...");
        need_edge(self, "released", "release", "");
    }
    talk_print("Press the e-stop button now ...");
    need_edge(self, "pressed", "press", "[estop] line and ");
    talk_print("Seen. Release it ...");
    need_edge(self, "released", "release", "");
    talk_print("Seen. In all later steps this button stops the wheels, and so does any key.");
    bringup_note(self, "estop", "line", NULL, "press and release were seen%s",
                 (strncmp(self->config.estop.line, "unix:", 5U) == 0) ? " (a SIMULATED button)" : "");
    bringup_store_wiring(self);
    ready_by_hand(self);
}
