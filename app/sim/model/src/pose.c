// SPDX-License-Identifier: MIT
#include "iwheel_sim/pose.h"

#include "iwheel_sim/trig.h"

void sim_pose_restart(sim_pose_t *self, iw_time_us_t now_us, int64_t right_nm) {
    sim_pose_t fresh = {.now_us = now_us, .left_received_us = now_us, .right_last_nm = right_nm};
    fresh.track_mm = self->track_mm;
    fresh.mirrored[IW_LEFT] = self->mirrored[IW_LEFT];
    fresh.mirrored[IW_RIGHT] = self->mirrored[IW_RIGHT];
    *self = fresh;
}

static void follow_left(sim_pose_t *self, iw_time_us_t now_us) {
    iw_time_us_t const silent_us = self->left_received_us + SIM_POSE_SILENT_US;
    iw_time_us_t const end_us = (now_us < silent_us) ? now_us : silent_us;
    if (end_us > self->now_us) {
        self->left_nm += (int64_t)self->left_um_s * (int64_t)(end_us - self->now_us) / 1000;
    }
    self->now_us = now_us;
}

void sim_pose_receive_left(sim_pose_t *self, iw_time_us_t now_us, int32_t speed_um_s) {
    follow_left(self, now_us);
    self->left_received_us = now_us;
    self->left_um_s = speed_um_s;
}

static int16_t saturated_mm(int64_t value_nm) {
    int64_t const value_mm = value_nm / 1000000;
    if (value_mm > INT16_MAX) {
        return INT16_MAX;
    }
    return (value_mm < INT16_MIN) ? INT16_MIN : (int16_t)value_mm;
}

static int16_t wrapped_mrad(int64_t value_nrad) {
    int64_t const counts = (value_nrad / 1000000) & 0xFFFF;
    return (int16_t)((counts > INT16_MAX) ? counts - 0x10000 : counts);
}

iw_codec_pose_t sim_pose_step(sim_pose_t *self, iw_time_us_t now_us, int64_t right_nm) {
    follow_left(self, now_us);
    int64_t const left = self->mirrored[IW_LEFT] ? -self->left_nm : self->left_nm;
    int64_t const right_way = right_nm - self->right_last_nm;
    int64_t const right = self->mirrored[IW_RIGHT] ? -right_way : right_way;
    int64_t const turned_nrad = (right - left) * 1000 / self->track_mm;
    int64_t const heading = self->psi_nrad + turned_nrad / 2;
    int64_t const way_um = (left + right) / 2000;
    self->x_nm += way_um * sim_trig_cos(heading) / (SIM_TRIG_ONE / 1000);
    self->y_nm += way_um * sim_trig_sin(heading) / (SIM_TRIG_ONE / 1000);
    self->psi_nrad += turned_nrad;
    self->left_nm = 0;
    self->right_last_nm = right_nm;
    return (iw_codec_pose_t){saturated_mm(self->x_nm), saturated_mm(self->y_nm), 0, wrapped_mrad(self->psi_nrad)};
}
