// SPDX-License-Identifier: MIT
// How zeros are held, how a latch ends, how a gateway starts after a crash, and when the permission must be stepped.
#include "permit_rig.h"
#include "unit.h"
#include <string.h>

static permit_rig_t rig;

void setUp(void) {
    permit_rig_init(&rig);
}

/// Latched while armed. Now the wheels are at standstill and the cause has ended long ago.
static void latch_and_calm(iw_cause_t cause) {
    permit_rig_begin(&rig, PERMIT_ARMED);
    permit_rig_raise(&rig, cause);
    rig.view.output_zero = true;
    rig.view.at_rest = true;
    rig.view.settled = true;
    permit_rig_wait(&rig, MS(500));
    permit_rig_wait(&rig, MS(500));
}

static void assert_holding_until(iw_time_us_t after_us, iw_state_t then) {
    const iw_state_t state = iw_permit_state(&rig.permit);
    permit_rig_wait(&rig, after_us - 1U);
    TEST_ASSERT_EQUAL_INT(state, iw_permit_state(&rig.permit));
    TEST_ASSERT_TRUE(iw_permit_demand(&rig.permit) != IW_DEMAND_SILENCE);
    permit_rig_wait(&rig, 1);
    TEST_ASSERT_EQUAL_INT(then, iw_permit_state(&rig.permit));
    TEST_ASSERT_EQUAL_INT(IW_DEMAND_SILENCE, iw_permit_demand(&rig.permit));
}

TEST(test_permit_hold_begins_when_the_output_is_zero) {
    permit_rig_begin(&rig, PERMIT_STOPPING);
    rig.view.settled = true;
    permit_rig_wait(&rig, MS(3000));
    TEST_ASSERT_EQUAL_INT(IW_STATE_STOPPING, iw_permit_state(&rig.permit));
    rig.view.output_zero = true;
    permit_rig_step(&rig);
    assert_holding_until(MS(1500), IW_STATE_LISTENING);
    TEST_ASSERT_EQUAL_UINT32(0, rig.permit.still_moving);
}

TEST(test_permit_hold_follows_the_configuration) {
    rig.config.zero_hold_ms = 1100;
    permit_rig_begin(&rig, PERMIT_HOLDING);
    rig.view.settled = true;
    assert_holding_until(MS(1100), IW_STATE_LISTENING);
}

TEST(test_permit_hold_waits_for_settled_wheels) {
    permit_rig_begin(&rig, PERMIT_HOLDING);
    permit_rig_wait(&rig, MS(4000));
    TEST_ASSERT_EQUAL_INT(IW_STATE_STOPPING, iw_permit_state(&rig.permit));
    rig.view.settled = true;
    permit_rig_wait(&rig, MS(1));
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, iw_permit_state(&rig.permit));
    TEST_ASSERT_EQUAL_UINT32(0, rig.permit.still_moving);
}

TEST(test_permit_hold_ends_after_60_s_and_counts_moving_wheels) {
    permit_rig_begin(&rig, PERMIT_HOLDING);
    assert_holding_until(MS(60000), IW_STATE_LISTENING);
    TEST_ASSERT_EQUAL_UINT32(1, rig.permit.still_moving);
    permit_rig_begin(&rig, PERMIT_HOLDING);
    permit_rig_wait(&rig, MS(59999));
    rig.view.settled = true;
    permit_rig_wait(&rig, MS(1));
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, iw_permit_state(&rig.permit));
    TEST_ASSERT_EQUAL_UINT32(0, rig.permit.still_moving);
}

TEST(test_permit_longest_hold_follows_the_configuration) {
    rig.config.hold_max_s = 10;
    permit_rig_begin(&rig, PERMIT_HOLDING);
    assert_holding_until(MS(10000), IW_STATE_LISTENING);
    rig.config.hold_max_s = 600;
    permit_rig_begin(&rig, PERMIT_LATCHED);
    assert_holding_until(MS(600000), IW_STATE_LATCHED);
    TEST_ASSERT_EQUAL_UINT32(1, rig.permit.still_moving);
}

