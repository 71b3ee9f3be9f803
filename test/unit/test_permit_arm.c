// SPDX-License-Identifier: MIT
// Which client is armed, and which client is refused for which reason.
#include "permit_rig.h"
#include "unit.h"

static permit_rig_t rig;

void setUp(void) {
    permit_rig_init(&rig);
}

static void assert_arm_refused(iw_refusal_t expected) {
    TEST_ASSERT_EQUAL_INT(expected, permit_rig_arm(&rig, HOLDER));
    TEST_ASSERT_FALSE(iw_permit_arming(&rig.permit));
    permit_rig_assert(&rig, IW_STATE_LISTENING, IW_DEMAND_SILENCE);
    permit_rig_prove(&rig);
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, iw_permit_state(&rig.permit));
    TEST_ASSERT_EQUAL_INT(IW_CLIENT_NONE, rig.permit.holder);
}

TEST(test_permit_starts_listening_and_sends_nothing) {
    permit_rig_assert(&rig, IW_STATE_LISTENING, IW_DEMAND_SILENCE);
    TEST_ASSERT_EQUAL_INT(IW_CLIENT_NONE, rig.permit.holder);
    TEST_ASSERT_EQUAL_UINT32(0, rig.permit.stop.number);
    TEST_ASSERT_TRUE(iw_permit_next_us(&rig.permit) == IW_NEVER);
    permit_rig_wait(&rig, MS(3600000));
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, iw_permit_state(&rig.permit));
}

TEST(test_permit_arm_at_clock_zero_has_no_earlier_event) {
    rig.now_us = 0;
    iw_permit_init(&rig.permit, &rig.config, 0, false);
    permit_rig_step(&rig);
    TEST_ASSERT_EQUAL_HEX32(0, iw_permit_present(&rig.permit, 0));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, permit_rig_arm(&rig, HOLDER));
}

TEST(test_permit_arm_sends_zeros_and_is_armed_after_their_echoes) {
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, permit_rig_arm(&rig, HOLDER));
    TEST_ASSERT_TRUE(iw_permit_arming(&rig.permit));
    TEST_ASSERT_EQUAL_INT(IW_DEMAND_ZERO, iw_permit_demand(&rig.permit));
    permit_rig_wait(&rig, MS(10));
    TEST_ASSERT_TRUE(iw_permit_arming(&rig.permit));
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, iw_permit_state(&rig.permit));
    rig.view.proven = true;
    permit_rig_wait(&rig, MS(10));
    TEST_ASSERT_FALSE(iw_permit_arming(&rig.permit));
    permit_rig_assert(&rig, IW_STATE_ARMED, IW_DEMAND_FOLLOW);
    TEST_ASSERT_EQUAL_INT(HOLDER, rig.permit.holder);
}

TEST(test_permit_arm_after_a_reset_without_a_latch_is_accepted) {
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, permit_rig_reset(&rig));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, permit_rig_arm(&rig, HOLDER));
}

TEST(test_permit_arm_without_echo_in_time_is_send_stalled) {
    (void)permit_rig_arm(&rig, HOLDER);
    permit_rig_wait(&rig, MS(50) - 1U);
    TEST_ASSERT_TRUE(iw_permit_arming(&rig.permit));
    permit_rig_wait(&rig, 1);
    TEST_ASSERT_FALSE(iw_permit_arming(&rig.permit));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_SEND_STALLED, rig.permit.arm_refusal);
    permit_rig_assert(&rig, IW_STATE_LISTENING, IW_DEMAND_SILENCE);
    rig.view.proven = true;
    permit_rig_wait(&rig, 1);
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, iw_permit_state(&rig.permit));
}

TEST(test_permit_arm_must_be_echoed_within_50_ms) {
    (void)permit_rig_arm(&rig, HOLDER);
    rig.view.proven = true;
    permit_rig_wait(&rig, MS(50));
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, iw_permit_state(&rig.permit));
    setUp();
    (void)permit_rig_arm(&rig, HOLDER);
    rig.view.proven = true;
    permit_rig_wait(&rig, MS(50) + 1U);
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, iw_permit_state(&rig.permit));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_SEND_STALLED, rig.permit.arm_refusal);
}

