// SPDX-License-Identifier: MIT
// after_stop = hold: zeros after a stop or a latch end by release, arm, another master or the end of the gateway, and
// by no other event.
#include "permit_rig.h"
#include "unit.h"

static permit_rig_t rig;

#define DAY_US ((iw_time_us_t)86400U * 1000000U)

void setUp(void) {
    permit_rig_init(&rig);
    rig.config.hold = true;
}

static void assert_held_for_a_day(iw_state_t state) {
    permit_rig_wait(&rig, DAY_US);
    TEST_ASSERT_EQUAL_INT(state, iw_permit_state(&rig.permit));
    TEST_ASSERT_TRUE(iw_permit_demand(&rig.permit) != IW_DEMAND_SILENCE);
    TEST_ASSERT_TRUE(iw_permit_holding(&rig.permit));
    TEST_ASSERT_FALSE(iw_permit_ending(&rig.permit, rig.now_us));
    TEST_ASSERT_TRUE(iw_permit_next_us(&rig.permit) == IW_NEVER);
    TEST_ASSERT_EQUAL_UINT32(0, rig.permit.still_moving);
}

static void assert_silent(iw_state_t state) {
    permit_rig_assert(&rig, state, IW_DEMAND_SILENCE);
    TEST_ASSERT_FALSE(iw_permit_holding(&rig.permit));
}

static void calm(void) {
    rig.view.at_rest = true;
    rig.view.settled = true;
    rig.view.output_zero = true;
}

/// After a stop, with the wheels at standstill for this time.
static void hold_for(iw_time_us_t for_us) {
    permit_rig_begin(&rig, PERMIT_HOLDING);
    calm();
    permit_rig_wait(&rig, for_us);
}

static void release(void) {
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, iw_permit_release(&rig.permit));
    permit_rig_step(&rig);
}

TEST(test_permit_keep_zeros_never_end_at_standstill_or_in_motion) {
    permit_rig_begin(&rig, PERMIT_HOLDING);
    TEST_ASSERT_TRUE(iw_permit_holding(&rig.permit));
    assert_held_for_a_day(IW_STATE_STOPPING);
    calm();
    assert_held_for_a_day(IW_STATE_STOPPING);
}

TEST(test_permit_keep_latched_zeros_have_no_end) {
    permit_rig_begin(&rig, PERMIT_LATCHED);
    assert_held_for_a_day(IW_STATE_LATCHED);
}

TEST(test_permit_keep_begins_when_the_ramp_has_ended) {
    permit_rig_begin(&rig, PERMIT_STOPPING);
    TEST_ASSERT_FALSE(iw_permit_holding(&rig.permit));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NOT_AT_REST, iw_permit_release(&rig.permit));
    rig.view.output_zero = true;
    permit_rig_step(&rig);
    TEST_ASSERT_TRUE(iw_permit_holding(&rig.permit));
}

TEST(test_permit_keep_is_off_unless_configured) {
    rig.config.hold = false;
    permit_rig_begin(&rig, PERMIT_HOLDING);
    TEST_ASSERT_FALSE(iw_permit_holding(&rig.permit));
    permit_rig_begin(&rig, PERMIT_LATCHED);
    TEST_ASSERT_FALSE(iw_permit_holding(&rig.permit));
}

TEST(test_permit_keep_ends_by_release) {
    permit_rig_begin(&rig, PERMIT_HOLDING);
    calm();
    assert_held_for_a_day(IW_STATE_STOPPING);
    release();
    assert_silent(IW_STATE_LISTENING);
    permit_rig_begin(&rig, PERMIT_LATCHED);
    calm();
    assert_held_for_a_day(IW_STATE_LATCHED);
    release();
    assert_silent(IW_STATE_LATCHED);
}

