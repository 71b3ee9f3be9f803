// SPDX-License-Identifier: MIT
#include "iwheel_linux/backend.h"

#include "unix_link.h"

#include <errno.h>
#include <poll.h>
#include <sys/socket.h>

/// Longer bursts of presses are read in the next step: the link is level-triggered.
#define BURST_MAX 64
/// Time at the start for the button to report its level. Without it the button would be unreadable, which latches.
#define FIRST_LEVEL_MS 100

typedef struct {
    iwl_unix_link_t link;
    bool known; ///< The button has reported its level on this connection.
    bool level; ///< The button is pressed.
    bool edge;  ///< The level changed since the last call of `pressed`.
} unix_estop_t;

IW_STATIC_ASSERT(sizeof(unix_estop_t) <= sizeof(iwl_backend_store_t), unix_estop_fits);

static void button_close(void *self) {
    iwl_unix_link_close(&((unix_estop_t *)self)->link);
}

static int button_watch_fd(const void *self) {
    return ((const unix_estop_t *)self)->link.watch_fd;
}

static void button_poll(void *self, iw_time_us_t now_us) {
    (void)iwl_unix_link_poll(&((unix_estop_t *)self)->link, now_us);
}

static iw_time_us_t button_next_us(const void *self) {
    return ((const unix_estop_t *)self)->link.retry_us;
}

static void take_levels(unix_estop_t *button, const char *levels, size_t count) {
    for (size_t i = 0; i < count; i++) {
        const bool level = levels[i] != '0'; // Any value but "released" is pressed.
        button->edge = button->edge || level || (button->known && level != button->level);
        button->level = level;
        button->known = true;
    }
}

/// Detects a broken connection. The button is unreadable in this step, even if the connection returns immediately.
static void listen_to(unix_estop_t *button) {
    char levels[BURST_MAX];
    if (!iwl_unix_link_is_up(&button->link)) {
        return;
    }
    const ssize_t count = recv(button->link.fd, levels, sizeof levels, MSG_DONTWAIT);
    if (count > 0) {
        take_levels(button, levels, (size_t)count);
    } else if (count == 0 || (errno != EAGAIN && errno != EINTR)) {
        iwl_unix_link_lose(&button->link);
        button->known = false;
    }
}

static int button_open(void *self, const iwl_estop_config_t *config) {
    unix_estop_t *button = (unix_estop_t *)self;
    *button = (unix_estop_t){.level = true};
    const int error = iwl_unix_link_open(&button->link, config->name, SOCK_STREAM);
    if (error == 0 && iwl_unix_link_is_up(&button->link)) {
        struct pollfd level = {.fd = button->link.fd, .events = POLLIN};
        (void)poll(&level, 1, FIRST_LEVEL_MS);
        listen_to(button);
    }
    return error;
}

/// The button is unreadable, which counts as pressed (R2), until it has reported its level and after a broken
/// connection.
static int button_pressed(void *self, bool quiet) {
    unix_estop_t *button = (unix_estop_t *)self;
    (void)quiet; // Level and edges arrive in the same messages, so both are always read.
    listen_to(button);
    const bool pressed = button->edge || button->level;
    button->edge = false;
    return button->known ? (int)pressed : -1;
}

static int button_trouble(const void *self) {
    return ((const unix_estop_t *)self)->known ? 0 : ENOTCONN;
}

const iwl_estop_ops_t iwl_unix_estop_ops = {
    .open = button_open,
    .close = button_close,
    .watch_fd = button_watch_fd,
    .poll = button_poll,
    .next_us = button_next_us,
    .pressed = button_pressed,
    .trouble = button_trouble,
    .simulated = true,
    .present = true,
};
