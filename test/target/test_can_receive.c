// SPDX-License-Identifier: MIT
// Filters, FIFO and ring: bxCAN 7.3 and 7.4, M_CAN 3.4.
#include "can_rig.h"
#include "iwheel/codec.h"
#include "unit.h"

#include <string.h>

static const uint32_t ours[] = {256, 257, 266, 288, 289, 290, 298, 512, 513, 544, 545};

void setUp(void) {
    rig_reset();
    rig_start(0);
}

static bool is_ours(uint32_t id) {
    for (size_t i = 0; i < sizeof ours / sizeof ours[0]; i++) {
        if (ours[i] == id) {
            return true;
        }
    }
    return false;
}

/// Returns 1 if the frame passes the filters, with the received frame in `*out_frame`.
static int pass(const model_frame_t *frame, iw_can_frame_t *out_frame) {
    (void)can_model_receive(model, frame);
    rig_serve(0);
    return can_receive(driver, out_frame);
}

TEST(test_filters_exactly_11_of_all_2048_standard_ids_pass) {
    for (uint32_t id = 0; id < 2048U; id++) {
        for (uint8_t remote = 0; remote <= 1; remote++) {
            const model_frame_t frame = {.id = id, .remote = remote, .dlc = 4};
            iw_can_frame_t received;
            TEST_ASSERT_EQUAL_MESSAGE(iw_codec_find(id) != NULL, is_ours(id), "the core's table has other ids");
            TEST_ASSERT_EQUAL_MESSAGE(is_ours(id) ? 1 : 0, pass(&frame, &received), "an id is filtered wrongly");
            if (is_ours(id)) {
                TEST_ASSERT_EQUAL_HEX32(id | ((remote != 0U) ? IW_CAN_REMOTE : 0U), received.id);
            }
        }
    }
}

TEST(test_filters_extended_ids_pass_only_with_the_same_number) {
    for (uint32_t bit = 0; bit < 29U; bit++) {
        for (uint32_t id = 0; id < 2048U; id++) {
            const model_frame_t frame = {.id = id ^ (1U << bit), .extended = 1, .dlc = 4};
            iw_can_frame_t received;
            TEST_ASSERT_EQUAL(is_ours(frame.id) ? 1 : 0, pass(&frame, &received));
            if (is_ours(frame.id)) {
                TEST_ASSERT_EQUAL_HEX32(frame.id | IW_CAN_EXTENDED, received.id);
            }
        }
    }
}

TEST(test_filters_extended_id_with_the_same_prefix_does_not_pass) {
    for (size_t i = 0; i < sizeof ours / sizeof ours[0]; i++) {
        const model_frame_t frame = {.id = ours[i] << 18, .extended = 1, .dlc = 4};
        iw_can_frame_t received;
        TEST_ASSERT_EQUAL(0, pass(&frame, &received));
    }
}

TEST(test_received_frame_has_the_same_bytes) {
    const model_frame_t frame = {.id = 290, .dlc = 8, .data = {0x81, 0x02, 0xF3, 0x04, 0x95, 0x06, 0xA7, 0x08}};
    iw_can_frame_t received;
    memset(&received, 0xA5, sizeof received);
    TEST_ASSERT_EQUAL(1, pass(&frame, &received));
    TEST_ASSERT_EQUAL(290, received.id);
    TEST_ASSERT_EQUAL(8, received.dlc);
    TEST_ASSERT_EQUAL(IW_CAN_RECEIVED, received.kind);
    TEST_ASSERT_EQUAL_HEX8_ARRAY(frame.data, received.data, 8);
}

TEST(test_received_dlc_above_8_means_8_bytes) {
    const model_frame_t frame = {.id = 256, .dlc = 15};
    iw_can_frame_t received;
    TEST_ASSERT_EQUAL(1, pass(&frame, &received));
    TEST_ASSERT_EQUAL(8, received.dlc);
}

TEST(test_received_frames_and_echoes_are_in_the_order_of_the_bus) {
    const iw_can_frame_t left = rig_frame(266, 9);
    const uint32_t expected[] = {256, 266, 512, 288};
    model_frame_t on_bus;
    iw_can_frame_t received;
    (void)can_send(driver, &left, 1);
    (void)rig_hear(0, 256, 4);
    (void)rig_send_next(0, &on_bus);
    (void)rig_hear(0, 512, 4);
    (void)rig_hear(0, 288, 4);
    for (size_t i = 0; i < 4; i++) {
        TEST_ASSERT_EQUAL(1, can_receive(driver, &received));
        TEST_ASSERT_EQUAL(expected[i], received.id);
    }
    TEST_ASSERT_EQUAL(0, can_receive(driver, &received));
}

