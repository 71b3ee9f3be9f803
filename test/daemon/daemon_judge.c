// SPDX-License-Identifier: MIT
#include "daemon_judge.h"

#include "kernel.h"

#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#define MS          1000U
#define S           1000000U
#define CLIENTS     VK_STREAMS
#define ENDS        16U
#define LATE_US     (100U * MS) ///< Permitted delay of the gateway's loop.
#define GONE_US     (60U * MS)  ///< Time from a client's death to the ramp.
#define GAP_US      (100U * MS)
#define RESTART_US  (100U * MS) ///< Time from the start of the process to the zeros.
#define START_US    (5U * MS)   ///< Longer than the calls of a start.
#define HOLD_MAX_US (63U * S)   ///< Ramp, a minute of zeros for wheels that continue to turn, and a margin.
#define CALM_US     (300U * MS) ///< Time after a fault of the bus in which gaps are not judged.
#define WATCHDOG_US S           ///< Watchdog of the wheels.
#define WANTED      3U          ///< Number of last commands that setpoints may still follow.
#define WAITS_MAX   8000U       ///< Limit of waits in a second.

typedef struct {
    iw_time_us_t at_us;
    iw_time_us_t stolen_us;
    iw_time_us_t limit_us;
    const char *why;
    bool armed[CLIENTS]; ///< An arm was read after this end,
    bool fresh[CLIENTS]; ///< and a drive after the arm.
} end_t;

typedef struct {
    iw_time_us_t sent_us; ///< Time of the last accepted setpoint.
    iw_time_us_t stolen_us;
    int32_t speed;
    unsigned pending; ///< Accepted setpoints whose echo the gateway has not read.
    bool zeroed;      ///< A zero of this life was on the bus.
} side_t;

static struct {
    const iw_config_t *config;
    result_t *result;
    bool alive;
    side_t side[IW_SIDES];
    end_t end[ENDS];
    unsigned ends;
    int32_t wanted[CLIENTS][WANTED][IW_SIDES];
    iw_time_us_t drive_us[CLIENTS]; ///< Time when the gateway read the last nonzero drive.
    iw_time_us_t drive_stolen_us[CLIENTS];
    iw_time_us_t gone_us[CLIENTS];
    iw_time_us_t gone_stolen_us[CLIENTS];
    iw_time_us_t may_send_until_us; ///< The gateway may send until this time; 0: not at all.
    iw_time_us_t armed_us;          ///< Time when the gateway read an arm while it sent nothing.
    iw_time_us_t moved_us;          ///< Time of the last accepted nonzero setpoint: zeros are held from then on.
    iw_time_us_t fault_us;          ///< Time of the last fault of the bus.
    iw_time_us_t fault_stolen_us;
    iw_time_us_t life_us;
    iw_time_us_t life_stolen_us;
    iw_time_us_t killed_us;
    iw_time_us_t second_us;
    uint64_t second_waits;
    unsigned frames;  ///< Frames of this life.
    unsigned foreign; ///< Setpoints of others on the bus, in this life.
    phase_t killed_at;
    int tried_side;     ///< Side of the last frame; -1: none in this life.
    bool tried_nonzero; ///< The last frame was nonzero and accepted.
    bool broken;        ///< A nonzero frame was not accepted: the next must be zero.
    bool reset_said;
    bool armed_said; ///< An arm was read in this life.
    bool owes;       ///< Motion was commanded when the process died: zeros are due.
    bool something;  ///< A setpoint was, or may have been, sent before the process died.
    int32_t sum;     ///< Sum of both wheels' absolute speeds after the last pair,
    int32_t trend;   ///< and its last change.
} self;

void judge_begin(const scenario_t *scenario, result_t *result) {
    memset(&self, 0, sizeof self);
    self.config = &scenario->config;
    self.result = result;
    for (unsigned i = 0; i < CLIENTS; i++) {
        self.drive_us[i] = self.gone_us[i] = IW_NEVER;
    }
}

void judge_break(uint32_t rule, const char *format, ...) {
    va_list arguments;
    if (self.result->rule != 0U) {
        return;
    }
    self.result->rule = rule;
    self.result->broken_us = vk.now_us;
    va_start(arguments, format);
    (void)vsnprintf(self.result->text, sizeof self.result->text, format, arguments);
    va_end(arguments);
    vk.end_us = vk.now_us; // Later events prove nothing.
}

