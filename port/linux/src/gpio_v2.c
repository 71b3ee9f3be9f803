// SPDX-License-Identifier: MIT
// libgpiod 2.
#include "gpio.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <gpiod.h>
#include <stdio.h>
#include <string.h>

/// The kernel holds this many edges of a line.
#define EVENTS    16U
#define PATH_SIZE 320U

/// The chip at this path, if it is one, and the line's offset on it.
static struct gpiod_chip *try_chip(const char *path, const iw_gpio_address_t *address, unsigned *out_offset) {
    struct gpiod_chip *chip = gpiod_is_gpiochip_device(path) ? gpiod_chip_open(path) : NULL;
    if (chip == NULL) {
        return NULL;
    }
    const int offset =
        address->by_offset ? (int)address->offset : gpiod_chip_get_line_offset_from_name(chip, address->name);
    if (offset < 0) {
        gpiod_chip_close(chip);
        errno = ENOENT;
        return NULL;
    }
    *out_offset = (unsigned)offset;
    return chip;
}

/// libgpiod 2 has no search by a line's name over all chips. A chip that we may not open is remembered: the line may be
/// on it, and "permission denied" is the cure where "no such line" would mislead.
static struct gpiod_chip *search(const iw_gpio_address_t *address, unsigned *out_offset) {
    char path[PATH_SIZE];
    struct gpiod_chip *chip = NULL;
    int refusal = 0;
    DIR *folder = opendir("/dev");
    const struct dirent *entry = (folder == NULL) ? NULL : readdir(folder);
    for (; entry != NULL && chip == NULL; entry = readdir(folder)) {
        if (strncmp(entry->d_name, "gpiochip", 8) == 0) {
            (void)snprintf(path, sizeof path, "/dev/%s", entry->d_name);
            chip = try_chip(path, address, out_offset);
            refusal = (errno == EACCES || errno == EPERM) ? errno : refusal;
        }
    }
    if (folder != NULL) {
        (void)closedir(folder);
    }
    errno = (refusal != 0) ? refusal : ENOENT;
    return chip;
}

static struct gpiod_chip *find(const iw_gpio_address_t *address, unsigned *out_offset) {
    char path[PATH_SIZE];
    if (!address->by_offset) {
        return search(address, out_offset);
    }
    (void)snprintf(path, sizeof path, "/dev/%s", address->name);
    errno = ENOENT;
    return try_chip(path, address, out_offset);
}

/// Pull-up: a cut wire of a normally closed contact to ground reads high, like the pressed button.
static bool configure(struct gpiod_line_settings *settings, struct gpiod_line_config *lines, unsigned offset) {
    return gpiod_line_settings_set_direction(settings, GPIOD_LINE_DIRECTION_INPUT) == 0 &&
           gpiod_line_settings_set_edge_detection(settings, GPIOD_LINE_EDGE_BOTH) == 0 &&
           gpiod_line_settings_set_bias(settings, GPIOD_LINE_BIAS_PULL_UP) == 0 &&
           gpiod_line_config_add_line_settings(lines, &offset, 1, settings) == 0;
}

static struct gpiod_line_request *request(struct gpiod_chip *chip, unsigned offset) {
    struct gpiod_line_request *line = NULL;
    struct gpiod_line_settings *settings = gpiod_line_settings_new();
    struct gpiod_line_config *lines = gpiod_line_config_new();
    struct gpiod_request_config *wish = gpiod_request_config_new();
    if (settings != NULL && lines != NULL && wish != NULL && configure(settings, lines, offset)) {
        gpiod_request_config_set_consumer(wish, "iwheel-gateway e-stop");
        gpiod_request_config_set_event_buffer_size(wish, EVENTS);
        line = gpiod_chip_request_lines(chip, wish, lines);
    }
    const int error = errno;
    gpiod_request_config_free(wish);
    gpiod_line_config_free(lines);
    gpiod_line_settings_free(settings);
    errno = error;
    return line;
}

int iw_gpio_line_open(iw_gpio_line_t *self, const iw_gpio_address_t *address) {
    unsigned offset = 0;
    *self = (iw_gpio_line_t){.fd = -1};
    errno = 0;
    self->chip = find(address, &offset);
    if (self->chip == NULL) {
        return (errno != 0) ? errno : ENOENT;
    }
    self->line = request((struct gpiod_chip *)self->chip, offset);
    self->events = (self->line == NULL) ? NULL : gpiod_edge_event_buffer_new(EVENTS);
    self->fd = (self->events == NULL) ? -1 : gpiod_line_request_get_fd((struct gpiod_line_request *)self->line);
    if (self->fd < 0 || fcntl(self->fd, F_SETFL, O_NONBLOCK) != 0) {
        const int error = (errno != 0) ? errno : ENOMEM;
        iw_gpio_line_close(self);
        return error;
    }
    return 0;
}

void iw_gpio_line_close(iw_gpio_line_t *self) {
    gpiod_edge_event_buffer_free((struct gpiod_edge_event_buffer *)self->events);
    if (self->line != NULL) {
        gpiod_line_request_release((struct gpiod_line_request *)self->line);
    }
    if (self->chip != NULL) {
        gpiod_chip_close((struct gpiod_chip *)self->chip);
    }
    *self = (iw_gpio_line_t){.fd = -1};
}

int iw_gpio_line_level(const iw_gpio_line_t *self) {
    unsigned offset;
    struct gpiod_line_request *line = (struct gpiod_line_request *)self->line;
    if (gpiod_line_request_get_requested_offsets(line, &offset, 1) != 1U) {
        return -1;
    }
    const enum gpiod_line_value value = gpiod_line_request_get_value(line, offset);
    return (value == GPIOD_LINE_VALUE_ERROR) ? -1 : (int)(value == GPIOD_LINE_VALUE_ACTIVE);
}

int iw_gpio_line_take_edges(iw_gpio_line_t *self) {
    int taken = 0;
    while (taken < IW_GPIO_EDGES_MAX) {
        const int count = gpiod_line_request_read_edge_events((struct gpiod_line_request *)self->line,
                                                              (struct gpiod_edge_event_buffer *)self->events, EVENTS);
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
