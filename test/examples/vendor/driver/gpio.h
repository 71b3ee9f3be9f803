// SPDX-License-Identifier: MIT
// Only what examples/hal uses, after the documentation of ESP-IDF. The real header has more and other values.
#ifndef GPIO_H
#define GPIO_H

#include <stdint.h>

typedef int esp_err_t;
typedef int gpio_num_t;
typedef void (*gpio_isr_t)(void *argument);

#define ESP_OK                0
#define ESP_ERR_TIMEOUT       0x107
#define ESP_ERR_INVALID_STATE 0x103
#define GPIO_MODE_INPUT       1
#define GPIO_PULLUP_ENABLE    1
#define GPIO_INTR_ANYEDGE     3

typedef struct {
    uint64_t pin_bit_mask;
    int mode;
    int pull_up_en;
    int pull_down_en;
    int intr_type;
} gpio_config_t;

esp_err_t gpio_config(const gpio_config_t *config);
esp_err_t gpio_install_isr_service(int flags);
esp_err_t gpio_isr_handler_add(gpio_num_t pin, gpio_isr_t handler, void *argument);
int gpio_get_level(gpio_num_t pin);

#endif
