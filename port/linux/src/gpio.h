// SPDX-License-Identifier: MIT
/// What an e-stop on a GPIO line is made of: its address, the line, the release delay.
#ifndef IW_GPIO_H
#define IW_GPIO_H

#include "iwheel/types.h"
#include "iwheel_linux/backend.h"

/// How a GPIO line is named in the configuration: by its own name, or as `gpiochipN:OFFSET`.
///
/// The kernel's names have at most 31 characters.
#define IW_GPIO_NAME_SIZE IW_ESTOP_NAME_SIZE

typedef struct {
    char name[IW_GPIO_NAME_SIZE]; ///< Of the chip (`by_offset`) or of the line.
    unsigned offset;
    bool by_offset;
    iw_estop_seen_t expected; ///< What the line must be called; empty: it is not compared.
} iw_gpio_address_t;

/// 0, or EINVAL (it begins like an address by offset and is none) or ENAMETOOLONG, `*out_address` untouched.
int iw_gpio_address_parse(const char *text, iw_gpio_address_t *out_address);

/// One input line of a GPIO chip with both its edges. Two implementations, one per generation of libgpiod: gpio_v1.c
/// and gpio_v2.c; CMake takes the one that is installed.
typedef struct {
    void *chip;
    void *line;           ///< v1: the line; v2: the request.
    void *events;         ///< v2: where edges are read to.
    int fd;               ///< Readable when there is an edge; -1: closed.
    iw_estop_seen_t seen; ///< What the line is called.
} iw_gpio_line_t;

/// Takes the line as input with pull-up and both edges. 0, or an errno, `*self` then closed: ENOENT no such line or
/// chip, ENOTUNIQ two lines have that name, EREMCHG it is not called as expected, EBUSY another program has the line.
/// Allocates.
int iw_gpio_line_open(iw_gpio_line_t *self, const iw_gpio_address_t *address);

/// What the line is called, also while another program has it. 0, or an errno as above. Allocates.
int iw_gpio_line_see(const iw_gpio_address_t *address, iw_estop_seen_t *out_seen);

/// Copies both names; NULL: it has none. The node and the offset are the caller's to set.
void iw_gpio_note(iw_estop_seen_t *out_seen, const char *chip, const char *line);
/// Copies where the line is.
void iw_gpio_place(iw_estop_seen_t *out_seen, const char *node, unsigned offset);

/// Whether the line is called as the address expects.
bool iw_gpio_is_expected(const iw_gpio_address_t *address, const iw_estop_seen_t *seen);
void iw_gpio_line_close(iw_gpio_line_t *self);

/// 1 high, 0 low, < 0 cannot be read any more.
int iw_gpio_line_level(const iw_gpio_line_t *self);

/// Takes edges that have not been taken yet, IW_GPIO_EDGES_MAX at the most, without waiting. Their number, < 0 if the
/// line is gone.
#define IW_GPIO_EDGES_MAX 64
int iw_gpio_line_take_edges(iw_gpio_line_t *self);

/// Release delay (debounce) of a button: a press counts at once, a release only when it has lasted.
///
///     RELEASED --edge or active--> PRESSED --inactive, no edge for the debounce time--> RELEASED
///
/// An edge counts as pressed whatever the level: a pulse can be shorter than the time between two looks. Pure state
/// machine; begins RELEASED, so that the first look decides.
typedef struct {
    uint32_t debounce_us;
    iw_time_us_t released_us; ///< Released from then on, if nothing happens.
    bool active;
    bool edge; ///< Seen and not yet reported by `iw_gpio_release_take_pressed`.
} iw_gpio_release_t;

void iw_gpio_release_init(iw_gpio_release_t *self, uint32_t debounce_us);

/// What a look at the line has shown: its level, and whether there were edges since the last look.
void iw_gpio_release_see(iw_gpio_release_t *self, iw_time_us_t now_us, bool active, bool edge);

/// True if pressed. An edge is reported once.
bool iw_gpio_release_take_pressed(iw_gpio_release_t *self, iw_time_us_t now_us);

/// When the answer will change by time alone; IW_NEVER if it will not.
iw_time_us_t iw_gpio_release_next_us(const iw_gpio_release_t *self, iw_time_us_t now_us);

#endif
