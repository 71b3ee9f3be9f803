// SPDX-License-Identifier: MIT
// Initialisation, joining the bus, silent mode, bus-off: bxCAN chapter 4 and section 7.6, M_CAN 3.1.
#include "can_rig.h"
#include "unit.h"

void setUp(void) {
    rig_reset();
}

static iw_bus_state_t state(void) {
    return can_bus_state(driver);
}

TEST(test_bus_is_down_until_11_recessive_bits) {
    rig_init(0, false);
    TEST_ASSERT_EQUAL(IW_BUS_DOWN, state());
    can_model_recessive(model, 10);
    TEST_ASSERT_EQUAL(IW_BUS_DOWN, state());
    rig_assert_active_after(0, 1);
    TEST_ASSERT_TRUE(can_model_is_on(model));
}

TEST(test_bus_bit_timing_is_written_as_configured) {
    rig_start(0);
    TEST_ASSERT_EQUAL_HEX32(RIG_TIMING, can_model_read(model, RIG_TIMING_REGISTER));
    TEST_ASSERT_EQUAL_HEX32(RIG_MODE_RUNNING, can_model_read(model, RIG_MODE_REGISTER));
}

TEST(test_bus_dominant_at_start_is_polled_without_blocking) {
    rig_init(0, false);
    for (int i = 0; i < 1000; i++) {
        can_model_dominant(model);
        TEST_ASSERT_EQUAL(IW_BUS_DOWN, state());
    }
    rig_assert_active_after(0, 11);
}

TEST(test_bus_controller_without_a_reply_is_down_and_recovers) {
    model->deaf = true;
    rig_init(0, false);
    for (int i = 0; i < 100; i++) {
        TEST_ASSERT_EQUAL(IW_BUS_DOWN, state());
    }
    model->deaf = false;
    (void)state();
    can_model_recessive(model, 11);
    rig_assert_joins(0);
}

TEST(test_bus_unexpected_reset_is_reported_and_repaired) {
    rig_start(0);
    can_model_reset(model, 28);
    TEST_ASSERT_EQUAL(IW_BUS_DOWN, state());
    rig_assert_joins(0);
    TEST_ASSERT_EQUAL_HEX32(RIG_TIMING, can_model_read(model, RIG_TIMING_REGISTER));
}

TEST(test_bus_unexpected_reset_while_joining_is_repaired) {
    rig_init(0, false);
    (void)state();
    can_model_reset(model, 28);
    for (int i = 0; i < 3; i++) {
        TEST_ASSERT_EQUAL(IW_BUS_DOWN, state());
    }
    rig_assert_active_after(0, 11);
}

TEST(test_bus_lost_request_is_repeated) {
    model->deaf = true;
    rig_init(0, false);
    (void)state();
    can_model_reset(model, 28);
    for (int i = 0; i < 3; i++) {
        TEST_ASSERT_EQUAL(IW_BUS_DOWN, state());
    }
    rig_assert_active_after(0, 11);
}

TEST(test_bus_unexpected_initialisation_mode_is_left) {
    rig_start(0);
    can_model_write(model, RIG_MODE_REGISTER, RIG_MODE_INIT);
    TEST_ASSERT_EQUAL(IW_BUS_DOWN, state());
    rig_assert_joins(0);
}

TEST(test_bus_silent_device_only_receives) {
    iw_can_frame_t first_frame;
    rig_init(0, true);
    rig_assert_joins(0);
    TEST_ASSERT_FALSE(rig_hear(0, 256, 4));
    TEST_ASSERT_EQUAL(1, can_receive(driver, &first_frame));
    TEST_ASSERT_LESS_THAN(0, rig_send(266, 1));
}

TEST(test_bus_device_that_is_not_silent_acknowledges) {
    rig_start(0);
    TEST_ASSERT_TRUE(rig_hear(0, 256, 4));
}

static void fail_until_bus_off(void) {
    model_frame_t frame;
    int tries = 0;
    while (rig_attempt_next(0, MODEL_BIT_ERROR, &frame)) {
        TEST_ASSERT_LESS_THAN(33, tries++);
    }
    TEST_ASSERT_TRUE(model->bus_off);
}