TEST(test_permit_arm_again_after_a_failure_clears_the_old_reason) {
    (void)permit_rig_arm(&rig, HOLDER);
    permit_rig_wait(&rig, MS(60));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, permit_rig_arm(&rig, OTHER));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, rig.permit.arm_refusal);
    rig.view.proven = true;
    permit_rig_wait(&rig, MS(1));
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, iw_permit_state(&rig.permit));
    TEST_ASSERT_EQUAL_INT(OTHER, rig.permit.holder);
}

TEST(test_permit_arm_without_type_or_role_is_refused) {
    rig.config.setpoint_type_set = false;
    assert_arm_refused(IW_REFUSE_TYPE_NOT_SET);
    setUp();
    rig.config.current_role = IW_ROLE_UNSET;
    assert_arm_refused(IW_REFUSE_TYPE_NOT_SET);
    setUp();
    rig.config.current_role = IW_ROLE_SETPOINT;
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, permit_rig_arm(&rig, HOLDER));
}

TEST(test_permit_arm_without_a_track_is_refused) {
    rig.config.track_mm = 0;
    assert_arm_refused(IW_REFUSE_TRACK_NOT_SET);
    rig.config.setpoint_type_set = false; // A value that cannot be measured is refused first.
    assert_arm_refused(IW_REFUSE_TYPE_NOT_SET);
    setUp();
    rig.config.track_mm = 0;
    permit_rig_raise(&rig, IW_CAUSE_WHEEL_LOST); // A cause that may disappear on its own is refused later.
    assert_arm_refused(IW_REFUSE_TRACK_NOT_SET);
}

TEST(test_permit_arm_with_listen_only_is_refused) {
    rig.config.listen_only = true;
    assert_arm_refused(IW_REFUSE_LISTEN_ONLY);
}

TEST(test_permit_arm_is_judged_by_the_view_of_the_last_step) {
    static const struct {
        size_t flag;
        iw_refusal_t refusal;
    } cases[] = {{offsetof(iw_permit_view_t, online), IW_REFUSE_WHEEL_LOST},
                 {offsetof(iw_permit_view_t, at_rest), IW_REFUSE_NOT_AT_REST},
                 {offsetof(iw_permit_view_t, output_zero), IW_REFUSE_NOT_AT_REST},
                 {offsetof(iw_permit_view_t, timing_ok), IW_REFUSE_TIMING_MISMATCH},
                 {offsetof(iw_permit_view_t, can_send), IW_REFUSE_SEND_STALLED}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        setUp();
        *((bool *)&rig.view + cases[i].flag) = false;
        permit_rig_step(&rig);
        assert_arm_refused(cases[i].refusal);
    }
}

TEST(test_permit_arm_needs_no_settled_wheels) {
    rig.view.settled = false;
    permit_rig_step(&rig);
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, permit_rig_arm(&rig, HOLDER));
}

TEST(test_permit_arm_with_a_cause_present_is_refused) {
    static const struct {
        iw_cause_t cause;
        iw_refusal_t refusal;
    } levels[] = {{IW_CAUSE_BUS_DOWN, IW_REFUSE_BUS_DOWN},
                  {IW_CAUSE_WHEEL_LOST, IW_REFUSE_WHEEL_LOST},
                  {IW_CAUSE_SEND_STALLED, IW_REFUSE_SEND_STALLED}};
    for (size_t i = 0; i < sizeof levels / sizeof levels[0]; i++) {
        setUp();
        permit_rig_raise(&rig, levels[i].cause);
        TEST_ASSERT_EQUAL_INT(levels[i].refusal, permit_rig_arm(&rig, HOLDER));
        permit_rig_step(&rig);
        assert_arm_refused(levels[i].refusal);
        permit_rig_step(&rig);
        TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, permit_rig_arm(&rig, HOLDER));
    }
}

TEST(test_permit_arm_within_a_second_of_an_event_is_refused) {
    static const struct {
        iw_cause_t cause;
        iw_refusal_t refusal;
    } events[] = {{IW_CAUSE_SECOND_MASTER, IW_REFUSE_SECOND_MASTER},
                  {IW_CAUSE_WHEEL_REBOOTED, IW_REFUSE_CAUSE_PRESENT},
                  {IW_CAUSE_FEEDBACK_SIGN, IW_REFUSE_CAUSE_PRESENT},
                  {IW_CAUSE_OVERSPEED, IW_REFUSE_CAUSE_PRESENT},
                  {IW_CAUSE_LOOP_HUNG, IW_REFUSE_CAUSE_PRESENT}};
    for (size_t i = 0; i < sizeof events / sizeof events[0]; i++) {
        setUp();
        permit_rig_raise(&rig, events[i].cause);
        permit_rig_wait(&rig, MS(1000) - 1U);
        assert_arm_refused(events[i].refusal);
        permit_rig_wait(&rig, 1);
        TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, permit_rig_arm(&rig, HOLDER));
    }
}

