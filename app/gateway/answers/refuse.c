// SPDX-License-Identifier: MIT
#include "dispatch.h"

#include "clients/clients.h"
#include "ledger/knowledge.h"
#include "status/observe.h"
#include "wheels/wheels.h"

#include "iwheel_northbound/words.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

/// Where a message is being written.
typedef struct {
    const gw_answers_t *answers;
    iw_snapshot_t seen;
    const iwn_request_t *request;
    char *text;
    size_t size;
} wording_t;

#define SAY(self, ...) (void)snprintf((self)->text, (self)->size, __VA_ARGS__)

static uint64_t ms_since(const wording_t *self, iw_time_us_t then_us) {
    return (then_us < self->seen.at_us) ? (self->seen.at_us - then_us) / IW_US_PER_MS : 0U;
}

static void name_client(const wording_t *self, iw_client_t id, char *out_text, size_t size) {
    const gw_client_t *client = gw_clients_find(self->answers->clients, id);
    if (client != NULL) {
        gw_client_describe(client, out_text, size);
    } else {
        (void)snprintf(out_text, size, "client %u (gone)", (unsigned)id);
    }
}

static void say_holder(const wording_t *self) {
    const iw_snapshot_t *seen = &self->seen;
    char holder[GW_CLIENT_TEXT_SIZE];
    name_client(self, seen->holder, holder, sizeof holder);
    const uint64_t left_ms = (seen->arming || seen->lease_until_us <= seen->at_us)
                                 ? 0U
                                 : (seen->lease_until_us - seen->at_us) / IW_US_PER_MS;
    SAY(self,
        "%s holds the lease for another %" PRIu64
        " ms at least; let it stop first, or, with the wheels at rest, arm with takeover",
        holder, left_ms);
}

static void say_not_armed(const wording_t *self) {
    const gw_status_t *status = self->answers->status;
    const iw_stop_t *stop = self->seen.stop;
    const char *state = iwn_state_name(self->seen.state);
    if (self->answers->wheels->shutting_down) {
        SAY(self, "not armed: the gateway is shutting down");
    } else if (stop->number > 0U && stop->cause == IW_CAUSE_CLIENT_STOP && status->stopped_by.at_us > 0U) {
        SAY(self,
            "not armed (%s); the last stop was %" PRIu64 " ms ago: %s, asked for by user %u (process %d). Arm first",
            state, ms_since(self, stop->at_us), iwn_cause_name(stop->cause), (unsigned)status->stopped_by.uid,
            status->stopped_by.pid);
    } else if (stop->number > 0U) {
        SAY(self, "not armed (%s); the last stop was %" PRIu64 " ms ago: %s. Arm first", state,
            ms_since(self, stop->at_us), iwn_cause_name(stop->cause));
    } else {
        SAY(self, "not armed (%s); arm first", state);
    }
}

static void say_estop(const wording_t *self) {
    const gw_wheels_t *wheels = self->answers->wheels;
    if (wheels->hal.estop_last < 0) {
        SAY(self, "the e-stop %s cannot be read, which counts as pressed; check its wire, then: iwheelctl reset",
            wheels->estop);
    } else {
        SAY(self, "the e-stop %s is pressed; release the button, then: iwheelctl reset", wheels->estop);
    }
}

static void say_lost(const wording_t *self) {
    size_t length = 0;
    for (unsigned side = 0; side < IW_SIDES; side++) {
        const iw_snapshot_wheel_t *wheel = &self->seen.wheel[side];
        if (wheel->heard || length >= self->size) {
            continue;
        }
        char *end = &self->text[length];
        const size_t room = self->size - length;
        const char *name = (side == IW_LEFT) ? "left" : "right";
        if (wheel->speed_us == IW_NEVER) {
            (void)snprintf(end, room, "the %s wheel was never heard; ", name);
        } else {
            (void)snprintf(end, room, "the %s wheel was last heard %" PRIu64 " ms ago; ", name,
                           ms_since(self, wheel->speed_us));
        }
        length += strlen(end);
    }
    (void)snprintf(&self->text[length], self->size - length, "check its power, cable and termination");
}