/// Zeros between the setpoints of another master would only jerk the wheels.
TEST(test_permit_hold_against_a_second_master_ends_after_10_s) {
    permit_rig_begin(&rig, PERMIT_HOLDING);
    permit_rig_wait(&rig, MS(3000));
    permit_rig_raise(&rig, IW_CAUSE_SECOND_MASTER);
    permit_rig_step(&rig);
    assert_holding_until(MS(10000), IW_STATE_LATCHED);
    permit_rig_begin(&rig, PERMIT_LATCHED);
    permit_rig_wait(&rig, MS(20000));
    TEST_ASSERT_EQUAL_INT(IW_DEMAND_ZERO, iw_permit_demand(&rig.permit));
    permit_rig_raise(&rig, IW_CAUSE_SECOND_MASTER);
    permit_rig_step(&rig);
    permit_rig_assert(&rig, IW_STATE_LATCHED, IW_DEMAND_SILENCE);
}

TEST(test_permit_second_master_before_the_hold_does_not_count) {
    permit_rig_begin(&rig, PERMIT_LISTENING);
    permit_rig_raise(&rig, IW_CAUSE_SECOND_MASTER);
    permit_rig_wait(&rig, MS(2000)); // The event of the second master has ended long ago.
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, permit_rig_arm(&rig, HOLDER));
    permit_rig_prove(&rig);
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, iw_permit_state(&rig.permit));
    rig.view.settled = false;
    iw_permit_stop(&rig.permit, rig.now_us, HOLDER, IW_CAUSE_CLIENT_STOP);
    permit_rig_step(&rig);
    assert_holding_until(MS(60000), IW_STATE_LISTENING);
}

TEST(test_permit_end_of_zeros_is_reported_5_s_before) {
    permit_rig_begin(&rig, PERMIT_HOLDING);
    permit_rig_wait(&rig, MS(55000) - 1U);
    TEST_ASSERT_FALSE(iw_permit_ending(&rig.permit, rig.now_us));
    permit_rig_wait(&rig, 1);
    TEST_ASSERT_TRUE(iw_permit_ending(&rig.permit, rig.now_us));
    rig.view.settled = true;
    permit_rig_wait(&rig, 1);
    TEST_ASSERT_FALSE(iw_permit_ending(&rig.permit, rig.now_us));
    permit_rig_begin(&rig, PERMIT_LATCHED);
    permit_rig_wait(&rig, MS(59999));
    TEST_ASSERT_TRUE(iw_permit_ending(&rig.permit, rig.now_us));
    permit_rig_wait(&rig, MS(1));
    TEST_ASSERT_FALSE(iw_permit_ending(&rig.permit, rig.now_us));
    permit_rig_begin(&rig, PERMIT_ARMED);
    TEST_ASSERT_FALSE(iw_permit_ending(&rig.permit, rig.now_us + MS(100000)));
}

/// A late query between two steps: the next step ends the hold whose time is over.
TEST(test_permit_end_of_zeros_is_not_reported_for_a_short_hold) {
    permit_rig_begin(&rig, PERMIT_HOLDING);
    rig.view.settled = true;
    permit_rig_step(&rig);
    TEST_ASSERT_FALSE(iw_permit_ending(&rig.permit, rig.now_us + MS(59999)));
    permit_rig_init_restarted(&rig);
    rig.view.settled = false;
    permit_rig_step(&rig);
    TEST_ASSERT_FALSE(iw_permit_ending(&rig.permit, rig.now_us + MS(59999)));
}

TEST(test_permit_hold_of_a_cut_stop_begins_immediately) {
    permit_rig_begin(&rig, PERMIT_ARMED);
    permit_rig_raise(&rig, IW_CAUSE_LOOP_LATE);
    rig.view.settled = true;
    permit_rig_step(&rig);
    assert_holding_until(MS(1500), IW_STATE_LISTENING);
}