/// The same times as without after_stop = hold: the watchdog second of the wheels must be over, and they must be at
/// standstill.
TEST(test_permit_keep_released_early_ends_at_the_normal_time) {
    permit_rig_begin(&rig, PERMIT_HOLDING);
    calm();
    release();
    TEST_ASSERT_FALSE(iw_permit_holding(&rig.permit));
    permit_rig_wait(&rig, MS(1500) - 1U);
    TEST_ASSERT_EQUAL_INT(IW_DEMAND_BRAKE, iw_permit_demand(&rig.permit));
    permit_rig_wait(&rig, 1);
    assert_silent(IW_STATE_LISTENING);
    permit_rig_begin(&rig, PERMIT_HOLDING);
    release();
    permit_rig_wait(&rig, MS(59999));
    TEST_ASSERT_EQUAL_INT(IW_STATE_STOPPING, iw_permit_state(&rig.permit));
    permit_rig_wait(&rig, MS(1));
    assert_silent(IW_STATE_LISTENING);
    TEST_ASSERT_EQUAL_UINT32(1, rig.permit.still_moving);
}

TEST(test_permit_keep_released_late_waits_60_s_for_moving_wheels) {
    permit_rig_begin(&rig, PERMIT_HOLDING);
    permit_rig_wait(&rig, MS(120000));
    release();
    permit_rig_wait(&rig, MS(54999));
    TEST_ASSERT_FALSE(iw_permit_ending(&rig.permit, rig.now_us));
    permit_rig_wait(&rig, MS(1));
    TEST_ASSERT_TRUE(iw_permit_ending(&rig.permit, rig.now_us));
    permit_rig_wait(&rig, MS(4999));
    TEST_ASSERT_EQUAL_INT(IW_STATE_STOPPING, iw_permit_state(&rig.permit));
    permit_rig_wait(&rig, MS(1));
    assert_silent(IW_STATE_LISTENING);
    TEST_ASSERT_EQUAL_UINT32(1, rig.permit.still_moving);
}

TEST(test_permit_keep_release_while_driving_or_arming_is_refused) {
    static const permit_situation_t refused[] = {PERMIT_ARMING, PERMIT_ARMED, PERMIT_STOPPING};
    for (size_t i = 0; i < sizeof refused / sizeof refused[0]; i++) {
        permit_rig_begin(&rig, refused[i]);
        TEST_ASSERT_EQUAL_INT(IW_REFUSE_NOT_AT_REST, iw_permit_release(&rig.permit));
        permit_rig_raise(&rig, IW_CAUSE_ESTOP_LINE);
        assert_held_for_a_day(IW_STATE_LATCHED);
    }
    hold_for(MS(600));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, permit_rig_arm(&rig, HOLDER));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NOT_AT_REST, iw_permit_release(&rig.permit));
}

/// R19: also in a latch. A release that was sent during the ramp would end the zeros of a machine on a slope.
TEST(test_permit_keep_release_in_the_ramp_of_a_latch_is_refused) {
    permit_rig_begin(&rig, PERMIT_ARMED);
    const iw_event_t event = {IW_CAUSE_WHEEL_LOST, IW_SIDES_LEFT, 0, IW_REACT_RAMP};
    rig.permit.view.output_zero = false;
    iw_permit_raise(&rig.permit, &event, rig.now_us);
    TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, iw_permit_state(&rig.permit));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NOT_AT_REST, iw_permit_release(&rig.permit));
    TEST_ASSERT_TRUE(rig.permit.until_release);
    rig.permit.view.output_zero = true;
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, iw_permit_release(&rig.permit));
    TEST_ASSERT_FALSE(rig.permit.until_release);
}

TEST(test_permit_keep_release_without_setpoints_changes_nothing) {
    release();
    assert_silent(IW_STATE_LISTENING);
    permit_rig_raise(&rig, IW_CAUSE_ESTOP_LINE);
    permit_rig_step(&rig);
    assert_silent(IW_STATE_LATCHED);
    release();
    assert_silent(IW_STATE_LATCHED);
}

TEST(test_permit_keep_latch_while_listening_sends_nothing) {
    hold_for(MS(2000));
    release();
    permit_rig_raise(&rig, IW_CAUSE_ESTOP_LINE);
    permit_rig_step(&rig);
    assert_silent(IW_STATE_LATCHED);
}