static void say_not_at_rest(const wording_t *self) {
    const iw_snapshot_t *seen = &self->seen;
    SAY(self,
        "the wheels turn or are told to: left %d rpm, told %d mm/s; right %d rpm, told %d mm/s; wait until both stand "
        "for %u ms",
        seen->wheel[IW_LEFT].told->speed.speed_rpm, seen->applied.wheel[IW_LEFT].speed_mm_s,
        seen->wheel[IW_RIGHT].told->speed.speed_rpm, seen->applied.wheel[IW_RIGHT].speed_mm_s, seen->config->rest_ms);
}

static void say_stalled(const wording_t *self) {
    static const char cure[] = "check that the wheels have power and the bus is terminated";
    const gw_wheels_t *wheels = self->answers->wheels;
    const iw_time_us_t waiting_us = self->seen.waiting_us;
    const char *bus = wheels->bus.name;
    if (waiting_us == IW_NEVER) {
        SAY(self, "the zero setpoints were not acknowledged on the bus within %u ms; %s", self->seen.config->echo_ms,
            cure);
    } else if (iw_linux_hal_link(&wheels->hal)->presence == IW_LINK_LOCAL) {
        SAY(self, "a setpoint has been waiting for %" PRIu64 " ms to be acknowledged on the bus; %s",
            ms_since(self, waiting_us), cure);
    } else {
        SAY(self,
            "a setpoint has been waiting for %" PRIu64 " ms to be acknowledged on the bus; %s; if so, it was lost: ip "
            "link set %s down; ip link set %s up",
            ms_since(self, waiting_us), cure, bus, bus);
    }
}

static void say_stale(const wording_t *self) {
    char client[GW_CLIENT_TEXT_SIZE];
    name_client(self, self->seen.stale_client, client, sizeof client);
    if (self->request->cmd == IWN_CMD_DRIVE || self->request->cmd == IWN_CMD_TWIST) {
        SAY(self, "this command was sent before arm was answered; wait for that answer, then command anew");
        return;
    }
    SAY(self, "%s sent a nonzero drive command %" PRIu64 " ms ago; let go of the stick, wait %u ms, try again", client,
        ms_since(self, self->seen.stale_us), IW_STALE_COMMAND_US / IW_US_PER_MS);
}

static void say_second_master(const wording_t *self) {
    const iw_time_us_t seen_us = self->seen.seen_us[IW_CAUSE_SECOND_MASTER];
    SAY(self,
        "somebody else sent a setpoint (id 266 = 0x10A or 298 = 0x12A) %" PRIu64
        " ms ago; switch the other sender off, wait a second",
        ms_since(self, seen_us));
}

/// Whoever keeps stopping is to be found, whatever socket it uses.
static void say_estopped(const wording_t *self) {
    const gw_stopper_t *by = &self->answers->status->estopped_by;
    SAY(self,
        "estop_software was asked for %" PRIu64
        " ms ago by user %u (process %d); end that program if it keeps asking, and wait a second",
        ms_since(self, by->at_us), (unsigned)by->uid, by->pid);
}

static void say_present(const wording_t *self) {
    const uint32_t present = self->seen.present;
    for (unsigned cause = 0; cause < IW_CAUSES; cause++) {
        if (cause == IW_CAUSE_ESTOP_SOFTWARE && (present & (1U << cause)) != 0U &&
            self->answers->status->estopped_by.at_us > 0U) {
            say_estopped(self);
            return;
        }
        if ((present & (1U << cause)) != 0U) {
            SAY(self, "%s was seen %" PRIu64 " ms ago; %s, and wait a second", iwn_cause_name((iw_cause_t)cause),
                ms_since(self, self->seen.seen_us[cause]), iwn_why_cure((iw_cause_t)cause));
            return;
        }
    }
    SAY(self, "zeros are still being sent because the gateway died while armed; wait %u ms",
        self->seen.config->zero_hold_ms);
}

