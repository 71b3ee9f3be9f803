// SPDX-License-Identifier: MIT
// The lease: which requests extend it, when it ends, and which client can acquire it by takeover.
#include "permit_rig.h"
#include "unit.h"

static permit_rig_t rig;

void setUp(void) {
    permit_rig_init(&rig);
}

/// Armed just now, at standstill, no drive command yet.
static void arm(void) {
    permit_rig_begin(&rig, PERMIT_LISTENING);
    (void)permit_rig_arm(&rig, HOLDER);
    permit_rig_prove(&rig);
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, iw_permit_state(&rig.permit));
}

static void assert_lost_after(iw_time_us_t for_us, iw_cause_t cause) {
    permit_rig_wait(&rig, for_us - 1U);
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, iw_permit_state(&rig.permit));
    permit_rig_wait(&rig, 1);
    TEST_ASSERT_EQUAL_INT(IW_STATE_STOPPING, iw_permit_state(&rig.permit));
    TEST_ASSERT_EQUAL_INT(cause, rig.permit.stop.cause);
    TEST_ASSERT_FALSE(rig.permit.stop.latched);
}

TEST(test_permit_lease_after_arm_lasts_a_second) {
    arm();
    assert_lost_after(MS(1000), IW_CAUSE_LEASE_LOST);
    TEST_ASSERT_EQUAL_INT(IW_DEMAND_BRAKE, iw_permit_demand(&rig.permit));
    TEST_ASSERT_EQUAL_UINT32(1000, rig.permit.stop.detail);
    TEST_ASSERT_EQUAL_INT(HOLDER, rig.permit.stop.client);
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, rig.permit.stop.from);
    TEST_ASSERT_EQUAL_UINT32(1, rig.permit.stop.number);
    TEST_ASSERT_EQUAL_UINT8(IW_SIDES_NONE, rig.permit.stop.sides);
    TEST_ASSERT_TRUE(rig.permit.stop.at_us == rig.now_us);
    TEST_ASSERT_EQUAL_INT(IW_CLIENT_NONE, rig.permit.holder);
}

TEST(test_permit_lease_lost_in_a_long_stall_saturates_its_detail) {
    arm();
    permit_rig_wait(&rig, MS(4294967) + 295U);
    TEST_ASSERT_EQUAL_INT(IW_CAUSE_LEASE_LOST, rig.permit.stop.cause);
    TEST_ASSERT_EQUAL_UINT32(4294967, rig.permit.stop.detail);
    arm();
    permit_rig_wait(&rig, MS(3600000) * 24U);
    TEST_ASSERT_EQUAL_UINT32(4294967, rig.permit.stop.detail);
}

TEST(test_permit_lease_is_shortened_by_the_first_drive) {
    arm();
    permit_rig_wait(&rig, MS(10));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, permit_rig_drive(&rig, HOLDER, true));
    assert_lost_after(MS(200), IW_CAUSE_LEASE_LOST);
}

TEST(test_permit_lease_follows_the_configuration) {
    static const uint16_t leases_ms[] = {20, 100, 500};
    for (size_t i = 0; i < 3; i++) {
        rig.config.lease_ms = leases_ms[i];
        arm();
        (void)permit_rig_drive(&rig, HOLDER, true);
        assert_lost_after(MS(leases_ms[i]), IW_CAUSE_LEASE_LOST);
        TEST_ASSERT_EQUAL_UINT32(leases_ms[i], rig.permit.stop.detail);
    }
}

TEST(test_permit_lease_is_extended_by_each_accepted_drive) {
    arm();
    for (uint32_t n = 0; n < 100; n++) {
        TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, permit_rig_drive(&rig, HOLDER, (n & 1U) != 0U));
        permit_rig_wait(&rig, MS(200) - 1U);
        TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, iw_permit_state(&rig.permit));
    }
    permit_rig_wait(&rig, 1);
    TEST_ASSERT_EQUAL_INT(IW_STATE_STOPPING, iw_permit_state(&rig.permit));
}

