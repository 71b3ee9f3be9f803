// SPDX-License-Identifier: MIT
// Before anything turns: the checks of doctor, and the e-stop.
#include "bringup.h"
#include "text/text.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define PRESS_US 60000000
#define LOOK_NS  20000000L

bringup_result_t bringup_checks(bringup_t *self) {
    doctor_t *doctor = calloc(1, sizeof(*doctor));
    bringup_result_t result = BRINGUP_ON;
    if (doctor == NULL) {
        (void)ctl_fail(CTL_INTERNAL, "out of memory");
        return BRINGUP_FAILED;
    }
    talk_step(1, "checks (nothing is sent)");
    doctor->ctl = self->ctl;
    doctor->listen_ms = DOCTOR_LISTEN_MS;
    doctor->config = self->config;
    doctor->bus = self->config.bus.interface;
    inspect_begin(&doctor->findings);
    near_look(self->ctl, doctor->bus, &doctor->gateway);
    if (doctor->gateway.result == NEAR_FOUND) {
        talk_say("A gateway already runs on this bus (%s). Two cannot drive the same wheels: stop it "
                 "(systemctl stop iwheel-gateway, or end its terminal), then start bringup again.",
                 doctor->gateway.path);
        result = BRINGUP_FAILED;
    } else if (doctor_look_at_machine(doctor)) {
        doctor_look_at_bus(doctor);
    }
    doctor_print(doctor, 0);
    if (result == BRINGUP_ON && doctor->findings.total[INSPECT_FAIL] > 0U) {
        talk_say("Mend what failed (each line tells how), then start bringup again.");
        result = BRINGUP_FAILED;
    }
    doctor_close(doctor);
    client_close(&self->ctl->client);
    free(doctor);
    return result;
}

/// Waits for the e-stop's state as the gateway sees it; false after a minute or at a key.
static bool await_estop(bringup_t *self, const char *wanted) {
    const int64_t end_us = client_now_us() + PRESS_US;
    const struct timespec pause = {0, LOOK_NS};
    bool there = false;
    talk_keys_begin();
    while (!there && client_now_us() < end_us && !talk_key_pressed()) {
        json_t *status = trial_status(self);
        there = strcmp(text_word(json_object_get(status, "estop"), "state"), wanted) == 0;
        json_decref(status);
        (void)nanosleep(&pause, NULL);
    }
    talk_keys_end();
    return there;
}

static bringup_result_t go_without(bringup_t *self) {
    bool yes = false;
    talk_say("There is NO e-stop line. Then only the keyboard, the wheels' own one-second watchdog and their power "
             "switch stop them. Better: wire a button, name it with --estop LINE, and begin again.");
    if (!talk_yes("Go on without one?", false, &yes) || !yes) {
        return BRINGUP_QUIT;
    }
    bringup_note(self, "estop", "line", NULL, "there was no e-stop");
    return BRINGUP_ON;
}

bringup_result_t bringup_estop(bringup_t *self) {
    talk_step(2, "the e-stop (nothing is sent)");
    if (strcmp(self->config.estop.line, "none") == 0) {
        return go_without(self);
    }
    if (!trial_start(self, &self->config, false)) {
        return BRINGUP_FAILED;
    }
    talk_say("Press the e-stop button now ...");
    if (!await_estop(self, "pressed")) {
        talk_say("No press was seen on %s. Check its wire, [estop] line and [estop] active; then begin again.",
                 self->config.estop.line);
        return BRINGUP_FAILED;
    }
    talk_say("Seen. Release it ...");
    if (!await_estop(self, "released")) {
        talk_say("No release was seen on %s. Check its wire and [estop] active; then begin again.",
                 self->config.estop.line);
        return BRINGUP_FAILED;
    }
    talk_say("Seen. It will stop the wheels in everything that follows, and so does any key.");
    bringup_note(self, "estop", "line", NULL, "press and release were seen%s",
                 strncmp(self->config.estop.line, "unix:", 5U) == 0 ? " (a SIMULATED button)" : "");
    return trial_wait_ready(self) ? BRINGUP_ON : BRINGUP_FAILED;
}