TEST(test_permit_latched_holds_zeros_like_stopping) {
    permit_rig_begin(&rig, PERMIT_LATCHED);
    TEST_ASSERT_EQUAL_INT(IW_DEMAND_ZERO, iw_permit_demand(&rig.permit));
    rig.view.settled = true;
    assert_holding_until(MS(1500), IW_STATE_LATCHED);
    permit_rig_begin(&rig, PERMIT_LATCHED);
    assert_holding_until(MS(60000), IW_STATE_LATCHED);
    TEST_ASSERT_EQUAL_UINT32(1, rig.permit.still_moving);
    permit_rig_wait(&rig, MS(60000));
    TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, iw_permit_state(&rig.permit));
    TEST_ASSERT_EQUAL_UINT32(1, rig.permit.still_moving);
}

TEST(test_permit_latch_during_the_hold_begins_a_new_hold) {
    permit_rig_begin(&rig, PERMIT_HOLDING);
    rig.view.settled = true;
    permit_rig_wait(&rig, MS(1400));
    permit_rig_raise(&rig, IW_CAUSE_ESTOP_LINE);
    assert_holding_until(MS(1500), IW_STATE_LATCHED);
}

TEST(test_permit_reset_ends_the_latch_without_setpoints) {
    latch_and_calm(IW_CAUSE_INTERNAL);
    TEST_ASSERT_EQUAL_INT(IW_DEMAND_ZERO, iw_permit_demand(&rig.permit));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, permit_rig_reset(&rig));
    permit_rig_assert(&rig, IW_STATE_LISTENING, IW_DEMAND_SILENCE);
    TEST_ASSERT_TRUE(iw_permit_next_us(&rig.permit) == IW_NEVER);
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NOT_ARMED, permit_rig_drive(&rig, HOLDER, true));
}

TEST(test_permit_reset_of_a_latch_from_listening_is_accepted) {
    permit_rig_raise(&rig, IW_CAUSE_ESTOP_LINE);
    permit_rig_step(&rig);
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_ESTOP_PRESSED, permit_rig_reset(&rig));
    permit_rig_step(&rig);
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, permit_rig_reset(&rig));
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, iw_permit_state(&rig.permit));
}

TEST(test_permit_reset_while_not_latched_changes_nothing) {
    for (int situation = 0; situation < PERMIT_LATCHED; situation++) {
        permit_rig_begin(&rig, (permit_situation_t)situation);
        const iw_permit_t before = rig.permit;
        for (uint32_t n = 0; n < 3; n++) {
            TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, permit_rig_reset(&rig));
            TEST_ASSERT_EQUAL_MEMORY(&before, &rig.permit, sizeof before);
        }
    }
}

TEST(test_permit_reset_repeated_does_not_clear_a_new_latch) {
    latch_and_calm(IW_CAUSE_ESTOP_SOFTWARE);
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, permit_rig_reset(&rig));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, permit_rig_reset(&rig));
    permit_rig_raise(&rig, IW_CAUSE_ESTOP_SOFTWARE);
    TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, iw_permit_state(&rig.permit));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_CAUSE_PRESENT, permit_rig_reset(&rig));
    TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, iw_permit_state(&rig.permit));
}

TEST(test_permit_reset_with_a_level_present_names_it) {
    static const struct {
        iw_cause_t cause;
        iw_refusal_t refusal;
    } cases[] = {{IW_CAUSE_ESTOP_LINE, IW_REFUSE_ESTOP_PRESSED},
                 {IW_CAUSE_BUS_DOWN, IW_REFUSE_BUS_DOWN},
                 {IW_CAUSE_SEND_STALLED, IW_REFUSE_SEND_STALLED},
                 {IW_CAUSE_WHEEL_LOST, IW_REFUSE_WHEEL_LOST}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        latch_and_calm(IW_CAUSE_INTERNAL);
        permit_rig_raise(&rig, cases[i].cause);
        TEST_ASSERT_EQUAL_INT(cases[i].refusal, permit_rig_reset(&rig));
        permit_rig_wait(&rig, MS(1));
        TEST_ASSERT_EQUAL_INT(cases[i].refusal, permit_rig_reset(&rig));
        permit_rig_wait(&rig, MS(1));
        TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, permit_rig_reset(&rig));
    }
}

