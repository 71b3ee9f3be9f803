// SPDX-License-Identifier: MIT
#include "hal_fdcan.h"

#include "iwheel/bit_timing.h"
#include "iwheel/codec.h"

#include <string.h>

#define QUANTUM_HZ    (8U * IW_BUS_BITRATE_HZ)
#define PRESCALER_MAX 512U
#define DRAIN_MAX     16U   // More than both FIFOs hold: the rest raises the interrupt again.
#define POLL_CYCLES   8U    // At least, for two registers.
#define CANCEL_HZ     4000U // 250 us: longer than the longest frame with an error at its end.
#define INTERRUPTS                                                                                                     \
    (FDCAN_IT_RX_FIFO0_NEW_MESSAGE | FDCAN_IT_RX_FIFO0_MESSAGE_LOST | FDCAN_IT_TX_EVT_FIFO_NEW_DATA |                  \
     FDCAN_IT_TX_EVT_FIFO_ELT_LOST)

static hal_fdcan_t *active; // The callbacks of ST's HAL have no argument of their own.

static bool configure(FDCAN_HandleTypeDef *controller, uint32_t clock_hz) {
    FDCAN_InitTypeDef *const init = &controller->Init;
    init->ClockDivider = FDCAN_CLOCK_DIV1;
    init->FrameFormat = FDCAN_FRAME_CLASSIC;
    init->Mode = FDCAN_MODE_NORMAL;
    init->AutoRetransmission = ENABLE;
    init->TransmitPause = DISABLE;
    init->ProtocolException = ENABLE; // An FD frame of another node is not destroyed.
    init->NominalPrescaler = clock_hz / QUANTUM_HZ;
    init->NominalTimeSeg1 = 4;
    init->NominalTimeSeg2 = 3;
    init->NominalSyncJumpWidth = 1;
    init->TxFifoQueueMode = FDCAN_TX_QUEUE_OPERATION;
    // All ids in every format: the core counts them.
    return HAL_FDCAN_Init(controller) == HAL_OK &&
           HAL_FDCAN_ConfigGlobalFilter(controller, FDCAN_ACCEPT_IN_RX_FIFO0, FDCAN_ACCEPT_IN_RX_FIFO0,
                                        FDCAN_FILTER_REMOTE, FDCAN_FILTER_REMOTE) == HAL_OK &&
           HAL_FDCAN_ConfigTimestampCounter(controller, FDCAN_TIMESTAMP_PRESC_1) == HAL_OK &&
           HAL_FDCAN_EnableTimestampCounter(controller, FDCAN_TIMESTAMP_INTERNAL) == HAL_OK &&
           HAL_FDCAN_ActivateNotification(controller, INTERRUPTS, 0) == HAL_OK;
}

bool hal_fdcan_start(hal_fdcan_t *self, const hal_fdcan_config_t *config) {
    const uint32_t prescaler = config->clock_hz / QUANTUM_HZ;
    memset(self, 0, sizeof *self);
    self->config = *config;
    active = self;
    if (prescaler == 0U || prescaler > PRESCALER_MAX || config->clock_hz % QUANTUM_HZ != 0U) {
        return false;
    }
    return configure(config->controller, config->clock_hz) && HAL_FDCAN_Start(config->controller) == HAL_OK;
}

/// A request moves from TXBAR to TXBRP when the controller has noticed it, so TXBAR must be read first.
static uint32_t read_pending(const hal_fdcan_t *self) {
    const uint32_t requested = self->config.controller->Instance->TXBAR;
    return requested | self->config.controller->Instance->TXBRP;
}

static bool in_init(const hal_fdcan_t *self) {
    return (self->config.controller->Instance->CCCR & FDCAN_CCCR_INIT) != 0U;
}

/// After the restart of bus-off INIT is 0, and BO remains set until the controller is on the bus again.
static bool is_off(const hal_fdcan_t *self) {
    FDCAN_ProtocolStatusTypeDef status;
    return in_init(self) || HAL_FDCAN_GetProtocolStatus(self->config.controller, &status) != HAL_OK ||
           status.BusOff != 0U;
}

static bool has_room(const hal_fdcan_t *self, const iw_can_frame_t *frames, uint32_t count) {
    const uint32_t pending = read_pending(self);
    bool room = true; // At most two of three buffers are in use. The free level is always 0 in queue mode.
    for (uint32_t i = 0; i < count; i++) {
        room = room && (pending & self->buffer[iw_codec_side(frames[i].id)]) == 0U;
    }
    return room;
}

