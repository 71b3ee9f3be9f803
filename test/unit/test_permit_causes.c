// SPDX-License-Identifier: MIT
// Every cause in every situation: its effect, its lasting state and its refusals.
#include "permit_rig.h"
#include "unit.h"

static permit_rig_t rig;

void setUp(void) {
    permit_rig_init(&rig);
}

/// Effect of a cause.
typedef enum { NOTHING, LATCH, LATCH_SILENT, RAMP, CUT, END_ARMING } effect_t;

/// The effects are indexed by permit_situation_t.
typedef struct {
    iw_cause_t cause;
    effect_t effect[PERMIT_SITUATIONS];
} row_t;

#define ALWAYS(cause)                                                                                                  \
    {                                                                                                                  \
        cause, {                                                                                                       \
            LATCH_SILENT, LATCH, LATCH, LATCH, LATCH, NOTHING                                                          \
        }                                                                                                              \
    }
#define MOVING(cause)                                                                                                  \
    {                                                                                                                  \
        cause, {                                                                                                       \
            NOTHING, END_ARMING, LATCH, LATCH, LATCH, NOTHING                                                          \
        }                                                                                                              \
    }

static const row_t rows[] = {
    {IW_CAUSE_ESTOP_LINE, {LATCH_SILENT, LATCH, LATCH, LATCH, LATCH, LATCH}},
    {IW_CAUSE_ESTOP_SOFTWARE, {LATCH_SILENT, LATCH, LATCH, LATCH, LATCH, LATCH}},
    ALWAYS(IW_CAUSE_ESTOP_DISAGREES),
    ALWAYS(IW_CAUSE_INTERNAL),
    MOVING(IW_CAUSE_WHEEL_LOST),
    MOVING(IW_CAUSE_WHEEL_REBOOTED),
    MOVING(IW_CAUSE_SEND_STALLED),
    MOVING(IW_CAUSE_BUS_DOWN),
    MOVING(IW_CAUSE_SECOND_MASTER),
    MOVING(IW_CAUSE_FEEDBACK_SIGN),
    MOVING(IW_CAUSE_OVERSPEED),
    MOVING(IW_CAUSE_LOOP_HUNG),
    {IW_CAUSE_LOOP_LATE, {NOTHING, END_ARMING, CUT, CUT, CUT, NOTHING}},
    {IW_CAUSE_WHEEL_BLOCKED, {NOTHING, END_ARMING, RAMP, NOTHING, NOTHING, NOTHING}},
    {IW_CAUSE_PAIR_DIVERGES, {NOTHING, END_ARMING, RAMP, NOTHING, NOTHING, NOTHING}},
};
#define ROWS (sizeof rows / sizeof rows[0])

static const iw_state_t state_of[PERMIT_SITUATIONS] = {IW_STATE_LISTENING, IW_STATE_LISTENING, IW_STATE_ARMED,
                                                       IW_STATE_STOPPING,  IW_STATE_STOPPING,  IW_STATE_LATCHED};

static void assert_stop_reported(iw_cause_t cause, iw_state_t from, bool latched) {
    const iw_stop_t *const stop = &rig.permit.stop;
    TEST_ASSERT_EQUAL_INT(cause, stop->cause);
    TEST_ASSERT_EQUAL_INT(from, stop->from);
    TEST_ASSERT_EQUAL_INT(latched, stop->latched);
    TEST_ASSERT_EQUAL_UINT32(42, stop->detail);
    TEST_ASSERT_EQUAL_UINT8(IW_SIDES_BOTH, stop->sides);
    TEST_ASSERT_TRUE(stop->at_us == rig.now_us);
}

