// SPDX-License-Identifier: MIT
// The example HAL of ESP-IDF's TWAI driver, against a model of that driver.
#include "hal_twai.h"

#include "driver/twai.h"
#include "esp_timer.h"
#include "hal_check.h"

#include <string.h>

#define QUEUE 64U

static const hal_twai_pins_t pins = {.tx = 5, .rx = 4, .estop = 7};
static hal_twai_t self;
static iw_hal_t hal;

// The driver: frames to send, the first of them in the controller, and received frames.
static struct {
    twai_status_info_t status;
    twai_general_config_t general;
    twai_timing_config_t timing;
    twai_message_t to_send[QUEUE], received[QUEUE];
    uint32_t to_send_count, received_count;
    TickType_t longest_wait;
    int level;
    gpio_isr_t on_edge;
    void *on_edge_argument;
    esp_err_t install_result;
} model;

esp_err_t gpio_config(const gpio_config_t *config) {
    return (config->pin_bit_mask == 1ULL << pins.estop && config->intr_type == GPIO_INTR_ANYEDGE) ? ESP_OK : -1;
}

esp_err_t gpio_install_isr_service(int flags) {
    return (flags == 0) ? ESP_OK : -1;
}

esp_err_t gpio_isr_handler_add(gpio_num_t pin, gpio_isr_t handler, void *argument) {
    model.on_edge = handler;
    model.on_edge_argument = argument;
    return (pin == pins.estop) ? ESP_OK : -1;
}

int gpio_get_level(gpio_num_t pin) {
    return (pin == pins.estop) ? model.level : 1;
}

int64_t esp_timer_get_time(void) {
    return 5000000000;
}

esp_err_t twai_driver_install(const twai_general_config_t *general, const twai_timing_config_t *timing,
                              const twai_filter_config_t *filter) {
    model.general = *general;
    model.timing = *timing;
    return (filter->acceptance_mask == UINT32_MAX) ? model.install_result : -1;
}

esp_err_t twai_start(void) {
    if (model.status.state != TWAI_STATE_STOPPED) {
        return ESP_ERR_INVALID_STATE;
    }
    model.to_send_count = 0;
    model.received_count = 0;
    model.status.state = TWAI_STATE_RUNNING;
    return ESP_OK;
}

esp_err_t twai_stop(void) {
    if (model.status.state != TWAI_STATE_RUNNING) {
        return ESP_ERR_INVALID_STATE;
    }
    model.to_send_count = 0;
    model.status.state = TWAI_STATE_STOPPED;
    return ESP_OK;
}

esp_err_t twai_transmit(const twai_message_t *message, TickType_t ticks) {
    model.longest_wait = (ticks > model.longest_wait) ? ticks : model.longest_wait;
    if (model.status.state != TWAI_STATE_RUNNING) {
        return ESP_ERR_INVALID_STATE;
    }
    if (model.to_send_count == 1U + model.general.tx_queue_len) {
        return ESP_ERR_TIMEOUT;
    }
    model.to_send[model.to_send_count++] = *message;
    return ESP_OK;
}

static void arrive(const twai_message_t *message) {
    if (model.received_count == model.general.rx_queue_len) {
        model.status.rx_missed_count++;
        return;
    }
    model.received[model.received_count++] = *message;
}

/// Another node acknowledges so many frames. With self-reception the controller receives them.
static void acknowledge(uint32_t count) {
    for (uint32_t i = 0; i < count; i++) {
        if (model.to_send[0].self != 0U) {
            twai_message_t message = model.to_send[0];
            message.self = 0; // The driver does not set it.
            arrive(&message);
        }
        model.to_send_count--;
        memmove(&model.to_send[0], &model.to_send[1], sizeof model.to_send - sizeof model.to_send[0]);
    }
}

esp_err_t twai_receive(twai_message_t *message, TickType_t ticks) {
    model.longest_wait = (ticks > model.longest_wait) ? ticks : model.longest_wait;
    if (model.received_count == 0U) {
        return ESP_ERR_TIMEOUT;
    }
    *message = model.received[0];
    model.received_count--;
    memmove(&model.received[0], &model.received[1], sizeof model.received - sizeof model.received[0]);
    return ESP_OK;
}

