// SPDX-License-Identifier: MIT
/// The part of libgpiod 1.5 that the port uses, so that gpio_v1.c can be tested on any machine.
#ifndef TEST_GPIOD_H
#define TEST_GPIOD_H

#include <time.h>

#define GPIOD_LINE_REQUEST_FLAG_BIAS_PULL_DOWN (1 << 4)
#define GPIOD_LINE_REQUEST_FLAG_BIAS_PULL_UP   (1 << 5)

struct gpiod_chip;
struct gpiod_chip_iter;
struct gpiod_line;
struct gpiod_line_event {
    struct timespec ts;
    int event_type;
    int offset;
};

struct gpiod_chip *gpiod_chip_open_by_name(const char *name);
void gpiod_chip_close(struct gpiod_chip *chip);
struct gpiod_line *gpiod_chip_get_line(struct gpiod_chip *chip, unsigned offset);
struct gpiod_chip_iter *gpiod_chip_iter_new(void);
struct gpiod_chip *gpiod_chip_iter_next_noclose(struct gpiod_chip_iter *iter);
void gpiod_chip_iter_free_noclose(struct gpiod_chip_iter *iter);
unsigned gpiod_chip_num_lines(struct gpiod_chip *chip);
const char *gpiod_line_name(struct gpiod_line *line);
struct gpiod_chip *gpiod_line_get_chip(struct gpiod_line *line);
const char *gpiod_chip_label(struct gpiod_chip *chip);
const char *gpiod_chip_name(struct gpiod_chip *chip);
unsigned gpiod_line_offset(struct gpiod_line *line);
void gpiod_line_close_chip(struct gpiod_line *line);
int gpiod_line_request_both_edges_events_flags(struct gpiod_line *line, const char *consumer, int flags);
int gpiod_line_request_rising_edge_events_flags(struct gpiod_line *line, const char *consumer, int flags);
int gpiod_line_event_get_fd(struct gpiod_line *line);
int gpiod_line_get_value(struct gpiod_line *line);
int gpiod_line_event_read_fd_multiple(int fd, struct gpiod_line_event *events, unsigned count);

#endif
