// SPDX-License-Identifier: MIT
// Features of FDCAN that bxCAN does not have: FD frames, requests with one write, the configuration that must not depend on earlier values.
#include "can_rig.h"
#include "unit.h"

#include <string.h>

static can_driver_t *const driver = &rig[0].driver;
static can_model_t *const model = &rig[0].model;

void setUp(void);
void tearDown(void);

void setUp(void) {
    rig_reset();
    rig_start(0);
}

void tearDown(void) {
    rig_assert_no_violation();
}

static int send(uint32_t id, uint8_t mark) {
    const iw_can_frame_t frame = rig_frame(id, mark);
    return can_send(driver, &frame, 1);
}

static void assert_loss_is_reported(void) {
    iw_can_frame_t frame;
    TEST_ASSERT_EQUAL(1, can_receive(driver, &frame));
    TEST_ASSERT_EQUAL_HEX32(IW_CAN_ERROR, frame.id);
    TEST_ASSERT_EQUAL(0, can_receive(driver, &frame));
}

TEST(test_fd_frame_to_send_is_refused) {
    const iw_can_frame_t frame = {.id = 266U | IW_CAN_FD, .dlc = 5};
    model_frame_t on_bus;
    TEST_ASSERT_LESS_THAN(0, can_send(driver, &frame, 1));
    TEST_ASSERT_FALSE(rig_send_next(0, &on_bus));
}

TEST(test_fd_frame_of_another_node_is_not_destroyed) {
    TEST_ASSERT_FALSE(fdcan_model_receive_fd(model));
    TEST_ASSERT_EQUAL(0, model->rec);
}

TEST(test_fd_frame_of_another_node_is_reported_once) {
    (void)fdcan_model_receive_fd(model);
    TEST_ASSERT_EQUAL(IW_BUS_ACTIVE, can_bus_state(driver));
    TEST_ASSERT_EQUAL(1, driver->exceptions);
    assert_loss_is_reported();
    TEST_ASSERT_EQUAL(IW_BUS_ACTIVE, can_bus_state(driver));
    TEST_ASSERT_EQUAL(1, driver->exceptions);
}

/// The read of PSR in `send` clears the flag, too.
TEST(test_fd_frame_before_a_send_is_counted) {
    (void)fdcan_model_receive_fd(model);
    TEST_ASSERT_EQUAL(1, send(266, 1));
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
    model_frame_t on_bus;
    iw_can_frame_t echo;
    TEST_ASSERT_EQUAL(1, send(266, 1));
    TEST_ASSERT_TRUE(rig_send_next(0, &on_bus));
    TEST_ASSERT_EQUAL(1, can_receive(driver, &echo));
    model->put = 1;
    TEST_ASSERT_EQUAL(1, send(298, 2));
    model->put = 0;
}

/// The right frame was sent. The new left one has no echo before it is sent too.
static void assert_left_is_not_sent_yet(uint8_t mark) {
    model_frame_t on_bus;
    iw_can_frame_t echo;
    TEST_ASSERT_EQUAL(1, can_receive(driver, &echo));
    TEST_ASSERT_EQUAL(298, echo.id);
    TEST_ASSERT_EQUAL(0, can_receive(driver, &echo));
    TEST_ASSERT_TRUE(rig_send_next(0, &on_bus));
    TEST_ASSERT_EQUAL(266, on_bus.id);
    TEST_ASSERT_EQUAL(1, can_receive(driver, &echo));
    TEST_ASSERT_EQUAL(266, echo.id);
    TEST_ASSERT_EQUAL(mark, echo.data[0]);
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
    TEST_ASSERT_EQUAL(1, send(266, 2));
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
    iw_can_frame_t echo;
    TEST_ASSERT_EQUAL(1, send(266, 1));
    model->unnoticed = model->pending;
    model->ir |= BRD_IR_TC;
    rig_serve(0);
    TEST_ASSERT_EQUAL(0, can_receive(driver, &echo));
    TEST_ASSERT_EQUAL(1, driver->outgoing[0].owed);
}

TEST(test_bus_off_drops_frames_with_the_next_state) {
    TEST_ASSERT_EQUAL(1, send(266, 1));
    model->tec = 255;
    can_model_begin(model, 0);
    can_model_end(model, 0, MODEL_BIT_ERROR);
    TEST_ASSERT_EQUAL(IW_BUS_OFF, can_bus_state(driver));
    TEST_ASSERT_EQUAL(0, model->pending);
    TEST_ASSERT_EQUAL(0, driver->outgoing[0].owed);
}

TEST(test_values_from_before_do_not_matter) {
    model_frame_t on_bus;
    iw_can_frame_t echo;
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
    TEST_ASSERT_EQUAL(1, send(298, 2));
    TEST_ASSERT_EQUAL(1, send(266, 1));
    TEST_ASSERT_TRUE(rig_send_next(0, &on_bus));
    TEST_ASSERT_EQUAL(266, on_bus.id);
    TEST_ASSERT_EQUAL(1, can_receive(driver, &echo));
    TEST_ASSERT_EQUAL(266, echo.id);
}

TEST(test_full_fifo_retains_the_older_frames) {
    iw_can_frame_t received;
    for (uint8_t i = 0; i < 4; i++) {
        const model_frame_t frame = {.id = 256, .dlc = 1, .data = {i}};
        (void)can_model_receive(model, &frame);
    }
    rig_serve(0);
    TEST_ASSERT_EQUAL(1, can_receive(driver, &received));
    TEST_ASSERT_EQUAL_HEX32(IW_CAN_ERROR, received.id);
    for (uint8_t i = 0; i < 3; i++) {
        TEST_ASSERT_EQUAL(1, can_receive(driver, &received));
        TEST_ASSERT_EQUAL(i, received.data[0]);
    }
    TEST_ASSERT_EQUAL(0, can_receive(driver, &received));
}
