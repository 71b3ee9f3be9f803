// SPDX-License-Identifier: MIT
/// One GPIO line behind both generations of libgpiod: the values that a test sets, and the request of the code under test.
#ifndef TEST_FAKE_GPIO_H
#define TEST_FAKE_GPIO_H

#include <stdbool.h>

typedef struct {
    int level;       ///< Level of the line; -1: it cannot be read.
    int edges;       ///< Edges that wait to be read.
    int edges_error; ///< errno of reading edges; 0: none; -1: a read without an edge is no error.
    int chip_error;  ///< errno of opening the chip; 0: it opens.
    int busy_error;  ///< errno of requesting the line; 0: the request succeeds.
    int twin; ///< 0: the line's name is unique; 1: another line of its chip has it; 2: one of another chip; 3: the
              ///< line with its offset of another chip.
    int link; ///< 0: its chip has one node; 1, 2: a link to it is listed before, or after, the node.

    const char *label; ///< Label of the line's chip; NULL: FAKE_GPIO_LABEL.
    bool unnamed;      ///< The line has no name of its own.

    bool is_input;
    bool pulled_up;
    bool both_edges;
    unsigned buffer_size; ///< Requested size of the kernel's edge buffer.
    unsigned offset;      ///< Requested offset.
    int open;             ///< Chips that are open.
    int requested;        ///< Lines that are requested.
    int reads;            ///< Reads of edges.
    int ends[2];          ///< A pipe: the first is the line's descriptor.
} fake_gpio_t;

extern fake_gpio_t fake_gpio;

/// Name of a line of the line's own chip, or of the other chip.
const char *fake_gpio_name(bool own, unsigned offset);

/// Label of the line's own chip.
const char *fake_gpio_label(void);

/// Returns the number of edges that one read returns.
int fake_gpio_take(unsigned buffer_size);

/// The line's own chip, its label, the line's name and its offset.
#define FAKE_GPIO_CHIP   "gpiochip3"
#define FAKE_GPIO_LABEL  "pinctrl-fake"
#define FAKE_GPIO_NAME   "ESTOP"
#define FAKE_GPIO_OFFSET 17U
/// The link to the line's own chip. The kernel knows only the chip's own name.
#define FAKE_GPIO_LINK "gpiochip4"
/// Lines of each chip.
#define FAKE_GPIO_LINES 32U

#endif