static void assert_effect(effect_t effect, const iw_permit_t *before, iw_cause_t cause) {
    const iw_demand_t demand = iw_permit_demand(&rig.permit);
    const bool stops = effect == LATCH || effect == LATCH_SILENT || effect == RAMP;
    const bool cuts_armed = effect == CUT && iw_permit_state(before) == IW_STATE_ARMED;
    TEST_ASSERT_EQUAL_UINT32(before->stop.number + ((stops || cuts_armed) ? 1U : 0U), rig.permit.stop.number);
    if (effect == LATCH || effect == LATCH_SILENT) {
        TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, iw_permit_state(&rig.permit));
        TEST_ASSERT_EQUAL_INT((effect == LATCH) ? IW_DEMAND_ZERO : IW_DEMAND_SILENCE, demand);
        assert_stop_reported(cause, iw_permit_state(before), true);
    } else if (effect == RAMP) {
        TEST_ASSERT_EQUAL_INT(IW_STATE_STOPPING, iw_permit_state(&rig.permit));
        TEST_ASSERT_EQUAL_INT(IW_DEMAND_BRAKE, demand);
        assert_stop_reported(cause, iw_permit_state(before), false);
    } else if (effect == CUT) {
        TEST_ASSERT_EQUAL_INT(IW_STATE_STOPPING, iw_permit_state(&rig.permit));
        TEST_ASSERT_EQUAL_INT(IW_DEMAND_ZERO, demand);
    } else if (effect == END_ARMING) {
        TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, iw_permit_state(&rig.permit));
        TEST_ASSERT_EQUAL_INT(IW_DEMAND_SILENCE, demand);
        TEST_ASSERT_TRUE(rig.permit.arm_refusal != IW_REFUSE_NONE);
    } else {
        TEST_ASSERT_EQUAL_INT(iw_permit_state(before), iw_permit_state(&rig.permit));
        TEST_ASSERT_EQUAL_INT(before->stop.cause, rig.permit.stop.cause);
    }
    TEST_ASSERT_TRUE(effect == NOTHING || rig.permit.holder == IW_CLIENT_NONE);
}

TEST(test_permit_each_cause_acts_immediately_in_each_situation) {
    for (size_t i = 0; i < ROWS; i++) {
        for (int situation = 0; situation < PERMIT_SITUATIONS; situation++) {
            permit_rig_begin(&rig, (permit_situation_t)situation);
            TEST_ASSERT_EQUAL_INT(state_of[situation], iw_permit_state(&rig.permit));
            const iw_permit_t before = rig.permit;
            permit_rig_raise(&rig, rows[i].cause);
            assert_effect(rows[i].effect[situation], &before, rows[i].cause);
            permit_rig_step(&rig);
            assert_effect(rows[i].effect[situation], &before, rows[i].cause);
        }
    }
}

TEST(test_permit_cause_raised_in_every_step_counts_as_one_stop) {
    for (size_t i = 0; i < ROWS; i++) {
        permit_rig_begin(&rig, PERMIT_ARMED);
        permit_rig_raise(&rig, rows[i].cause);
        const iw_stop_t first = rig.permit.stop;
        for (uint32_t n = 0; n < 100; n++) {
            permit_rig_wait(&rig, MS(1));
            permit_rig_raise(&rig, rows[i].cause);
        }
        TEST_ASSERT_EQUAL_UINT32(first.number, rig.permit.stop.number);
        TEST_ASSERT_TRUE(first.at_us == rig.permit.stop.at_us);
    }
}

TEST(test_permit_first_cause_of_a_latch_stays_the_cause) {
    for (size_t i = 0; i < ROWS; i++) {
        permit_rig_begin(&rig, PERMIT_ARMED);
        permit_rig_raise(&rig, IW_CAUSE_WHEEL_LOST);
        permit_rig_raise(&rig, rows[i].cause);
        permit_rig_wait(&rig, MS(1));
        permit_rig_raise(&rig, rows[i].cause);
        const bool estop = rows[i].cause == IW_CAUSE_ESTOP_LINE || rows[i].cause == IW_CAUSE_ESTOP_SOFTWARE;
        TEST_ASSERT_EQUAL_INT(estop ? rows[i].cause : IW_CAUSE_WHEEL_LOST, rig.permit.stop.cause);
        TEST_ASSERT_EQUAL_INT(IW_CAUSE_WHEEL_LOST, rig.permit.stop.first);
        TEST_ASSERT_EQUAL_UINT8(IW_SIDES_BOTH, rig.permit.stop.first_sides);
        TEST_ASSERT_EQUAL_UINT32(42, rig.permit.stop.first_detail);
        TEST_ASSERT_EQUAL_UINT32(estop ? 2U : 1U, rig.permit.stop.number);
    }
}