/// The frame is still waiting in bus-off.
static void start_and_fail_with_a_frame(void) {
    rig_start(0);
    (void)rig_send(266, 1);
    fail_until_bus_off();
}

TEST(test_bus_off_is_left_after_the_recovery_sequence) {
    start_and_fail_with_a_frame();
    TEST_ASSERT_EQUAL(IW_BUS_OFF, state());
    TEST_ASSERT_LESS_THAN(0, rig_send(266, 1));
    TEST_ASSERT_EQUAL(IW_BUS_OFF, state());
    can_model_recessive(model, RIG_REJOIN_BITS - 1U);
    TEST_ASSERT_EQUAL(IW_BUS_OFF, state());
    rig_assert_active_after(0, 1);
    TEST_ASSERT_EQUAL(1, driver->bus_offs);
}

TEST(test_bus_off_is_not_left_by_the_controller_alone) {
    start_and_fail_with_a_frame();
    can_model_recessive(model, 100U * RIG_REJOIN_BITS);
    TEST_ASSERT_TRUE(model->bus_off);
    TEST_ASSERT_EQUAL(IW_BUS_OFF, state());
}

TEST(test_bus_send_fails_in_bus_off_before_its_report) {
    start_and_fail_with_a_frame();
    TEST_ASSERT_LESS_THAN(0, rig_send(266, 1));
}

TEST(test_bus_frame_from_before_bus_off_is_not_sent_after_it) {
    rig_start(0);
    (void)rig_send(266, 1);
    (void)rig_send(298, 1);
    fail_until_bus_off();
    TEST_ASSERT_EQUAL(IW_BUS_OFF, state());
    for (int i = 0; i < MODEL_MAILBOXES; i++) {
        TEST_ASSERT_FALSE(RIG_IS_PENDING(model, i));
    }
    (void)state();
    (void)state();
    rig_assert_active_after(0, RIG_REJOIN_BITS);
    rig_assert_idle();
}

#ifndef IWHEEL_RIG_FDCAN
TEST(test_bus_recovery_waits_for_the_abort_of_waiting_frames) {
    start_and_fail_with_a_frame();
    model->abort_reads = 5000;
    for (int i = 0; i < 3; i++) {
        TEST_ASSERT_EQUAL(IW_BUS_OFF, state());
    }
    can_model_recessive(model, 2U * RIG_REJOIN_BITS);
    TEST_ASSERT_TRUE(model->bus_off);
    for (int i = 0; i < 4; i++) {
        TEST_ASSERT_EQUAL(IW_BUS_OFF, state());
    }
    rig_assert_active_after(0, RIG_REJOIN_BITS);
}
#endif

TEST(test_bus_purge_pending_in_bus_off_ends_in_the_recovery) {
    start_and_fail_with_a_frame();
    model->abort_reads = 2000;
    TEST_ASSERT_EQUAL(0, can_purge(driver));
    TEST_ASSERT_EQUAL(0, driver->resets);
    for (int i = 0; i < 4; i++) {
        TEST_ASSERT_EQUAL(IW_BUS_OFF, state());
    }
    rig_assert_active_after(0, RIG_REJOIN_BITS);
    rig_assert_nothing_waits();
}

TEST(test_bus_error_passive_is_reported) {
    model_frame_t on_bus;
    rig_start(0);
    (void)rig_send(266, 1);
    for (int i = 0; i < 100; i++) { // Without an acknowledgement the device becomes error passive, but never bus-off.
        TEST_ASSERT_TRUE(rig_attempt_next(0, MODEL_NO_ACKNOWLEDGEMENT, &on_bus));
    }
    TEST_ASSERT_EQUAL(IW_BUS_PASSIVE, state());
    TEST_ASSERT_EQUAL(128, rig_read_tec(0));
    rig_assert_lec(0, 3);
}

TEST(test_bus_receive_errors_are_reported) {
    rig_start(0);
    for (int i = 0; i < 130; i++) {
        can_model_receive_error(model);
    }
    TEST_ASSERT_GREATER_THAN(127, rig_read_rec(0));
    rig_assert_lec(0, 1);
    TEST_ASSERT_EQUAL(IW_BUS_PASSIVE, state());
}

