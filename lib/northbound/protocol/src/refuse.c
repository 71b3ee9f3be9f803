// SPDX-License-Identifier: MIT
#include "iwheel_northbound/refuse.h"

#include "iwheel_northbound/why.h"

/// Message that is written.
typedef struct {
    const iwn_refuse_context_t *context;
    const iw_snapshot_t *seen;
    const iwn_request_t *request;
    iwn_text_t text;
} wording_t;

#define WRITE(self, ...) IWN_TEXT_JOIN(&(self)->text, __VA_ARGS__)

/// A number of a request may have any value.
static void big_number(wording_t *self, int64_t value, const char *after) {
    iwn_text_int(&self->text, value);
    iwn_text_add(&self->text, after);
}

static void number(wording_t *self, const char *before, int32_t value, const char *after) {
    iwn_text_add(&self->text, before);
    big_number(self, value, after);
}

/// Appends the milliseconds since a time, at most INT32_MAX (24 days).
static void since(wording_t *self, const char *before, iw_time_us_t then_us, const char *after) {
    const iw_time_us_t at_us = self->seen->at_us;
    const iw_time_us_t ms = (then_us < at_us) ? (at_us - then_us) / IW_US_PER_MS : 0U;
    number(self, before, (ms < INT32_MAX) ? (int32_t)ms : INT32_MAX, after);
}

static void explain_holder(wording_t *self) {
    const iw_snapshot_t *seen = self->seen;
    const bool over = seen->arming || seen->lease_until_us <= seen->at_us;
    iwn_text_add(&self->text, self->context->holder);
    number(self, " holds the lease for another ",
           over ? 0 : (int32_t)((seen->lease_until_us - seen->at_us) / IW_US_PER_MS),
           " ms at least; let it stop first");
    if (self->request->cmd != IWN_CMD_RELEASE) {
        iwn_text_add(&self->text, ", or, with the wheels at standstill, arm with takeover");
    }
}

static void explain_not_armed(wording_t *self) {
    const iw_stop_t *stop = self->seen->stop;
    const char *by = self->context->stopped_by;
    if (self->context->shutting_down) {
        iwn_text_add(&self->text, "not armed: the gateway is shutting down");
        return;
    }
    WRITE(self, "not armed (", iwn_state_name(self->seen->state), ")");
    if (stop->number == 0U) {
        iwn_text_add(&self->text, "; arm first");
        return;
    }
    since(self, "; the last stop was ", stop->at_us, " ms ago: ");
    iwn_text_add(&self->text, iwn_cause_name(stop->cause));
    if (stop->cause == IW_CAUSE_CLIENT_STOP && by != NULL) {
        WRITE(self, ", requested by ", by);
    }
    iwn_text_add(&self->text, ". Arm first");
}

static void explain_estop(wording_t *self) {
    WRITE(self, "the e-stop ", self->context->estop,
          (self->context->estop_answer < 0) ? " cannot be read, which counts as pressed; check its wire"
                                            : " is pressed; release the button",
          iwn_why_then(IW_CAUSE_ESTOP_LINE, true));
}

static void explain_lost(wording_t *self) {
    for (unsigned side = 0; side < IW_SIDES; side++) {
        const iw_snapshot_wheel_t *wheel = &self->seen->wheel[side];
        if (wheel->heard) {
            continue;
        }
        WRITE(self, "the ", (side == IW_LEFT) ? "left" : "right");
        if (wheel->speed_us == IW_NEVER) {
            iwn_text_add(&self->text, " wheel never sent telemetry; ");
        } else {
            since(self, " wheel sent its last telemetry ", wheel->speed_us, " ms ago; ");
        }
    }
    iwn_text_add(&self->text, "check its power, cable and termination");
}

