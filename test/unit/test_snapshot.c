// SPDX-License-Identifier: MIT
// A snapshot, the only interface for reading: it equals the state of the parts of the gateway in every state, and no
// field is missing.
#include "test_gateway_core_rig.h"
#include "unit.h"

#include <string.h>

#define PLACE(member)                                                                                                  \
    { offsetof(iw_snapshot_t, member), sizeof(((iw_snapshot_t *)0)->member), #member }
#define PLACES_OF_WHEEL(side)                                                                                          \
    PLACE(wheel[side].telemetry), PLACE(wheel[side].force), PLACE(wheel[side].speed_us), PLACE(wheel[side].status_us), \
        PLACE(wheel[side].ticks), PLACE(wheel[side].nm_per_tick), PLACE(wheel[side].speed_mm_s),                       \
        PLACE(wheel[side].um_s_per_rpm), PLACE(wheel[side].reboots), PLACE(wheel[side].heard),                         \
        PLACE(wheel[side].at_rest)

typedef struct {
    size_t offset;
    size_t size;
    const char *name;
} place_t;

/// Every field, in the order of the struct.
static const place_t places[] = {
    PLACE(at_us),        PLACE(config),        PLACE(counters),        PLACE(sent),           PLACE(stop),
    PLACE(assumed),      PLACE(seen_us),       PLACES_OF_WHEEL(0),     PLACES_OF_WHEEL(1),    PLACE(stopped),
    PLACE(stray_echoes), PLACE(pose_us),       PLACE(armed_us),        PLACE(lease_until_us), PLACE(stale_us),
    PLACE(waiting_us),   PLACE(confirmed_us),  PLACE(holder),          PLACE(stale_client),   PLACE(target),
    PLACE(applied),      PLACE(present),       PLACE(assumed_changes), PLACE(pair_mm),        PLACE(pair_largest_mm),
    PLACE(still_moving), PLACE(state),         PLACE(arm_refusal),     PLACE(demand),         PLACE(bus),
    PLACE(doubt),        PLACE(arming),        PLACE(output_zero),     PLACE(echo_proven),    PLACE(zeros_ending),
    PLACE(rolling),      PLACE(rolling_fault), PLACE(left_behind),
};
#define PLACES (sizeof places / sizeof places[0])

static void assert_wheel(const iw_snapshot_wheel_t *seen, iw_side_t side, iw_time_us_t now_us) {
    const iw_wheel_t *wheel = &rig.gateway.wheel[side];
    TEST_ASSERT_EQUAL_PTR(&rig.gateway.telemetry[side], seen->telemetry);
    TEST_ASSERT_EQUAL_PTR(&rig.gateway.force[side], seen->force);
    TEST_ASSERT_EQUAL_UINT64(wheel->speed_us, seen->speed_us);
    TEST_ASSERT_EQUAL_UINT64(wheel->status_us, seen->status_us);
    TEST_ASSERT_EQUAL_INT64(wheel->ticks, seen->ticks);
    TEST_ASSERT_EQUAL_INT32(wheel->nm_per_tick, seen->nm_per_tick);
    TEST_ASSERT_EQUAL_INT32(wheel->speed_mm_s, seen->speed_mm_s);
    TEST_ASSERT_EQUAL_UINT32(wheel->um_s_per_rpm, seen->um_s_per_rpm);
    TEST_ASSERT_EQUAL_UINT32(wheel->reboots, seen->reboots);
    TEST_ASSERT_EQUAL_INT(iw_wheel_online(wheel, now_us), seen->heard);
    TEST_ASSERT_EQUAL_INT(iw_wheel_rest_us(wheel, now_us) >= rig.config.rest_ms * 1000U, seen->at_rest);
}

static void assert_sent(const iw_snapshot_t *seen) {
    const iw_sender_t *sender = &rig.gateway.sender;
    TEST_ASSERT_EQUAL_PTR(&sender->sent, seen->sent);
    TEST_ASSERT_EQUAL_UINT32(sender->envelope.stopped, seen->stopped);
    TEST_ASSERT_EQUAL_UINT32(sender->confirmation.stray, seen->stray_echoes);
}

static void assert_permit(const iw_snapshot_t *seen, iw_time_us_t now_us) {
    const iw_permit_t *permit = &rig.gateway.permit;
    TEST_ASSERT_EQUAL_PTR(&permit->stop, seen->stop);
    TEST_ASSERT_EQUAL_PTR(permit->seen_us, seen->seen_us);
    TEST_ASSERT_EQUAL_UINT64(permit->armed_us, seen->armed_us);
    TEST_ASSERT_EQUAL_UINT64(permit->lease_until_us, seen->lease_until_us);
    TEST_ASSERT_EQUAL_UINT64(permit->stale_us, seen->stale_us);
    TEST_ASSERT_EQUAL_UINT32(permit->holder, seen->holder);
    TEST_ASSERT_EQUAL_UINT32(permit->stale_client, seen->stale_client);
    TEST_ASSERT_EQUAL_HEX32(iw_permit_present(permit, now_us), seen->present);
    TEST_ASSERT_EQUAL_UINT32(permit->still_moving, seen->still_moving);
    TEST_ASSERT_EQUAL_INT32(rig.gateway.diverge.path_um / 1000, seen->pair_mm);
    TEST_ASSERT_EQUAL_INT32(rig.gateway.diverge.largest_um / 1000, seen->pair_largest_mm);
    TEST_ASSERT_EQUAL_INT(iw_permit_state(permit), seen->state);
    TEST_ASSERT_EQUAL_INT(permit->arm_refusal, seen->arm_refusal);
    TEST_ASSERT_EQUAL_INT(iw_permit_arming(permit), seen->arming);
    TEST_ASSERT_EQUAL_INT(seen->state, state());
    TEST_ASSERT_EQUAL_INT(seen->arming, iw_gateway_arming(&rig.gateway));
    TEST_ASSERT_EQUAL_INT(seen->arm_refusal, iw_gateway_arm_refusal(&rig.gateway));
    TEST_ASSERT_EQUAL_INT(iw_permit_demand(permit) != IW_DEMAND_SILENCE, iw_gateway_is_sending(&rig.gateway));
}

static void assert_rest(const iw_snapshot_t *seen) {
    const iw_gateway_t *gateway = &rig.gateway;
    const iw_pair_t applied = iw_setpoint_applied(&gateway->setpoint);
    TEST_ASSERT_EQUAL_PTR(&gateway->config, seen->config);
    TEST_ASSERT_EQUAL_PTR(&gateway->counters, seen->counters);
    TEST_ASSERT_EQUAL_PTR(gateway->assumptions.entry, seen->assumed);
    TEST_ASSERT_EQUAL_UINT32(gateway->assumptions.changes, seen->assumed_changes);
    TEST_ASSERT_EQUAL_INT(gateway->assumptions.doubt, seen->doubt);
    TEST_ASSERT_EQUAL_UINT64(gateway->pose_us, seen->pose_us);
    TEST_ASSERT_EQUAL_UINT64(iw_confirmation_waiting_us(&gateway->sender.confirmation), seen->waiting_us);
    TEST_ASSERT_EQUAL_UINT64(iw_confirmation_proven_us(&gateway->sender.confirmation), seen->confirmed_us);
    TEST_ASSERT_EQUAL_INT(gateway->setpoint.demand, seen->demand);
    TEST_ASSERT_EQUAL_MEMORY(&gateway->setpoint.target, &seen->target, sizeof seen->target);
    TEST_ASSERT_EQUAL_MEMORY(&applied, &seen->applied, sizeof applied);
    TEST_ASSERT_EQUAL_INT(iw_setpoint_is_zero(&gateway->setpoint), seen->output_zero);
    TEST_ASSERT_EQUAL_INT(gateway->bus, seen->bus);
    TEST_ASSERT_EQUAL_INT(gateway->facts.echo_proven, seen->echo_proven);
    TEST_ASSERT_EQUAL_INT(gateway->left_behind, seen->left_behind);
}

/// Takes two snapshots into structs with different contents: every field must be equal, and equal to the state of the
/// parts.
static iw_snapshot_t snapshot_at(iw_time_us_t now_us) {
    iw_snapshot_t seen;
    iw_snapshot_t again;
    memset(&seen, FIXTURE_POISON, sizeof seen);
    memset(&again, (uint8_t)~FIXTURE_POISON, sizeof again);
    iw_gateway_snapshot(&rig.gateway, now_us, &seen);
    iw_gateway_snapshot(&rig.gateway, now_us, &again);
    for (size_t i = 0; i < PLACES; i++) {
        const int other = memcmp((const uint8_t *)&seen + places[i].offset, (const uint8_t *)&again + places[i].offset,
                                 places[i].size);
        TEST_ASSERT_EQUAL_INT_MESSAGE(0, other, places[i].name);
    }
    TEST_ASSERT_EQUAL_UINT64(now_us, seen.at_us);
    assert_wheel(&seen.wheel[IW_LEFT], IW_LEFT, now_us);
    assert_wheel(&seen.wheel[IW_RIGHT], IW_RIGHT, now_us);
    assert_sent(&seen);
    assert_permit(&seen, now_us);
    assert_rest(&seen);
    return seen;
}

static iw_snapshot_t snapshot(void) {
    return snapshot_at(rig.now_us);
}

TEST(test_snapshot_no_field_is_missing_in_this_test) {
    size_t end = 0;
    for (size_t i = 0; i < PLACES; i++) {
        TEST_ASSERT_TRUE_MESSAGE(places[i].offset >= end, places[i].name);
        TEST_ASSERT_TRUE_MESSAGE(places[i].offset - end < sizeof(iw_time_us_t), places[i].name);
        end = places[i].offset + places[i].size;
    }
    TEST_ASSERT_TRUE(sizeof(iw_snapshot_t) - end < sizeof(iw_time_us_t));
}

TEST(test_snapshot_before_the_first_frame_has_no_telemetry) {
    const iw_snapshot_t seen = snapshot();
    for (size_t side = 0; side < IW_SIDES; side++) {
        TEST_ASSERT_EQUAL_UINT64(IW_NEVER, seen.wheel[side].speed_us);
        TEST_ASSERT_EQUAL_UINT64(IW_NEVER, seen.wheel[side].status_us);
        TEST_ASSERT_EQUAL_INT(IW_FORCE_NO_TELEMETRY, iw_snapshot_force_validity(&seen, (iw_side_t)side));
        TEST_ASSERT_FALSE(seen.wheel[side].heard || seen.wheel[side].at_rest);
    }
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, seen.state);
    TEST_ASSERT_EQUAL_INT(IW_DEMAND_SILENCE, seen.demand);
    TEST_ASSERT_EQUAL_INT(IW_BUS_DOWN, seen.bus);
    TEST_ASSERT_EQUAL_INT(IW_ASSUMPTION_ITEMS, seen.doubt);
    TEST_ASSERT_EQUAL_UINT64(IW_NEVER, seen.pose_us);
    TEST_ASSERT_EQUAL_UINT64(IW_NEVER, seen.stale_us);
    TEST_ASSERT_EQUAL_UINT64(IW_NEVER, seen.waiting_us);
    TEST_ASSERT_EQUAL_UINT64(0, seen.confirmed_us);
    TEST_ASSERT_EQUAL_UINT32(0, seen.stop->number);
    TEST_ASSERT_EQUAL_UINT32(0, seen.present);
    TEST_ASSERT_EQUAL_UINT32(IW_CLIENT_NONE, seen.holder);
    TEST_ASSERT_TRUE(seen.output_zero);
    for (size_t cause = 0; cause < IW_CAUSES; cause++) {
        TEST_ASSERT_EQUAL_UINT64(IW_NEVER, seen.seen_us[cause]);
    }
}