static void say_out_of_range(const wording_t *self) {
    const iwn_request_t *request = self->request;
    const bool setpoint = self->seen.config->current_role == IW_ROLE_SETPOINT;
    if (request->cmd == IWN_CMD_TWIST) {
        SAY(self, "%" PRId64 " mm/s with %" PRId64 " mrad/s makes a wheel faster than 32767 mm/s; nothing was applied",
            request->v_mm_s, request->yaw_mrad_s);
        return;
    }
    SAY(self,
        "left %" PRId64 " mm/s, right %" PRId64 " mm/s: allowed are -32768..32767 mm/s and %s mA; nothing was applied",
        request->left_mm_s, request->right_mm_s, setpoint ? "-2000..2000" : "0..2000");
}

static void say_type(const wording_t *self) {
    const iw_config_t *config = self->seen.config;
    const bool both = !config->setpoint_type_set && config->current_role == IW_ROLE_UNSET;
    SAY(self,
        "%s%s%s not configured, and the wheels' document leaves %s open; set %s under [wheels] in the configuration",
        config->setpoint_type_set ? "" : "setpoint_type", both ? " and " : "",
        (config->current_role == IW_ROLE_UNSET) ? "current_role" : "", both ? "them" : "it", both ? "them" : "it");
}

static void say_bus_down(const wording_t *self) {
    const gw_wheels_t *wheels = self->answers->wheels;
    const char *bus = wheels->bus.name;
    const bool local = iw_linux_hal_link(&wheels->hal)->presence == IW_LINK_LOCAL;
    const bool off = self->seen.bus == IW_BUS_OFF;
    SAY(self, "bus %s is %s; %s%s", bus, iwn_bus_state_name(self->seen.bus),
        (local && off) ? "end it in the simulator: iwheel-sim busoff off"
        : local        ? "start the simulator: iwheel-sim --can "
        : off          ? "check cable, termination and bit rate; what else: iwheelctl doctor "
                       : "bring it up; how: iwheelctl doctor ",
        (local && off) ? "" : bus);
}

static void say_timing(const wording_t *self) {
    const inspect_wish_t *wish = &self->answers->wheels->bus;
    SAY(self, "the bit timing of %s is not %u bit/s with sample point %u permille; set it, or on_mismatch = warn",
        wish->name, (unsigned)wish->bitrate_hz, wish->sample_point_permille);
}

static void say_missing(const wording_t *self) {
    SAY(self, "%s needs currents because current_role is setpoint: use drive with left_mA and right_mA",
        (self->request->cmd == IWN_CMD_TWIST) ? "twist" : "drive");
}

/// The last stop still holds.
static void say_stop(const wording_t *self) {
    SAY(self, "%s: %s", (self->seen.state == IW_STATE_LATCHED) ? "latched" : "stopped",
        self->answers->status->last_stop.sentence);
}

static void say_listen_only(const wording_t *self) {
    SAY(self, "the gateway runs with --listen-only and never sends; start it without");
}

static void say_contradicted(const wording_t *self) {
    gw_knowledge_describe_contradiction(self->answers->knowledge, self->seen.doubt, self->text, self->size);
}

