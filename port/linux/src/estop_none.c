// SPDX-License-Identifier: MIT
#include "iwheel_linux/backend.h"

/// No e-stop at all: `present` is false, so that status and doctor say so wherever the e-stop is shown.
static int none_open(void *self, const iw_estop_wish_t *wish) {
    (void)self;
    (void)wish;
    return 0;
}

static void none_close(void *self) {
    (void)self;
}

static int none_watch_fd(const void *self) {
    (void)self;
    return -1;
}

static void none_tend(void *self, iw_time_us_t now_us) {
    (void)self;
    (void)now_us;
}

static iw_time_us_t none_next_us(const void *self) {
    (void)self;
    return IW_NEVER;
}

static int none_pressed(void *self, bool quiet) {
    (void)self;
    (void)quiet;
    return 0;
}

static int none_trouble(const void *self) {
    (void)self;
    return 0;
}

const iw_estop_ops_t iw_no_estop_ops = {
    .open = none_open,
    .close = none_close,
    .watch_fd = none_watch_fd,
    .tend = none_tend,
    .next_us = none_next_us,
    .pressed = none_pressed,
    .trouble = none_trouble,
    .simulated = false,
    .present = false,
};
