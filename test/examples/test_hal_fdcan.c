// SPDX-License-Identifier: MIT
// The example HAL of ST's FDCAN driver, against a model of that driver and its controller.
#include "hal_fdcan.h"

#include "hal_check.h"

#include <string.h>

#define FIFO    3U
#define BUFFERS 3U
#define ESTOP   0x0008U

uint32_t SystemCoreClock = 170000000;

static hal_fdcan_t self;
static iw_hal_t hal;
static FDCAN_GlobalTypeDef registers;
static FDCAN_HandleTypeDef controller;
static TIM_HandleTypeDef timer;
static GPIO_TypeDef port;

static struct {
    FDCAN_TxHeaderTypeDef header[BUFFERS];
    uint8_t data[BUFFERS][8];
    uint32_t latest;
    FDCAN_RxHeaderTypeDef received[FIFO];
    uint8_t received_data[FIFO][8];
    FDCAN_TxEventFifoTypeDef event[FIFO];
    uint32_t received_count, event_count;
    FDCAN_ProtocolStatusTypeDef status;
    uint32_t on_bus; ///< Buffers that a cancellation does not stop.
    uint32_t masked, requested_unmasked;
    uint32_t interrupts, starts;
    bool accepts_remote;
    GPIO_PinState level;
} model;

uint32_t __get_PRIMASK(void) {
    return model.masked;
}

void __set_PRIMASK(uint32_t masked) {
    model.masked = masked;
}

void __disable_irq(void) {
    model.masked = 1;
}

GPIO_PinState HAL_GPIO_ReadPin(GPIO_TypeDef *gpio, uint16_t pin) {
    return (gpio == &port && pin == ESTOP) ? model.level : GPIO_PIN_SET;
}

HAL_StatusTypeDef HAL_FDCAN_Init(FDCAN_HandleTypeDef *self_) {
    self_->Instance->CCCR = FDCAN_CCCR_INIT;
    return HAL_OK;
}

HAL_StatusTypeDef HAL_FDCAN_ConfigGlobalFilter(FDCAN_HandleTypeDef *self_, uint32_t standard, uint32_t extended,
                                               uint32_t remote_standard, uint32_t remote_extended) {
    (void)self_;
    const bool all = standard == FDCAN_ACCEPT_IN_RX_FIFO0 && extended == FDCAN_ACCEPT_IN_RX_FIFO0;
    model.accepts_remote = remote_standard == FDCAN_FILTER_REMOTE && remote_extended == FDCAN_FILTER_REMOTE;
    return all ? HAL_OK : HAL_ERROR;
}

HAL_StatusTypeDef HAL_FDCAN_ConfigTimestampCounter(FDCAN_HandleTypeDef *self_, uint32_t prescaler) {
    (void)self_;
    return (prescaler == FDCAN_TIMESTAMP_PRESC_1) ? HAL_OK : HAL_ERROR;
}

HAL_StatusTypeDef HAL_FDCAN_EnableTimestampCounter(FDCAN_HandleTypeDef *self_, uint32_t operation) {
    (void)self_;
    return (operation == FDCAN_TIMESTAMP_INTERNAL) ? HAL_OK : HAL_ERROR;
}

HAL_StatusTypeDef HAL_FDCAN_ActivateNotification(FDCAN_HandleTypeDef *self_, uint32_t interrupts, uint32_t buffers) {
    (void)self_;
    model.interrupts = interrupts;
    return (buffers == 0U) ? HAL_OK : HAL_ERROR;
}

HAL_StatusTypeDef HAL_FDCAN_Start(FDCAN_HandleTypeDef *self_) {
    self_->Instance->CCCR = 0;
    model.starts++;
    return HAL_OK;
}

/// CCE drops all frames in the controller.
HAL_StatusTypeDef HAL_FDCAN_Stop(FDCAN_HandleTypeDef *self_) {
    self_->Instance->CCCR = FDCAN_CCCR_INIT;
    self_->Instance->TXBRP = 0;
    model.received_count = 0;
    model.event_count = 0;
    return HAL_OK;
}

