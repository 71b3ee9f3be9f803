// SPDX-License-Identifier: MIT
/// Parts of an e-stop on a GPIO line: its address, the line, and the release delay.
#ifndef IWL_GPIO_H
#define IWL_GPIO_H

#include "iwheel/types.h"
#include "iwheel_linux/backend.h"

/// Name of a GPIO line in the configuration: its own name, or `gpiochipN:OFFSET`.
///
/// The kernel limits names to 31 characters.
#define IWL_GPIO_NAME_SIZE IWL_ESTOP_NAME_SIZE

typedef struct {
    char name[IWL_GPIO_NAME_SIZE]; ///< Name of the chip (`by_offset`) or of the line.
    unsigned offset;
    bool by_offset;
    iwl_estop_seen_t expected; ///< Expected identity of the line. An empty name is not compared.
} iwl_gpio_address_t;

/// Parses an address. Returns 0 or an errno, and then leaves `*out_address` unchanged: EINVAL if it begins like an
/// address by offset and is none, ENAMETOOLONG.
int iwl_gpio_address_parse(const char *text, iwl_gpio_address_t *out_address);

/// An input line of a GPIO chip with both edges. There are two implementations, one per generation of libgpiod:
/// gpio_v1.c and gpio_v2.c. CMake selects the installed one.
typedef struct {
    void *chip;
    void *line;            ///< v1: the line; v2: the request.
    void *events;          ///< v2: buffer of edges.
    int fd;                ///< Readable when there is an edge; -1 if closed.
    iwl_estop_seen_t seen; ///< Identity of the line.
} iwl_gpio_line_t;

/// Opens the line as input with pull-up and both edges. Returns 0 or an errno; then `*self` is closed. ENOENT: no such
/// line or chip. ENOTUNIQ: two lines have the name. EREMCHG: it has another identity than expected. EBUSY: another
/// program uses the line. It allocates memory.
int iwl_gpio_line_open(iwl_gpio_line_t *self, const iwl_gpio_address_t *address);

/// Reads the identity of the line, even if another program uses it. Returns 0 or an errno as above. It allocates
/// memory.
int iwl_gpio_line_see(const iwl_gpio_address_t *address, iwl_estop_seen_t *out_seen);

/// Copies both names; NULL if there is none. The caller sets node and offset.
void iwl_gpio_note(iwl_estop_seen_t *out_seen, const char *chip, const char *line);
/// Copies node and offset.
void iwl_gpio_place(iwl_estop_seen_t *out_seen, const char *node, unsigned offset);

bool iwl_gpio_is_expected(const iwl_gpio_address_t *address, const iwl_estop_seen_t *seen);
void iwl_gpio_line_close(iwl_gpio_line_t *self);

/// Returns 1 (high), 0 (low), or < 0 if the line can no longer be read.
int iwl_gpio_line_level(const iwl_gpio_line_t *self);

/// Reads up to IWL_GPIO_EDGES_MAX edges without waiting. Returns their number, or < 0 if the line is gone.
#define IWL_GPIO_EDGES_MAX 64
int iwl_gpio_line_take_edges(iwl_gpio_line_t *self);

/// Release delay (debounce) of a button: a press counts immediately, a release only after the debounce time.
///
///     RELEASED --edge or active--> PRESSED --inactive, no edge for the debounce time--> RELEASED
///
/// An edge counts as pressed at any level, because a pulse can be shorter than the interval between readings. Pure
/// state machine. It begins with RELEASED, so that the first reading decides.
typedef struct {
    uint32_t debounce_us;
    iw_time_us_t released_us; ///< Released from then on, if nothing happens.
    bool active;
    bool edge; ///< Seen and not yet reported by `iwl_gpio_release_take_pressed`.
} iwl_gpio_release_t;

void iwl_gpio_release_init(iwl_gpio_release_t *self, uint32_t debounce_us);

/// Reports a reading of the line: its level, and whether there were edges since the last reading.
void iwl_gpio_release_see(iwl_gpio_release_t *self, iw_time_us_t now_us, bool active, bool edge);

/// Returns true if pressed. An edge is reported once.
bool iwl_gpio_release_take_pressed(iwl_gpio_release_t *self, iw_time_us_t now_us);

/// Returns the time at which the result changes without a new reading; IW_NEVER if it does not.
iw_time_us_t iwl_gpio_release_next_us(const iwl_gpio_release_t *self, iw_time_us_t now_us);

#endif
