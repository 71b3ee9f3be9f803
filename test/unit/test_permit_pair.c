// SPDX-License-Identifier: MIT
// Reactions of the permission to a diverging pair and to one wheel offline: a ramp or an immediate zero, a latch at the
// third time, a refusal with its own name.
#include "permit_rig.h"

#include "unit.h"

static permit_rig_t rig;

void setUp(void) {
    permit_rig_init(&rig);
}

static void raise(iw_cause_t cause, uint8_t sides, iw_react_t react) {
    const iw_event_t event = {cause, sides, 61, (uint8_t)react};
    iw_permit_raise(&rig.permit, &event, rig.now_us);
}

static iw_demand_t demand(void) {
    return iw_permit_demand(&rig.permit);
}

/// Arms again from STOPPING, with everything at standstill and after the time of the zeros.
static void arm_again(void) {
    rig.view.output_zero = true;
    rig.view.at_rest = true;
    permit_rig_step(&rig);
    permit_rig_wait(&rig, MS(1500));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, permit_rig_arm(&rig, HOLDER));
    permit_rig_prove(&rig);
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, iw_permit_state(&rig.permit));
    rig.view.output_zero = false;
}

TEST(test_permit_diverging_pair_stops_without_a_latch) {
    permit_rig_begin(&rig, PERMIT_ARMED);
    raise(IW_CAUSE_PAIR_DIVERGES, IW_SIDES_LEFT, IW_REACT_RAMP);
    permit_rig_assert(&rig, IW_STATE_STOPPING, IW_DEMAND_BRAKE);
    TEST_ASSERT_FALSE(rig.permit.stop.at_once);
    TEST_ASSERT_FALSE(rig.permit.stop.latched);
    TEST_ASSERT_EQUAL_UINT32(61, rig.permit.stop.detail);
    permit_rig_begin(&rig, PERMIT_ARMED);
    raise(IW_CAUSE_PAIR_DIVERGES, IW_SIDES_LEFT, IW_REACT_ZERO);
    permit_rig_assert(&rig, IW_STATE_STOPPING, IW_DEMAND_ZERO);
    TEST_ASSERT_TRUE(rig.permit.stop.at_once);
}

TEST(test_permit_diverging_pair_in_a_stop_changes_only_the_ramp) {
    permit_rig_begin(&rig, PERMIT_STOPPING);
    const iw_stop_t before = rig.permit.stop;
    raise(IW_CAUSE_PAIR_DIVERGES, IW_SIDES_RIGHT, IW_REACT_RAMP);
    TEST_ASSERT_EQUAL_INT(IW_DEMAND_BRAKE, demand());
    raise(IW_CAUSE_PAIR_DIVERGES, IW_SIDES_RIGHT, IW_REACT_ZERO);
    TEST_ASSERT_EQUAL_INT(IW_DEMAND_ZERO, demand());
    TEST_ASSERT_EQUAL_INT(before.cause, rig.permit.stop.cause);
    TEST_ASSERT_EQUAL_UINT32(before.number, rig.permit.stop.number);
    raise(IW_CAUSE_PAIR_DIVERGES, IW_SIDES_RIGHT, IW_REACT_RAMP);
    TEST_ASSERT_EQUAL_INT(IW_DEMAND_ZERO, demand());
}

TEST(test_permit_diverging_pair_refuses_its_client_until_hold_end) {
    permit_rig_begin(&rig, PERMIT_ARMED);
    raise(IW_CAUSE_PAIR_DIVERGES, IW_SIDES_LEFT, IW_REACT_RAMP);
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_PAIR_DIVERGES, permit_rig_drive(&rig, HOLDER, false));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NOT_ARMED, permit_rig_drive(&rig, OTHER, false));
    rig.view.output_zero = true;
    rig.view.settled = true;
    permit_rig_step(&rig);
    permit_rig_wait(&rig, MS(2000));
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, iw_permit_state(&rig.permit));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NOT_ARMED, permit_rig_drive(&rig, HOLDER, false));
}