TEST(test_permit_reset_within_a_second_of_an_event_is_refused) {
    static const iw_cause_t events[] = {IW_CAUSE_SECOND_MASTER, IW_CAUSE_WHEEL_REBOOTED, IW_CAUSE_FEEDBACK_SIGN,
                                        IW_CAUSE_OVERSPEED,     IW_CAUSE_LOOP_HUNG,      IW_CAUSE_INTERNAL,
                                        IW_CAUSE_ESTOP_SOFTWARE};
    for (size_t i = 0; i < sizeof events / sizeof events[0]; i++) {
        latch_and_calm(IW_CAUSE_INTERNAL);
        permit_rig_raise(&rig, events[i]);
        permit_rig_wait(&rig, MS(1000) - 1U);
        const iw_refusal_t refusal = permit_rig_reset(&rig);
        TEST_ASSERT_EQUAL_INT((events[i] == IW_CAUSE_SECOND_MASTER) ? IW_REFUSE_SECOND_MASTER : IW_REFUSE_CAUSE_PRESENT,
                              refusal);
        TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, iw_permit_state(&rig.permit));
        permit_rig_wait(&rig, 1);
        TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, permit_rig_reset(&rig));
    }
}

TEST(test_permit_reset_needs_telemetry_and_standstill) {
    latch_and_calm(IW_CAUSE_INTERNAL);
    rig.view.online = false;
    permit_rig_step(&rig);
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_WHEEL_LOST, permit_rig_reset(&rig));
    rig.view.online = true;
    rig.view.at_rest = false;
    permit_rig_step(&rig);
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NOT_AT_REST, permit_rig_reset(&rig));
    rig.view.at_rest = true;
    rig.view.settled = false;
    permit_rig_step(&rig);
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, permit_rig_reset(&rig));
}

TEST(test_permit_reset_after_a_drive_of_any_client_is_refused) {
    latch_and_calm(IW_CAUSE_INTERNAL);
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_LATCHED, permit_rig_drive(&rig, OTHER, true));
    permit_rig_wait(&rig, MS(500) - 1U);
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_STALE_COMMAND, permit_rig_reset(&rig));
    TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, iw_permit_state(&rig.permit));
    TEST_ASSERT_EQUAL_INT(OTHER, rig.permit.stale_client);
    permit_rig_wait(&rig, 2);
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, permit_rig_reset(&rig));
}

TEST(test_permit_after_reset_the_old_holder_has_no_lease) {
    latch_and_calm(IW_CAUSE_INTERNAL);
    (void)permit_rig_reset(&rig);
    TEST_ASSERT_EQUAL_INT(IW_CLIENT_NONE, rig.permit.holder);
    permit_rig_wait(&rig, MS(5000));
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, iw_permit_state(&rig.permit));
}

TEST(test_permit_stop_after_a_reset_is_not_latched) {
    latch_and_calm(IW_CAUSE_INTERNAL);
    TEST_ASSERT_TRUE(rig.permit.stop.latched);
    (void)permit_rig_reset(&rig);
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, permit_rig_arm(&rig, HOLDER));
    permit_rig_prove(&rig);
    iw_permit_stop(&rig.permit, rig.now_us, HOLDER, IW_CAUSE_CLIENT_STOP);
    TEST_ASSERT_EQUAL_INT(IW_STATE_STOPPING, iw_permit_state(&rig.permit));
    TEST_ASSERT_FALSE(rig.permit.stop.latched);
}

TEST(test_permit_restarted_sends_zeros_before_listening) {
    permit_rig_init_restarted(&rig);
    permit_rig_assert(&rig, IW_STATE_STOPPING, IW_DEMAND_ZERO);
    TEST_ASSERT_EQUAL_INT(IW_CAUSE_RESTART, rig.permit.stop.cause);
    TEST_ASSERT_EQUAL_INT(IW_CAUSE_RESTART, rig.permit.stop.first);
    TEST_ASSERT_EQUAL_UINT32(1, rig.permit.stop.number);
    TEST_ASSERT_TRUE(rig.permit.stop.at_us == FIXTURE_START_US);
    assert_holding_until(MS(1500), IW_STATE_LISTENING);
}

