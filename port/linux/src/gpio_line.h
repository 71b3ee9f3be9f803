// SPDX-License-Identifier: MIT
/// One input line of a GPIO chip with both its edges. Two implementations, one per generation of libgpiod: gpio_v1.c
/// and gpio_v2.c; CMake takes the one that is installed.
#ifndef IW_GPIO_LINE_H
#define IW_GPIO_LINE_H

#include "gpio_address.h"

typedef struct {
    void *chip;
    void *line;   ///< v1: the line; v2: the request.
    void *events; ///< v2: where edges are read to.
    int fd;       ///< Readable when there is an edge; -1: closed.
} iw_gpio_line_t;

/// Takes the line as input with pull-up and both edges. 0, or an errno, `*self` then closed: ENOENT no such line or
/// chip, EBUSY somebody else has it. Allocates.
int iw_gpio_line_open(iw_gpio_line_t *self, const iw_gpio_address_t *address);
void iw_gpio_line_close(iw_gpio_line_t *self);

/// 1 high, 0 low, < 0 cannot be read any more.
int iw_gpio_line_level(const iw_gpio_line_t *self);

/// Takes edges that have not been taken yet, IW_GPIO_EDGES_MAX at the most, without waiting. Their number, < 0 if the
/// line is gone.
#define IW_GPIO_EDGES_MAX 64
int iw_gpio_line_take_edges(iw_gpio_line_t *self);

#endif