/// The length codes of ST's HAL are the number of bytes, in older versions shifted.
static bool request(hal_fdcan_t *self, const iw_can_frame_t *frame) {
    const uint8_t marker = self->next_marker;
    uint8_t data[IW_CAN_DATA_MAX]; // Older versions of ST's HAL do not receive it as const.
    FDCAN_TxHeaderTypeDef header = {.Identifier = frame->id,
                                    .IdType = FDCAN_STANDARD_ID,
                                    .TxFrameType = FDCAN_DATA_FRAME,
                                    .DataLength = frame->dlc * FDCAN_DLC_BYTES_1,
                                    .ErrorStateIndicator = FDCAN_ESI_ACTIVE,
                                    .BitRateSwitch = FDCAN_BRS_OFF,
                                    .FDFormat = FDCAN_CLASSIC_CAN,
                                    .TxEventFifoControl = FDCAN_STORE_TX_EVENTS,
                                    .MessageMarker = marker};
    self->sent[marker] = *frame;
    self->sent[marker].kind = IW_CAN_ECHO;
    self->sent_epoch[marker] = self->epoch;
    memcpy(data, frame->data, sizeof data);
    if (HAL_FDCAN_AddMessageToTxFifoQ(self->config.controller, &header, data) != HAL_OK) {
        return false;
    }
    self->next_marker = (uint8_t)((marker + 1U) % HAL_FDCAN_SENT);
    self->buffer[iw_codec_side(frame->id)] = HAL_FDCAN_GetLatestTxFifoQRequestBuffer(self->config.controller);
    return true;
}

static int send(void *context, const iw_can_frame_t *frames, uint32_t count) {
    hal_fdcan_t *const self = context;
    uint32_t accepted = 0;
    if (is_off(self)) {
        return -1;
    }
    if (!has_room(self, frames, count)) {
        return 0;
    }
    const uint32_t masked = __get_PRIMASK();
    __disable_irq();
    while (accepted < count && request(self, &frames[accepted])) {
        accepted++;
    }
    __set_PRIMASK(masked);
    return (int)accepted;
}

static void put(hal_fdcan_t *self, const iw_can_frame_t *frame, uint8_t epoch) {
    if (!brd_frame_ring_put(&self->ring, frame, epoch)) {
        self->lost++;
    }
}

static void put_received(hal_fdcan_t *self, const FDCAN_RxHeaderTypeDef *header, const uint8_t *data) {
    const uint32_t length = header->DataLength / FDCAN_DLC_BYTES_1;
    iw_can_frame_t frame = {.id = header->Identifier, .kind = IW_CAN_RECEIVED};
    frame.id |= (header->IdType == FDCAN_EXTENDED_ID) ? IW_CAN_EXTENDED : 0U;
    frame.id |= (header->RxFrameType == FDCAN_REMOTE_FRAME) ? IW_CAN_REMOTE : 0U;
    frame.dlc = (uint8_t)((length < IW_CAN_DATA_MAX) ? length : IW_CAN_DATA_MAX);
    memcpy(frame.data, data, frame.dlc);
    put(self, &frame, 0);
}

static void put_echo(hal_fdcan_t *self, const FDCAN_TxEventFifoTypeDef *event) {
    const uint32_t marker = event->MessageMarker % HAL_FDCAN_SENT;
    put(self, &self->sent[marker], self->sent_epoch[marker]);
}

static bool read_frame(FDCAN_HandleTypeDef *controller, FDCAN_RxHeaderTypeDef *header, uint8_t *data) {
    return HAL_FDCAN_GetRxFifoFillLevel(controller, FDCAN_RX_FIFO0) > 0U &&
           HAL_FDCAN_GetRxMessage(controller, FDCAN_RX_FIFO0, header, data) == HAL_OK;
}

/// Moves frames and TX events to the ring, the older one first. The stamps wrap; both FIFOs span less than half of that.
static void drain(hal_fdcan_t *self) {
    FDCAN_HandleTypeDef *const controller = self->config.controller;
    FDCAN_RxHeaderTypeDef header;
    FDCAN_TxEventFifoTypeDef event;
    uint8_t data[64]; // ST's HAL writes the length that it reads.
    bool has_frame = read_frame(controller, &header, data);
    bool has_event = HAL_FDCAN_GetTxEvent(controller, &event) == HAL_OK;
    for (uint32_t i = 0; i < DRAIN_MAX && (has_frame || has_event); i++) {
        const bool frame_first = has_frame && has_event && (int16_t)(header.RxTimestamp - event.TxTimestamp) < 0;
        if (frame_first || !has_event) {
            put_received(self, &header, data);
            has_frame = read_frame(controller, &header, data);
        } else {
            put_echo(self, &event);
            has_event = HAL_FDCAN_GetTxEvent(controller, &event) == HAL_OK;
        }
    }
    if (has_frame) {
        put_received(self, &header, data);
    }
    if (has_event) {
        put_echo(self, &event);
    }
}