HAL_StatusTypeDef HAL_FDCAN_AddMessageToTxFifoQ(FDCAN_HandleTypeDef *self_, const FDCAN_TxHeaderTypeDef *header,
                                                const uint8_t *data) {
    for (uint32_t i = 0; i < BUFFERS; i++) {
        if (((self_->Instance->TXBRP >> i) & 1U) == 0U) {
            model.header[i] = *header;
            memcpy(model.data[i], data, 8);
            model.latest = 1U << i;
            model.requested_unmasked += (model.masked == 0U) ? 1U : 0U;
            self_->Instance->TXBRP |= 1U << i;
            return HAL_OK;
        }
    }
    return HAL_ERROR;
}

uint32_t HAL_FDCAN_GetLatestTxFifoQRequestBuffer(const FDCAN_HandleTypeDef *self_) {
    (void)self_;
    return model.latest;
}

HAL_StatusTypeDef HAL_FDCAN_AbortTxRequest(FDCAN_HandleTypeDef *self_, uint32_t buffers) {
    self_->Instance->TXBRP &= ~buffers | model.on_bus;
    return HAL_OK;
}

uint32_t HAL_FDCAN_GetRxFifoFillLevel(const FDCAN_HandleTypeDef *self_, uint32_t fifo) {
    (void)self_;
    return (fifo == FDCAN_RX_FIFO0) ? model.received_count : 0U;
}

HAL_StatusTypeDef HAL_FDCAN_GetRxMessage(FDCAN_HandleTypeDef *self_, uint32_t fifo, FDCAN_RxHeaderTypeDef *header,
                                         uint8_t *data) {
    (void)self_;
    if (fifo != FDCAN_RX_FIFO0 || model.received_count == 0U) {
        return HAL_ERROR;
    }
    *header = model.received[0];
    memcpy(data, model.received_data[0], 8);
    model.received_count--;
    memmove(&model.received[0], &model.received[1], sizeof model.received - sizeof model.received[0]);
    memmove(&model.received_data[0], &model.received_data[1], sizeof model.received_data - 8U);
    return HAL_OK;
}

HAL_StatusTypeDef HAL_FDCAN_GetTxEvent(FDCAN_HandleTypeDef *self_, FDCAN_TxEventFifoTypeDef *event) {
    (void)self_;
    if (model.event_count == 0U) {
        return HAL_ERROR;
    }
    *event = model.event[0];
    model.event_count--;
    memmove(&model.event[0], &model.event[1], sizeof model.event - sizeof model.event[0]);
    return HAL_OK;
}

HAL_StatusTypeDef HAL_FDCAN_GetProtocolStatus(const FDCAN_HandleTypeDef *self_, FDCAN_ProtocolStatusTypeDef *status) {
    (void)self_;
    *status = model.status;
    return HAL_OK;
}

/// The frame in `buffer` is acknowledged; it began at `stamp`.
static void acknowledge(uint32_t buffer, uint16_t stamp) {
    registers.TXBRP &= ~(1U << buffer);
    model.event[model.event_count] = (FDCAN_TxEventFifoTypeDef){.Identifier = model.header[buffer].Identifier,
                                                                .TxTimestamp = stamp,
                                                                .MessageMarker = model.header[buffer].MessageMarker};
    model.event_count++;
}

static void arrive(uint32_t id, uint32_t format, uint32_t length, uint16_t stamp) {
    model.received[model.received_count] = (FDCAN_RxHeaderTypeDef){.Identifier = id,
                                                                   .IdType = format & FDCAN_EXTENDED_ID,
                                                                   .RxFrameType = format & FDCAN_REMOTE_FRAME,
                                                                   .DataLength = length * FDCAN_DLC_BYTES_1,
                                                                   .RxTimestamp = stamp};
    model.received_count++;
}

static void interrupt(void) {
    HAL_FDCAN_RxFifo0Callback(&controller, FDCAN_IT_RX_FIFO0_NEW_MESSAGE);
}

static bool start(uint32_t clock_hz) {
    const hal_fdcan_config_t config = {&controller, clock_hz, &timer, &port, ESTOP};
    return hal_fdcan_start(&self, &config);
}

void setUp(void) {
    memset(&model, 0, sizeof model);
    memset(&registers, 0, sizeof registers);
    memset(&self, 0xA5, sizeof self);
    controller.Instance = &registers;
    TEST_ASSERT_TRUE(start(80000000));
    hal = hal_fdcan(&self);
}

