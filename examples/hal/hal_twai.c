// SPDX-License-Identifier: MIT
#include "hal_twai.h"

#include "driver/twai.h"
#include "esp_timer.h"
#include "iwheel/bit_timing.h"

#include <string.h>

#define QUEUE_RECEIVE 64U // 3 ms of a full bus.
#define QUEUE_SEND    1U
#define ROOM          (1U + QUEUE_SEND) // Buffer of the controller and queue.
#define PASSIVE       128U              // Error counter of a controller that is error passive.
#define QUANTUM_HZ    (8U * IW_BUS_BITRATE_HZ)

static void on_estop(void *argument) {
    hal_twai_t *const self = argument;
    atomic_store(&self->estop_set, true);
}

static bool start_estop(hal_twai_t *self) {
    const gpio_config_t config = {.pin_bit_mask = 1ULL << self->pins.estop,
                                  .mode = GPIO_MODE_INPUT,
                                  .pull_up_en = GPIO_PULLUP_ENABLE,
                                  .intr_type = GPIO_INTR_ANYEDGE};
    return gpio_config(&config) == ESP_OK && gpio_install_isr_service(0) == ESP_OK &&
           gpio_isr_handler_add(self->pins.estop, on_estop, self) == ESP_OK;
}

bool hal_twai_start(hal_twai_t *self, const hal_twai_pins_t *pins) {
    memset(self, 0, sizeof *self);
    self->pins = *pins;
    twai_general_config_t general = TWAI_GENERAL_CONFIG_DEFAULT(pins->tx, pins->rx, TWAI_MODE_NORMAL);
    general.tx_queue_len = QUEUE_SEND;
    general.rx_queue_len = QUEUE_RECEIVE;
    const twai_timing_config_t timing = {.quanta_resolution_hz = QUANTUM_HZ, .tseg_1 = 4, .tseg_2 = 3, .sjw = 1};
    const twai_filter_config_t all = TWAI_FILTER_CONFIG_ACCEPT_ALL(); // The core counts frames in every format.
    return start_estop(self) && twai_driver_install(&general, &timing, &all) == ESP_OK && twai_start() == ESP_OK;
}

static twai_message_t message_of(const iw_can_frame_t *frame) {
    twai_message_t message = {.identifier = frame->id, .data_length_code = frame->dlc, .self = 1};
    memcpy(message.data, frame->data, sizeof frame->data);
    return message;
}

static void forget_oldest(hal_twai_t *self, uint32_t count) {
    self->waits -= count;
    memmove(&self->waiting[0], &self->waiting[count], self->waits * sizeof self->waiting[0]);
}

static void remember(hal_twai_t *self, const iw_can_frame_t *frame) {
    if (self->waits == HAL_TWAI_WAITING) {
        forget_oldest(self, 1); // Its echo was lost in a full queue.
    }
    self->waiting[self->waits++] = *frame;
}

static int send(void *context, const iw_can_frame_t *frames, uint32_t count) {
    hal_twai_t *const self = context;
    twai_status_info_t status;
    uint32_t accepted = 0;
    if (twai_get_status_info(&status) != ESP_OK || status.state != TWAI_STATE_RUNNING) {
        return -1;
    }
    if (status.msgs_to_tx + count > ROOM) {
        return 0;
    }
    while (accepted < count) {
        const twai_message_t message = message_of(&frames[accepted]);
        if (twai_transmit(&message, 0) != ESP_OK) {
            break;
        }
        remember(self, &frames[accepted]);
        accepted++;
    }
    return (int)accepted;
}

static bool is_echo(hal_twai_t *self, const iw_can_frame_t *frame) {
    for (uint32_t i = 0; i < self->waits; i++) {
        const iw_can_frame_t *const sent = &self->waiting[i];
        if (sent->id == frame->id && sent->dlc == frame->dlc && memcmp(sent->data, frame->data, frame->dlc) == 0) {
            forget_oldest(self, i + 1U); // The echoes of older frames were lost: the order is that of the requests.
            return true;
        }
    }
    return false;
}

static bool has_lost(hal_twai_t *self) {
    twai_status_info_t status;
    if (twai_get_status_info(&status) == ESP_OK && status.rx_missed_count + status.rx_overrun_count != self->losses) {
        self->losses = status.rx_missed_count + status.rx_overrun_count;
        self->has_lost = true;
    }
    return self->has_lost;
}

static int receive(void *context, iw_can_frame_t *out_frame) {
    hal_twai_t *const self = context;
    twai_message_t message;
    if (has_lost(self)) {
        self->has_lost = false;
        *out_frame = (iw_can_frame_t){.id = IW_CAN_ERROR, .kind = IW_CAN_RECEIVED};
        return 1;
    }
    if (twai_receive(&message, 0) != ESP_OK) {
        return 0;
    }
    *out_frame = (iw_can_frame_t){.id = message.identifier, .kind = IW_CAN_RECEIVED};
    out_frame->id |= message.extd ? IW_CAN_EXTENDED : 0U;
    out_frame->id |= message.rtr ? IW_CAN_REMOTE : 0U;
    out_frame->dlc = (message.data_length_code < IW_CAN_DATA_MAX) ? message.data_length_code : IW_CAN_DATA_MAX;
    memcpy(out_frame->data, message.data, out_frame->dlc);
    if (is_echo(self, out_frame)) {
        out_frame->kind = IW_CAN_ECHO;
    }
    return 1;
}

static void drop(hal_twai_t *self) {
    self->waits = 0;
    (void)twai_clear_receive_queue();
}

/// The recovery ends in the stopped state; the start after it drops what was received in between.
static iw_bus_state_t bus_state(void *context) {
    hal_twai_t *const self = context;
    twai_status_info_t status;
    if (twai_get_status_info(&status) != ESP_OK) {
        return IW_BUS_DOWN;
    }
    switch (status.state) {
    case TWAI_STATE_RUNNING:
        return (status.tx_error_counter < PASSIVE && status.rx_error_counter < PASSIVE) ? IW_BUS_ACTIVE
                                                                                        : IW_BUS_PASSIVE;
    case TWAI_STATE_BUS_OFF:
        drop(self);
        (void)twai_initiate_recovery(); // Empties the queue of frames to send.
        return IW_BUS_OFF;
    case TWAI_STATE_RECOVERING:
        return IW_BUS_OFF;
    default:
        drop(self);
        (void)twai_start();
        return IW_BUS_DOWN;
    }
}

/// Off the bus `twai_stop` refuses. Then nothing is sent, and the recovery drops all frames.
static int purge(void *context) {
    hal_twai_t *const self = context;
    if (twai_stop() != ESP_OK) {
        return 0;
    }
    drop(self);
    self->has_lost = true;
    (void)twai_start(); // If it fails, `bus_state` reports it and tries again.
    return 1;
}

static int estop_pressed(void *context) {
    hal_twai_t *const self = context;
    const bool had_edge = atomic_exchange(&self->estop_set, false);
    return (had_edge || gpio_get_level(self->pins.estop) != 0) ? 1 : 0;
}

iw_hal_t hal_twai(hal_twai_t *self) {
    return (iw_hal_t){.send = send,
                      .receive = receive,
                      .bus_state = bus_state,
                      .purge = purge,
                      .estop_pressed = estop_pressed,
                      .context = self};
}

iw_time_us_t hal_twai_time_us(void) {
    return (iw_time_us_t)esp_timer_get_time(); // 64 bits.
}