TEST(test_snapshot_listening_has_telemetry_and_its_time) {
    const message_t force = {IW_CODEC_FORCE, IW_RIGHT, {.force = {0, 200}}};
    const message_t pose = {IW_CODEC_POSE, IW_RIGHT, {.pose = {1, 2, 3, 4}}};
    rig.config.invert[IW_RIGHT] = true;
    gateway_rig_begin(&rig, false);
    gateway_rig_run(&rig, MS(5)); // Each wheel has sent its ticks once: counting starts there.
    rig.wheel[IW_LEFT] = (rig_wheel_t){false, true, 1, 7, rig.wheel[IW_LEFT].speed_us, rig.wheel[IW_LEFT].status_us};
    rig.wheel[IW_RIGHT] =
        (rig_wheel_t){false, true, 9, 11, rig.wheel[IW_RIGHT].speed_us, rig.wheel[IW_RIGHT].status_us};
    gateway_rig_run(&rig, MS(295));
    rig.now_us += 100U;
    put(&force);
    put(&pose);
    gateway_rig_step(&rig);
    const iw_snapshot_t seen = snapshot_at(rig.now_us + 50U);
    TEST_ASSERT_EQUAL_UINT64(50, seen.at_us - seen.pose_us);
    TEST_ASSERT_EQUAL_INT16(4, seen.wheel[IW_RIGHT].telemetry->pose.psi_mrad);
    TEST_ASSERT_EQUAL_INT32(20, seen.wheel[IW_LEFT].speed_mm_s);
    TEST_ASSERT_EQUAL_INT32(-180, seen.wheel[IW_RIGHT].speed_mm_s);
    TEST_ASSERT_EQUAL_INT64(7, seen.wheel[IW_LEFT].ticks);
    TEST_ASSERT_EQUAL_INT64(11, seen.wheel[IW_RIGHT].ticks);
    TEST_ASSERT_TRUE(seen.wheel[IW_LEFT].ticks * seen.wheel[IW_LEFT].nm_per_tick > 0 &&
                     seen.wheel[IW_RIGHT].ticks * seen.wheel[IW_RIGHT].nm_per_tick < 0);
    TEST_ASSERT_TRUE(seen.wheel[IW_LEFT].at_rest);
    TEST_ASSERT_FALSE(seen.wheel[IW_RIGHT].at_rest);
    TEST_ASSERT_EQUAL_INT(IW_FORCE_NO_TELEMETRY, iw_snapshot_force_validity(&seen, (iw_side_t)IW_LEFT));
    TEST_ASSERT_EQUAL_INT(IW_FORCE_NO_OFFSET, iw_snapshot_force_validity(&seen, (iw_side_t)IW_RIGHT));
    TEST_ASSERT_EQUAL_INT(IW_BUS_ACTIVE, seen.bus);
}

