// SPDX-License-Identifier: MIT
// Only what examples/hal uses, after the documentation of ESP-IDF. The real header has more and other values.
#ifndef TWAI_H
#define TWAI_H

#include "driver/gpio.h"

#include <stdint.h>

typedef uint32_t TickType_t;
typedef enum { TWAI_MODE_NORMAL, TWAI_MODE_NO_ACK, TWAI_MODE_LISTEN_ONLY } twai_mode_t;
typedef enum { TWAI_STATE_STOPPED, TWAI_STATE_RUNNING, TWAI_STATE_BUS_OFF, TWAI_STATE_RECOVERING } twai_state_t;

typedef struct {
    twai_mode_t mode;
    gpio_num_t tx_io;
    gpio_num_t rx_io;
    uint32_t tx_queue_len;
    uint32_t rx_queue_len;
} twai_general_config_t;

typedef struct {
    uint32_t quanta_resolution_hz;
    uint32_t brp;
    uint8_t tseg_1;
    uint8_t tseg_2;
    uint8_t sjw;
} twai_timing_config_t;

typedef struct {
    uint32_t acceptance_code;
    uint32_t acceptance_mask;
} twai_filter_config_t;

typedef struct {
    uint32_t extd : 1;
    uint32_t rtr : 1;
    uint32_t ss : 1;
    uint32_t self : 1;
    uint32_t identifier;
    uint8_t data_length_code;
    uint8_t data[8];
} twai_message_t;

typedef struct {
    twai_state_t state;
    uint32_t msgs_to_tx;
    uint32_t tx_error_counter;
    uint32_t rx_error_counter;
    uint32_t rx_missed_count;
    uint32_t rx_overrun_count;
} twai_status_info_t;

#define TWAI_GENERAL_CONFIG_DEFAULT(tx_pin, rx_pin, op_mode)                                                           \
    { .mode = (op_mode), .tx_io = (tx_pin), .rx_io = (rx_pin), .tx_queue_len = 5, .rx_queue_len = 5 }
#define TWAI_FILTER_CONFIG_ACCEPT_ALL()                                                                                \
    { .acceptance_code = 0, .acceptance_mask = UINT32_MAX }

esp_err_t twai_driver_install(const twai_general_config_t *general, const twai_timing_config_t *timing,
                              const twai_filter_config_t *filter);
esp_err_t twai_start(void);
esp_err_t twai_stop(void);
esp_err_t twai_transmit(const twai_message_t *message, TickType_t ticks);
esp_err_t twai_receive(twai_message_t *message, TickType_t ticks);
esp_err_t twai_get_status_info(twai_status_info_t *status);
esp_err_t twai_initiate_recovery(void);
esp_err_t twai_clear_receive_queue(void);

#endif