TEST(test_permit_keep_reset_ends_the_latch_and_not_the_hold) {
    permit_rig_begin(&rig, PERMIT_LATCHED);
    calm();
    permit_rig_wait(&rig, MS(5000));
    permit_rig_wait(&rig, MS(5000));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, permit_rig_reset(&rig));
    TEST_ASSERT_EQUAL_INT(IW_STATE_STOPPING, iw_permit_state(&rig.permit));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, permit_rig_reset(&rig));
    assert_held_for_a_day(IW_STATE_STOPPING);
    release();
    assert_silent(IW_STATE_LISTENING);
}

/// The client that released the zeros of a stop did not know of a button that was pressed later.
TEST(test_permit_keep_latch_after_release_is_held_again) {
    permit_rig_begin(&rig, PERMIT_HOLDING);
    calm();
    release();
    TEST_ASSERT_FALSE(iw_permit_holding(&rig.permit));
    permit_rig_raise(&rig, IW_CAUSE_ESTOP_LINE);
    permit_rig_step(&rig);
    assert_held_for_a_day(IW_STATE_LATCHED);
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, permit_rig_reset(&rig));
    assert_held_for_a_day(IW_STATE_STOPPING);
    release();
    assert_silent(IW_STATE_LISTENING);
}

TEST(test_permit_keep_latch_is_not_held_unless_configured) {
    rig.config.hold = false;
    permit_rig_begin(&rig, PERMIT_HOLDING);
    release();
    permit_rig_raise(&rig, IW_CAUSE_ESTOP_LINE);
    permit_rig_step(&rig);
    TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, iw_permit_state(&rig.permit));
    TEST_ASSERT_FALSE(iw_permit_holding(&rig.permit));
}

TEST(test_permit_keep_is_not_ended_by_any_other_request) {
    hold_for(MS(5000));
    iw_permit_stop(&rig.permit, rig.now_us, OTHER, IW_CAUSE_CLIENT_STOP);
    iw_permit_disconnect(&rig.permit, rig.now_us, HOLDER);
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, permit_rig_reset(&rig));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NOT_ARMED, permit_rig_drive(&rig, HOLDER, true));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_STALE_COMMAND, permit_rig_arm(&rig, HOLDER));
    assert_held_for_a_day(IW_STATE_STOPPING);
}

TEST(test_permit_keep_ends_by_arm_and_returns_if_arming_fails) {
    hold_for(MS(5000));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, permit_rig_arm(&rig, HOLDER));
    TEST_ASSERT_FALSE(iw_permit_holding(&rig.permit));
    permit_rig_wait(&rig, MS(50));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_SEND_STALLED, rig.permit.arm_refusal);
    assert_held_for_a_day(IW_STATE_STOPPING);
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, permit_rig_arm(&rig, HOLDER));
    permit_rig_prove(&rig);
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, iw_permit_state(&rig.permit));
    TEST_ASSERT_FALSE(iw_permit_holding(&rig.permit));
}

TEST(test_permit_keep_ends_with_the_gateway) {
    permit_rig_begin(&rig, PERMIT_ARMED);
    iw_permit_stop(&rig.permit, rig.now_us, IW_CLIENT_NONE, IW_CAUSE_SHUTDOWN);
    calm();
    permit_rig_step(&rig);
    permit_rig_raise(&rig, IW_CAUSE_ESTOP_LINE);
    permit_rig_wait(&rig, MS(1500));
    assert_silent(IW_STATE_LATCHED);
    hold_for(MS(5000));
    iw_permit_stop(&rig.permit, rig.now_us, IW_CLIENT_NONE, IW_CAUSE_SHUTDOWN);
    permit_rig_step(&rig);
    assert_silent(IW_STATE_LISTENING);
}

/// The gateway did not end after all.
TEST(test_permit_keep_returns_with_arm_after_a_shutdown) {
    permit_rig_begin(&rig, PERMIT_HOLDING);
    calm();
    iw_permit_stop(&rig.permit, rig.now_us, IW_CLIENT_NONE, IW_CAUSE_SHUTDOWN);
    permit_rig_wait(&rig, MS(1500));
    assert_silent(IW_STATE_LISTENING);
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, permit_rig_arm(&rig, HOLDER));
    permit_rig_raise(&rig, IW_CAUSE_ESTOP_LINE);
    permit_rig_step(&rig);
    assert_held_for_a_day(IW_STATE_LATCHED);
}

