// SPDX-License-Identifier: MIT
#include "../fake_gpio.h"

#include <dirent.h>
#include <errno.h>
#include <gpiod.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static char one;
/// The line's own chip, opened through its node and through the link, and the other chip.
static char chips[3];
static struct dirent entry;
static unsigned listed;
static unsigned allocated;
static unsigned wanted_size;
static bool shown_own;
static unsigned shown_offset;

/// /dev has two chips; the line is on the second. A link to that one may be next to it.
DIR *opendir(const char *name) {
    (void)name;
    listed = 0;
    return (DIR *)(void *)&one;
}

struct dirent *readdir(DIR *folder) {
    static const char *const names[] = {"null", FAKE_GPIO_LINK, "gpiochip0", FAKE_GPIO_CHIP, FAKE_GPIO_LINK, "zero"};
    (void)folder;
    if ((listed == 1U && fake_gpio.link != 1) || (listed == 4U && fake_gpio.link != 2)) {
        listed++;
    }
    if (listed == sizeof names / sizeof names[0]) {
        return NULL;
    }
    (void)strcpy(entry.d_name, names[listed++]);
    return &entry;
}

int closedir(DIR *folder) {
    (void)folder;
    return 0;
}

static bool is_link(const char *path) {
    return strcmp(path, "/dev/" FAKE_GPIO_LINK) == 0;
}

static bool is_ours(const char *path) {
    return strcmp(path, "/dev/" FAKE_GPIO_CHIP) == 0 || is_link(path);
}

static bool is_own_chip(const void *chip) {
    return chip == &chips[0] || chip == &chips[1];
}

/// The library follows links.
bool gpiod_is_gpiochip_device(const char *path) {
    return is_ours(path) || strcmp(path, "/dev/gpiochip0") == 0;
}

struct gpiod_chip *gpiod_chip_open(const char *path) {
    if (is_ours(path) && fake_gpio.chip_error != 0) {
        errno = fake_gpio.chip_error;
        return NULL;
    }
    fake_gpio.open++;
    return (struct gpiod_chip *)(void *)&chips[is_link(path) ? 1 : is_ours(path) ? 0 : 2];
}

void gpiod_chip_close(struct gpiod_chip *chip) {
    fake_gpio.open -= (chip != NULL) ? 1 : 0;
    errno = EACCES; // Any call may set errno.
}

struct gpiod_chip_info *gpiod_chip_get_info(struct gpiod_chip *chip) {
    if (chip == NULL) {
        abort(); // The library crashes here.
    }
    allocated++;
    return (struct gpiod_chip_info *)(void *)chip;
}

size_t gpiod_chip_info_get_num_lines(struct gpiod_chip_info *info) {
    (void)info;
    return FAKE_GPIO_LINES;
}

const char *gpiod_chip_info_get_label(struct gpiod_chip_info *info) {
    return is_own_chip(info) ? fake_gpio_label() : "another-chip";
}

const char *gpiod_chip_info_get_name(struct gpiod_chip_info *info) {
    return is_own_chip(info) ? FAKE_GPIO_CHIP : "gpiochip0";
}

void gpiod_chip_info_free(struct gpiod_chip_info *info) {
    allocated -= (info != NULL) ? 1U : 0U;
}

struct gpiod_line_info *gpiod_chip_get_line_info(struct gpiod_chip *chip, unsigned offset) {
    allocated++;
    shown_own = is_own_chip(chip);
    shown_offset = offset;
    return (struct gpiod_line_info *)(void *)&one;
}

const char *gpiod_line_info_get_name(struct gpiod_line_info *info) {
    (void)info;
    return fake_gpio_name(shown_own, shown_offset);
}

void gpiod_line_info_free(struct gpiod_line_info *info) {
    shown_offset = FAKE_GPIO_LINES - 1U; // Another line has its name now.
    allocated -= (info != NULL) ? 1U : 0U;
}