TEST(test_permit_third_divergence_within_a_minute_latches) {
    permit_rig_begin(&rig, PERMIT_ARMED);
    raise(IW_CAUSE_PAIR_DIVERGES, IW_SIDES_LEFT, IW_REACT_RAMP);
    arm_again();
    raise(IW_CAUSE_PAIR_DIVERGES, IW_SIDES_LEFT, IW_REACT_RAMP);
    TEST_ASSERT_EQUAL_INT(IW_STATE_STOPPING, iw_permit_state(&rig.permit));
    arm_again();
    raise(IW_CAUSE_PAIR_DIVERGES, IW_SIDES_LEFT, IW_REACT_RAMP);
    TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, iw_permit_state(&rig.permit));
    TEST_ASSERT_TRUE(rig.permit.stop.latched);
    TEST_ASSERT_EQUAL_INT(IW_CAUSE_PAIR_DIVERGES, rig.permit.stop.cause);
    TEST_ASSERT_EQUAL_INT(IW_DEMAND_BRAKE, demand());
    rig.view.output_zero = true;
    permit_rig_step(&rig);
    rig.view.at_rest = true;
    permit_rig_wait(&rig, MS(600));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, permit_rig_reset(&rig));
}

TEST(test_permit_third_divergence_after_a_minute_does_not_latch) {
    for (unsigned beyond = 0; beyond < 2U; beyond++) {
        permit_rig_begin(&rig, PERMIT_ARMED);
        const iw_time_us_t first_us = rig.now_us;
        raise(IW_CAUSE_PAIR_DIVERGES, IW_SIDES_LEFT, IW_REACT_RAMP);
        arm_again();
        raise(IW_CAUSE_PAIR_DIVERGES, IW_SIDES_LEFT, IW_REACT_RAMP);
        arm_again();
        rig.now_us = first_us + IW_PERMIT_DIVERGED_US - 1U + beyond;
        raise(IW_CAUSE_PAIR_DIVERGES, IW_SIDES_LEFT, IW_REACT_RAMP);
        TEST_ASSERT_EQUAL_INT((beyond == 0U) ? IW_STATE_LATCHED : IW_STATE_STOPPING, iw_permit_state(&rig.permit));
    }
}

TEST(test_permit_stops_of_other_causes_are_no_divergence) {
    permit_rig_begin(&rig, PERMIT_ARMED);
    for (unsigned i = 0; i < 4U; i++) {
        permit_rig_raise(&rig, IW_CAUSE_WHEEL_BLOCKED);
        TEST_ASSERT_EQUAL_INT(IW_STATE_STOPPING, iw_permit_state(&rig.permit));
        arm_again();
    }
}

/// The client whose wheels did not follow waits for the zeros of the stop. Another client may arm at standstill.
TEST(test_permit_client_of_wheels_that_did_not_follow_waits) {
    static const struct {
        iw_cause_t cause;
        iw_refusal_t refusal;
    } rows[] = {{IW_CAUSE_WHEEL_BLOCKED, IW_REFUSE_WHEEL_BLOCKED}, {IW_CAUSE_PAIR_DIVERGES, IW_REFUSE_PAIR_DIVERGES}};
    for (unsigned i = 0; i < 4U; i++) {
        rig.config.hold = i >= 2U; // Time does not end the zeros, but the wait.
        permit_rig_begin(&rig, PERMIT_ARMED);
        raise(rows[i % 2U].cause, IW_SIDES_LEFT, IW_REACT_RAMP);
        rig.view.output_zero = true;
        rig.view.at_rest = true;
        permit_rig_step(&rig);
        rig.view.settled = true;
        permit_rig_wait(&rig, MS(1500) - 1U);
        TEST_ASSERT_EQUAL_INT(rows[i % 2U].refusal, permit_rig_arm(&rig, HOLDER));
        const iw_permit_t before = rig.permit;
        TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, permit_rig_arm(&rig, OTHER));
        rig.permit = before;
        permit_rig_wait(&rig, 1);
        TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, permit_rig_arm(&rig, HOLDER));
    }
}