/// A person who knows only the earlier stop must not reset the e-stop of another person.
TEST(test_permit_estop_while_latched_is_a_new_stop_once_a_second) {
    static const iw_cause_t estops[] = {IW_CAUSE_ESTOP_LINE, IW_CAUSE_ESTOP_SOFTWARE};
    for (size_t i = 0; i < 2U; i++) {
        setUp();
        for (uint32_t number = 1; number <= 3U; number++) {
            permit_rig_raise(&rig, estops[i]);
            permit_rig_assert(&rig, IW_STATE_LATCHED, IW_DEMAND_SILENCE);
            TEST_ASSERT_EQUAL_UINT32(number, rig.permit.stop.number);
            TEST_ASSERT_TRUE(rig.permit.stop.at_us == rig.now_us);
            TEST_ASSERT_TRUE(rig.permit.stop.latched);
            TEST_ASSERT_EQUAL_INT((number == 1U) ? IW_STATE_LISTENING : IW_STATE_LATCHED, rig.permit.stop.from);
            permit_rig_wait(&rig, IW_PERMIT_EVENT_US - 1U);
            permit_rig_raise(&rig, estops[i]); // A bounce, or the same person again.
            TEST_ASSERT_EQUAL_UINT32(number, rig.permit.stop.number);
            permit_rig_wait(&rig, IW_PERMIT_EVENT_US);
        }
        permit_rig_raise(&rig, IW_CAUSE_INTERNAL);
        TEST_ASSERT_EQUAL_UINT32(3, rig.permit.stop.number);
    }
}

/// Otherwise a client that repeats it, or a loose wire, would hold the zeros, and a second master, without end.
TEST(test_permit_estop_in_a_latch_does_not_prolong_the_zeros) {
    for (unsigned moving = 0; moving < 2U; moving++) {
        permit_rig_begin(&rig, PERMIT_LATCHED);
        rig.view.output_zero = true;
        rig.view.settled = moving == 0U;
        const uint32_t last_ms = (moving == 0U) ? 1500U : 60000U;
        for (uint32_t ms = 100; ms < last_ms; ms += 100U) {
            permit_rig_wait(&rig, MS(100));
            permit_rig_assert(&rig, IW_STATE_LATCHED, IW_DEMAND_ZERO);
            if (ms % 1200U == 0U) {
                permit_rig_raise(&rig, IW_CAUSE_ESTOP_SOFTWARE);
            }
        }
        TEST_ASSERT_GREATER_THAN_UINT32(1, rig.permit.stop.number);
        permit_rig_wait(&rig, MS(100));
        permit_rig_assert(&rig, IW_STATE_LATCHED, IW_DEMAND_SILENCE);
        TEST_ASSERT_EQUAL_UINT32(moving, rig.permit.still_moving);
    }
}

TEST(test_permit_reset_ends_the_memory_of_the_first_cause) {
    permit_rig_raise(&rig, IW_CAUSE_INTERNAL);
    permit_rig_wait(&rig, MS(1));
    permit_rig_raise(&rig, IW_CAUSE_ESTOP_SOFTWARE);
    TEST_ASSERT_EQUAL_INT(IW_CAUSE_INTERNAL, rig.permit.stop.first);
    permit_rig_wait(&rig, IW_PERMIT_EVENT_US);
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, permit_rig_reset(&rig));
    permit_rig_raise(&rig, IW_CAUSE_ESTOP_LINE);
    TEST_ASSERT_EQUAL_INT(IW_CAUSE_ESTOP_LINE, rig.permit.stop.first);
}