TEST(test_snapshot_heard_and_at_rest_are_judged_at_its_time) {
    gateway_rig_run(&rig, MS(199));
    const iw_time_us_t rest_us = rig.gateway.wheel[IW_LEFT].rest_since_us + MS(rig.config.rest_ms);
    TEST_ASSERT_FALSE(snapshot_at(rest_us - 1U).wheel[IW_LEFT].at_rest);
    TEST_ASSERT_TRUE(snapshot_at(rest_us).wheel[IW_LEFT].at_rest);
    const iw_time_us_t lost_us = rig.gateway.wheel[IW_LEFT].received_us + MS(rig.config.wheel_silent_ms);
    TEST_ASSERT_TRUE(snapshot_at(lost_us - 1U).wheel[IW_LEFT].heard);
    TEST_ASSERT_FALSE(snapshot_at(lost_us).wheel[IW_LEFT].heard);
}

TEST(test_snapshot_arming_has_its_client_and_start_time) {
    gateway_rig_run(&rig, MS(1100));
    rig.bus.echo_delay_us = MS(20);
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, gateway_rig_request_arm(&rig, HOLDER, false));
    const iw_time_us_t asked_us = rig.now_us;
    gateway_rig_run(&rig, MS(10));
    const iw_snapshot_t seen = snapshot();
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, seen.state);
    TEST_ASSERT_TRUE(seen.arming);
    TEST_ASSERT_TRUE(iw_gateway_is_sending(&rig.gateway));
    TEST_ASSERT_EQUAL_UINT32(HOLDER, seen.holder);
    TEST_ASSERT_EQUAL_INT(IW_DEMAND_ZERO, seen.demand);
    TEST_ASSERT_EQUAL_UINT64(asked_us, seen.waiting_us);
    TEST_ASSERT_EQUAL_UINT64(0, seen.confirmed_us);
}