/// A reset is a decision of a person, so the wait ends with the latch.
TEST(test_permit_reset_ends_the_wait_of_the_client) {
    rig.config.hold = true;
    permit_rig_begin(&rig, PERMIT_ARMED);
    raise(IW_CAUSE_WHEEL_BLOCKED, IW_SIDES_LEFT, IW_REACT_RAMP);
    raise(IW_CAUSE_ESTOP_LINE, IW_SIDES_NONE, IW_REACT_BY_CAUSE);
    rig.view.output_zero = true;
    rig.view.at_rest = true;
    permit_rig_step(&rig);
    permit_rig_wait(&rig, MS(600)); // The line is no longer raised, and the last command is old.
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, permit_rig_reset(&rig));
    permit_rig_assert(&rig, IW_STATE_STOPPING, IW_DEMAND_ZERO);
    TEST_ASSERT_EQUAL_UINT32(IW_CLIENT_NONE, rig.permit.blocked);
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NOT_ARMED, permit_rig_drive(&rig, HOLDER, false));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, permit_rig_arm(&rig, HOLDER));
}

TEST(test_permit_one_wheel_offline_latches_with_the_ramp) {
    permit_rig_begin(&rig, PERMIT_ARMED);
    raise(IW_CAUSE_WHEEL_LOST, IW_SIDES_LEFT, IW_REACT_RAMP);
    permit_rig_assert(&rig, IW_STATE_LATCHED, IW_DEMAND_BRAKE);
    TEST_ASSERT_FALSE(rig.permit.stop.at_once);
    permit_rig_begin(&rig, PERMIT_ARMED);
    raise(IW_CAUSE_WHEEL_LOST, IW_SIDES_BOTH, IW_REACT_ZERO);
    TEST_ASSERT_EQUAL_INT(IW_DEMAND_ZERO, demand());
    TEST_ASSERT_TRUE(rig.permit.stop.at_once);
}

TEST(test_permit_ramp_of_one_wheel_offline_ends_by_other_causes) {
    static const iw_cause_t causes[] = {IW_CAUSE_ESTOP_LINE,    IW_CAUSE_ESTOP_SOFTWARE, IW_CAUSE_BUS_DOWN,
                                        IW_CAUSE_SECOND_MASTER, IW_CAUSE_SEND_STALLED,   IW_CAUSE_WHEEL_REBOOTED,
                                        IW_CAUSE_FEEDBACK_SIGN, IW_CAUSE_OVERSPEED,      IW_CAUSE_LOOP_HUNG,
                                        IW_CAUSE_INTERNAL,      IW_CAUSE_LOOP_LATE};
    for (size_t i = 0; i < sizeof causes / sizeof causes[0]; i++) {
        permit_rig_begin(&rig, PERMIT_ARMED);
        raise(IW_CAUSE_WHEEL_LOST, IW_SIDES_RIGHT, IW_REACT_RAMP);
        permit_rig_raise(&rig, causes[i]);
        TEST_ASSERT_EQUAL_INT(IW_DEMAND_ZERO, demand());
        TEST_ASSERT_EQUAL_INT(IW_CAUSE_WHEEL_LOST, rig.permit.stop.first);
        raise(IW_CAUSE_WHEEL_LOST, IW_SIDES_RIGHT, IW_REACT_RAMP);
        TEST_ASSERT_EQUAL_INT(IW_DEMAND_ZERO, demand());
    }
    permit_rig_begin(&rig, PERMIT_ARMED);
    raise(IW_CAUSE_WHEEL_LOST, IW_SIDES_RIGHT, IW_REACT_RAMP);
    raise(IW_CAUSE_WHEEL_LOST, IW_SIDES_BOTH, IW_REACT_ZERO);
    TEST_ASSERT_EQUAL_INT(IW_DEMAND_ZERO, demand());
}