TEST(test_permit_lease_is_extended_by_no_other_request) {
    arm();
    (void)permit_rig_drive(&rig, HOLDER, true);
    permit_rig_wait(&rig, MS(150));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, permit_rig_arm(&rig, HOLDER));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, permit_rig_takeover(&rig, HOLDER));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NOT_HOLDER, permit_rig_drive(&rig, OTHER, true));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, permit_rig_reset(&rig));
    iw_permit_note_command(&rig.permit, rig.now_us, HOLDER);
    iw_permit_disconnect(&rig.permit, rig.now_us, OTHER);
    (void)permit_rig_arm(&rig, OTHER);
    (void)permit_rig_takeover(&rig, OTHER);
    assert_lost_after(MS(50), IW_CAUSE_LEASE_LOST);
}

TEST(test_permit_drive_at_or_after_the_lease_end_is_refused) {
    static const uint32_t late_us[] = {0, 1, 1000, 1000000};
    for (size_t i = 0; i < 4; i++) {
        arm();
        (void)permit_rig_drive(&rig, HOLDER, true);
        rig.now_us += MS(200) + late_us[i];
        TEST_ASSERT_EQUAL_INT(IW_REFUSE_NOT_ARMED, permit_rig_drive(&rig, HOLDER, true));
        permit_rig_step(&rig);
        TEST_ASSERT_EQUAL_INT(IW_STATE_STOPPING, iw_permit_state(&rig.permit));
        TEST_ASSERT_EQUAL_INT(IW_REFUSE_NOT_ARMED, permit_rig_drive(&rig, HOLDER, true));
        permit_rig_step(&rig);
        TEST_ASSERT_EQUAL_INT(IW_STATE_STOPPING, iw_permit_state(&rig.permit));
    }
}

TEST(test_permit_drive_just_before_the_lease_end_extends_it) {
    arm();
    (void)permit_rig_drive(&rig, HOLDER, true);
    rig.now_us += MS(200) - 1U;
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, permit_rig_drive(&rig, HOLDER, true));
    permit_rig_wait(&rig, MS(100));
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, iw_permit_state(&rig.permit));
}

TEST(test_permit_drive_is_refused_in_every_state_but_armed) {
    static const struct {
        permit_situation_t situation;
        iw_refusal_t refusal;
    } cases[] = {{PERMIT_LISTENING, IW_REFUSE_NOT_ARMED}, {PERMIT_ARMING, IW_REFUSE_NOT_ARMED},
                 {PERMIT_ARMED, IW_REFUSE_NONE},          {PERMIT_STOPPING, IW_REFUSE_NOT_ARMED},
                 {PERMIT_HOLDING, IW_REFUSE_NOT_ARMED},   {PERMIT_LATCHED, IW_REFUSE_LATCHED}};
    for (size_t i = 0; i < PERMIT_SITUATIONS; i++) {
        permit_rig_begin(&rig, cases[i].situation);
        const iw_demand_t before = iw_permit_demand(&rig.permit);
        TEST_ASSERT_EQUAL_INT(cases[i].refusal, permit_rig_drive(&rig, HOLDER, true));
        TEST_ASSERT_EQUAL_INT(before, iw_permit_demand(&rig.permit));
        TEST_ASSERT_EQUAL_INT(HOLDER, rig.permit.stale_client);
    }
}

TEST(test_permit_drive_refusals_name_the_cause) {
    rig.config.listen_only = true;
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_LISTEN_ONLY, permit_rig_drive(&rig, HOLDER, true));
    setUp();
    permit_rig_begin(&rig, PERMIT_LATCHED);
    permit_rig_raise(&rig, IW_CAUSE_ESTOP_LINE);
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_ESTOP_PRESSED, permit_rig_drive(&rig, HOLDER, true));
    permit_rig_begin(&rig, PERMIT_ARMED);
    permit_rig_raise(&rig, IW_CAUSE_WHEEL_BLOCKED);
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_WHEEL_BLOCKED, permit_rig_drive(&rig, HOLDER, true));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NOT_ARMED, permit_rig_drive(&rig, OTHER, true));
}

TEST(test_permit_refused_drive_changes_only_the_stale_command) {
    permit_rig_begin(&rig, PERMIT_ARMED);
    iw_permit_t before = rig.permit;
    (void)permit_rig_drive(&rig, OTHER, false);
    TEST_ASSERT_EQUAL_MEMORY(&before, &rig.permit, sizeof before);
    (void)permit_rig_drive(&rig, OTHER, true);
    before.stale_us = rig.permit.stale_us;
    before.stale_client = OTHER;
    TEST_ASSERT_EQUAL_MEMORY(&before, &rig.permit, sizeof before);
}

