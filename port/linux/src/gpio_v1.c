// SPDX-License-Identifier: MIT
// libgpiod 1.5 and later, before 2.
#include "gpio.h"

#include <errno.h>
#include <fcntl.h>
#include <gpiod.h>

/// The kernel holds this many edges of a line.
#define EVENTS 16U

/// A line found by its name belongs to a chip that libgpiod opened: closing the line's chip frees both.
static struct gpiod_line *find(const iw_gpio_address_t *address) {
    if (!address->by_offset) {
        return gpiod_line_find(address->name);
    }
    struct gpiod_chip *chip = gpiod_chip_open_by_name(address->name);
    struct gpiod_line *line = (chip == NULL) ? NULL : gpiod_chip_get_line(chip, address->offset);
    if (chip != NULL && line == NULL) {
        gpiod_chip_close(chip);
        errno = ENOENT;
    }
    return line;
}

int iw_gpio_line_open(iw_gpio_line_t *self, const iw_gpio_address_t *address) {
    *self = (iw_gpio_line_t){.fd = -1};
    errno = 0;
    struct gpiod_line *line = find(address);
    if (line == NULL) {
        return (errno != 0) ? errno : ENOENT;
    }
    self->line = line;
    if (gpiod_line_request_both_edges_events_flags(line, "iwheel-gateway e-stop",
                                                   GPIOD_LINE_REQUEST_FLAG_BIAS_PULL_UP) == 0) {
        self->fd = gpiod_line_event_get_fd(line);
    }
    if (self->fd < 0 || fcntl(self->fd, F_SETFL, O_NONBLOCK) != 0) {
        const int error = errno;
        iw_gpio_line_close(self);
        return error;
    }
    return 0;
}

void iw_gpio_line_close(iw_gpio_line_t *self) {
    if (self->line != NULL) {
        gpiod_line_close_chip((struct gpiod_line *)self->line);
    }
    *self = (iw_gpio_line_t){.fd = -1};
}

int iw_gpio_line_level(const iw_gpio_line_t *self) {
    return gpiod_line_get_value((struct gpiod_line *)self->line);
}

int iw_gpio_line_take_edges(iw_gpio_line_t *self) {
    struct gpiod_line_event events[EVENTS];
    int taken = 0;
    while (taken < IW_GPIO_EDGES_MAX) {
        const int count = gpiod_line_event_read_fd_multiple(self->fd, events, EVENTS);
        if (count < 0) {
            return (errno == EAGAIN || errno == EINTR) ? taken : -1;
        }
        if (count == 0) {
            return taken;
        }
        taken += count;
    }
    return taken;
}