TEST(test_permit_restarted_without_any_wheel_ends_the_hold) {
    permit_rig_init_restarted(&rig);
    rig.view.online = false;
    rig.view.at_rest = false;
    rig.view.settled = false;
    permit_rig_raise(&rig, IW_CAUSE_WHEEL_LOST);
    permit_rig_step(&rig);
    permit_rig_assert(&rig, IW_STATE_STOPPING, IW_DEMAND_ZERO);
    TEST_ASSERT_TRUE(iw_permit_next_us(&rig.permit) == rig.now_us + MS(1500));
    assert_holding_until(MS(1500), IW_STATE_LISTENING);
    TEST_ASSERT_EQUAL_UINT32(0, rig.permit.still_moving); // It is unknown whether the wheels move.
}

static void receive_foreign(uint8_t sides) {
    const iw_event_t foreign = {IW_CAUSE_SECOND_MASTER, sides, 42, IW_REACT_BY_CAUSE};
    iw_permit_raise(&rig.permit, &foreign, rig.now_us);
}

TEST(test_permit_restarted_ends_zeros_at_the_5th_foreign_setpoint) {
    static const uint8_t sides[] = {IW_SIDES_LEFT, IW_SIDES_RIGHT};
    for (size_t i = 0; i < 2; i++) {
        permit_rig_init_restarted(&rig);
        for (unsigned frame = 0; frame < 2; frame++) {
            receive_foreign(IW_SIDES_LEFT); // Frames that the dead process left in its controller.
            receive_foreign(IW_SIDES_RIGHT);
            permit_rig_assert(&rig, IW_STATE_STOPPING, IW_DEMAND_ZERO);
        }
        receive_foreign(sides[i]);
        permit_rig_assert(&rig, IW_STATE_LISTENING, IW_DEMAND_SILENCE);
    }
}

TEST(test_permit_restarted_latches_on_estop) {
    static const iw_cause_t causes[] = {IW_CAUSE_ESTOP_LINE, IW_CAUSE_ESTOP_SOFTWARE, IW_CAUSE_INTERNAL};
    for (size_t i = 0; i < 3; i++) {
        permit_rig_init_restarted(&rig);
        permit_rig_raise(&rig, causes[i]);
        permit_rig_assert(&rig, IW_STATE_LATCHED, IW_DEMAND_ZERO);
    }
}

TEST(test_permit_restarted_arm_before_the_end_of_hold_is_refused) {
    permit_rig_init_restarted(&rig);
    permit_rig_wait(&rig, MS(1000));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_CAUSE_PRESENT, permit_rig_arm(&rig, HOLDER));
    permit_rig_wait(&rig, MS(500));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, permit_rig_arm(&rig, HOLDER));
}

static void assert_restarted_silent(void) {
    memset(&rig.permit, FIXTURE_POISON, sizeof rig.permit);
    iw_permit_init(&rig.permit, &rig.config, rig.now_us, true);
    permit_rig_assert(&rig, IW_STATE_LISTENING, IW_DEMAND_SILENCE);
}

TEST(test_permit_restarted_without_permission_sends_nothing) {
    rig.config.listen_only = true;
    assert_restarted_silent();
    setUp();
    rig.config.setpoint_type_set = false;
    assert_restarted_silent();
    setUp();
    rig.config.current_role = IW_ROLE_UNSET;
    assert_restarted_silent();
}

/// No stop depends on the track: after an update a moving machine may have none.
TEST(test_permit_restarted_without_a_track_sends_zeros) {
    for (int hold = 0; hold < 2; hold++) {
        setUp();
        rig.config.track_mm = 0;
        rig.config.hold = hold != 0;
        iw_permit_init(&rig.permit, &rig.config, rig.now_us, true);
        permit_rig_step(&rig);
        permit_rig_assert(&rig, IW_STATE_STOPPING, IW_DEMAND_ZERO);
        permit_rig_wait(&rig, MS(1600));
        TEST_ASSERT_EQUAL_INT((hold != 0) ? IW_STATE_STOPPING : IW_STATE_LISTENING, iw_permit_state(&rig.permit));
        TEST_ASSERT_EQUAL(hold != 0, iw_permit_demand(&rig.permit) != IW_DEMAND_SILENCE);
        TEST_ASSERT_EQUAL_INT(IW_REFUSE_TRACK_NOT_SET, permit_rig_arm(&rig, HOLDER));
    }
}