TEST(test_permit_arm_of_another_client_is_busy) {
    arm();
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_BUSY, permit_rig_arm(&rig, OTHER));
    TEST_ASSERT_EQUAL_INT(HOLDER, rig.permit.holder);
}

TEST(test_permit_takeover_at_standstill_moves_the_lease) {
    arm();
    (void)permit_rig_drive(&rig, HOLDER, false);
    permit_rig_wait(&rig, MS(100));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, permit_rig_takeover(&rig, OTHER));
    TEST_ASSERT_EQUAL_INT(OTHER, rig.permit.holder);
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, iw_permit_state(&rig.permit));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NOT_HOLDER, permit_rig_drive(&rig, HOLDER, true));
    assert_lost_after(MS(1000), IW_CAUSE_LEASE_LOST);
    TEST_ASSERT_EQUAL_INT(OTHER, rig.permit.stop.client);
}

TEST(test_permit_takeover_makes_only_later_commands_fresh) {
    arm();
    permit_rig_wait(&rig, MS(100));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, permit_rig_takeover(&rig, OTHER));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_STALE_COMMAND, iw_permit_drive(&rig.permit, rig.now_us - 1U, OTHER, true));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, iw_permit_drive(&rig.permit, rig.now_us, OTHER, true));
}

TEST(test_permit_takeover_while_armed_does_not_wait_for_an_echo) {
    arm();
    rig.view.can_send = false; // A pair of this gateway is under way, as in every other step.
    permit_rig_step(&rig);
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, permit_rig_takeover(&rig, OTHER));
}

TEST(test_permit_takeover_in_motion_is_refused) {
    arm();
    rig.view.at_rest = false;
    permit_rig_step(&rig);
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NOT_AT_REST, permit_rig_takeover(&rig, OTHER));
    rig.view.at_rest = true;
    rig.view.output_zero = false;
    permit_rig_step(&rig);
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NOT_AT_REST, permit_rig_takeover(&rig, OTHER));
    TEST_ASSERT_EQUAL_INT(HOLDER, rig.permit.holder);
}

TEST(test_permit_takeover_after_a_drive_of_the_holder_is_stale) {
    arm();
    (void)permit_rig_drive(&rig, HOLDER, true);
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_STALE_COMMAND, permit_rig_takeover(&rig, OTHER));
    TEST_ASSERT_EQUAL_INT(HOLDER, rig.permit.holder);
}

TEST(test_permit_takeover_without_a_holder_is_an_ordinary_arm) {
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, permit_rig_takeover(&rig, OTHER));
    TEST_ASSERT_TRUE(iw_permit_arming(&rig.permit));
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, iw_permit_state(&rig.permit));
}

TEST(test_permit_takeover_after_the_lease_end_ends_the_lease) {
    arm();
    (void)permit_rig_drive(&rig, HOLDER, false);
    rig.now_us += MS(200);
    (void)permit_rig_takeover(&rig, OTHER);
    permit_rig_step(&rig);
    TEST_ASSERT_TRUE(rig.permit.holder != HOLDER);
}

TEST(test_permit_disconnect_of_the_holder_ends_the_lease) {
    arm();
    (void)permit_rig_drive(&rig, HOLDER, true);
    iw_permit_disconnect(&rig.permit, rig.now_us, HOLDER);
    permit_rig_assert(&rig, IW_STATE_STOPPING, IW_DEMAND_BRAKE);
    TEST_ASSERT_EQUAL_INT(IW_CAUSE_CLIENT_GONE, rig.permit.stop.cause);
    TEST_ASSERT_EQUAL_UINT32(0, rig.permit.stop.detail);
    TEST_ASSERT_EQUAL_UINT8(IW_SIDES_NONE, rig.permit.stop.sides);
    TEST_ASSERT_EQUAL_INT(HOLDER, rig.permit.stop.client);
    TEST_ASSERT_EQUAL_INT(IW_CLIENT_NONE, rig.permit.holder);
}

TEST(test_permit_drive_after_a_client_stop_is_not_armed) {
    for (iw_client_t client = 1; client < 9U; client++) {
        permit_rig_begin(&rig, PERMIT_STOPPING);
        TEST_ASSERT_EQUAL_INT(IW_REFUSE_NOT_ARMED, permit_rig_drive(&rig, client, true));
    }
}