TEST(test_permit_arm_while_latched_is_refused) {
    permit_rig_raise(&rig, IW_CAUSE_ESTOP_SOFTWARE);
    permit_rig_step(&rig);
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_LATCHED, permit_rig_arm(&rig, HOLDER));
    permit_rig_wait(&rig, MS(5000));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_LATCHED, permit_rig_arm(&rig, HOLDER));
    permit_rig_raise(&rig, IW_CAUSE_ESTOP_LINE);
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_ESTOP_PRESSED, permit_rig_arm(&rig, HOLDER));
    TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, iw_permit_state(&rig.permit));
    TEST_ASSERT_FALSE(iw_permit_arming(&rig.permit));
}

TEST(test_permit_arm_after_a_drive_of_any_client_is_stale_command) {
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NOT_ARMED, permit_rig_drive(&rig, OTHER, true));
    permit_rig_wait(&rig, MS(500) - 1U);
    assert_arm_refused(IW_REFUSE_STALE_COMMAND);
    TEST_ASSERT_EQUAL_INT(OTHER, rig.permit.stale_client);
    permit_rig_wait(&rig, 2);
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, permit_rig_arm(&rig, HOLDER));
}

TEST(test_permit_arm_after_a_noted_drive_is_stale_command) {
    iw_permit_note_command(&rig.permit, rig.now_us, OTHER);
    permit_rig_wait(&rig, MS(499));
    assert_arm_refused(IW_REFUSE_STALE_COMMAND);
    TEST_ASSERT_EQUAL_INT(OTHER, rig.permit.stale_client);
}

TEST(test_permit_arm_after_a_zero_drive_is_accepted) {
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NOT_ARMED, permit_rig_drive(&rig, OTHER, false));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, permit_rig_arm(&rig, HOLDER));
}

TEST(test_permit_drive_while_arming_is_refused) {
    permit_rig_begin(&rig, PERMIT_ARMING);
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NOT_ARMED, permit_rig_drive(&rig, HOLDER, true));
    TEST_ASSERT_EQUAL_INT(IW_DEMAND_ZERO, iw_permit_demand(&rig.permit));
}

TEST(test_permit_arm_while_another_client_is_arming_is_busy) {
    permit_rig_begin(&rig, PERMIT_ARMING);
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_BUSY, permit_rig_arm(&rig, OTHER));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_BUSY, permit_rig_takeover(&rig, OTHER));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, permit_rig_arm(&rig, HOLDER));
    TEST_ASSERT_EQUAL_INT(HOLDER, rig.permit.holder);
}

TEST(test_permit_arm_repeated_does_not_prolong_arming) {
    permit_rig_begin(&rig, PERMIT_ARMING);
    permit_rig_wait(&rig, MS(49));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, permit_rig_arm(&rig, HOLDER));
    permit_rig_wait(&rig, MS(1));
    TEST_ASSERT_FALSE(iw_permit_arming(&rig.permit));
}

TEST(test_permit_arming_ends_by_each_cause_that_refuses_arm) {
    static const struct {
        iw_cause_t cause;
        iw_refusal_t refusal;
    } cases[] = {{IW_CAUSE_BUS_DOWN, IW_REFUSE_BUS_DOWN},
                 {IW_CAUSE_WHEEL_LOST, IW_REFUSE_WHEEL_LOST},
                 {IW_CAUSE_SECOND_MASTER, IW_REFUSE_SECOND_MASTER},
                 {IW_CAUSE_SEND_STALLED, IW_REFUSE_SEND_STALLED},
                 {IW_CAUSE_WHEEL_REBOOTED, IW_REFUSE_CAUSE_PRESENT},
                 {IW_CAUSE_LOOP_HUNG, IW_REFUSE_CAUSE_PRESENT}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        permit_rig_begin(&rig, PERMIT_ARMING);
        rig.view.proven = true;
        permit_rig_raise(&rig, cases[i].cause);
        permit_rig_wait(&rig, MS(1));
        TEST_ASSERT_FALSE(iw_permit_arming(&rig.permit));
        TEST_ASSERT_EQUAL_INT(cases[i].refusal, rig.permit.arm_refusal);
        TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, iw_permit_state(&rig.permit));
        TEST_ASSERT_EQUAL_INT(IW_CLIENT_NONE, rig.permit.holder);
        TEST_ASSERT_EQUAL_UINT32(0, rig.permit.stop.number);
    }
}

