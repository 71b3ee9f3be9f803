// SPDX-License-Identifier: MIT
/// One GPIO line as both generations of libgpiod show it: what a test sets, and what it was asked for.
#ifndef TEST_FAKE_GPIO_H
#define TEST_FAKE_GPIO_H

#include <stdbool.h>

typedef struct {
    int level;       ///< Of the line; -1: it cannot be read.
    int edges;       ///< That wait to be read.
    int edges_error; ///< errno of reading them; 0: none; -1: a read that brings nothing is no error.
    int chip_error;  ///< errno of opening the chip; 0: it opens.
    int busy_error;  ///< errno of asking for the line; 0: it is given.
    int twin;        ///< 0: the line's name is unique; 1: another line of its chip has it; 2: one of another chip.

    const char *label; ///< Of the line's chip; NULL: FAKE_GPIO_LABEL.
    bool unnamed;      ///< The line has no name of its own.

    bool is_input;
    bool pulled_up;
    bool both_edges;
    unsigned room;   ///< For edges that wait, with the kernel.
    unsigned offset; ///< That was asked for.
    int open;        ///< Chips open now.
    int requested;   ///< Lines held now.
    int reads;       ///< Of edges.
    int ends[2];     ///< A pipe: the first is the line's descriptor.
} fake_gpio_t;

extern fake_gpio_t fake_gpio;

/// Name of a line of the line's own chip, or of another one.
const char *fake_gpio_name(bool own, unsigned offset);

/// Label of the line's own chip.
const char *fake_gpio_label(void);

/// How many edges one read takes.
int fake_gpio_take(unsigned room);

/// The line's own chip, its name and its offset there.
#define FAKE_GPIO_CHIP   "gpiochip3"
#define FAKE_GPIO_LABEL  "pinctrl-fake"
#define FAKE_GPIO_NAME   "ESTOP"
#define FAKE_GPIO_OFFSET 17U
/// Lines of each chip.
#define FAKE_GPIO_LINES 32U

#endif