/// Time since then in which the process could run.
static iw_time_us_t own_us(iw_time_us_t since_us, iw_time_us_t stolen_us) {
    const iw_time_us_t stolen = vk.stolen_us - stolen_us;
    const iw_time_us_t passed = vk.now_us - since_us;
    return (passed > stolen) ? passed - stolen : 0U;
}

static iw_time_us_t ramp_us(void) {
    return (iw_time_us_t)self.config->max_speed_mm_s * S / self.config->decel_mm_s2 +
           2U * (iw_time_us_t)self.config->period_ms * MS;
}

// ---- input -------------------------------------------------------------------------------------------------------

void judge_end(const char *why, iw_time_us_t limit_us) {
    if (!self.alive) {
        return;
    }
    if (self.ends == ENDS) {
        memmove(&self.end[0], &self.end[1], (ENDS - 1U) * sizeof self.end[0]);
        self.ends--;
    }
    self.end[self.ends++] = (end_t){.at_us = vk.now_us, .stolen_us = vk.stolen_us, .limit_us = limit_us, .why = why};
}

void judge_said(unsigned client, said_t what) {
    const iw_time_us_t until_us = vk.now_us + HOLD_MAX_US;
    for (unsigned i = 0; i < self.ends; i++) {
        end_t *end = &self.end[i];
        end->armed[client] = end->armed[client] || what == SAID_ARM;
        end->fresh[client] = end->fresh[client] || (what == SAID_DRIVE && end->armed[client]);
    }
    if (what == SAID_ARM || what == SAID_DRIVE) {
        self.armed_said = self.armed_said || what == SAID_ARM;
        self.armed_us = (what == SAID_ARM && judge_is_silent(GAP_US)) ? vk.now_us : self.armed_us;
        self.may_send_until_us = self.armed_said ? until_us : self.may_send_until_us;
    }
    if (what == SAID_DRIVE) {
        self.drive_us[client] = vk.now_us;
        self.drive_stolen_us[client] = vk.stolen_us;
        self.gone_us[client] = IW_NEVER;
    }
    if (what == SAID_STOP) {
        judge_end("stop", ramp_us());
    } else if (what == SAID_ESTOP) {
        judge_end("a client's e-stop", JUDGE_REACTION_US);
    }
    self.reset_said = self.reset_said || what == SAID_RESET;
}

void judge_wanted(unsigned client, int32_t left, int32_t right) {
    memmove(&self.wanted[client][1], &self.wanted[client][0], (WANTED - 1U) * sizeof self.wanted[client][0]);
    self.wanted[client][0][IW_LEFT] = left;
    self.wanted[client][0][IW_RIGHT] = right;
}

void judge_gone(unsigned client) {
    self.gone_us[client] = vk.now_us;
    self.gone_stolen_us[client] = vk.stolen_us;
}

void judge_stopped(iw_time_us_t span_us) {
    if (span_us > LATE_US + (iw_time_us_t)self.config->period_ms * MS + 10U * MS) {
        judge_end("the process did not run", JUDGE_REACTION_US);
    }
}

void judge_bus_fault(void) {
    self.fault_us = vk.now_us;
    self.fault_stolen_us = vk.stolen_us;
}

void judge_bus_lost(void) {
    judge_bus_fault();
    self.side[IW_LEFT].pending = self.side[IW_RIGHT].pending = 0;
}

void judge_echo(unsigned side) {
    self.side[side].pending -= (self.side[side].pending > 0U) ? 1U : 0U;
}

// ---- output ------------------------------------------------------------------------------------------------------

typedef enum { MAY_STAND, MAY_FALL, MAY_MOVE } right_t;

static right_t lesser(right_t one, right_t other) {
    return (one < other) ? one : other;
}

/// The right `since` an event that ends motion by a ramp: as before for `free_us`, then towards zero.
static right_t after(iw_time_us_t since_us, iw_time_us_t stolen_us, iw_time_us_t free_us) {
    const iw_time_us_t passed_us = own_us(since_us, stolen_us);
    return (passed_us <= free_us) ? MAY_MOVE : (passed_us <= free_us + ramp_us()) ? MAY_FALL : MAY_STAND;
}

static right_t after_end(const end_t *end) {
    const iw_time_us_t passed_us = own_us(end->at_us, end->stolen_us);
    if (passed_us > end->limit_us) {
        return MAY_STAND;
    }
    return (end->limit_us > JUDGE_REACTION_US && passed_us > GONE_US) ? MAY_FALL : MAY_MOVE;
}

