// SPDX-License-Identifier: MIT
/// What an e-stop on a GPIO line is made of: its address, the line, the release delay.
#ifndef IWL_GPIO_H
#define IWL_GPIO_H

#include "iwheel/types.h"
#include "iwheel_linux/backend.h"

/// How a GPIO line is named in the configuration: by its own name, or as `gpiochipN:OFFSET`.
///
/// The kernel's names have at most 31 characters.
#define IWL_GPIO_NAME_SIZE IWL_ESTOP_NAME_SIZE

typedef struct {
    char name[IWL_GPIO_NAME_SIZE]; ///< Of the chip (`by_offset`) or of the line.
    unsigned offset;
    bool by_offset;
    iwl_estop_seen_t expected; ///< What the line must be called; empty: it is not compared.
} iwl_gpio_address_t;

/// 0, or EINVAL (it begins like an address by offset and is none) or ENAMETOOLONG, `*out_address` untouched.
int iwl_gpio_address_parse(const char *text, iwl_gpio_address_t *out_address);

/// One input line of a GPIO chip with both its edges. Two implementations, one per generation of libgpiod: gpio_v1.c
/// and gpio_v2.c; CMake takes the one that is installed.
typedef struct {
    void *chip;
    void *line;            ///< v1: the line; v2: the request.
    void *events;          ///< v2: where edges are read to.
    int fd;                ///< Readable when there is an edge; -1: closed.
    iwl_estop_seen_t seen; ///< What the line is called.
} iwl_gpio_line_t;

/// Takes the line as input with pull-up and both edges. 0, or an errno, `*self` then closed: ENOENT no such line or
/// chip, ENOTUNIQ two lines have that name, EREMCHG it is not called as expected, EBUSY another program has the line.
/// Allocates.
int iwl_gpio_line_open(iwl_gpio_line_t *self, const iwl_gpio_address_t *address);

/// What the line is called, also while another program has it. 0, or an errno as above. Allocates.
int iwl_gpio_line_see(const iwl_gpio_address_t *address, iwl_estop_seen_t *out_seen);

/// Copies both names; NULL: it has none. The node and the offset are the caller's to set.
void iwl_gpio_note(iwl_estop_seen_t *out_seen, const char *chip, const char *line);
/// Copies where the line is.
void iwl_gpio_place(iwl_estop_seen_t *out_seen, const char *node, unsigned offset);

bool iwl_gpio_is_expected(const iwl_gpio_address_t *address, const iwl_estop_seen_t *seen);
void iwl_gpio_line_close(iwl_gpio_line_t *self);

/// 1 high, 0 low, < 0 cannot be read any more.
int iwl_gpio_line_level(const iwl_gpio_line_t *self);

/// Takes edges that have not been taken yet, IWL_GPIO_EDGES_MAX at the most, without waiting. Their number, < 0 if the
/// line is gone.
#define IWL_GPIO_EDGES_MAX 64
int iwl_gpio_line_take_edges(iwl_gpio_line_t *self);

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
    bool edge; ///< Seen and not yet reported by `iwl_gpio_release_take_pressed`.
} iwl_gpio_release_t;

void iwl_gpio_release_init(iwl_gpio_release_t *self, uint32_t debounce_us);

/// What a look at the line has shown: its level, and whether there were edges since the last look.
void iwl_gpio_release_see(iwl_gpio_release_t *self, iw_time_us_t now_us, bool active, bool edge);

/// True if pressed. An edge is reported once.
bool iwl_gpio_release_take_pressed(iwl_gpio_release_t *self, iw_time_us_t now_us);

/// When the answer will change by time alone; IW_NEVER if it will not.
iw_time_us_t iwl_gpio_release_next_us(const iwl_gpio_release_t *self, iw_time_us_t now_us);

#endif