void HAL_FDCAN_RxFifo0Callback(FDCAN_HandleTypeDef *controller, uint32_t interrupts) {
    (void)controller;
    if ((interrupts & FDCAN_IT_RX_FIFO0_MESSAGE_LOST) != 0U) {
        active->lost++;
    }
    drain(active);
}

void HAL_FDCAN_TxEventFifoCallback(FDCAN_HandleTypeDef *controller, uint32_t interrupts) {
    (void)controller;
    if ((interrupts & FDCAN_IT_TX_EVT_FIFO_ELT_LOST) != 0U) {
        active->lost++;
    }
    drain(active);
}

void HAL_GPIO_EXTI_Callback(uint16_t pin) {
    if (active != NULL && pin == active->config.estop_pin) {
        active->estop_edges++;
    }
}

static int receive(void *context, iw_can_frame_t *out_frame) {
    hal_fdcan_t *const self = context;
    const uint32_t lost = self->lost;
    iw_can_frame_t frame;
    uint8_t epoch;
    if (lost != self->lost_reported) {
        self->lost_reported = lost;
        *out_frame = (iw_can_frame_t){.id = IW_CAN_ERROR, .kind = IW_CAN_RECEIVED};
        return 1;
    }
    while (brd_frame_ring_take(&self->ring, &frame, &epoch)) {
        if (frame.kind == IW_CAN_RECEIVED || epoch == self->epoch) {
            *out_frame = frame;
            return 1;
        }
    }
    return 0;
}

/// Off the bus. `HAL_FDCAN_Stop` sets CCE, which drops all frames in the controller.
static void restart(hal_fdcan_t *self) {
    iw_can_frame_t frame;
    uint8_t epoch;
    const bool stopped = HAL_FDCAN_Stop(self->config.controller) == HAL_OK;
    while (brd_frame_ring_take(&self->ring, &frame, &epoch)) {
        // Frames from before the loss.
    }
    if (stopped) {
        (void)HAL_FDCAN_Start(self->config.controller);
    }
}

/// Bus-off sets INIT, so each bus-off leads to one restart.
static iw_bus_state_t bus_state(void *context) {
    hal_fdcan_t *const self = context;
    FDCAN_ProtocolStatusTypeDef status;
    if (HAL_FDCAN_GetProtocolStatus(self->config.controller, &status) != HAL_OK) {
        return IW_BUS_DOWN;
    }
    if (in_init(self)) {
        restart(self);
        return (status.BusOff != 0U) ? IW_BUS_OFF : IW_BUS_DOWN;
    }
    if (status.BusOff != 0U) {
        return IW_BUS_OFF;
    }
    return (status.ErrorPassive != 0U) ? IW_BUS_PASSIVE : IW_BUS_ACTIVE;
}

static int purge(void *context) {
    hal_fdcan_t *const self = context;
    (void)HAL_FDCAN_AbortTxRequest(self->config.controller, FDCAN_TX_BUFFER0 | FDCAN_TX_BUFFER1 | FDCAN_TX_BUFFER2);
    for (uint32_t poll = 0; poll < SystemCoreClock / POLL_CYCLES / CANCEL_HZ; poll++) {
        if (read_pending(self) == 0U) {
            self->epoch++; // Their echoes have the old epoch.
            return 1;
        }
    }
    return 0; // A frame without purge still has an echo.
}

static int estop_pressed(void *context) {
    hal_fdcan_t *const self = context;
    const uint32_t edges = self->estop_edges;
    const bool had_edge = edges != self->estop_edges_seen;
    self->estop_edges_seen = edges;
    const GPIO_PinState level = HAL_GPIO_ReadPin(self->config.estop_port, self->config.estop_pin);
    return (had_edge || level == GPIO_PIN_SET) ? 1 : 0;
}

iw_hal_t hal_fdcan(hal_fdcan_t *self) {
    return (iw_hal_t){.send = send,
                      .receive = receive,
                      .bus_state = bus_state,
                      .purge = purge,
                      .estop_pressed = estop_pressed,
                      .context = self};
}

iw_time_us_t hal_fdcan_time_us(hal_fdcan_t *self) {
    self->time_us += (uint32_t)(__HAL_TIM_GET_COUNTER(self->config.timer) - (uint32_t)self->time_us);
    return self->time_us;
}