TEST(test_permit_keep_ends_by_a_second_master) {
    hold_for(MS(5000));
    permit_rig_raise(&rig, IW_CAUSE_SECOND_MASTER);
    TEST_ASSERT_FALSE(iw_permit_holding(&rig.permit));
    permit_rig_wait(&rig, MS(1500) - 1U);
    TEST_ASSERT_EQUAL_INT(IW_DEMAND_ZERO, iw_permit_demand(&rig.permit));
    permit_rig_wait(&rig, 1);
    assert_silent(IW_STATE_LATCHED);
    permit_rig_begin(&rig, PERMIT_LATCHED);
    calm();
    permit_rig_wait(&rig, MS(5000));
    permit_rig_raise(&rig, IW_CAUSE_SECOND_MASTER);
    permit_rig_step(&rig);
    assert_silent(IW_STATE_LATCHED);
}

TEST(test_permit_keep_continues_through_every_other_fault) {
    static const iw_cause_t causes[] = {IW_CAUSE_ESTOP_LINE,     IW_CAUSE_BUS_DOWN,   IW_CAUSE_SEND_STALLED,
                                        IW_CAUSE_WHEEL_REBOOTED, IW_CAUSE_WHEEL_LOST, IW_CAUSE_OVERSPEED};
    for (size_t i = 0; i < sizeof causes / sizeof causes[0]; i++) {
        permit_rig_begin(&rig, PERMIT_HOLDING);
        rig.view.online = false;
        permit_rig_raise(&rig, causes[i]);
        permit_rig_step(&rig);
        assert_held_for_a_day(IW_STATE_LATCHED);
    }
}

static void begin_restarted(void) {
    rig.view.proven = false;
    calm();
    iw_permit_init(&rig.permit, &rig.config, rig.now_us, true);
    permit_rig_step(&rig);
}

static void receive_strangers(unsigned frames) {
    for (unsigned i = 0; i < frames; i++) {
        permit_rig_raise(&rig, IW_CAUSE_SECOND_MASTER);
    }
}

TEST(test_permit_keep_is_resumed_by_a_restart) {
    begin_restarted();
    TEST_ASSERT_FALSE(iw_permit_holding(&rig.permit));
    receive_strangers(4); // Frames that the dead process had left in its controller.
    permit_rig_wait(&rig, MS(1500));
    assert_held_for_a_day(IW_STATE_STOPPING);
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, permit_rig_arm(&rig, HOLDER));
}

TEST(test_permit_keep_resumed_ends_by_a_second_master) {
    begin_restarted();
    receive_strangers(5);
    assert_silent(IW_STATE_LISTENING);
    begin_restarted();
    permit_rig_wait(&rig, MS(1500));
    permit_rig_wait(&rig, MS(1500));
    permit_rig_raise(&rig, IW_CAUSE_SECOND_MASTER);
    permit_rig_wait(&rig, MS(1500));
    assert_silent(IW_STATE_LATCHED);
}

TEST(test_permit_keep_resumed_can_be_released_immediately) {
    begin_restarted();
    release();
    TEST_ASSERT_EQUAL_INT(IW_DEMAND_ZERO, iw_permit_demand(&rig.permit));
    permit_rig_wait(&rig, MS(1500));
    assert_silent(IW_STATE_LISTENING);
}

TEST(test_permit_keep_latched_by_one_wheel_offline_ramps_first) {
    permit_rig_begin(&rig, PERMIT_ARMED);
    const iw_event_t lost = {IW_CAUSE_WHEEL_LOST, IW_SIDES_LEFT, 50, IW_REACT_RAMP};
    iw_permit_raise(&rig.permit, &lost, rig.now_us);
    permit_rig_step(&rig);
    TEST_ASSERT_EQUAL_INT(IW_DEMAND_BRAKE, iw_permit_demand(&rig.permit));
    rig.view.output_zero = true;
    assert_held_for_a_day(IW_STATE_LATCHED);
}