/// After a kill the next start must detect the motion. A marker that could not be written is written soon.
static void judge_marker(void) {
    if (!vk_file_exists(VK_MARKER) && own_us(vk.failed_us, vk.failed_stolen_us) > CALM_US) {
        judge_break(10, "a nonzero setpoint without a crash marker");
    }
}

/// Right to drive from this client's commands, and the end that limits it.
static right_t right_of(unsigned client, const char **out_why) {
    const iw_time_us_t lease_us = ((iw_time_us_t)self.config->lease_ms + self.config->period_ms) * MS + LATE_US;
    if (self.drive_us[client] == IW_NEVER) {
        return MAY_STAND;
    }
    right_t right = after(self.drive_us[client], self.drive_stolen_us[client], lease_us);
    *out_why = (right != MAY_MOVE) ? "its lease is over" : *out_why;
    if (self.gone_us[client] != IW_NEVER) {
        right = lesser(right, after(self.gone_us[client], self.gone_stolen_us[client], GONE_US));
        *out_why = "its client has disconnected";
    }
    for (unsigned i = 0; i < self.ends; i++) {
        const end_t *end = &self.end[i];
        const right_t left = end->fresh[client] ? MAY_MOVE : after_end(end);
        *out_why = (left < right) ? end->why : *out_why;
        right = lesser(right, left);
    }
    return right;
}

static bool is_wanted(unsigned client, unsigned side, int32_t speed) {
    for (unsigned i = 0; i < WANTED; i++) {
        const int32_t wanted = self.wanted[client][i][side];
        if ((int64_t)wanted * speed > 0 && abs(speed) <= abs(wanted) + 1) {
            return true;
        }
    }
    return false;
}

/// Slower is allowed during a ramp; as fast as before or faster only by a command of a client that may drive.
static void judge_right(unsigned side, int32_t speed) {
    // Both wheels ramp together: by rounding, the slower one may have the same speed for two pairs.
    const int32_t before = abs(self.side[side].speed);
    const bool falls = abs(speed) < before || (abs(speed) == before && before < abs(self.side[1U - side].speed));
    const char *why = "no client drives";
    bool allowed = false;
    for (unsigned i = 0; i < CLIENTS; i++) {
        const right_t right = right_of(i, &why);
        allowed =
            allowed || (right == MAY_MOVE && (falls || is_wanted(i, side, speed))) || (right == MAY_FALL && falls);
    }
    if (!allowed) {
        judge_break(1, "%s wheel commanded %d mm/s, before %d, but: %s", (side == IW_LEFT) ? "left" : "right", speed,
                    self.side[side].speed, why);
    }
}

static void judge_slope(const side_t *side, int32_t speed) {
    const iw_config_t *config = self.config;
    const iw_time_us_t period_us = (iw_time_us_t)config->period_ms * MS;
    const bool away = abs(speed) > abs(side->speed);
    iw_time_us_t span_us = vk.now_us - side->sent_us;
    if (speed * side->speed < 0) {
        judge_break(8, "from %d to %d mm/s without a zero", side->speed, speed);
    }
    if (vk.stolen_us - side->stolen_us > MS) {
        return; // The time when the step began is unknown.
    }
    span_us = (away && span_us > 2U * period_us) ? 2U * period_us : span_us;
    const uint64_t slope = away ? config->accel_mm_s2 : config->decel_mm_s2;
    if ((uint64_t)abs(speed - side->speed) > slope * (span_us + 4U * MS) / S + 2U) {
        judge_break(8, "from %d to %d mm/s in %llu us", side->speed, speed,
                    (unsigned long long)(vk.now_us - side->sent_us));
    }
}

static void judge_form(const iw_can_frame_t *frame, int32_t speed, int32_t current) {
    const iw_config_t *config = self.config;
    if ((frame->id != 266U && frame->id != 298U) || frame->dlc != config->setpoint_dlc ||
        frame->data[0] != config->setpoint_type) {
        judge_break(8, "frame 0x%X with %u bytes of type %u", (unsigned)frame->id, frame->dlc, frame->data[0]);
    }
    if (abs(speed) > config->max_speed_mm_s || current < 0 || current > config->max_current_mA) {
        judge_break(8, "%d mm/s with %d mA is beyond the configured limits", speed, current);
    }
}

