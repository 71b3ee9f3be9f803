// SPDX-License-Identifier: MIT
// Implementation for libgpiod 2.
#include "gpio.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <gpiod.h>
#include <stdio.h>
#include <string.h>

/// Number of edges of a line that the kernel buffers.
#define EVENTS    16U
#define PATH_SIZE 320U

/// Returns the number of lines with the name on the chip; `*out_offset` is the offset of the first.
static unsigned count_named(struct gpiod_chip *chip, const char *name, unsigned *out_offset) {
    struct gpiod_chip_info *chip_info = gpiod_chip_get_info(chip);
    const unsigned lines = (chip_info == NULL) ? 0U : (unsigned)gpiod_chip_info_get_num_lines(chip_info);
    unsigned count = 0;
    for (unsigned offset = 0; offset < lines; offset++) {
        struct gpiod_line_info *info = gpiod_chip_get_line_info(chip, offset);
        const char *own = (info == NULL) ? NULL : gpiod_line_info_get_name(info);
        if (own != NULL && strcmp(own, name) == 0) {
            if (count == 0U) {
                *out_offset = offset;
            }
            count++;
        }
        gpiod_line_info_free(info);
    }
    gpiod_chip_info_free(chip_info);
    return count;
}

/// Returns true for two nodes of one chip, by the kernel's name of it. libgpiod follows links, and Raspberry Pi OS
/// links gpiochip4 to gpiochip0 on a Raspberry Pi 5. No other chip receives the name while the first node is open.
static bool is_same_chip(struct gpiod_chip *one, struct gpiod_chip *other) {
    struct gpiod_chip_info *first = gpiod_chip_get_info(one);
    struct gpiod_chip_info *second = gpiod_chip_get_info(other);
    const bool same = first != NULL && second != NULL &&
                      strcmp(gpiod_chip_info_get_name(first), gpiod_chip_info_get_name(second)) == 0;
    gpiod_chip_info_free(second);
    gpiod_chip_info_free(first);
    return same;
}

/// Returns the number of lines with the name on a chip that is open and not the one of `found`.
static unsigned count_new(struct gpiod_chip *chip, struct gpiod_chip *found, const char *name, unsigned *out_offset) {
    if (chip == NULL || (found != NULL && is_same_chip(found, chip))) {
        return 0;
    }
    return count_named(chip, name, out_offset);
}

static struct gpiod_chip *open_chip(const char *path) {
    errno = ENOENT;
    return gpiod_is_gpiochip_device(path) ? gpiod_chip_open(path) : NULL;
}

/// libgpiod 2 cannot search all chips for a line by name. If a chip must not be opened, the line may be on it: the
/// result is then "permission denied", which leads to the fix, and not "no such line". If two lines have the name,
/// neither is used.
static struct gpiod_chip *search(const char *name, unsigned *out_offset) {
    char path[PATH_SIZE];
    struct gpiod_chip *found = NULL;
    unsigned count = 0;
    int refusal = ENOENT;
    DIR *folder = opendir("/dev");
    const struct dirent *entry = (folder == NULL) ? NULL : readdir(folder);
    for (; entry != NULL; entry = readdir(folder)) {
        if (strncmp(entry->d_name, "gpiochip", 8) != 0) {
            continue;
        }
        (void)snprintf(path, sizeof path, "/dev/%s", entry->d_name);
        unsigned offset = 0;
        struct gpiod_chip *chip = open_chip(path);
        if (chip == NULL && (errno == EACCES || errno == EPERM)) {
            refusal = errno;
        }
        const unsigned here = count_new(chip, found, name, &offset);
        count += here;
        if (here > 0U && found == NULL) {
            found = chip;
            *out_offset = offset;
        } else if (chip != NULL) {
            gpiod_chip_close(chip);
        }
    }
    if (folder != NULL) {
        (void)closedir(folder);
    }
    if (count > 1U) {
        gpiod_chip_close(found);
        found = NULL;
        refusal = ENOTUNIQ;
    }
    errno = refusal;
    return found;
}

static struct gpiod_chip *find(const iwl_gpio_address_t *address, unsigned *out_offset) {
    char path[PATH_SIZE];
    if (!address->by_offset) {
        return search(address->name, out_offset);
    }
    (void)snprintf(path, sizeof path, "/dev/%s", address->name);
    *out_offset = address->offset;
    return open_chip(path);
}