void gw_refuse_describe(const gw_answers_t *answers, const iwn_request_t *request, iw_refusal_t refusal,
                        iwn_refusal_t *out_refusal) {
    static void (*const say[])(const wording_t *self) = {
        [IW_REFUSE_OUT_OF_RANGE] = say_out_of_range, [IW_REFUSE_MISSING_FIELD] = say_missing,
        [IW_REFUSE_NOT_HOLDER] = say_holder,         [IW_REFUSE_BUSY] = say_holder,
        [IW_REFUSE_NOT_ARMED] = say_not_armed,       [IW_REFUSE_LATCHED] = say_stop,
        [IW_REFUSE_ESTOP_PRESSED] = say_estop,       [IW_REFUSE_BUS_DOWN] = say_bus_down,
        [IW_REFUSE_TIMING_MISMATCH] = say_timing,    [IW_REFUSE_WHEEL_LOST] = say_lost,
        [IW_REFUSE_WHEEL_BLOCKED] = say_stop,        [IW_REFUSE_NOT_AT_REST] = say_not_at_rest,
        [IW_REFUSE_SEND_STALLED] = say_stalled,      [IW_REFUSE_SECOND_MASTER] = say_second_master,
        [IW_REFUSE_CAUSE_PRESENT] = say_present,     [IW_REFUSE_TYPE_NOT_SET] = say_type,
        [IW_REFUSE_STALE_COMMAND] = say_stale,       [IW_REFUSE_LISTEN_ONLY] = say_listen_only,
        [IW_REFUSE_CONTRADICTED] = say_contradicted,
    };
    const wording_t wording = {answers, gw_wheels_look(answers->wheels), request, out_refusal->message,
                               sizeof out_refusal->message};
    out_refusal->error = iwn_error_of(refusal);
    if ((size_t)refusal < sizeof say / sizeof say[0] && say[refusal] != NULL) {
        say[refusal](&wording);
    } else {
        SAY(&wording, "refused for a reason that has no name (%d); report this", (int)refusal);
    }
}

static void say_right(const gw_answers_t *answers, iwn_refusal_t *out_refusal) {
    const char *socket = answers->socket;
    const char *group = answers->group;
    out_refusal->error = IWN_DENIED;
    if (strcmp(group, "none") == 0) {
        (void)snprintf(out_refusal->message, sizeof out_refusal->message,
                       "this socket is for watching, stop and estop; who may drive uses %s", socket);
    } else {
        (void)snprintf(out_refusal->message, sizeof out_refusal->message,
                       "this socket is for watching, stop and estop; who may drive uses %s and is in group %s (sudo "
                       "usermod -aG %s USER, then log in again)",
                       socket, group, group);
    }
}

bool gw_refuse_by_right(const gw_answers_t *answers, gw_right_t right, iwn_cmd_t cmd, iwn_refusal_t *out_refusal) {
    if (right == GW_DRIVE || iwn_cmd_watches(cmd)) {
        return false;
    }
    say_right(answers, out_refusal);
    return true;
}

void gw_refuse_describe_tare(iw_side_t side, iw_tare_t result, iwn_refusal_t *out_refusal) {
    static const struct {
        iwn_error_t error;
        const char *why;
    } reasons[] = {
        [IW_TARE_OK] = {IWN_OK, ""},
        [IW_TARE_NO_FORCE] =
            {IWN_WHEEL_LOST,
             "has not sent force for two seconds without a gap; check its power and cable, wait two seconds"},
        [IW_TARE_MOVING] = {IWN_NOT_AT_REST, "turned within the last two seconds; let it stand, wait two seconds"},
        [IW_TARE_NOISY] = {IWN_DENIED, "has an unsteady force; let go of the machine, wait two seconds"},
        [IW_TARE_LOADED] = {IWN_DENIED,
                            "carries a load far from its earlier zero; let go of the machine, wait two seconds"},
        [IW_TARE_SATURATED] = {IWN_DENIED, "shows a force at the end of its range; check the sensor"},
    };
    const size_t known = sizeof reasons / sizeof reasons[0];
    out_refusal->error = ((size_t)result < known) ? reasons[result].error : IWN_INTERNAL;
    (void)snprintf(out_refusal->message, sizeof out_refusal->message, "the %s wheel %s; nothing was changed",
                   (side == IW_LEFT) ? "left" : "right",
                   ((size_t)result < known) ? reasons[result].why : "cannot be tared");
}