TEST(test_fdcan_start_has_the_bit_timing_of_the_wheels) {
    const FDCAN_InitTypeDef *const init = &controller.Init;
    TEST_ASSERT_EQUAL_UINT32(10, init->NominalPrescaler);
    TEST_ASSERT_EQUAL_UINT32(8, 1U + init->NominalTimeSeg1 + init->NominalTimeSeg2);
    TEST_ASSERT_EQUAL_UINT32(5, 1U + init->NominalTimeSeg1); // 62.5 %.
    TEST_ASSERT_EQUAL_INT(ENABLE, init->AutoRetransmission);
    TEST_ASSERT_EQUAL_HEX32(FDCAN_TX_QUEUE_OPERATION, init->TxFifoQueueMode); // A FIFO cannot be cancelled.
    TEST_ASSERT_TRUE(model.accepts_remote);
    TEST_ASSERT_FALSE(start(170000000));
    TEST_ASSERT_FALSE(start(4000000));
    TEST_ASSERT_FALSE(start(0));
}

TEST(test_fdcan_echo_comes_only_after_the_acknowledgement) {
    TEST_ASSERT_EQUAL_INT(2, send_pair(&hal, 10));
    TEST_ASSERT_EQUAL_UINT32(0, model.requested_unmasked);
    TEST_ASSERT_EQUAL_UINT32(0, model.masked);
    interrupt();
    expect_none(&hal);
    acknowledge(0, 100);
    acknowledge(1, 200);
    HAL_FDCAN_TxEventFifoCallback(&controller, FDCAN_IT_TX_EVT_FIFO_NEW_DATA);
    expect_echoes(&hal, 10);
    expect_none(&hal);
}

TEST(test_fdcan_send_refuses_a_pair_while_one_id_waits) {
    const iw_can_frame_t right = setpoint(RIGHT, 0);
    TEST_ASSERT_EQUAL_INT(2, send_pair(&hal, 10));
    acknowledge(1, 100); // Only the right one: no older frame of its id waits.
    TEST_ASSERT_EQUAL_INT(0, send_pair(&hal, 11));
    TEST_ASSERT_EQUAL_INT(1, hal.send(hal.context, &right, 1));
    TEST_ASSERT_EQUAL_INT(0, hal.send(hal.context, &right, 1));
    registers.TXBRP = 0;
    registers.TXBAR = 1; // The controller has not noticed the request yet.
    TEST_ASSERT_EQUAL_INT(0, send_pair(&hal, 12));
}

TEST(test_fdcan_frames_and_echoes_have_the_order_of_the_bus) {
    TEST_ASSERT_EQUAL_INT(2, send_pair(&hal, 10));
    acknowledge(0, 65000);
    acknowledge(1, 300); // The stamp has wrapped.
    arrive(0x100, 0, 8, 64000);
    arrive(0x120, 0, 8, 100);
    arrive(0x101, 0, 8, 500);
    interrupt();
    expect_frame(&hal, 0x100, IW_CAN_RECEIVED, 0);
    expect_frame(&hal, LEFT, IW_CAN_ECHO, 10);
    expect_frame(&hal, 0x120, IW_CAN_RECEIVED, 0);
    expect_frame(&hal, RIGHT, IW_CAN_ECHO, 10);
    expect_frame(&hal, 0x101, IW_CAN_RECEIVED, 0);
    expect_none(&hal);
}

TEST(test_fdcan_receive_marks_remote_and_extended_frames) {
    iw_can_frame_t frame;
    arrive(0x100, FDCAN_REMOTE_FRAME, 8, 1);
    arrive(0x100, FDCAN_EXTENDED_ID, 15, 2);
    interrupt();
    expect_frame(&hal, 0x100U | IW_CAN_REMOTE, IW_CAN_RECEIVED, 0);
    TEST_ASSERT_EQUAL_INT(1, hal.receive(hal.context, &frame));
    TEST_ASSERT_EQUAL_HEX32(0x100U | IW_CAN_EXTENDED, frame.id);
    TEST_ASSERT_EQUAL_UINT8(8, frame.dlc);
}