/// Returns true if both wheels are within `rest_rpm` and receive zero, but not for long enough: values of zero would
/// contradict the message.
static bool stands_too_short(const iw_snapshot_t *seen) {
    const int32_t rest_rpm = (int32_t)seen->config->rest_rpm;
    bool is_still = true;
    for (unsigned side = 0; side < IW_SIDES; side++) {
        const int32_t rpm = seen->wheel[side].telemetry->speed.speed_rpm;
        is_still = is_still && seen->wheel[side].heard && rpm <= rest_rpm && rpm >= -rest_rpm &&
                   seen->applied.wheel[side].speed_mm_s == 0;
    }
    return is_still;
}

static void explain_not_at_rest(wording_t *self) {
    const iw_snapshot_t *seen = self->seen;
    // Nothing is held yet, so there is nothing to release, even if the wheels are at standstill.
    if (self->request->cmd == IWN_CMD_RELEASE && seen->holder != IW_CLIENT_NONE) {
        explain_holder(self);
        return;
    }
    if (stands_too_short(seen)) {
        number(self, "the wheels are not at standstill for ", seen->config->rest_ms, " ms yet; wait, then try again");
        return;
    }
    number(self, "the wheels turn or are commanded to: left ", seen->wheel[IW_LEFT].telemetry->speed.speed_rpm,
           " rpm, commanded ");
    number(self, "", seen->applied.wheel[IW_LEFT].speed_mm_s, " mm/s; right ");
    number(self, "", seen->wheel[IW_RIGHT].telemetry->speed.speed_rpm, " rpm, commanded ");
    number(self, "", seen->applied.wheel[IW_RIGHT].speed_mm_s, " mm/s; wait until both are at standstill for ");
    number(self, "", seen->config->rest_ms, " ms");
}

static void explain_stalled(wording_t *self) {
    const iw_time_us_t waiting_us = self->seen->waiting_us;
    const char *more = self->context->stalled_fix;
    if (waiting_us == IW_NEVER) {
        number(self, "the zero setpoints were not acknowledged on the bus within ", self->seen->config->echo_ms, " ms");
    } else {
        since(self, "a setpoint has been waiting for ", waiting_us, " ms to be acknowledged on the bus");
    }
    iwn_text_add(&self->text, "; check that the wheels have power and the bus is terminated");
    if (waiting_us != IW_NEVER && more != NULL) {
        iwn_text_add(&self->text, more);
    }
}

static void explain_stale(wording_t *self) {
    if (self->request->cmd == IWN_CMD_DRIVE || self->request->cmd == IWN_CMD_TWIST) {
        iwn_text_add(&self->text,
                     "this command was sent before the reply to arm; wait for that reply, then send a new command");
        return;
    }
    iwn_text_add(&self->text, self->context->stale_client);
    since(self, " sent a nonzero drive command ", self->seen->stale_us, " ms ago");
    number(self, "; let go of the stick, wait ", IW_STALE_COMMAND_US / IW_US_PER_MS, " ms, try again");
}

static void explain_second_master(wording_t *self) {
    since(self, "another device sent a setpoint (id 266 = 0x10A or 298 = 0x12A) ",
          self->seen->seen_us[IW_CAUSE_SECOND_MASTER], " ms ago; switch the other sender off, wait a second");
}

/// Names the client that sends stops repeatedly, over any connection.
static void explain_estopped(wording_t *self) {
    since(self, "estop_software was requested ", self->context->estopped_us, " ms ago by ");
    WRITE(self, self->context->estopped_by, "; end that program if it repeats the request, and wait a second");
}

static void explain_present(wording_t *self) {
    const uint32_t present = self->seen->present;
    for (unsigned cause = 0; cause < IW_CAUSES; cause++) {
        if ((present & (1U << cause)) == 0U) {
            continue;
        }
        if (cause == IW_CAUSE_ESTOP_SOFTWARE && self->context->estopped_by != NULL) {
            explain_estopped(self);
            return;
        }
        iwn_text_add(&self->text, iwn_cause_name((iw_cause_t)cause));
        since(self, " was seen ", self->seen->seen_us[cause], " ms ago; ");
        WRITE(self, iwn_why_fix((iw_cause_t)cause),
              iwn_why_then((iw_cause_t)cause, self->seen->state == IW_STATE_LATCHED), ", and wait a second");
        return;
    }
    number(self, "zeros are still sent after a crash or a delay of the gateway; wait ",
           self->seen->config->zero_hold_ms, " ms");
}