static void judge_presence(void) {
    if (!self.armed_said && !self.something && !vk.marker_failed) {
        judge_break(3, "a setpoint, though no client has requested to arm and nothing had been sent before the start");
    }
    if (vk.now_us > self.may_send_until_us + vk.stolen_us - self.life_stolen_us) {
        judge_break(4, "still sending, though no client has driven for 13 s");
    }
}

static void judge_pair(unsigned side, bool nonzero, bool accepted) {
    if (self.tried_side == IW_LEFT && side == IW_LEFT && self.tried_nonzero) {
        judge_break(5, "two setpoints of the left wheel, and none of the right");
    }
    if (nonzero && self.broken) {
        judge_break(5, "nonzero after a pair that did not leave whole");
    }
    self.tried_side = (int)side;
    self.tried_nonzero = nonzero && accepted;
    self.broken = nonzero && !accepted;
}

static void note_accepted(unsigned number, int32_t speed) {
    side_t *side = &self.side[number];
    side->speed = speed;
    side->sent_us = vk.now_us;
    side->stolen_us = vk.stolen_us;
    side->pending += vk.link.off ? 0U : 1U; // In bus-off the controller holds no frame.
    if (speed != 0) {
        self.reset_said = false;
        self.moved_us = vk.now_us;
    }
    if (number == IW_RIGHT) {
        const int32_t sum = abs(self.side[IW_LEFT].speed) + abs(speed);
        self.trend = sum - self.sum;
        self.sum = sum;
    }
    self.frames++;
}

static void hash(uint64_t value) {
    self.result->hash = (self.result->hash ^ value) * UINT64_C(1099511628211);
}

void judge_call(const iw_can_frame_t *first, unsigned count) {
    const int16_t speed = (int16_t)(first->data[1] << 8 | first->data[2]);
    if (speed != 0 && (count != IW_SIDES || first->id != 266U)) {
        judge_break(5, "%d mm/s for one wheel in a separate call", speed);
    }
}

void judge_frame(const iw_can_frame_t *frame, bool accepted) {
    const unsigned number = (frame->id == 266U) ? IW_LEFT : IW_RIGHT;
    side_t *side = &self.side[number];
    const int32_t speed = (int16_t)(frame->data[1] << 8 | frame->data[2]);
    const int32_t current = (int16_t)(frame->data[3] << 8 | frame->data[4]);
    hash(vk.now_us ^ (uint64_t)frame->id << 48 ^ (uint64_t)(uint32_t)speed << 16 ^ (accepted ? 1U : 0U));
    self.result->frames++;
    self.result->nonzero += (speed != 0) ? 1U : 0U;
    judge_form(frame, speed, current);
    judge_presence();
    judge_pair(number, speed != 0, accepted);
    if (side->pending >= ((speed == 0) ? 2U : 1U)) {
        judge_break(6, "%d mm/s behind %u setpoints that were not echoed", speed, side->pending);
    }
    if (speed != 0) {
        judge_right(number, speed);
        judge_marker();
        judge_slope(side, speed);
    }
    if (accepted) {
        note_accepted(number, speed);
    }
}

/// The time until the zeros of a restart.
void judge_on_bus(const iw_can_frame_t *frame) {
    const unsigned number = (frame->id == 266U) ? IW_LEFT : IW_RIGHT;
    const bool zero = frame->data[1] == 0U && frame->data[2] == 0U;
    self.side[number].zeroed = self.side[number].zeroed || (self.alive && zero && self.frames > 0U);
    if (!self.owes || !self.side[IW_LEFT].zeroed || !self.side[IW_RIGHT].zeroed) {
        return;
    }
    phase_stats_t *stats = &self.result->phase[self.killed_at];
    const iw_time_us_t took_us = own_us(self.life_us, self.life_stolen_us);
    stats->worst_us = (took_us > stats->worst_us) ? took_us : stats->worst_us;
    stats->between_us =
        (vk.now_us - self.killed_us > stats->between_us) ? vk.now_us - self.killed_us : stats->between_us;
    self.owes = false;
}

void judge_foreign_on_bus(void) {
    self.foreign++;
    self.owes = false; // Another master commands the wheels.
}

// ---- lives -------------------------------------------------------------------------------------------------------

bool judge_is_silent(iw_time_us_t for_us) {
    const side_t *side = self.side;
    return own_us(side[IW_LEFT].sent_us, side[IW_LEFT].stolen_us) > for_us &&
           own_us(side[IW_RIGHT].sent_us, side[IW_RIGHT].stolen_us) > for_us;
}