TEST(test_permit_arming_ends_by_stop_and_disconnect_of_its_client) {
    permit_rig_begin(&rig, PERMIT_ARMING);
    iw_permit_stop(&rig.permit, rig.now_us, OTHER, IW_CAUSE_CLIENT_STOP);
    TEST_ASSERT_FALSE(iw_permit_arming(&rig.permit));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NOT_ARMED, rig.permit.arm_refusal);
    permit_rig_prove(&rig);
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, iw_permit_state(&rig.permit));

    permit_rig_begin(&rig, PERMIT_ARMING);
    iw_permit_disconnect(&rig.permit, rig.now_us, OTHER);
    TEST_ASSERT_TRUE(iw_permit_arming(&rig.permit));
    iw_permit_disconnect(&rig.permit, rig.now_us, HOLDER);
    TEST_ASSERT_FALSE(iw_permit_arming(&rig.permit));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NOT_ARMED, rig.permit.arm_refusal);
    permit_rig_prove(&rig);
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, iw_permit_state(&rig.permit));
}

TEST(test_permit_arm_in_stopping_needs_zero_and_standstill) {
    permit_rig_begin(&rig, PERMIT_STOPPING);
    permit_rig_wait(&rig, MS(600));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NOT_AT_REST, permit_rig_arm(&rig, OTHER));
    rig.view.output_zero = true;
    permit_rig_step(&rig);
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NOT_AT_REST, permit_rig_arm(&rig, OTHER));
    rig.view.at_rest = true;
    rig.view.can_send = false; // A zero of the hold is under way: arm does not wait for its echo.
    permit_rig_step(&rig);
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, permit_rig_arm(&rig, OTHER));
    rig.view.proven = true;
    permit_rig_wait(&rig, MS(3));
    permit_rig_assert(&rig, IW_STATE_ARMED, IW_DEMAND_FOLLOW);
    TEST_ASSERT_EQUAL_INT(OTHER, rig.permit.holder);
}

TEST(test_permit_arming_in_stopping_sends_only_zero) {
    permit_rig_begin(&rig, PERMIT_HOLDING);
    permit_rig_wait(&rig, MS(600));
    (void)permit_rig_arm(&rig, OTHER);
    TEST_ASSERT_TRUE(iw_permit_demand(&rig.permit) == IW_DEMAND_ZERO ||
                     iw_permit_demand(&rig.permit) == IW_DEMAND_BRAKE);
}

TEST(test_permit_arming_failed_in_stopping_continues_the_hold) {
    permit_rig_begin(&rig, PERMIT_HOLDING);
    const iw_time_us_t zero_us = rig.now_us;
    rig.view.settled = true;
    permit_rig_wait(&rig, MS(1460));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, permit_rig_arm(&rig, OTHER));
    permit_rig_wait(&rig, MS(40));
    TEST_ASSERT_EQUAL_INT(IW_STATE_STOPPING, iw_permit_state(&rig.permit)); // The hold is over, but arming is not.
    TEST_ASSERT_TRUE(iw_permit_next_us(&rig.permit) == rig.now_us + MS(10));
    permit_rig_wait(&rig, MS(10));
    TEST_ASSERT_FALSE(iw_permit_arming(&rig.permit));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_SEND_STALLED, rig.permit.arm_refusal);
    TEST_ASSERT_TRUE(rig.now_us >= zero_us + MS(1500));
    permit_rig_wait(&rig, MS(1));
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, iw_permit_state(&rig.permit));
}

TEST(test_permit_arming_in_stopping_latches_on_a_cause) {
    permit_rig_begin(&rig, PERMIT_HOLDING);
    permit_rig_wait(&rig, MS(600));
    (void)permit_rig_arm(&rig, OTHER);
    permit_rig_raise(&rig, IW_CAUSE_WHEEL_LOST);
    TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, iw_permit_state(&rig.permit));
    TEST_ASSERT_FALSE(iw_permit_arming(&rig.permit));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_WHEEL_LOST, rig.permit.arm_refusal);
}