TEST(test_snapshot_confirmed_is_the_older_of_both_wheels) {
    gateway_rig_run(&rig, MS(1100));
    rig.bus.echo_delay_us = MS(2);
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, gateway_rig_request_arm(&rig, HOLDER, false));
    const iw_time_us_t first_us = rig.now_us;
    gateway_rig_run(&rig, MS(2)); // The echo of the left wheel has arrived, that of the right wheel has not.
    TEST_ASSERT_EQUAL_UINT64(0, snapshot().confirmed_us);
    gateway_rig_run(&rig, FAKE_BUS_FRAME_US);
    TEST_ASSERT_EQUAL_UINT64(first_us, snapshot().confirmed_us);
    TEST_ASSERT_EQUAL_UINT64(IW_NEVER, snapshot().waiting_us);
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, snapshot().state);
}

TEST(test_snapshot_armed_shows_command_ramp_and_lease) {
    gateway_rig_arm(&rig);
    const iw_snapshot_t armed = snapshot();
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, armed.state);
    TEST_ASSERT_FALSE(armed.arming);
    TEST_ASSERT_EQUAL_UINT64(armed.armed_us + MS(1000), armed.lease_until_us);
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, gateway_rig_cruise(&rig, 300, -150, MS(200)));
    const iw_snapshot_t seen = snapshot();
    TEST_ASSERT_EQUAL_INT16(300, seen.target.wheel[IW_LEFT].speed_mm_s);
    TEST_ASSERT_EQUAL_INT16(-150, seen.target.wheel[IW_RIGHT].speed_mm_s);
    TEST_ASSERT_INT16_WITHIN(50, 140, seen.applied.wheel[IW_LEFT].speed_mm_s);
    TEST_ASSERT_INT16_WITHIN(25, -70, seen.applied.wheel[IW_RIGHT].speed_mm_s);
    TEST_ASSERT_FALSE(seen.output_zero);
    TEST_ASSERT_EQUAL_INT(IW_DEMAND_FOLLOW, seen.demand);
    TEST_ASSERT_EQUAL_UINT64(seen.stale_us + MS(rig.config.lease_ms), seen.lease_until_us);
    TEST_ASSERT_EQUAL_UINT64(MS(50), seen.at_us - seen.stale_us);
    TEST_ASSERT_EQUAL_UINT32(HOLDER, seen.stale_client);
    TEST_ASSERT_TRUE(seen.sent->pairs > 0U && seen.sent->gap_max_us >= seen.sent->gap_us);
    TEST_ASSERT_UINT32_WITHIN(1, seen.sent->pairs, seen.counters->echoes / 2U);
}

