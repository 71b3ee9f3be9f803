// SPDX-License-Identifier: MIT
// Implementation for libgpiod 1.5 and later, before 2.
#include "gpio.h"

#include <errno.h>
#include <fcntl.h>
#include <gpiod.h>
#include <stdbool.h>
#include <string.h>

/// Number of edges of a line that the kernel buffers.
#define EVENTS 16U

/// Returns true for one line, through two nodes of its chip, by the kernel's name of the chip. libgpiod follows links,
/// and Raspberry Pi OS links gpiochip4 to gpiochip0 on a Raspberry Pi 5. No other chip receives the name while the
/// first node is open.
static bool is_same_line(struct gpiod_line *one, struct gpiod_line *other) {
    return gpiod_line_offset(one) == gpiod_line_offset(other) &&
           strcmp(gpiod_chip_name(gpiod_line_get_chip(one)), gpiod_chip_name(gpiod_line_get_chip(other))) == 0;
}

/// Searches one chip for lines with the name; `*found` is the first one on all chips. Returns true if there is a second
/// one.
static bool search_chip(struct gpiod_chip *chip, const char *name, struct gpiod_line **found) {
    const unsigned lines = gpiod_chip_num_lines(chip);
    bool second = false;
    for (unsigned offset = 0; offset < lines && !second; offset++) {
        struct gpiod_line *line = gpiod_chip_get_line(chip, offset);
        const char *own = (line == NULL) ? NULL : gpiod_line_name(line);
        if (own != NULL && strcmp(own, name) == 0) {
            second = *found != NULL && !is_same_line(*found, line);
            if (*found == NULL) {
                *found = line;
            }
        }
    }
    return second;
}

/// Returns the only line with the name on all chips. Its chip stays open until the line's chip is closed.
static struct gpiod_line *find_by_name(const char *name) {
    struct gpiod_chip_iter *chips = gpiod_chip_iter_new();
    struct gpiod_line *found = NULL;
    struct gpiod_chip *chip;
    bool second = false;
    if (chips == NULL) {
        return NULL;
    }
    while ((chip = gpiod_chip_iter_next_noclose(chips)) != NULL) {
        const struct gpiod_line *before = found;
        second = search_chip(chip, name, &found) || second;
        if (found == before) {
            gpiod_chip_close(chip);
        }
    }
    gpiod_chip_iter_free_noclose(chips);
    if (second) {
        gpiod_line_close_chip(found);
    }
    errno = second ? ENOTUNIQ : ENOENT;
    return second ? NULL : found;
}

static struct gpiod_line *find(const iwl_gpio_address_t *address) {
    if (!address->by_offset) {
        return find_by_name(address->name);
    }
    struct gpiod_chip *chip = gpiod_chip_open_by_name(address->name);
    struct gpiod_line *line = (chip == NULL) ? NULL : gpiod_chip_get_line(chip, address->offset);
    if (chip != NULL && line == NULL) {
        gpiod_chip_close(chip);
        errno = ENOENT;
    }
    return line;
}

/// Returns the line with its identity; NULL and an errno if there is none.
static struct gpiod_line *find_and_see(const iwl_gpio_address_t *address, iwl_estop_seen_t *out_seen) {
    errno = ENOENT; // Valid unless a call below sets another one.
    struct gpiod_line *line = find(address);
    if (line == NULL) {
        return NULL;
    }
    iwl_gpio_note(out_seen, gpiod_chip_label(gpiod_line_get_chip(line)), gpiod_line_name(line));
    iwl_gpio_place(out_seen, gpiod_chip_name(gpiod_line_get_chip(line)), gpiod_line_offset(line));
    return line;
}

int iwl_gpio_line_see(const iwl_gpio_address_t *address, iwl_estop_seen_t *out_seen) {
    struct gpiod_line *line = find_and_see(address, out_seen);
    if (line == NULL) {
        return errno;
    }
    gpiod_line_close_chip(line);
    return 0;
}

int iwl_gpio_line_open(iwl_gpio_line_t *self, const iwl_gpio_address_t *address) {
    *self = (iwl_gpio_line_t){.fd = -1};
    struct gpiod_line *line = find_and_see(address, &self->seen);
    if (line == NULL) {
        return errno;
    }
    self->line = line;
    if (!iwl_gpio_is_expected(address, &self->seen)) {
        iwl_gpio_line_close(self);
        return EREMCHG;
    }
    if (gpiod_line_request_both_edges_events_flags(line, "iwheel-gateway e-stop",
                                                   GPIOD_LINE_REQUEST_FLAG_BIAS_PULL_UP) == 0) {
        self->fd = gpiod_line_event_get_fd(line);
    }
    if (self->fd < 0 || fcntl(self->fd, F_SETFL, O_NONBLOCK) != 0) {
        const int error = errno;
        iwl_gpio_line_close(self);
        return error;
    }
    return 0;
}

void iwl_gpio_line_close(iwl_gpio_line_t *self) {
    if (self->line != NULL) {
        gpiod_line_close_chip((struct gpiod_line *)self->line);
    }
    *self = (iwl_gpio_line_t){.fd = -1};
}

int iwl_gpio_line_level(const iwl_gpio_line_t *self) {
    return gpiod_line_get_value((struct gpiod_line *)self->line);
}

int iwl_gpio_line_take_edges(iwl_gpio_line_t *self) {
    struct gpiod_line_event events[EVENTS];
    int count_read = 0;
    while (count_read < IWL_GPIO_EDGES_MAX) {
        const int count = gpiod_line_event_read_fd_multiple(self->fd, events, EVENTS);
        if (count < 0) {
            return (errno == EAGAIN || errno == EINTR) ? count_read : -1;
        }
        if (count == 0) {
            return count_read;
        }
        count_read += count;
    }
    return count_read;
}
