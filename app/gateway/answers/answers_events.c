// SPDX-License-Identifier: MIT
// Reports changes to the log and to the recorder, and checks the daemon's own causes of events.
#include "answers.h"

#include "assumptions/assumptions.h"
#include "box/box.h"
#include "bus/bus_facts.h"
#include "sockets/log.h"
#include "sockets/owners.h"
#include "wheels/wheels.h"

#include "inspect.h"

#include "iwheel_linux/clock.h"
#include "iwheel_server/target.h"

#include <stdio.h>
#include <string.h>

int64_t iwn_target_wall_us(void) {
    return iwl_clock_wall_us();
}

static void log_estop(const gw_answers_t *self, const char *state) {
    const iwn_estop_t *estop = &self->server.estop;
    const char *where = estop->pressed_at;
    const char *trouble = inspect_estop_trouble(&self->wheels->hal);
    sock_log(self->log, (estop->answer == 0) ? SOCK_LOG_INFO : SOCK_LOG_WARNING, "e-stop %s: %s%s%s%s%s", estop->line,
             state, (where == NULL) ? "" : ", pressed at ", (where == NULL) ? "" : where,
             (trouble[0] == '\0') ? "" : ": ", trouble);
}

/// Logs it once when it begins, and requests a restart of the link if that is set up.
static void report_left_behind(const gw_answers_t *self) {
    const iwl_bus_link_t *link = iwl_hal_link(&self->wheels->hal);
    char sentence[GW_WARNING_SIZE];
    gw_bus_left_sentence(link, self->server.bus, sentence, sizeof sentence);
    sock_log(self->log, SOCK_LOG_WARNING, "%s", sentence);
    if (link->presence != IWL_LINK_LOCAL) { // If the restart could not be requested, the sentence has the fix.
        (void)gw_bus_left_ask(SOCK_RUNTIME_DIRECTORY, self->server.bus);
    }
}

static void log_stop(const gw_answers_t *self) {
    const iwn_stop_note_t *note = &self->server.last_stop;
    sock_log(self->log, SOCK_LOG_WARNING, "stop %u: %s", (unsigned)note->stop.number, note->sentence);
    gw_wheels_note_stop(self->wheels, &note->stop);
    if (note->stop.latched) {
        gw_record_stop(self->box, self->log, note, self->wheels->now_us);
    }
}

static void log_lease(gw_answers_t *self, const char *change) {
    const iw_client_t holder = self->server.reported.holder;
    sock_log(self->log, SOCK_LOG_INFO, "lease %s: %s", change,
             (holder == IW_CLIENT_NONE) ? "no holder" : iwn_target_name(&self->server, holder));
}

static void log_fault(const gw_answers_t *self, const char *cause, bool present) {
    sock_log(self->log, present ? SOCK_LOG_WARNING : SOCK_LOG_INFO, "%s: %s", present ? "fault" : "fault gone", cause);
}

static void log_rolling(const gw_answers_t *self, bool present) {
    sock_log(self->log, SOCK_LOG_INFO, "%s",
             present ? "rolling: a wheel turns although nothing is sent to it" : "rolling: no longer");
}

void iwn_target_changed(iwn_server_t *server, const iw_snapshot_t *seen, iwn_change_t change, const char *word,
                        bool present) {
    gw_answers_t *self = gw_answers_of(server);
    switch (change) {
    case IWN_CHANGE_BUS:
        sock_log(self->log, present ? SOCK_LOG_WARNING : SOCK_LOG_INFO, "bus %s: %s", server->bus, word);
        break;
    case IWN_CHANGE_ESTOP:
        log_estop(self, word);
        break;
    case IWN_CHANGE_FAULT:
        log_fault(self, word, present);
        break;
    case IWN_CHANGE_LEFT_BEHIND:
        if (present) {
            report_left_behind(self);
        }
        break;
    case IWN_CHANGE_ROLLING:
        log_rolling(self, present);
        break;
    case IWN_CHANGE_ROLLS_AWAY:
        if (present) {
            gw_record_rolling(self->box, self->log, seen);
        }
        break;
    case IWN_CHANGE_STOP:
        log_stop(self);
        break;
    case IWN_CHANGE_LEASE:
        log_lease(self, word);
        break;
    case IWN_CHANGE_STATE:
        sock_log(self->log, SOCK_LOG_INFO, "state: %s", word);
        gw_wheels_note_state(self->wheels, seen, server->reported.state);
        break;
    case IWN_CHANGE_HOLDING:
    default:
        sock_log(self->log, SOCK_LOG_INFO, present ? "holding: zeros until release or arm" : "holding: no longer");
        break;
    }
}