TEST(test_snapshot_braking_has_the_stop_and_the_applied_pair) {
    gateway_rig_arm(&rig);
    (void)gateway_rig_cruise(&rig, 400, 400, MS(400));
    gateway_rig_stop(&rig);
    gateway_rig_run(&rig, MS(50));
    const iw_snapshot_t seen = snapshot();
    TEST_ASSERT_EQUAL_INT(IW_STATE_STOPPING, seen.state);
    TEST_ASSERT_EQUAL_INT(IW_DEMAND_BRAKE, seen.demand);
    TEST_ASSERT_EQUAL_INT(IW_CAUSE_CLIENT_STOP, seen.stop->cause);
    TEST_ASSERT_EQUAL_UINT64(MS(50), seen.at_us - seen.stop->at_us);
    TEST_ASSERT_TRUE(seen.stop->applied.wheel[IW_LEFT].speed_mm_s > seen.applied.wheel[IW_LEFT].speed_mm_s);
    TEST_ASSERT_EQUAL_INT16(0, seen.target.wheel[IW_LEFT].speed_mm_s);
    TEST_ASSERT_FALSE(seen.output_zero);
    TEST_ASSERT_EQUAL_UINT32(IW_CLIENT_NONE, seen.holder);
}

TEST(test_snapshot_latched_has_a_cause_while_it_prevents_reset) {
    const uint32_t bit = 1U << IW_CAUSE_ESTOP_SOFTWARE;
    gateway_rig_arm(&rig);
    (void)gateway_rig_cruise(&rig, 300, 300, MS(400));
    iw_gateway_estop(&rig.gateway, rig.now_us, OTHER);
    const iw_time_us_t pressed_us = rig.now_us;
    gateway_rig_step(&rig);
    const iw_snapshot_t seen = snapshot();
    TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, seen.state);
    TEST_ASSERT_EQUAL_INT(IW_DEMAND_ZERO, seen.demand);
    TEST_ASSERT_TRUE(seen.output_zero);
    TEST_ASSERT_EQUAL_UINT32(OTHER, seen.stop->detail);
    TEST_ASSERT_EQUAL_UINT64(pressed_us, seen.seen_us[IW_CAUSE_ESTOP_SOFTWARE]);
    TEST_ASSERT_EQUAL_HEX32(bit, snapshot_at(pressed_us + MS(1000) - 1U).present);
    TEST_ASSERT_EQUAL_HEX32(0, snapshot_at(pressed_us + MS(1000)).present);
    gateway_rig_run(&rig, MS(5000));
    TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, snapshot().state);
    TEST_ASSERT_EQUAL_INT(IW_DEMAND_SILENCE, snapshot().demand);
    TEST_ASSERT_FALSE(iw_gateway_is_sending(&rig.gateway));
}