esp_err_t twai_get_status_info(twai_status_info_t *status) {
    model.status.msgs_to_tx = model.to_send_count;
    *status = model.status;
    return ESP_OK;
}

esp_err_t twai_initiate_recovery(void) {
    if (model.status.state != TWAI_STATE_BUS_OFF) {
        return ESP_ERR_INVALID_STATE;
    }
    model.to_send_count = 0;
    model.status.state = TWAI_STATE_RECOVERING;
    return ESP_OK;
}

esp_err_t twai_clear_receive_queue(void) {
    model.received_count = 0;
    return ESP_OK;
}

void setUp(void) {
    memset(&model, 0, sizeof model);
    memset(&self, 0xA5, sizeof self);
    TEST_ASSERT_TRUE(hal_twai_start(&self, &pins));
    hal = hal_twai(&self);
}

TEST(test_twai_start_has_the_bit_timing_of_the_wheels) {
    TEST_ASSERT_EQUAL_UINT32(8000000U, model.timing.quanta_resolution_hz);
    TEST_ASSERT_EQUAL_UINT32(8U, 1U + model.timing.tseg_1 + model.timing.tseg_2);
    TEST_ASSERT_EQUAL_UINT32(5U, 1U + model.timing.tseg_1); // 62.5 %.
    TEST_ASSERT_EQUAL_INT(TWAI_MODE_NORMAL, model.general.mode);
    TEST_ASSERT_EQUAL_UINT64(5000000000U, hal_twai_time_us());
    model.install_result = -1;
    TEST_ASSERT_FALSE(hal_twai_start(&self, &pins));
}

TEST(test_twai_echo_comes_only_after_the_acknowledgement) {
    TEST_ASSERT_EQUAL_INT(2, send_pair(&hal, 10));
    expect_none(&hal);
    acknowledge(1);
    expect_frame(&hal, LEFT, IW_CAN_ECHO, 10);
    expect_none(&hal);
    acknowledge(1);
    expect_frame(&hal, RIGHT, IW_CAN_ECHO, 10);
    expect_none(&hal);
    TEST_ASSERT_EQUAL_UINT32(0, model.longest_wait);
}

TEST(test_twai_send_without_room_accepts_no_part_of_a_pair) {
    const iw_can_frame_t right = setpoint(RIGHT, 0);
    TEST_ASSERT_EQUAL_INT(2, send_pair(&hal, 10));
    TEST_ASSERT_EQUAL_INT(0, send_pair(&hal, 11));
    acknowledge(1);
    TEST_ASSERT_EQUAL_INT(0, send_pair(&hal, 12));
    TEST_ASSERT_EQUAL_INT(1, hal.send(hal.context, &right, 1));
    TEST_ASSERT_EQUAL_UINT32(2, model.to_send_count);
}

TEST(test_twai_setpoint_of_another_master_is_no_echo) {
    twai_message_t foreign = {.identifier = LEFT, .data_length_code = 5, .data = {1, 0, 99}};
    arrive(&foreign);
    expect_frame(&hal, LEFT, IW_CAN_RECEIVED, 99);
    TEST_ASSERT_EQUAL_INT(2, send_pair(&hal, 10));
    foreign.data[2] = 11;
    arrive(&foreign);
    expect_frame(&hal, LEFT, IW_CAN_RECEIVED, 11);
    acknowledge(2);
    expect_echoes(&hal, 10);
    twai_message_t again = {.identifier = LEFT, .data_length_code = 5, .data = {1, 0, 10, 0, 100}};
    arrive(&again); // The bytes of an own frame that already has its echo.
    expect_frame(&hal, LEFT, IW_CAN_RECEIVED, 10);
}