TEST(test_received_foreign_setpoint_is_no_echo) {
    iw_can_frame_t received;
    (void)rig_hear(0, 266, 5);
    TEST_ASSERT_EQUAL(1, can_receive(driver, &received));
    TEST_ASSERT_EQUAL(IW_CAN_RECEIVED, received.kind);
}

#ifndef IWHEEL_RIG_FDCAN
TEST(test_received_frame_with_a_slow_release_is_not_doubled) {
    model->release_slow = 4;
    rig_hear_burst(3);
    rig_assert_received(3);
}
#endif

TEST(test_overrun_of_the_controller_is_counted_once) {
    rig_hear_burst(5);
    TEST_ASSERT_EQUAL(1, driver->overruns);
    (void)rig_hear(0, 256, 4);
    TEST_ASSERT_EQUAL(1, driver->overruns);
}

TEST(test_overrun_is_reported_once_and_before_its_frames) {
    iw_can_frame_t received;
    for (int round = 0; round < 2; round++) {
        rig_hear_burst(5);
        rig_assert_loss_reported();
        for (int i = 0; i < 3; i++) {
            TEST_ASSERT_EQUAL(1, can_receive(driver, &received));
            TEST_ASSERT_EQUAL(256, received.id);
        }
        TEST_ASSERT_EQUAL(0, can_receive(driver, &received));
    }
}

TEST(test_full_ring_drops_and_counts_the_newest) {
    iw_can_frame_t received;
    for (uint32_t i = 0; i < BRD_FRAME_RING_LENGTH + 5U; i++) {
        const model_frame_t frame = {.id = 256, .dlc = 1, .data = {(uint8_t)i}};
        (void)can_model_receive(model, &frame);
        rig_serve(0);
    }
    TEST_ASSERT_EQUAL(5, driver->lost);
    rig_assert_loss_reported();
    rig_assert_received(BRD_FRAME_RING_LENGTH);
    (void)rig_hear(0, 257, 7);
    TEST_ASSERT_EQUAL(1, can_receive(driver, &received));
}

TEST(test_ring_continues_after_the_overflow_of_its_indices) {
    iw_can_frame_t received;
    atomic_store(&driver->ring.head, UINT32_MAX - 20U);
    atomic_store(&driver->ring.tail, UINT32_MAX - 20U);
    for (uint32_t i = 0; i < 100U; i++) {
        const model_frame_t frame = {.id = 256, .dlc = 1, .data = {(uint8_t)i}};
        TEST_ASSERT_EQUAL(1, pass(&frame, &received));
        TEST_ASSERT_EQUAL(i, received.data[0]);
    }
    TEST_ASSERT_EQUAL(0, driver->lost);
}

#ifndef IWHEEL_RIG_FDCAN
TEST(test_filters_do_not_depend_on_earlier_values) {
    rig_reset();
    model->fm1r = 0x0FFFFFFFU;
    model->fs1r = 0x0FFFFFFFU;
    model->ffa1r = 0x0FFFFFFFU;
    rig_start(0);
    for (size_t i = 0; i < sizeof ours / sizeof ours[0]; i++) {
        const model_frame_t frame = {.id = ours[i], .dlc = 4};
        iw_can_frame_t received;
        TEST_ASSERT_EQUAL(1, pass(&frame, &received));
    }
    TEST_ASSERT_EQUAL_HEX32(0x0FFFFFC0U, model->fm1r);
    TEST_ASSERT_EQUAL_HEX32(0x0FFFFFC0U, model->ffa1r);
    TEST_ASSERT_EQUAL_HEX32(0x0FFFFFFCU, model->fs1r);
}
#endif

#ifndef IWHEEL_RIG_FDCAN
TEST(test_filters_do_not_change_other_banks) {
    rig_reset();
    model->fa1r = 1U << 20;
    model->bank[20][0] = 0x12345678U;
    rig_start(0);
    TEST_ASSERT_EQUAL_HEX32(0x3FU | (1U << 20), model->fa1r);
    TEST_ASSERT_EQUAL_HEX32(0x12345678U, model->bank[20][0]);
}
#endif

#ifndef IWHEEL_RIG_FDCAN
TEST(test_filters_fit_a_controller_with_14_banks) {
    rig_reset();
    can_model_reset(model, 14);
    rig_start(0);
    TEST_ASSERT_EQUAL_HEX32(0x3FU, model->fa1r);
    TEST_ASSERT_EQUAL_HEX32(0, model->fmr & 1U);
}
#endif

TEST(test_receive_error_counter_decreases_again) {
    for (int i = 0; i < 10; i++) {
        can_model_receive_error(model);
    }
    for (int i = 0; i < 4; i++) {
        (void)rig_hear(0, 256, 4);
    }
    TEST_ASSERT_EQUAL(6, rig_read_rec(0));
    rig_assert_lec(0, 0);
}