static void explain_out_of_range(wording_t *self) {
    const iwn_request_t *request = self->request;
    if (request->cmd == IWN_CMD_TWIST) {
        big_number(self, request->v_mm_s, " mm/s with ");
        big_number(self, request->yaw_mrad_s, " mrad/s makes a wheel faster than 32767 mm/s; nothing was applied");
        return;
    }
    iwn_text_add(&self->text, "left ");
    big_number(self, request->left_mm_s, " mm/s, right ");
    big_number(self, request->right_mm_s, " mm/s: allowed are -32768..32767 mm/s and ");
    WRITE(self, (self->seen->config->current_role == IW_ROLE_SETPOINT) ? "-2000..2000" : "0..2000",
          " mA; nothing was applied");
}

static void explain_type(wording_t *self) {
    const bool type = self->seen->config->setpoint_type_set;
    const bool role = self->seen->config->current_role != IW_ROLE_UNSET;
    const char *it = (type || role) ? "it" : "them";
    WRITE(self, type ? "" : "setpoint_type", (type || role) ? "" : " and ", role ? "" : "current_role",
          " not configured, and the wheels' document leaves ", it, " open; set ", it, " ", self->context->configure);
}

static void explain_track(wording_t *self) {
    WRITE(self, "track_mm not configured, and every limit of turning depends on it; set it ", self->context->configure);
}

static void explain_bus_down(wording_t *self) {
    WRITE(self, "bus ", self->context->bus, " is ", iwn_bus_state_name(self->seen->bus), "; ", self->context->bus_fix);
}

static void explain_timing(wording_t *self) {
    iwn_text_add(&self->text, self->context->timing);
}

static void explain_missing(wording_t *self) {
    WRITE(self, (self->request->cmd == IWN_CMD_TWIST) ? "twist" : "drive",
          " needs currents because current_role is setpoint: use drive with left_mA and right_mA");
}

/// The last stop is still in effect.
static void explain_stop(wording_t *self) {
    WRITE(self, (self->seen->state == IW_STATE_LATCHED) ? "latched: " : "stopped: ", self->context->last_stop);
}

static void explain_listen_only(wording_t *self) {
    iwn_text_add(&self->text, self->context->listen_only);
}

static void explain_contradicted(wording_t *self) {
    iwn_text_add(&self->text, self->context->contradiction);
}

void iwn_refuse_describe(const iwn_refuse_context_t *context, const iwn_request_t *request, iw_refusal_t refusal,
                         iwn_refusal_t *out_refusal) {
    static void (*const explain[IW_REFUSALS])(wording_t * self) = {
        [IW_REFUSE_OUT_OF_RANGE] = explain_out_of_range,   [IW_REFUSE_MISSING_FIELD] = explain_missing,
        [IW_REFUSE_NOT_HOLDER] = explain_holder,           [IW_REFUSE_BUSY] = explain_holder,
        [IW_REFUSE_NOT_ARMED] = explain_not_armed,         [IW_REFUSE_LATCHED] = explain_stop,
        [IW_REFUSE_ESTOP_PRESSED] = explain_estop,         [IW_REFUSE_BUS_DOWN] = explain_bus_down,
        [IW_REFUSE_TIMING_MISMATCH] = explain_timing,      [IW_REFUSE_WHEEL_LOST] = explain_lost,
        [IW_REFUSE_WHEEL_BLOCKED] = explain_stop,          [IW_REFUSE_PAIR_DIVERGES] = explain_stop,
        [IW_REFUSE_NOT_AT_REST] = explain_not_at_rest,     [IW_REFUSE_SEND_STALLED] = explain_stalled,
        [IW_REFUSE_SECOND_MASTER] = explain_second_master, [IW_REFUSE_CAUSE_PRESENT] = explain_present,
        [IW_REFUSE_TYPE_NOT_SET] = explain_type,           [IW_REFUSE_STALE_COMMAND] = explain_stale,
        [IW_REFUSE_LISTEN_ONLY] = explain_listen_only,     [IW_REFUSE_CONTRADICTED] = explain_contradicted,
        [IW_REFUSE_TRACK_NOT_SET] = explain_track,
    };
    wording_t wording = {context, context->seen, request,
                         iwn_text_begin(out_refusal->message, sizeof out_refusal->message)};
    out_refusal->error = iwn_error_of(refusal);
    if ((unsigned)refusal < IW_REFUSALS && explain[refusal] != NULL) {
        explain[refusal](&wording);
    } else {
        number(&wording, "refused for a reason that has no name (", (int32_t)refusal, "); report this");
    }
}