TEST(test_snapshot_after_a_reboot_has_no_status_until_a_new_one) {
    rig.wheel[IW_RIGHT].ticks = 500;
    gateway_rig_run(&rig, MS(100));
    rig.wheel[IW_RIGHT].mute = true;
    gateway_rig_run(&rig, MS(1100));
    TEST_ASSERT_FALSE(snapshot().wheel[IW_RIGHT].heard);
    rig.wheel[IW_RIGHT].mute = false;
    rig.wheel[IW_RIGHT].status_us = rig.now_us + MS(20);
    gateway_rig_run(&rig, MS(10));
    const iw_snapshot_t back = snapshot();
    TEST_ASSERT_EQUAL_UINT32(1, back.wheel[IW_RIGHT].reboots);
    TEST_ASSERT_EQUAL_UINT32(0, back.wheel[IW_LEFT].reboots);
    TEST_ASSERT_EQUAL_UINT64(IW_NEVER, back.wheel[IW_RIGHT].status_us);
    TEST_ASSERT_TRUE(back.wheel[IW_RIGHT].heard);
    TEST_ASSERT_EQUAL_HEX32(1U << IW_CAUSE_WHEEL_REBOOTED, back.present);
    gateway_rig_run(&rig, MS(11));
    TEST_ASSERT_TRUE(snapshot().at_us - snapshot().wheel[IW_RIGHT].status_us <= MS(1));
}

