// SPDX-License-Identifier: MIT
// Commands that move wheels: checks of key, age and values.
#include "server_calls.h"

/// Limits a number that is too large for the core; the core then refuses it by its range.
static int32_t saturate(int64_t value) {
    return (value > INT32_MAX) ? INT32_MAX : (value < INT32_MIN) ? INT32_MIN : (int32_t)value;
}

static iw_refusal_t judge(iwn_server_t *self, const iwn_client_t *client, iw_time_us_t sent_us,
                          const iw_drive_t *wanted, iw_applied_t *out_applied) {
    const iw_refusal_t refusal = iw_gateway_drive(self->core, sent_us, client->id, wanted, out_applied);
    iwn_target_driven(self, client, wanted, sent_us, refusal);
    return refusal;
}

static bool would_move(const iw_config_t *config, const iw_drive_t *wanted) {
    const bool by_current = wanted->has_current && config->current_role == IW_ROLE_SETPOINT;
    return wanted->speed_mm_s[IW_LEFT] != 0 || wanted->speed_mm_s[IW_RIGHT] != 0 ||
           (by_current && (wanted->current_mA[IW_LEFT] != 0 || wanted->current_mA[IW_RIGHT] != 0));
}

/// Refuses a command before the core judges it. The core receives a command out of range instead, so that no client can
/// arm while the command continues.
static void refuse_unjudged(iwn_server_t *self, iwn_client_t *client, const iw_drive_t *wanted) {
    const iw_drive_t unknown = {.speed_mm_s = {INT32_MAX, INT32_MAX}};
    iw_applied_t applied;
    if (would_move(iwn_server_snapshot(self)->config, wanted)) {
        (void)judge(self, client, self->now_us, &unknown, &applied);
    }
    iwn_server_refuse(self, client, &self->request.id);
}

/// A command on the holder's connection with another key comes from another person. If the core refuses it anyway, the
/// core's reason is reported.
static bool has_wrong_key(iwn_server_t *self, const iwn_client_t *client) {
    const char *const key = self->request.lease_key;
    return key[0] != '\0' && iw_gateway_state(self->core) == IW_STATE_ARMED &&
           iwn_server_snapshot(self)->holder == client->id && !iwn_target_is_key(self, client, key);
}

static void drive(iwn_server_t *self, iwn_client_t *client, const iw_drive_t *wanted) {
    iw_time_us_t sent_us = self->now_us;
    iw_applied_t applied;
    if (has_wrong_key(self, client) || !iwn_target_is_fresh(self, client, &sent_us)) {
        refuse_unjudged(self, client, wanted);
        return;
    }
    const iw_refusal_t refusal = judge(self, client, sent_us, wanted, &applied);
    if (refusal != IW_REFUSE_NONE) {
        iwn_server_refuse_as(self, client, refusal);
        return;
    }
    iwn_out_t json = iwn_server_begin_reply(self, &self->request.id);
    iwn_write_applied(&applied, &json);
    iwn_server_send_reply(self, client, &json);
}

void iwn_server_drive(iwn_server_t *self, iwn_client_t *client) {
    const iwn_request_t *const request = &self->request;
    const iw_drive_t wanted = {
        .speed_mm_s = {saturate(request->left_mm_s), saturate(request->right_mm_s)},
        .current_mA = {saturate(request->left_mA), saturate(request->right_mA)},
        .has_current = request->has_current,
    };
    drive(self, client, &wanted);
}

/// Refuses a turn for which no speeds are known.
static void refuse_turn(iwn_server_t *self, iwn_client_t *client) {
    const iw_drive_t turn = {.speed_mm_s = {-1, 1}};
    self->refusal.error = IWN_DENIED;
    iwn_target_contradiction(self, IW_ASSUMPTION_TRACK, self->refusal.message, sizeof self->refusal.message);
    refuse_unjudged(self, client, &turn);
}

static int32_t limit(int64_t value) {
    const int32_t most = 1000000; // Far outside the range, and its product with the largest track has 31 bits.
    return (value > most) ? most : (value < -most) ? -most : (int32_t)value;
}

void iwn_server_twist(iwn_server_t *self, iwn_client_t *client) {
    const int32_t v_mm_s = limit(self->request.v_mm_s);
    const int32_t yaw_mrad_s = limit(self->request.yaw_mrad_s);
    const iw_snapshot_t *const seen = iwn_server_snapshot(self);
    if (yaw_mrad_s != 0 && seen->assumed[IW_ASSUMPTION_TRACK].state == IW_CONTRADICTED) {
        refuse_turn(self, client);
        return;
    }
    const int32_t rim_mm_s = yaw_mrad_s * (int32_t)seen->config->track_mm / 2000;
    const iw_drive_t wanted = {.speed_mm_s = {v_mm_s - rim_mm_s, v_mm_s + rim_mm_s}};
    drive(self, client, &wanted);
}