/// Pull-up: a cut wire of a normally closed contact to ground reads high, like a pressed button.
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
    struct gpiod_request_config *config = gpiod_request_config_new();
    if (settings != NULL && lines != NULL && config != NULL && configure(settings, lines, offset)) {
        gpiod_request_config_set_consumer(config, "iwheel-gateway e-stop");
        gpiod_request_config_set_event_buffer_size(config, EVENTS);
        line = gpiod_chip_request_lines(chip, config, lines);
    }
    const int error = errno;
    gpiod_request_config_free(config);
    gpiod_line_config_free(lines);
    gpiod_line_settings_free(settings);
    errno = error;
    return line;
}

static void see(struct gpiod_chip *chip, unsigned offset, iwl_estop_seen_t *out_seen) {
    struct gpiod_chip_info *chip_info = gpiod_chip_get_info(chip);
    struct gpiod_line_info *info = gpiod_chip_get_line_info(chip, offset);
    iwl_gpio_note(out_seen, (chip_info == NULL) ? NULL : gpiod_chip_info_get_label(chip_info),
                  (info == NULL) ? NULL : gpiod_line_info_get_name(info));
    iwl_gpio_place(out_seen, (chip_info == NULL) ? NULL : gpiod_chip_info_get_name(chip_info), offset);
    gpiod_line_info_free(info);
    gpiod_chip_info_free(chip_info);
}

/// Returns the chip with the identity of the line; NULL and an errno if there is none.
static struct gpiod_chip *find_and_see(const iwl_gpio_address_t *address, unsigned *out_offset,
                                       iwl_estop_seen_t *out_seen) {
    errno = ENOENT; // Valid unless a call below sets another one.
    struct gpiod_chip *chip = find(address, out_offset);
    if (chip == NULL) {
        return NULL;
    }
    see(chip, *out_offset, out_seen);
    return chip;
}

int iwl_gpio_line_see(const iwl_gpio_address_t *address, iwl_estop_seen_t *out_seen) {
    unsigned offset = 0;
    struct gpiod_chip *chip = find_and_see(address, &offset, out_seen);
    if (chip == NULL) {
        return errno;
    }
    gpiod_chip_close(chip);
    return 0;
}

int iwl_gpio_line_open(iwl_gpio_line_t *self, const iwl_gpio_address_t *address) {
    unsigned offset = 0;
    *self = (iwl_gpio_line_t){.fd = -1};
    self->chip = find_and_see(address, &offset, &self->seen);
    if (self->chip == NULL) {
        return errno;
    }
    if (!iwl_gpio_is_expected(address, &self->seen)) {
        iwl_gpio_line_close(self);
        return EREMCHG;
    }
    errno = 0;
    self->line = request((struct gpiod_chip *)self->chip, offset);
    self->events = (self->line == NULL) ? NULL : gpiod_edge_event_buffer_new(EVENTS);
    self->fd = (self->events == NULL) ? -1 : gpiod_line_request_get_fd((struct gpiod_line_request *)self->line);
    if (self->fd < 0 || fcntl(self->fd, F_SETFL, O_NONBLOCK) != 0) {
        const int error = (errno != 0) ? errno : ENOMEM;
        iwl_gpio_line_close(self);
        return error;
    }
    return 0;
}

void iwl_gpio_line_close(iwl_gpio_line_t *self) {
    gpiod_edge_event_buffer_free((struct gpiod_edge_event_buffer *)self->events);
    if (self->line != NULL) {
        gpiod_line_request_release((struct gpiod_line_request *)self->line);
    }
    if (self->chip != NULL) {
        gpiod_chip_close((struct gpiod_chip *)self->chip);
    }
    *self = (iwl_gpio_line_t){.fd = -1};
}

int iwl_gpio_line_level(const iwl_gpio_line_t *self) {
    unsigned offset;
    struct gpiod_line_request *line = (struct gpiod_line_request *)self->line;
    if (gpiod_line_request_get_requested_offsets(line, &offset, 1) != 1U) {
        return -1;
    }
    const enum gpiod_line_value value = gpiod_line_request_get_value(line, offset);
    return (value == GPIOD_LINE_VALUE_ERROR) ? -1 : (int)(value == GPIOD_LINE_VALUE_ACTIVE);
}

int iwl_gpio_line_take_edges(iwl_gpio_line_t *self) {
    int count_read = 0;
    while (count_read < IWL_GPIO_EDGES_MAX) {
        const int count = gpiod_line_request_read_edge_events((struct gpiod_line_request *)self->line,
                                                              (struct gpiod_edge_event_buffer *)self->events, EVENTS);
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