TEST(test_permit_latch_after_a_stop_is_a_new_stop) {
    permit_rig_begin(&rig, PERMIT_STOPPING);
    const uint32_t number = rig.permit.stop.number;
    permit_rig_raise(&rig, IW_CAUSE_ESTOP_LINE);
    TEST_ASSERT_EQUAL_INT(IW_CAUSE_ESTOP_LINE, rig.permit.stop.cause);
    TEST_ASSERT_EQUAL_INT(IW_STATE_STOPPING, rig.permit.stop.from);
    TEST_ASSERT_EQUAL_UINT32(number + 1U, rig.permit.stop.number);
}

TEST(test_permit_latched_while_listening_never_sends) {
    permit_rig_raise(&rig, IW_CAUSE_ESTOP_LINE);
    for (uint32_t n = 0; n < 20; n++) {
        permit_rig_wait(&rig, MS(700));
        permit_rig_assert(&rig, IW_STATE_LATCHED, IW_DEMAND_SILENCE);
        TEST_ASSERT_TRUE(iw_permit_next_us(&rig.permit) == IW_NEVER);
    }
    TEST_ASSERT_EQUAL_UINT32(0, rig.permit.still_moving);
}

TEST(test_permit_late_loop_cuts_the_ramp) {
    permit_rig_begin(&rig, PERMIT_STOPPING);
    TEST_ASSERT_EQUAL_INT(IW_DEMAND_BRAKE, iw_permit_demand(&rig.permit));
    permit_rig_raise(&rig, IW_CAUSE_LOOP_LATE);
    for (uint32_t n = 0; n < 10; n++) {
        permit_rig_wait(&rig, MS(20));
        TEST_ASSERT_EQUAL_INT(IW_DEMAND_ZERO, iw_permit_demand(&rig.permit));
    }
}

TEST(test_permit_stop_after_a_cut_one_ramps_again) {
    permit_rig_begin(&rig, PERMIT_ARMED);
    permit_rig_raise(&rig, IW_CAUSE_LOOP_LATE);
    rig.view.output_zero = true;
    rig.view.at_rest = true;
    permit_rig_wait(&rig, MS(600));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, permit_rig_arm(&rig, HOLDER));
    permit_rig_prove(&rig);
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, iw_permit_state(&rig.permit));
    iw_permit_stop(&rig.permit, rig.now_us, HOLDER, IW_CAUSE_CLIENT_STOP);
    TEST_ASSERT_EQUAL_INT(IW_DEMAND_BRAKE, iw_permit_demand(&rig.permit));
}

TEST(test_permit_cut_stop_stays_cut_after_a_ramping_cause) {
    permit_rig_begin(&rig, PERMIT_ARMED);
    permit_rig_raise(&rig, IW_CAUSE_LOOP_LATE);
    permit_rig_raise(&rig, IW_CAUSE_WHEEL_BLOCKED);
    permit_rig_step(&rig);
    TEST_ASSERT_EQUAL_INT(IW_DEMAND_ZERO, iw_permit_demand(&rig.permit));
}

TEST(test_permit_stop_stores_sides_detail_and_client_of_its_cause) {
    permit_rig_begin(&rig, PERMIT_ARMED);
    const iw_event_t lost = {IW_CAUSE_WHEEL_LOST, IW_SIDES_RIGHT, UINT32_MAX, IW_REACT_BY_CAUSE};
    iw_permit_raise(&rig.permit, &lost, rig.now_us);
    TEST_ASSERT_EQUAL_UINT8(IW_SIDES_RIGHT, rig.permit.stop.sides);
    TEST_ASSERT_EQUAL_UINT32(UINT32_MAX, rig.permit.stop.detail);
    TEST_ASSERT_EQUAL_INT(HOLDER, rig.permit.stop.client);
}

