// SPDX-License-Identifier: MIT
#include "../fake_gpio.h"

#include <errno.h>
#include <gpiod.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/// Two chips with their lines; the line is on the second. The third is the second again, opened through a link. The
/// pointer to a chip is the pointer to its first line.
static char lines[3][FAKE_GPIO_LINES];
static unsigned iterated;

static void *open_chip(unsigned chip) {
    if (fake_gpio.chip_error != 0) {
        errno = fake_gpio.chip_error;
        return NULL;
    }
    fake_gpio.open++;
    return lines[chip];
}

struct gpiod_chip *gpiod_chip_open_by_name(const char *name) {
    errno = ENOENT;
    const unsigned chip = (strcmp(name, FAKE_GPIO_CHIP) == 0) ? 1U : (strcmp(name, FAKE_GPIO_LINK) == 0) ? 2U : 0U;
    return (chip > 0U) ? (struct gpiod_chip *)open_chip(chip) : NULL;
}

void gpiod_chip_close(struct gpiod_chip *chip) {
    fake_gpio.open -= (chip != NULL) ? 1 : 0;
    errno = EACCES; // Any call may set errno.
}

struct gpiod_line *gpiod_chip_get_line(struct gpiod_chip *chip, unsigned offset) {
    fake_gpio.offset = offset;
    errno = EINVAL;
    return (offset < FAKE_GPIO_LINES) ? (struct gpiod_line *)(void *)((char *)(void *)chip + offset) : NULL;
}

struct gpiod_chip_iter *gpiod_chip_iter_new(void) {
    iterated = 0;
    errno = fake_gpio.chip_error;
    return (fake_gpio.chip_error != 0) ? NULL : (struct gpiod_chip_iter *)(void *)lines;
}

struct gpiod_chip *gpiod_chip_iter_next_noclose(struct gpiod_chip_iter *iter) {
    (void)iter;
    static const unsigned orders[3][3] = {{0U, 1U, 0U}, {2U, 0U, 1U}, {0U, 1U, 2U}};
    const unsigned chips = (fake_gpio.link == 0) ? 2U : 3U;
    return (iterated < chips) ? (struct gpiod_chip *)open_chip(orders[fake_gpio.link][iterated++]) : NULL;
}

void gpiod_chip_iter_free_noclose(struct gpiod_chip_iter *iter) {
    (void)iter;
    errno = EACCES; // Any call may set errno.
}

unsigned gpiod_chip_num_lines(struct gpiod_chip *chip) {
    (void)chip;
    return FAKE_GPIO_LINES;
}

const char *gpiod_line_name(struct gpiod_line *line) {
    const size_t at = (size_t)((char *)(void *)line - &lines[0][0]);
    return fake_gpio_name(at >= FAKE_GPIO_LINES, (unsigned)(at % FAKE_GPIO_LINES));
}

struct gpiod_chip *gpiod_line_get_chip(struct gpiod_line *line) {
    if (line == NULL) {
        abort(); // The library crashes here.
    }
    const size_t at = (size_t)((char *)(void *)line - &lines[0][0]);
    return (struct gpiod_chip *)(void *)lines[at / FAKE_GPIO_LINES];
}

const char *gpiod_chip_label(struct gpiod_chip *chip) {
    return ((void *)chip != (void *)lines[0]) ? fake_gpio_label() : "another-chip";
}

const char *gpiod_chip_name(struct gpiod_chip *chip) {
    return ((void *)chip != (void *)lines[0]) ? FAKE_GPIO_CHIP : "gpiochip0";
}

unsigned gpiod_line_offset(struct gpiod_line *line) {
    return (unsigned)((size_t)((char *)(void *)line - &lines[0][0]) % FAKE_GPIO_LINES);
}

void gpiod_line_close_chip(struct gpiod_line *line) {
    (void)line;
    fake_gpio.open--;
    if (fake_gpio.requested > 0) {
        fake_gpio.requested--;
        (void)close(fake_gpio.ends[0]);
        (void)close(fake_gpio.ends[1]);
    }
}

static int request_line(struct gpiod_line *line, int flags, bool both) {
    fake_gpio.offset = gpiod_line_offset(line);
    fake_gpio.is_input = true;
    fake_gpio.both_edges = both;
    fake_gpio.buffer_size = 16U; // libgpiod 1 always uses this size.
    fake_gpio.pulled_up = (flags & GPIOD_LINE_REQUEST_FLAG_BIAS_PULL_UP) != 0;
    errno = fake_gpio.busy_error;
    if (fake_gpio.busy_error != 0 || pipe(fake_gpio.ends) != 0) {
        return -1;
    }
    fake_gpio.requested++;
    return 0;
}

int gpiod_line_request_both_edges_events_flags(struct gpiod_line *line, const char *consumer, int flags) {
    (void)consumer;
    return request_line(line, flags, true);
}

int gpiod_line_request_rising_edge_events_flags(struct gpiod_line *line, const char *consumer, int flags) {
    (void)consumer;
    return request_line(line, flags, false);
}

int gpiod_line_event_get_fd(struct gpiod_line *line) {
    (void)line;
    return fake_gpio.ends[0];
}

int gpiod_line_get_value(struct gpiod_line *line) {
    (void)line;
    errno = ENODEV;
    return fake_gpio.level;
}

int gpiod_line_event_read_fd_multiple(int fd, struct gpiod_line_event *events, unsigned count) {
    (void)fd;
    memset(events, 0, count * sizeof *events);
    return fake_gpio_take(count);
}
