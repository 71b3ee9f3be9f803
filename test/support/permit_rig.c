// SPDX-License-Identifier: MIT
#include "permit_rig.h"

#include "unity.h"

#include <string.h>

static void start(permit_rig_t *self, bool restarted) {
    const iw_permit_view_t good = {.online = true,
                                   .at_rest = true,
                                   .settled = true,
                                   .output_zero = true,
                                   .timing_ok = true,
                                   .can_send = true,
                                   .proven = false};
    self->view = good;
    self->now_us = FIXTURE_START_US;
    memset(&self->permit, FIXTURE_POISON, sizeof self->permit);
    iw_permit_init(&self->permit, &self->config, self->now_us, restarted);
    permit_rig_step(self);
}

void permit_rig_init(permit_rig_t *self) {
    fixture_config(&self->config);
    start(self, false);
}

void permit_rig_init_restarted(permit_rig_t *self) {
    fixture_config(&self->config);
    start(self, true);
}

/// Moving, with a valid lease.
static void drive_off(permit_rig_t *self) {
    self->view.output_zero = false;
    self->view.at_rest = false;
    self->view.settled = false;
    (void)permit_rig_drive(self, HOLDER, true);
    permit_rig_step(self);
}

static void come_to_rest(permit_rig_t *self) {
    self->view.output_zero = true;
    self->view.at_rest = true;
    permit_rig_step(self);
}

void permit_rig_begin(permit_rig_t *self, permit_situation_t situation) {
    start(self, false);
    if (situation == PERMIT_LISTENING) {
        return;
    }
    (void)permit_rig_arm(self, HOLDER);
    if (situation == PERMIT_ARMING) {
        permit_rig_step(self);
        return;
    }
    permit_rig_prove(self);
    drive_off(self);
    if (situation == PERMIT_STOPPING || situation == PERMIT_HOLDING) {
        iw_permit_stop(&self->permit, self->now_us, HOLDER, IW_CAUSE_CLIENT_STOP);
        permit_rig_step(self);
    }
    if (situation == PERMIT_HOLDING) {
        come_to_rest(self);
    }
    if (situation == PERMIT_LATCHED) {
        permit_rig_raise(self, IW_CAUSE_INTERNAL);
        permit_rig_step(self);
    }
}

void permit_rig_step(permit_rig_t *self) {
    self->permit.view = self->view;
    iw_permit_step(&self->permit, self->now_us);
}

void permit_rig_wait(permit_rig_t *self, iw_time_us_t for_us) {
    self->now_us += for_us;
    permit_rig_step(self);
}

void permit_rig_prove(permit_rig_t *self) {
    self->view.proven = true;
    permit_rig_step(self);
    self->view.proven = false;
}

void permit_rig_assert(const permit_rig_t *self, iw_state_t state, iw_demand_t demand) {
    TEST_ASSERT_EQUAL_INT(state, iw_permit_state(&self->permit));
    TEST_ASSERT_EQUAL_INT(demand, iw_permit_demand(&self->permit));
}

void permit_rig_raise(permit_rig_t *self, iw_cause_t cause) {
    const iw_event_t event = {cause, IW_SIDES_BOTH, 42, IW_REACT_BY_CAUSE};
    iw_permit_raise(&self->permit, &event, self->now_us);
}

iw_refusal_t permit_rig_arm(permit_rig_t *self, iw_client_t client) {
    return iw_permit_arm(&self->permit, self->now_us, client, false);
}

iw_refusal_t permit_rig_takeover(permit_rig_t *self, iw_client_t client) {
    return iw_permit_arm(&self->permit, self->now_us, client, true);
}

iw_refusal_t permit_rig_drive(permit_rig_t *self, iw_client_t client, bool nonzero) {
    return iw_permit_drive(&self->permit, self->now_us, client, nonzero);
}

iw_refusal_t permit_rig_reset(permit_rig_t *self) {
    return iw_permit_reset(&self->permit, self->now_us);
}