TEST(test_permit_present_has_raised_levels_and_events_for_1_s) {
    static const iw_cause_t levels[] = {IW_CAUSE_ESTOP_LINE, IW_CAUSE_ESTOP_DISAGREES, IW_CAUSE_BUS_DOWN,
                                        IW_CAUSE_SEND_STALLED, IW_CAUSE_WHEEL_LOST};
    static const iw_cause_t events[] = {IW_CAUSE_ESTOP_SOFTWARE, IW_CAUSE_SECOND_MASTER, IW_CAUSE_WHEEL_REBOOTED,
                                        IW_CAUSE_FEEDBACK_SIGN,  IW_CAUSE_OVERSPEED,     IW_CAUSE_LOOP_HUNG,
                                        IW_CAUSE_INTERNAL};
    for (size_t i = 0; i < sizeof levels / sizeof levels[0]; i++) {
        setUp();
        permit_rig_raise(&rig, levels[i]);
        TEST_ASSERT_EQUAL_HEX32(1U << levels[i], iw_permit_present(&rig.permit, rig.now_us));
        permit_rig_wait(&rig, MS(1));
        TEST_ASSERT_EQUAL_HEX32(1U << levels[i], iw_permit_present(&rig.permit, rig.now_us));
        permit_rig_wait(&rig, MS(1));
        TEST_ASSERT_EQUAL_HEX32(0, iw_permit_present(&rig.permit, rig.now_us));
    }
    for (size_t i = 0; i < sizeof events / sizeof events[0]; i++) {
        setUp();
        permit_rig_raise(&rig, events[i]);
        permit_rig_wait(&rig, MS(500));
        permit_rig_wait(&rig, MS(500) - 1U);
        TEST_ASSERT_EQUAL_HEX32(1U << events[i], iw_permit_present(&rig.permit, rig.now_us));
        permit_rig_wait(&rig, 1);
        TEST_ASSERT_EQUAL_HEX32(0, iw_permit_present(&rig.permit, rig.now_us));
    }
}

TEST(test_permit_unjudged_step_retains_levels_and_adds_causes) {
    permit_rig_begin(&rig, PERMIT_LATCHED);
    permit_rig_wait(&rig, MS(1000));
    permit_rig_raise(&rig, IW_CAUSE_WHEEL_LOST);
    permit_rig_raise(&rig, IW_CAUSE_BUS_DOWN);
    permit_rig_step(&rig);
    permit_rig_raise(&rig, IW_CAUSE_ESTOP_LINE);
    iw_permit_retain_present(&rig.permit);
    permit_rig_step(&rig);
    TEST_ASSERT_EQUAL_HEX32(1U << IW_CAUSE_ESTOP_LINE | 1U << IW_CAUSE_WHEEL_LOST,
                            iw_permit_present(&rig.permit, rig.now_us));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_ESTOP_PRESSED, permit_rig_reset(&rig));
}

TEST(test_permit_present_has_no_cause_that_does_not_latch) {
    permit_rig_begin(&rig, PERMIT_ARMED);
    permit_rig_raise(&rig, IW_CAUSE_LOOP_LATE);
    permit_rig_raise(&rig, IW_CAUSE_WHEEL_BLOCKED);
    TEST_ASSERT_EQUAL_HEX32(0, iw_permit_present(&rig.permit, rig.now_us));
}

TEST(test_permit_is_quiet_without_a_present_cause) {
    permit_rig_begin(&rig, PERMIT_LISTENING);
    TEST_ASSERT_TRUE(rig.permit.quiet);
    permit_rig_raise(&rig, IW_CAUSE_SECOND_MASTER);
    TEST_ASSERT_FALSE(rig.permit.quiet);
    permit_rig_wait(&rig, IW_PERMIT_EVENT_US - 1U);
    TEST_ASSERT_FALSE(rig.permit.quiet);
    permit_rig_wait(&rig, 1U);
    TEST_ASSERT_TRUE(rig.permit.quiet);
}