/// The reaction of an earlier stop must not turn this ramp into an immediate zero.
TEST(test_permit_one_wheel_offline_after_a_cut_stop_ramps) {
    permit_rig_begin(&rig, PERMIT_ARMED);
    permit_rig_raise(&rig, IW_CAUSE_LOOP_LATE);
    TEST_ASSERT_EQUAL_INT(IW_DEMAND_ZERO, demand());
    arm_again();
    raise(IW_CAUSE_WHEEL_LOST, IW_SIDES_LEFT, IW_REACT_RAMP);
    TEST_ASSERT_EQUAL_INT(IW_DEMAND_BRAKE, demand());
    TEST_ASSERT_FALSE(rig.permit.stop.at_once);
}

/// The clock of a board starts at zero, which does not count as a divergence.
TEST(test_permit_first_divergences_after_power_on_do_not_latch) {
    iw_permit_init(&rig.permit, &rig.config, 0, false);
    for (unsigned i = 0; i < 2U; i++) {
        rig.permit.phase = IW_PHASE_ARMED;
        rig.now_us = MS(1000) * (i + 1U);
        raise(IW_CAUSE_PAIR_DIVERGES, IW_SIDES_LEFT, IW_REACT_RAMP);
        TEST_ASSERT_EQUAL_INT(IW_STATE_STOPPING, iw_permit_state(&rig.permit));
    }
}

TEST(test_permit_stop_of_a_restart_is_marked_as_immediate) {
    permit_rig_init_restarted(&rig);
    TEST_ASSERT_TRUE(rig.permit.stop.at_once);
}

TEST(test_permit_hold_after_the_latched_ramp_begins_at_its_end) {
    permit_rig_begin(&rig, PERMIT_ARMED);
    rig.view.settled = true;
    raise(IW_CAUSE_WHEEL_LOST, IW_SIDES_LEFT, IW_REACT_RAMP);
    rig.view.output_zero = false;
    for (uint32_t n = 0; n < 300; n++) {
        permit_rig_wait(&rig, MS(10));
        TEST_ASSERT_EQUAL_INT(IW_DEMAND_BRAKE, demand());
    }
    rig.view.output_zero = true;
    permit_rig_wait(&rig, MS(rig.config.zero_hold_ms) - 1U);
    TEST_ASSERT_EQUAL_INT(IW_DEMAND_BRAKE, demand());
    permit_rig_wait(&rig, 1U);
    permit_rig_assert(&rig, IW_STATE_LATCHED, IW_DEMAND_SILENCE);
}

TEST(test_permit_hold_of_a_latch_without_ramp_begins_immediately) {
    permit_rig_begin(&rig, PERMIT_ARMED);
    rig.view.settled = true;
    rig.view.output_zero = false; // Nothing could be sent yet: the bus is down.
    permit_rig_raise(&rig, IW_CAUSE_BUS_DOWN);
    permit_rig_wait(&rig, MS(rig.config.zero_hold_ms));
    TEST_ASSERT_EQUAL_INT(IW_DEMAND_SILENCE, demand());
}

TEST(test_permit_reset_waits_for_the_end_of_the_latched_ramp) {
    permit_rig_begin(&rig, PERMIT_ARMED);
    raise(IW_CAUSE_WHEEL_LOST, IW_SIDES_LEFT, IW_REACT_RAMP);
    rig.view.output_zero = false;
    rig.view.at_rest = true; // The speed is below the limit of standstill.
    permit_rig_step(&rig);
    permit_rig_wait(&rig, MS(600));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NOT_AT_REST, permit_rig_reset(&rig));
    rig.view.output_zero = true;
    permit_rig_step(&rig);
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, permit_rig_reset(&rig));
}