static bool refuse_late(iwn_refusal_t *out_refusal, const char *before, int64_t value, const char *after) {
    iwn_text_t text = iwn_text_begin(out_refusal->message, sizeof out_refusal->message);
    out_refusal->error = IWN_STALE_COMMAND;
    iwn_text_add(&text, before);
    iwn_text_int(&text, value);
    iwn_text_add(&text, after);
    return true;
}

bool iwn_refuse_late(const iwn_request_t *request, const iwn_moment_t *moment, iwn_refusal_t *out_refusal) {
    const int64_t now_us = (int64_t)moment->now_us;
    const int64_t t_us = request->t_us;
    if (request->has_stop && request->stop != (int64_t)moment->stop) {
        return refuse_late(out_refusal, "this request names another stop than the last one, number ", moment->stop,
                           "; read why (iwheelctl why), then send it again");
    }
    if (!request->has_t_us) {
        return false;
    }
    if (t_us > now_us && t_us - now_us > (int64_t)IWN_AHEAD_MAX_US) {
        return refuse_late(out_refusal, "t_us is ahead of the gateway's clock, which is at ", now_us,
                           " us; count from the t_us of its events");
    }
    if (t_us < now_us - (int64_t)moment->max_age_ms * (int64_t)IW_US_PER_MS) {
        return refuse_late(out_refusal, "this request came too late, more than ", moment->max_age_ms,
                           " ms after t_us; if it is still wanted, send it again");
    }
    if (t_us < (int64_t)moment->stopped_us) {
        return refuse_late(out_refusal, "the wheels were stopped after t_us of this request, ",
                           (int64_t)((moment->now_us - moment->stopped_us) / IW_US_PER_MS),
                           " ms ago; read why (iwheelctl why), then send it again");
    }
    return false;
}

void iwn_refuse_describe_tare(iw_side_t side, iw_tare_t result, iwn_refusal_t *out_refusal) {
    static const struct {
        iwn_error_t error;
        const char *why;
    } reasons[] = {
        [IW_TARE_OK] = {IWN_OK, ""},
        [IW_TARE_NO_FORCE] =
            {IWN_WHEEL_LOST,
             "has not sent force for two seconds without a gap; check its power and cable, wait two seconds"},
        [IW_TARE_MOVING] = {IWN_NOT_AT_REST, "turned within the last two seconds; stop it, wait two seconds"},
        [IW_TARE_NOISY] = {IWN_DENIED, "has an unsteady force; let go of the machine, wait two seconds"},
        [IW_TARE_LOADED] = {IWN_DENIED,
                            "carries a load far from its earlier zero; let go of the machine, wait two seconds"},
        [IW_TARE_SATURATED] = {IWN_DENIED, "shows a force at the end of its range; check the sensor"},
    };
    const bool known = (size_t)result < sizeof reasons / sizeof reasons[0];
    iwn_text_t text = iwn_text_begin(out_refusal->message, sizeof out_refusal->message);
    out_refusal->error = known ? reasons[result].error : IWN_INTERNAL;
    IWN_TEXT_JOIN(&text, "the ", (side == IW_LEFT) ? "left" : "right", " wheel ",
                  known ? reasons[result].why : "cannot be tared", "; nothing was changed");
}