static bool is_any_unwell(const gw_health_t *health, gw_ailment_t ailment) {
    return health->present[IW_LEFT][ailment] || health->present[IW_RIGHT][ailment];
}

/// A fault is active while a wheel has it. Log and warnings name the wheel.
static void report_ailment(gw_answers_t *self, const iw_snapshot_t *seen, const gw_health_t *before,
                           gw_ailment_t ailment, const char *name) {
    const gw_health_t *health = &self->wheels->health;
    char sentence[GW_HEALTH_TEXT_SIZE];
    for (unsigned side = 0; side < IW_SIDES; side++) {
        if (health->present[side][ailment] && !before->present[side][ailment]) {
            gw_health_sentence(health, seen, (iw_side_t)side, ailment, sentence);
            sock_log(self->log, SOCK_LOG_WARNING, "%s", sentence);
        }
    }
    if (is_any_unwell(health, ailment) != is_any_unwell(before, ailment)) {
        log_fault(self, name, is_any_unwell(health, ailment));
        iwn_server_report_fault(&self->server, name, is_any_unwell(health, ailment));
    }
}

/// Without a threshold this costs nothing per frame.
static void observe_health(gw_answers_t *self, const iw_snapshot_t *seen) {
    gw_health_t *health = &self->wheels->health;
    if (health->limits.battery_low_dV == 0U && health->limits.temperature_high_degC == 0U) {
        return;
    }
    const gw_health_t before = *health;
    gw_health_check(health, seen);
    report_ailment(self, seen, &before, GW_BATTERY_LOW, "battery_low");
    report_ailment(self, seen, &before, GW_TEMPERATURE_HIGH, "temperature_high");
}

static void observe_purge(gw_answers_t *self) {
    const iwl_link_purge_t purge = iwl_hal_link(&self->wheels->hal)->purge;
    const char *bus = self->server.bus;
    if (purge == self->purge) {
        return;
    }
    self->purge = purge;
    if (purge == IWL_LINK_PURGE_DONE) {
        sock_log(self->log, SOCK_LOG_WARNING, "bus %s: set down and up again, so that no old setpoint waits in it",
                 bus);
    } else if (purge == IWL_LINK_PURGE_NOT_ALLOWED) {
        sock_log(self->log, SOCK_LOG_WARNING,
                 "bus %s: an old setpoint may still wait in its queue, and this process may not empty it; do: ip link "
                 "set %s down; ip link set %s up (or, permanently: systemctl enable --now "
                 "iwheel-can-restart@%s.path)",
                 bus, bus, bus, bus);
    } else if (purge == IWL_LINK_PURGE_FAILED) {
        sock_log(self->log, SOCK_LOG_ERROR,
                 "bus %s: its queue could not be emptied; check it: ip -details link show %s", bus, bus);
    }
}

void gw_answers_check_watchers(gw_answers_t *self, const iw_snapshot_t *seen) {
    observe_purge(self);
    observe_health(self, seen);
    gw_assumptions_observe(self->assumptions, seen);
    gw_wheels_note_again(self->wheels);
    atomic_store(&self->box->ring->sending, gw_wheels_are_sent_to(self->wheels));
}

void gw_answers_observe(gw_answers_t *self, const iw_snapshot_t *seen) {
    gw_answers_refresh(self);
    iwn_server_observe(&self->server, seen);
    gw_answers_check_watchers(self, seen);
}

static void report_frame(iwn_server_t *server, const gw_tapped_t *tapped) {
    iwn_out_t json = iwn_server_begin_event(server, "frame");
    iwn_out_frame(&tapped->frame, tapped->at_us, &json);
    iwn_server_send_event(server, IWN_TOPIC_FRAME, &json);
}

void gw_answers_frames(gw_answers_t *self) {
    gw_tape_t *tape = &self->wheels->tape;
    const iw_time_us_t now_us = self->wheels->now_us;
    const uint32_t watching = (tape->tapped > 0U) ? gw_answers_watching_frames(self) : 0U;
    if (watching > GW_FRAMES_ONE_BY_ONE && now_us < self->frames_us && tape->tapped <= GW_FRAMES / 2U) {
        return;
    }
    for (uint32_t i = 0; i < tape->tapped && watching > 0U; i++) {
        report_frame(&self->server, &tape->tap[i]);
    }
    tape->tapped = 0;
    self->frames_us = now_us - now_us % GW_FRAMES_TOGETHER_US + GW_FRAMES_TOGETHER_US;
}

iw_time_us_t gw_answers_frames_us(const gw_answers_t *self) {
    return (self->wheels->tape.tapped > 0U) ? self->frames_us : IW_NEVER;
}