struct gpiod_line_request *gpiod_chip_request_lines(struct gpiod_chip *chip, struct gpiod_request_config *config,
                                                    struct gpiod_line_config *lines) {
    (void)chip;
    (void)config;
    (void)lines;
    errno = (fake_gpio.busy_error != 0) ? fake_gpio.busy_error : EINVAL;
    if (fake_gpio.busy_error != 0 || fake_gpio.offset != FAKE_GPIO_OFFSET || pipe(fake_gpio.ends) != 0) {
        return NULL;
    }
    fake_gpio.requested++;
    fake_gpio.buffer_size = wanted_size;
    return (struct gpiod_line_request *)(void *)&one;
}

struct gpiod_line_settings *gpiod_line_settings_new(void) {
    allocated++;
    return (struct gpiod_line_settings *)(void *)&one;
}

void gpiod_line_settings_free(struct gpiod_line_settings *settings) {
    allocated -= (settings != NULL) ? 1U : 0U;
    errno = EACCES; // Any call may set errno.
}

int gpiod_line_settings_set_direction(struct gpiod_line_settings *settings, enum gpiod_line_direction direction) {
    (void)settings;
    fake_gpio.is_input = direction == GPIOD_LINE_DIRECTION_INPUT;
    return 0;
}

int gpiod_line_settings_set_edge_detection(struct gpiod_line_settings *settings, enum gpiod_line_edge edge) {
    (void)settings;
    fake_gpio.both_edges = edge == GPIOD_LINE_EDGE_BOTH;
    return 0;
}

int gpiod_line_settings_set_bias(struct gpiod_line_settings *settings, enum gpiod_line_bias bias) {
    (void)settings;
    fake_gpio.pulled_up = bias == GPIOD_LINE_BIAS_PULL_UP;
    return 0;
}

struct gpiod_line_config *gpiod_line_config_new(void) {
    allocated++;
    return (struct gpiod_line_config *)(void *)&one;
}

void gpiod_line_config_free(struct gpiod_line_config *lines) {
    allocated -= (lines != NULL) ? 1U : 0U;
}

int gpiod_line_config_add_line_settings(struct gpiod_line_config *lines, const unsigned *offsets, size_t count,
                                        struct gpiod_line_settings *settings) {
    (void)lines;
    (void)settings;
    fake_gpio.offset = (count == 1U) ? offsets[0] : 0U;
    return 0;
}

struct gpiod_request_config *gpiod_request_config_new(void) {
    allocated++;
    wanted_size = 0;
    return (struct gpiod_request_config *)(void *)&one;
}

void gpiod_request_config_free(struct gpiod_request_config *config) {
    allocated -= (config != NULL) ? 1U : 0U;
}

void gpiod_request_config_set_consumer(struct gpiod_request_config *config, const char *consumer) {
    (void)config;
    (void)consumer;
}

void gpiod_request_config_set_event_buffer_size(struct gpiod_request_config *config, size_t size) {
    (void)config;
    wanted_size = (unsigned)size;
}

void gpiod_line_request_release(struct gpiod_line_request *line) {
    (void)line;
    fake_gpio.requested--;
    (void)close(fake_gpio.ends[0]);
    (void)close(fake_gpio.ends[1]);
}

int gpiod_line_request_get_fd(struct gpiod_line_request *line) {
    (void)line;
    return fake_gpio.ends[0];
}

size_t gpiod_line_request_get_requested_offsets(struct gpiod_line_request *line, unsigned *offsets, size_t max) {
    (void)line;
    offsets[0] = fake_gpio.offset;
    return (max > 0U) ? 1U : 0U;
}

enum gpiod_line_value gpiod_line_request_get_value(struct gpiod_line_request *line, unsigned offset) {
    (void)line;
    return (offset == FAKE_GPIO_OFFSET) ? (enum gpiod_line_value)fake_gpio.level : GPIOD_LINE_VALUE_ERROR;
}

struct gpiod_edge_event_buffer *gpiod_edge_event_buffer_new(size_t capacity) {
    allocated++;
    return (capacity > 0U) ? (struct gpiod_edge_event_buffer *)(void *)&one : NULL;
}

void gpiod_edge_event_buffer_free(struct gpiod_edge_event_buffer *buffer) {
    allocated -= (buffer != NULL) ? 1U : 0U;
}

int gpiod_line_request_read_edge_events(struct gpiod_line_request *line, struct gpiod_edge_event_buffer *buffer,
                                        size_t max) {
    (void)line;
    (void)buffer;
    return fake_gpio_take((unsigned)max);
}
