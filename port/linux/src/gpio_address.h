// SPDX-License-Identifier: MIT
/// How a GPIO line is named in the configuration: by its own name, or as `gpiochipN:OFFSET`. Pure function.
#ifndef IW_GPIO_ADDRESS_H
#define IW_GPIO_ADDRESS_H

#include "iwheel/types.h"

/// The kernel's names have at most 31 characters.
#define IW_GPIO_NAME_SIZE 32U

typedef struct {
    char name[IW_GPIO_NAME_SIZE]; ///< Of the chip (`by_offset`) or of the line.
    unsigned offset;
    bool by_offset;
} iw_gpio_address_t;

/// 0, or EINVAL (it begins like an address by offset and is none) or ENAMETOOLONG, `*out_address` untouched.
int iw_gpio_address_parse(const char *text, iw_gpio_address_t *out_address);

#endif