/// The state that is visible from outside.
static uint32_t outside(const iw_permit_t *permit) {
    return (uint32_t)iw_permit_state(permit) | (uint32_t)iw_permit_demand(permit) << 4 |
           (uint32_t)iw_permit_arming(permit) << 8 | (uint32_t)(permit->phase == IW_PHASE_CUT) << 9 |
           permit->holder << 10 | (uint32_t)permit->arm_refusal << 16 | permit->stop.number << 22;
}

/// A step at `next_us` changes the state; a step before it does not.
static void assert_next_is_right(void) {
    const iw_permit_t now = rig.permit;
    const iw_time_us_t next_us = iw_permit_next_us(&rig.permit);
    const iw_time_us_t before_us = (next_us == IW_NEVER) ? rig.now_us + MS(100000) : next_us - 1U;
    if (before_us >= rig.now_us) {
        iw_permit_step(&rig.permit, before_us);
        TEST_ASSERT_EQUAL_HEX32_MESSAGE(outside(&now), outside(&rig.permit), "changed before next_us");
        rig.permit = now;
    }
    if (next_us != IW_NEVER) {
        TEST_ASSERT_TRUE_MESSAGE(next_us > rig.now_us, "asks to be called again immediately");
        iw_permit_step(&rig.permit, next_us);
        TEST_ASSERT_TRUE_MESSAGE(outside(&now) != outside(&rig.permit), "nothing changed at next_us");
        rig.permit = now;
    }
}

static void random_input(fixture_random_t *random) {
    const uint32_t choice = fixture_random(random) % 24U;
    const iw_client_t client = ((fixture_random(random) & 1U) != 0U) ? HOLDER : OTHER;
    rig.view.settled = rig.view.settled != (choice == 0U);
    rig.view.at_rest = rig.view.settled || choice < 12U;
    rig.view.output_zero = choice != 1U;
    if (choice < 8U) {
        (void)permit_rig_arm(&rig, client);
        rig.view.proven = (fixture_random(random) & 3U) != 0U;
    } else if (choice < 14U) {
        (void)permit_rig_drive(&rig, client, choice == 9U);
    } else if (choice < 15U) {
        iw_permit_stop(&rig.permit, rig.now_us, client, IW_CAUSE_CLIENT_STOP);
    } else if (choice < 16U) {
        iw_permit_disconnect(&rig.permit, rig.now_us, client);
    } else if (choice < 18U) {
        permit_rig_raise(&rig, (iw_cause_t)fixture_random_in(random, IW_CAUSE_ESTOP_LINE, IW_CAUSE_WHEEL_BLOCKED));
    } else {
        (void)permit_rig_reset(&rig);
    }
}

TEST(test_permit_next_us_is_exact_in_20000_random_situations) {
    fixture_random_t random;
    fixture_random_init(&random, 6);
    uint32_t seen[4] = {0, 0, 0, 0};
    for (uint32_t n = 0; n < 20000; n++) {
        random_input(&random);
        const iw_time_us_t next_us = iw_permit_next_us(&rig.permit);
        const iw_time_us_t for_us = (iw_time_us_t)fixture_random_in(&random, 0, 300000);
        const bool jump = next_us != IW_NEVER && next_us > rig.now_us && (fixture_random(&random) & 3U) == 0U;
        permit_rig_wait(&rig, jump ? next_us - rig.now_us : for_us);
        permit_rig_step(&rig);
        seen[iw_permit_state(&rig.permit)]++;
        assert_next_is_right();
    }
    for (size_t state = 0; state < 4; state++) {
        TEST_ASSERT_TRUE_MESSAGE(seen[state] > 500, "a state was hardly visited");
    }
}