TEST(test_snapshot_doubt_is_the_first_blocking_contradiction) {
    const iw_assumption_entry_t wrong = {IW_CONTRADICTED, IW_SOURCE_OPERATOR, 0};
    const uint32_t changes = snapshot().assumed_changes;
    iw_gateway_set_assumption(&rig.gateway, IW_ASSUMPTION_GEAR_RATIO, &wrong);
    TEST_ASSERT_EQUAL_INT(IW_ASSUMPTION_ITEMS, snapshot().doubt);
    iw_gateway_set_assumption(&rig.gateway, IW_ASSUMPTION_MOUNT_SIGN_LEFT, &wrong);
    TEST_ASSERT_EQUAL_INT(IW_ASSUMPTION_MOUNT_SIGN_LEFT, snapshot().doubt);
    iw_gateway_set_assumption(&rig.gateway, IW_ASSUMPTION_CURRENT_ROLE, &wrong);
    TEST_ASSERT_EQUAL_INT(IW_ASSUMPTION_CURRENT_ROLE, snapshot().doubt);
    TEST_ASSERT_EQUAL_UINT32(changes + 3U, snapshot().assumed_changes);
    TEST_ASSERT_EQUAL_INT(IW_CONTRADICTED, snapshot().assumed[IW_ASSUMPTION_GEAR_RATIO].state);
}

TEST(test_snapshot_failed_arming_has_refusal_and_left_behind) {
    const iw_bus_facts_t facts = {false, true};
    iw_gateway_bus_facts(&rig.gateway, &facts);
    gateway_rig_run(&rig, MS(1100));
    rig.bus.acknowledged = false;
    rig.bus.purge_result = -1;
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, gateway_rig_request_arm(&rig, HOLDER, false));
    gateway_rig_run(&rig, MS(100));
    const iw_snapshot_t seen = snapshot();
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_SEND_STALLED, seen.arm_refusal);
    TEST_ASSERT_TRUE(seen.left_behind);
    TEST_ASSERT_TRUE(seen.echo_proven);
    TEST_ASSERT_FALSE(iw_gateway_is_sending(&rig.gateway));
}

/// Counters that ordinary runs do not change, each with a separate value.
TEST(test_snapshot_counters_of_sending_are_not_exchanged) {
    gateway_rig_arm(&rig);
    rig.gateway.sender.sent.later = 101;
    rig.gateway.sender.sent.clamped = 102;
    rig.gateway.sender.envelope.stopped = 103;
    rig.gateway.sender.confirmation.stray = 104;
    rig.gateway.permit.still_moving = 105;
    rig.gateway.diverge.path_um = -1006999;
    rig.gateway.diverge.largest_um = 1006999;
    rig.gateway.rolling.rolling = true;
    const iw_snapshot_t seen = snapshot();
    TEST_ASSERT_EQUAL_UINT32(101, seen.sent->later);
    TEST_ASSERT_EQUAL_UINT32(102, seen.sent->clamped);
    TEST_ASSERT_EQUAL_UINT32(103, seen.stopped);
    TEST_ASSERT_EQUAL_UINT32(104, seen.stray_echoes);
    TEST_ASSERT_EQUAL_UINT32(105, seen.still_moving);
    TEST_ASSERT_EQUAL_INT32(-1006, seen.pair_mm);
    TEST_ASSERT_EQUAL_INT32(1006, seen.pair_largest_mm);
    TEST_ASSERT_TRUE(seen.rolling);
    TEST_ASSERT_FALSE(seen.rolling_fault);
    rig.gateway.rolling.rolling = false;
    rig.gateway.rolling.is_fault = true;
    TEST_ASSERT_TRUE(snapshot().rolling_fault);
    TEST_ASSERT_FALSE(snapshot().rolling);
}
