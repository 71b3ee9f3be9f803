// SPDX-License-Identifier: MIT
// Features of FDCAN that bxCAN does not have: FD frames, requests with one write, the configuration that must not depend on earlier values.
#include "can_rig.h"
#include "unit.h"

#include <string.h>

void setUp(void) {
    rig_reset();
    rig_start(0);
}

TEST(test_fd_frame_to_send_is_refused) {
    const iw_can_frame_t frame = {.id = 266U | IW_CAN_FD, .dlc = 5};
    TEST_ASSERT_LESS_THAN(0, can_send(driver, &frame, 1));
    rig_assert_nothing_waits();
}

TEST(test_fd_frame_of_another_node_is_not_destroyed) {
    TEST_ASSERT_FALSE(fdcan_model_receive_fd(model));
    TEST_ASSERT_EQUAL(0, model->rec);
}

TEST(test_fd_frame_of_another_node_is_reported_once) {
    (void)fdcan_model_receive_fd(model);
    TEST_ASSERT_EQUAL(IW_BUS_ACTIVE, can_bus_state(driver));
    TEST_ASSERT_EQUAL(1, driver->exceptions);
    rig_assert_loss_reported();
    rig_assert_no_echo();
    TEST_ASSERT_EQUAL(IW_BUS_ACTIVE, can_bus_state(driver));
    TEST_ASSERT_EQUAL(1, driver->exceptions);
}

/// The read of PSR in `send` clears the flag, too.
TEST(test_fd_frame_before_a_send_is_counted) {
    (void)fdcan_model_receive_fd(model);
    TEST_ASSERT_EQUAL(1, rig_send(266, 1));
    (void)can_bus_state(driver);
    TEST_ASSERT_EQUAL(1, driver->exceptions);
}

TEST(test_stored_fd_frame_is_no_classic_frame) {
    const model_frame_t frame = {.id = 266, .dlc = 5};
    iw_can_frame_t received;
    (void)can_model_receive(model, &frame);
    model->ram[44U + 1U] |= BRD_ELEMENT_FDF;
    rig_serve(0);
    TEST_ASSERT_EQUAL(1, can_receive(driver, &received));
    TEST_ASSERT_EQUAL_HEX32(266U | IW_CAN_FD, received.id);
}

TEST(test_controller_is_in_classic_mode_with_a_queue) {
    TEST_ASSERT_EQUAL_HEX32(0, can_model_read(model, 0x18));
    TEST_ASSERT_EQUAL_HEX32(BRD_TXBC_QUEUE, can_model_read(model, 0xC0));
}

TEST(test_silent_device_is_in_bus_monitoring_mode) {
    rig_reset();
    rig_init(0, true);
    (void)can_bus_state(driver);
    TEST_ASSERT_EQUAL_HEX32(BRD_CCCR_MON, can_model_read(model, 0x18));
}

static void complete_right(void) {
    can_model_begin(model, 1);
    can_model_end(model, 1, MODEL_SENT);
}

/// A left frame was sent from buffer 0, and a right frame waits in buffer 1. TXBTO is that of the frame before until the
/// new one is requested.
static void send_left_and_load_right(void) {
    TEST_ASSERT_EQUAL(1, rig_send(266, 1));
    rig_assert_on_bus(266, 1);
    rig_assert_echo(266, 1);
    model->put = 1;
    TEST_ASSERT_EQUAL(1, rig_send(298, 2));
    model->put = 0;
}

/// The right frame was sent. The new left one has no echo before it is sent too.
static void assert_left_is_not_sent_yet(uint8_t mark) {
    rig_assert_echo(298, 2);
    rig_assert_no_echo();
    rig_assert_on_bus(266, mark);
    rig_assert_echo(266, mark);
}

static bool complete_right_at_masking(uint32_t offset) {
    if (offset != RIG_MASK_REGISTER || !RIG_IS_PENDING(model, 1)) {
        return true;
    }
    complete_right();
    return false;
}

TEST(test_loaded_buffer_that_is_not_requested_has_no_echo) {
    const iw_can_frame_t pair[] = {rig_frame(266, 3), rig_frame(299, 4)};
    send_left_and_load_right();
    rig[0].on_read = complete_right_at_masking;
    TEST_ASSERT_EQUAL(2, can_send(driver, pair, 2));
    rig[0].on_read = NULL;
    assert_left_is_not_sent_yet(3);
}

static unsigned masks; ///< Writes of the mask until the hook acts.

static void complete_right_at_request(uint32_t offset) {
    if (offset == RIG_MASK_REGISTER && --masks == 0U) {
        rig[0].on_write = NULL;
        complete_right();
    }
}

TEST(test_completion_of_another_buffer_at_the_request_gives_no_echo) {
    send_left_and_load_right();
    masks = 3; // Masked and unmasked for the buffer, and masked for the request.
    rig[0].on_write = complete_right_at_request;
    TEST_ASSERT_EQUAL(1, rig_send(266, 2));
    TEST_ASSERT_EQUAL(0, masks);
    assert_left_is_not_sent_yet(2);
}

static uint32_t requests;

static void note_request(uint32_t offset) {
    if (RIG_IS_REQUEST(offset)) {
        requests++;
        TEST_ASSERT_EQUAL(0, model->pending);
    }
}

TEST(test_pair_is_requested_with_one_write) {
    const iw_can_frame_t pair[] = {rig_frame(266, 1), rig_frame(298, 2)};
    requests = 0;
    rig[0].on_write = note_request;
    TEST_ASSERT_EQUAL(2, can_send(driver, pair, 2));
    rig[0].on_write = NULL;
    TEST_ASSERT_EQUAL(1, requests);
    TEST_ASSERT_TRUE(RIG_IS_PENDING(model, 0) && RIG_IS_PENDING(model, 1));
}

TEST(test_request_that_is_not_noticed_yet_is_pending) {
    TEST_ASSERT_EQUAL(1, rig_send(266, 1));
    model->unnoticed = model->pending;
    model->ir |= BRD_IR_TC;
    rig_serve(0);
    rig_assert_no_echo();
    TEST_ASSERT_EQUAL(1, driver->outgoing[0].owed);
}

TEST(test_bus_off_drops_frames_with_the_next_state) {
    TEST_ASSERT_EQUAL(1, rig_send(266, 1));
    model->tec = 255;
    can_model_begin(model, 0);
    can_model_end(model, 0, MODEL_BIT_ERROR);
    TEST_ASSERT_EQUAL(IW_BUS_OFF, can_bus_state(driver));
    TEST_ASSERT_EQUAL(0, model->pending);
    TEST_ASSERT_EQUAL(0, driver->outgoing[0].owed);
}

TEST(test_values_from_before_do_not_matter) {
    rig_reset();
    memset(model->ram, 0xA5, sizeof model->ram);
    model->rxgfc = 0x0F1F0303U;
    model->txbc = 0;
    model->ils = 0x7F;
    model->ile = 2;
    model->txbtie = model->txbcie = 0;
    model->ckdiv = 3;
    rig_start(0);
    TEST_ASSERT_EQUAL_HEX32(0x0404003CU, model->rxgfc);
    TEST_ASSERT_EQUAL(0, model->ckdiv);
    TEST_ASSERT_EQUAL(1, rig_send(298, 2));
    TEST_ASSERT_EQUAL(1, rig_send(266, 1));
    rig_assert_on_bus(266, 1);
    rig_assert_echo(266, 1);
}

TEST(test_full_fifo_retains_the_older_frames) {
    rig_hear_burst(4);
    rig_assert_loss_reported();
    rig_assert_received(3);
}