void judge_life(void) {
    self.alive = true;
    self.ends = 0;
    self.frames = self.foreign = 0;
    self.tried_side = -1;
    self.tried_nonzero = self.broken = self.armed_said = self.reset_said = false;
    self.life_us = self.second_us = vk.now_us;
    self.second_waits = vk.waits;
    self.life_stolen_us = vk.stolen_us;
    self.may_send_until_us = (self.something || vk.marker_failed) ? vk.now_us + HOLD_MAX_US : 0U;
    self.side[IW_LEFT].pending = self.side[IW_RIGHT].pending = 0;
    self.side[IW_LEFT].zeroed = self.side[IW_RIGHT].zeroed = false;
    self.side[IW_LEFT].speed = self.side[IW_RIGHT].speed = 0;
    for (unsigned i = 0; i < CLIENTS; i++) {
        self.drive_us[i] = IW_NEVER;
    }
    self.result->lives++;
}

phase_t judge_phase(void) {
    if (self.side[IW_LEFT].speed != 0 || self.side[IW_RIGHT].speed != 0) {
        return (self.trend > 0 || self.sum == 0) ? AT_RAMP_UP : (self.trend < 0) ? AT_RAMP_DOWN : AT_STEADY;
    }
    if (self.armed_us > self.life_us && vk.now_us - self.armed_us < GAP_US) {
        return AT_ARMING;
    }
    if (judge_is_silent(GAP_US)) {
        return (vk.now_us - self.life_us < START_US) ? AT_START : AT_SILENCE;
    }
    return (self.moved_us > self.life_us) ? AT_HOLD : AT_RESTART;
}

void judge_death(bool in_order) {
    const iw_time_us_t long_us = WATCHDOG_US + 200U * MS;
    const bool quiet = judge_is_silent(long_us) && own_us(self.fault_us, self.fault_stolen_us) > long_us;
    const bool moving =
        (self.side[IW_LEFT].speed != 0 || self.side[IW_RIGHT].speed != 0) && !judge_is_silent(WATCHDOG_US);
    self.killed_at = judge_phase();
    self.killed_us = vk.now_us;
    // A process that is killed before its zeros are on the bus still owes them.
    self.something = !in_order && ((self.something && self.frames == 0U) || (self.frames > 0U && !quiet));
    self.owes = !in_order && (moving || self.owes) && vk.now_us - self.fault_us > CALM_US && !vk.marker_failed;
    self.alive = false;
    self.side[IW_LEFT].zeroed = self.side[IW_RIGHT].zeroed = false;
    if (!in_order) {
        self.result->phase[self.killed_at].kills++;
        self.result->phase[self.killed_at].moving += self.owes ? 1U : 0U;
    }
}

// ---- time --------------------------------------------------------------------------------------------------------

static void judge_gap(const side_t *side) {
    const bool moves = self.side[IW_LEFT].speed != 0 || self.side[IW_RIGHT].speed != 0;
    const bool holds = self.moved_us > self.life_us && !self.reset_said &&
                       vk.now_us - self.moved_us < ((iw_time_us_t)self.config->zero_hold_ms - 100U) * MS;
    if (self.frames == 0U || !(moves || holds) || own_us(side->sent_us, side->stolen_us) <= GAP_US) {
        return;
    }
    judge_break(4, "no setpoint for %llu ms", (unsigned long long)((vk.now_us - side->sent_us) / MS));
}

void judge_tick(void) {
    if (!self.alive) {
        return;
    }
    if (vk.now_us - self.second_us >= S) {
        if (vk.waits - self.second_waits > WAITS_MAX) {
            judge_break(11, "it does not sleep: %llu waits in a second",
                        (unsigned long long)(vk.waits - self.second_waits));
        }
        self.second_us = vk.now_us;
        self.second_waits = vk.waits;
    }
    const bool calm =
        own_us(self.fault_us, self.fault_stolen_us) > CALM_US && own_us(vk.failed_us, vk.failed_stolen_us) > CALM_US;
    if (!calm) {
        self.owes = self.owes && vk.failed_us < self.life_us && self.fault_us < self.life_us;
        return;
    }
    judge_gap(&self.side[IW_LEFT]);
    judge_gap(&self.side[IW_RIGHT]);
    if (self.owes && own_us(self.life_us, self.life_stolen_us) > RESTART_US) {
        judge_break(10, "no zeros on the bus %llu ms after the restart, killed at: %s",
                    (unsigned long long)((vk.now_us - self.life_us) / MS), world_phase_name(self.killed_at));
    }
}