TEST(test_permit_disconnect_of_another_client_changes_nothing) {
    for (int situation = 0; situation < PERMIT_SITUATIONS; situation++) {
        permit_rig_begin(&rig, (permit_situation_t)situation);
        const iw_permit_t before = rig.permit;
        iw_permit_disconnect(&rig.permit, rig.now_us, OTHER);
        TEST_ASSERT_EQUAL_MEMORY(&before, &rig.permit, sizeof before);
    }
}

TEST(test_permit_latch_survives_disconnect_of_every_client) {
    static const iw_time_us_t after_us[] = {0, MS(1), MS(1000), MS(1600), MS(12000), MS(62000)};
    const iw_event_t estop = {IW_CAUSE_ESTOP_SOFTWARE, IW_SIDES_NONE, (uint32_t)OTHER, IW_REACT_BY_CAUSE};
    for (size_t i = 0; i < sizeof after_us / sizeof after_us[0]; i++) {
        permit_rig_begin(&rig, ((i & 1U) == 0U) ? PERMIT_ARMED : PERMIT_LISTENING);
        iw_permit_raise(&rig.permit, &estop, rig.now_us);
        permit_rig_wait(&rig, after_us[i]);
        for (unsigned client = 0; client < 12U; client++) {
            iw_permit_disconnect(&rig.permit, rig.now_us, (iw_client_t)client);
        }
        permit_rig_wait(&rig, MS(20));
        TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, iw_permit_state(&rig.permit));
    }
}

TEST(test_permit_disconnect_of_the_former_holder_changes_nothing) {
    static const permit_situation_t after[] = {PERMIT_STOPPING, PERMIT_HOLDING, PERMIT_LATCHED};
    for (size_t i = 0; i < 3; i++) {
        permit_rig_begin(&rig, after[i]);
        const iw_permit_t before = rig.permit;
        iw_permit_disconnect(&rig.permit, rig.now_us, HOLDER);
        TEST_ASSERT_EQUAL_MEMORY(&before, &rig.permit, sizeof before);
    }
    arm();
    (void)permit_rig_takeover(&rig, OTHER);
    iw_permit_disconnect(&rig.permit, rig.now_us, HOLDER);
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, iw_permit_state(&rig.permit));
}

TEST(test_permit_stop_needs_no_lease_and_ramps) {
    static const iw_cause_t causes[] = {IW_CAUSE_CLIENT_STOP, IW_CAUSE_SHUTDOWN};
    for (size_t i = 0; i < 2; i++) {
        permit_rig_begin(&rig, PERMIT_ARMED);
        rig.view.applied.wheel[IW_LEFT].speed_mm_s = 123;
        permit_rig_step(&rig);
        iw_permit_stop(&rig.permit, rig.now_us, OTHER, causes[i]);
        permit_rig_assert(&rig, IW_STATE_STOPPING, IW_DEMAND_BRAKE);
        TEST_ASSERT_EQUAL_INT(causes[i], rig.permit.stop.cause);
        TEST_ASSERT_EQUAL_UINT32(0, rig.permit.stop.detail);
        TEST_ASSERT_EQUAL_UINT8(IW_SIDES_NONE, rig.permit.stop.sides);
        TEST_ASSERT_EQUAL_INT(OTHER, rig.permit.stop.client);
        TEST_ASSERT_EQUAL_INT(123, rig.permit.stop.applied.wheel[IW_LEFT].speed_mm_s);
    }
}

TEST(test_permit_stop_while_not_sending_changes_nothing) {
    static const permit_situation_t situations[] = {PERMIT_LISTENING, PERMIT_STOPPING, PERMIT_HOLDING, PERMIT_LATCHED};
    for (size_t i = 0; i < 4; i++) {
        permit_rig_begin(&rig, situations[i]);
        const iw_permit_t before = rig.permit;
        iw_permit_stop(&rig.permit, rig.now_us, HOLDER, IW_CAUSE_CLIENT_STOP);
        TEST_ASSERT_EQUAL_MEMORY(&before, &rig.permit, sizeof before);
    }
}

TEST(test_permit_arm_after_a_stop_needs_500_ms_without_a_drive) {
    permit_rig_begin(&rig, PERMIT_HOLDING);
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_STALE_COMMAND, permit_rig_arm(&rig, HOLDER));
    permit_rig_wait(&rig, MS(500));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, permit_rig_arm(&rig, HOLDER));
}
