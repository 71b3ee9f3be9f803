// SPDX-License-Identifier: MIT
#include "iwheel_linux/backend.h"

#include "gpio.h"

#include <errno.h>
#include <string.h>
#include <sys/epoll.h>
#include <unistd.h>

/// Interval of attempts to open a line.
#define RETRY_US 200000U

typedef struct {
    iwl_gpio_line_t line;
    iwl_gpio_address_t address;
    iwl_gpio_release_t release;
    iw_time_us_t now_us;   ///< Time of the last `poll`.
    iw_time_us_t retry_us; ///< Time of the next attempt; IW_NEVER while open.
    uint32_t debounce_us;
    int trouble; ///< Errno of the reason why it is closed.
    int watch_fd;
    bool active_high;
} gpio_estop_t;

IW_STATIC_ASSERT(sizeof(gpio_estop_t) <= sizeof(iwl_backend_store_t), gpio_estop_fits);

static bool is_open(const gpio_estop_t *estop) {
    return estop->line.fd >= 0;
}

/// A line that cannot be read counts as pressed (R2, fault 14).
static void lose(gpio_estop_t *estop, int trouble) {
    iwl_gpio_line_close(&estop->line);
    estop->trouble = trouble;
    estop->retry_us = estop->now_us + RETRY_US;
}

static void try_open(gpio_estop_t *estop) {
    struct epoll_event interest = {.events = EPOLLIN};
    int error = iwl_gpio_line_open(&estop->line, &estop->address);
    if (error == 0 && epoll_ctl(estop->watch_fd, EPOLL_CTL_ADD, estop->line.fd, &interest) != 0) {
        error = errno;
    }
    if (error != 0) {
        lose(estop, error);
        return;
    }
    estop->trouble = 0;
    estop->retry_us = IW_NEVER;
    iwl_gpio_release_init(&estop->release, estop->debounce_us);
}

/// Copies an expected name from the configuration. "any" means none.
static int expect(char *out_name, const char *name) {
    const size_t length = (name == NULL || strcmp(name, "any") == 0) ? 0U : strlen(name);
    if (length >= IWL_GPIO_NAME_SIZE) {
        return ENAMETOOLONG;
    }
    memcpy(out_name, (length > 0U) ? name : "", length + 1U);
    return 0;
}

/// Only a malformed name is an error. An absent or busy line is retried, and counts as pressed until then.
static int gpio_open(void *self, const iwl_estop_config_t *config) {
    gpio_estop_t *estop = (gpio_estop_t *)self;
    *estop = (gpio_estop_t){.line = {.fd = -1},
                            .debounce_us = (uint32_t)config->debounce_ms * IW_US_PER_MS,
                            .active_high = config->active_high};
    int error = iwl_gpio_address_parse(config->name, &estop->address);
    if (error == 0) {
        error = expect(estop->address.expected.chip, config->chip);
    }
    if (error == 0) {
        error = expect(estop->address.expected.line, config->chip_line);
    }
    if (error != 0) {
        return error;
    }
    estop->watch_fd = epoll_create1(EPOLL_CLOEXEC);
    if (estop->watch_fd < 0) {
        return errno;
    }
    try_open(estop);
    return 0;
}

static void gpio_close(void *self) {
    gpio_estop_t *estop = (gpio_estop_t *)self;
    iwl_gpio_line_close(&estop->line);
    (void)close(estop->watch_fd);
}

static int gpio_watch_fd(const void *self) {
    return ((const gpio_estop_t *)self)->watch_fd;
}

static void gpio_poll(void *self, iw_time_us_t now_us) {
    gpio_estop_t *estop = (gpio_estop_t *)self;
    estop->now_us = now_us;
    if (!is_open(estop) && now_us >= estop->retry_us) {
        try_open(estop);
    }
}

static iw_time_us_t gpio_next_us(const void *self) {
    const gpio_estop_t *estop = (const gpio_estop_t *)self;
    return is_open(estop) ? iwl_gpio_release_next_us(&estop->release, estop->now_us) : estop->retry_us;
}

/// Reads edges before the level. An edge between the two wakes the loop again; in the other order it would be lost.
static void poll_line(gpio_estop_t *estop, bool quiet) {
    if (!is_open(estop)) {
        return;
    }
    const int edges = quiet ? 0 : iwl_gpio_line_take_edges(&estop->line);
    const int level = iwl_gpio_line_level(&estop->line);
    // After a chip was unplugged its descriptor is still open, and only reads fail.
    if (edges < 0 || level < 0) {
        lose(estop, ENODEV);
        return;
    }
    iwl_gpio_release_see(&estop->release, estop->now_us, (level == 1) == estop->active_high, edges > 0);
}

/// A line that was lost during the reading is reported, even if it returns immediately.
static int gpio_pressed(void *self, bool quiet) {
    gpio_estop_t *estop = (gpio_estop_t *)self;
    poll_line(estop, quiet);
    if (!is_open(estop)) {
        return -1;
    }
    return iwl_gpio_release_take_pressed(&estop->release, estop->now_us) ? 1 : 0;
}

static int gpio_trouble(const void *self) {
    return ((const gpio_estop_t *)self)->trouble;
}

static const iwl_estop_seen_t *gpio_seen(const void *self) {
    const gpio_estop_t *estop = (const gpio_estop_t *)self;
    return is_open(estop) ? &estop->line.seen : NULL;
}

int iwl_estop_see(const char *name, iwl_estop_seen_t *out_seen) {
    iwl_gpio_address_t address;
    if (strncmp(name, "unix:", 5U) == 0) {
        return ENOTSUP;
    }
    const int error = iwl_gpio_address_parse(name, &address);
    return (error != 0) ? error : iwl_gpio_line_see(&address, out_seen);
}

static const iwl_estop_ops_t ops = {
    .open = gpio_open,
    .close = gpio_close,
    .watch_fd = gpio_watch_fd,
    .poll = gpio_poll,
    .next_us = gpio_next_us,
    .pressed = gpio_pressed,
    .trouble = gpio_trouble,
    .seen = gpio_seen,
    .simulated = false,
    .present = true,
};

const iwl_estop_ops_t *const iwl_gpio_estop_ops = &ops;