TEST(test_fdcan_lost_frames_are_reported_once) {
    HAL_FDCAN_RxFifo0Callback(&controller, FDCAN_IT_RX_FIFO0_MESSAGE_LOST);
    expect_frame(&hal, IW_CAN_ERROR, IW_CAN_RECEIVED, 0);
    expect_none(&hal);
    HAL_FDCAN_TxEventFifoCallback(&controller, FDCAN_IT_TX_EVT_FIFO_ELT_LOST);
    expect_frame(&hal, IW_CAN_ERROR, IW_CAN_RECEIVED, 0);
    expect_none(&hal);
    for (uint32_t i = 0; i < BRD_FRAME_RING_LENGTH + 1U; i++) {
        arrive(0x100, 0, 8, 1);
        interrupt();
    }
    expect_frame(&hal, IW_CAN_ERROR, IW_CAN_RECEIVED, 0);
}

TEST(test_fdcan_purge_removes_every_frame_and_echo) {
    TEST_ASSERT_EQUAL_INT(2, send_pair(&hal, 10));
    acknowledge(0, 100);
    interrupt(); // Its echo is in the ring.
    acknowledge(1, 200);
    arrive(0x100, 0, 8, 300);
    TEST_ASSERT_EQUAL_INT(1, hal.purge(hal.context));
    interrupt();
    expect_frame(&hal, 0x100, IW_CAN_RECEIVED, 0);
    expect_none(&hal);
    TEST_ASSERT_EQUAL_INT(2, send_pair(&hal, 11));
    acknowledge(0, 400);
    acknowledge(1, 500);
    interrupt();
    expect_echoes(&hal, 11);
}

TEST(test_fdcan_purge_with_a_frame_on_the_bus_is_limited) {
    TEST_ASSERT_EQUAL_INT(2, send_pair(&hal, 10));
    model.on_bus = 1;
    TEST_ASSERT_EQUAL_INT(0, hal.purge(hal.context));
    acknowledge(0, 100);
    interrupt();
    expect_frame(&hal, LEFT, IW_CAN_ECHO, 10); // It was not purged.
    TEST_ASSERT_EQUAL_INT(1, hal.purge(hal.context));
    TEST_ASSERT_EQUAL_UINT32(0, registers.TXBRP);
}

TEST(test_fdcan_bus_off_is_reported_and_drops_all_frames) {
    TEST_ASSERT_EQUAL_INT(2, send_pair(&hal, 10));
    acknowledge(0, 100);
    interrupt();
    registers.CCCR = FDCAN_CCCR_INIT;
    model.status.BusOff = 1;
    TEST_ASSERT_EQUAL_INT(-1, send_pair(&hal, 11));
    expect_state(&hal, IW_BUS_OFF);
    expect_none(&hal);
    TEST_ASSERT_EQUAL_UINT32(0, registers.TXBRP);
    TEST_ASSERT_EQUAL_UINT32(2, model.starts);
    expect_state(&hal, IW_BUS_OFF); // The recovery runs; another restart would begin it again.
    TEST_ASSERT_EQUAL_UINT32(2, model.starts);
    TEST_ASSERT_EQUAL_INT(-1, send_pair(&hal, 12)); // It would leave late, after the recovery.
    model.status.BusOff = 0;
    expect_state(&hal, IW_BUS_ACTIVE);
    model.status.ErrorPassive = 1;
    expect_state(&hal, IW_BUS_PASSIVE);
    registers.CCCR = FDCAN_CCCR_INIT; // Not a bus-off: a reset of the controller.
    expect_state(&hal, IW_BUS_DOWN);
}

TEST(test_fdcan_estop_reports_level_and_short_edges) {
    TEST_ASSERT_EQUAL_INT(0, hal.estop_pressed(hal.context));
    HAL_GPIO_EXTI_Callback(ESTOP << 1);
    TEST_ASSERT_EQUAL_INT(0, hal.estop_pressed(hal.context));
    HAL_GPIO_EXTI_Callback(ESTOP);
    TEST_ASSERT_EQUAL_INT(1, hal.estop_pressed(hal.context));
    TEST_ASSERT_EQUAL_INT(0, hal.estop_pressed(hal.context));
    model.level = GPIO_PIN_SET; // Pressed, or the wire is broken.
    TEST_ASSERT_EQUAL_INT(1, hal.estop_pressed(hal.context));
}

TEST(test_fdcan_time_continues_when_the_timer_wraps) {
    timer.counter = UINT32_MAX;
    TEST_ASSERT_EQUAL_UINT64(UINT32_MAX, hal_fdcan_time_us(&self));
    timer.counter = 9;
    TEST_ASSERT_EQUAL_UINT64((iw_time_us_t)UINT32_MAX + 10U, hal_fdcan_time_us(&self));
}