TEST(test_bus_error_interrupt_wakes_and_ends) {
    rig_start(0);
    for (int i = 0; i < 128; i++) {
        can_model_receive_error(model);
    }
    TEST_ASSERT_TRUE(can_model_irq_error(model));
    (void)state();
    TEST_ASSERT_FALSE(can_model_irq_error(model));
    TEST_ASSERT_EQUAL(1, rig[0].interrupts);
}

TEST(test_bus_two_devices_share_only_their_filters) {
    const iw_can_frame_t frame = rig_frame(266, 7);
    model_frame_t on_bus;
    iw_can_frame_t first_frame;
    rig_start(0);
    rig_start(1);
#ifndef IWHEEL_RIG_FDCAN
    TEST_ASSERT_EQUAL_HEX32(0x3FU | (0x3FU << 14), model->fa1r);
    TEST_ASSERT_EQUAL(0, rig[1].model.fa1r);
#endif
    TEST_ASSERT_EQUAL(1, can_send(&rig[1].driver, &frame, 1));
    TEST_ASSERT_FALSE(rig_send_next(0, &on_bus));
    TEST_ASSERT_TRUE(rig_send_next(1, &on_bus));
    TEST_ASSERT_EQUAL(0, can_receive(&rig[0].driver, &first_frame));
    TEST_ASSERT_EQUAL(1, can_receive(&rig[1].driver, &first_frame));
    TEST_ASSERT_EQUAL(IW_CAN_ECHO, first_frame.kind);
}

static bool in_use_reads_back(uint32_t id) {
    model_frame_t on_bus;
    iw_can_frame_t echo;
    return rig_send(id, 5) > 0 && rig_send_next(0, &on_bus) && can_receive(driver, &echo) > 0 && echo.id == id &&
           echo.kind == IW_CAN_ECHO;
}

TEST(test_bus_off_of_one_device_does_not_affect_the_other) {
    can_driver_t *const other = &rig[1].driver;
    const iw_can_frame_t frame = rig_frame(298, 7);
    model_frame_t on_bus;
    iw_can_frame_t received;
    rig_start(0);
    rig_start(1);
    TEST_ASSERT_EQUAL(1, can_send(other, &frame, 1));
    while (can_model_is_on(&rig[1].model)) {
        (void)rig_attempt_next(1, MODEL_BIT_ERROR, &on_bus);
    }
    TEST_ASSERT_EQUAL(IW_BUS_OFF, can_bus_state(other));
    TEST_ASSERT_EQUAL(IW_BUS_ACTIVE, state());
    TEST_ASSERT_TRUE(in_use_reads_back(266));
    TEST_ASSERT_TRUE(rig_hear(0, 256, 4));
    TEST_ASSERT_EQUAL(1, can_receive(driver, &received));
    TEST_ASSERT_EQUAL(0, driver->bus_offs);
    TEST_ASSERT_EQUAL(1, other->bus_offs);
    (void)can_bus_state(other);
    (void)can_bus_state(other);
    rig_assert_active_after(1, RIG_REJOIN_BITS);
    TEST_ASSERT_EQUAL(1, can_purge(other));
    TEST_ASSERT_TRUE(in_use_reads_back(298));
}

TEST(test_bus_dominant_within_our_frame_is_bus_off) {
    model_frame_t on_bus;
    rig_start(0);
    (void)rig_send(266, 1);
    (void)rig_attempt_next(0, MODEL_BIT_ERROR, &on_bus);
    can_model_hold(model, 300, true);
    TEST_ASSERT_EQUAL(IW_BUS_OFF, state());
    for (int i = 0; i < 100; i++) {
        can_model_hold(model, 1000, true);
        TEST_ASSERT_EQUAL(IW_BUS_OFF, state());
    }
    rig_assert_active_after(0, RIG_REJOIN_BITS);
    rig_assert_nothing_waits();
}

TEST(test_bus_dominant_while_listening_is_passive_only) {
    rig_start(0);
    can_model_hold(model, 1000000, false);
    TEST_ASSERT_EQUAL(IW_BUS_PASSIVE, state());
    TEST_ASSERT_GREATER_THAN(127, rig_read_rec(0));
}