TEST(test_twai_receive_marks_remote_and_extended_frames) {
    const twai_message_t remote = {.identifier = 0x100, .rtr = 1, .data_length_code = 8};
    const twai_message_t extended = {.identifier = 0x100, .extd = 1, .data_length_code = 15};
    iw_can_frame_t frame;
    arrive(&remote);
    expect_frame(&hal, 0x100U | IW_CAN_REMOTE, IW_CAN_RECEIVED, 0);
    arrive(&extended);
    TEST_ASSERT_EQUAL_INT(1, hal.receive(hal.context, &frame));
    TEST_ASSERT_EQUAL_HEX32(0x100U | IW_CAN_EXTENDED, frame.id);
    TEST_ASSERT_EQUAL_UINT8(8, frame.dlc);
}

TEST(test_twai_lost_frames_are_reported_once) {
    model.status.rx_overrun_count = 3;
    expect_frame(&hal, IW_CAN_ERROR, IW_CAN_RECEIVED, 0);
    expect_none(&hal);
}

TEST(test_twai_lost_echo_does_not_hide_later_ones) {
    for (uint8_t value = 0; value < 10U; value++) {
        TEST_ASSERT_EQUAL_INT(2, send_pair(&hal, value));
        acknowledge(2);
        model.received_count = 0; // Both echoes are lost.
    }
    TEST_ASSERT_EQUAL_INT(2, send_pair(&hal, 15));
    acknowledge(1);
    model.received_count = 0; // The echo of the left one is lost.
    acknowledge(1);
    expect_frame(&hal, RIGHT, IW_CAN_ECHO, 15);
    const twai_message_t foreign = {.identifier = LEFT, .data_length_code = 5, .data = {1, 0, 15, 0, 100}};
    arrive(&foreign);
    expect_frame(&hal, LEFT, IW_CAN_RECEIVED, 15);
    TEST_ASSERT_EQUAL_INT(2, send_pair(&hal, 20));
    acknowledge(2);
    expect_echoes(&hal, 20);
}

TEST(test_twai_purge_removes_every_frame_and_echo) {
    TEST_ASSERT_EQUAL_INT(2, send_pair(&hal, 10));
    acknowledge(1);
    TEST_ASSERT_EQUAL_INT(1, hal.purge(hal.context));
    TEST_ASSERT_EQUAL_UINT32(0, model.to_send_count);
    expect_frame(&hal, IW_CAN_ERROR, IW_CAN_RECEIVED, 0); // Received frames may be lost too.
    expect_none(&hal);
    expect_state(&hal, IW_BUS_ACTIVE);
    const twai_message_t foreign = {.identifier = LEFT, .data_length_code = 5, .data = {1, 0, 10, 0, 100}};
    arrive(&foreign);
    expect_frame(&hal, LEFT, IW_CAN_RECEIVED, 10);
    TEST_ASSERT_EQUAL_INT(2, send_pair(&hal, 11));
    acknowledge(2);
    expect_echoes(&hal, 11);
}

TEST(test_twai_bus_off_is_reported_and_drops_all_frames) {
    TEST_ASSERT_EQUAL_INT(2, send_pair(&hal, 10));
    acknowledge(1);
    model.status.state = TWAI_STATE_BUS_OFF;
    TEST_ASSERT_EQUAL_INT(0, hal.purge(hal.context));
    TEST_ASSERT_EQUAL_INT(-1, send_pair(&hal, 11));
    expect_state(&hal, IW_BUS_OFF);
    expect_none(&hal);
    TEST_ASSERT_EQUAL_UINT32(0, model.to_send_count);
    expect_state(&hal, IW_BUS_OFF);
    model.status.state = TWAI_STATE_STOPPED; // The recovery ends.
    expect_state(&hal, IW_BUS_DOWN);
    expect_state(&hal, IW_BUS_ACTIVE);
    model.status.tx_error_counter = 128;
    expect_state(&hal, IW_BUS_PASSIVE);
}

TEST(test_twai_estop_reports_level_and_short_edges) {
    TEST_ASSERT_EQUAL_INT(0, hal.estop_pressed(hal.context));
    model.on_edge(model.on_edge_argument);
    TEST_ASSERT_EQUAL_INT(1, hal.estop_pressed(hal.context));
    TEST_ASSERT_EQUAL_INT(0, hal.estop_pressed(hal.context));
    model.level = 1; // Pressed, or the wire is broken.
    TEST_ASSERT_EQUAL_INT(1, hal.estop_pressed(hal.context));
}
