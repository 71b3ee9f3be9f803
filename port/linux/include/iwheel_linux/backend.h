// SPDX-License-Identifier: MIT
/// @file
/// Interface of a kind of bus and of a kind of e-stop: each is one file, and the rest of the port does not know which
/// is in use.
///
/// A backend is opened once and stays open for the life of the process. What it stands for may come and go: the backend
/// then says so through its state and comes back by itself from `tend`. It owns one descriptor that never changes (an
/// epoll set of its own, if what it really reads is reopened): the owner watches it for reading and then runs a step.
///
/// Nothing here blocks or allocates after open; open itself may wait for half a second. One thread of execution.
#ifndef IWHEEL_LINUX_BACKEND_H
#define IWHEEL_LINUX_BACKEND_H

#include "iwheel/hal.h"
#include "iwheel_linux/bus_link.h"

/// Storage for the state of any backend, so that the owner need not know its size.
typedef union {
    uint64_t align;      ///< For the strictest alignment that a backend needs.
    uint8_t bytes[4096]; ///< The backend's own.
} iw_backend_store_t;

/// A kind of bus. `self` is its state, of a type that only the backend knows.
typedef struct {
    /// 0, or an errno. `name` must outlive the bus. A bus that is merely absent is no error: it is down until it comes.
    int (*open)(void *self, const char *name);
    /// Gives back what `open` took.
    void (*close)(void *self);
    /// The descriptor to watch for reading; the same from open to close.
    int (*watch_fd)(const void *self);
    /// Reopens a lost interface or connection when the retry is due, and closes a dead one. Call it before every step.
    void (*tend)(void *self, iw_time_us_t now_us);
    /// When `tend` has something to do; IW_NEVER if it has not.
    iw_time_us_t (*next_us)(const void *self);
    /// As in iw_hal_t.
    int (*send)(void *self, const iw_can_frame_t *frame);
    /// As in iw_hal_t.
    int (*receive)(void *self, iw_can_frame_t *out_frame);
    /// As `bus_state` of iw_hal_t.
    iw_bus_state_t (*state)(void *self);
    /// As in iw_hal_t.
    int (*purge)(void *self);
    /// What is known of the link, always up to date.
    const iw_bus_link_t *(*link)(const void *self);
} iw_bus_ops_t;

/// An e-stop input, as configured.
typedef struct {
    const char *name;     ///< Must outlive the input.
    bool active_high;     ///< Pressed reads high. Only for real lines.
    uint16_t debounce_ms; ///< A release must last this long. Only for real lines.
} iw_estop_wish_t;

/// A kind of e-stop input. The functions mean the same as those of a bus.
typedef struct {
    /// 0, or an errno.
    int (*open)(void *self, const iw_estop_wish_t *wish);
    void (*close)(void *self);                     ///< Gives back what `open` took.
    int (*watch_fd)(const void *self);             ///< -1: there is nothing to watch.
    void (*tend)(void *self, iw_time_us_t now_us); ///< Call it before every step.
    iw_time_us_t (*next_us)(const void *self);     ///< When `tend` has something to do; IW_NEVER if not.
    /// As `estop_pressed` of iw_hal_t. `quiet`: the wait that has just ended found nothing at the descriptor, so that
    /// there are no edges to be read; the level always is.
    int (*pressed)(void *self, bool quiet);
    int (*trouble)(const void *self); ///< Why it cannot be read, as an errno; 0 while it can.
    bool simulated;                   ///< Not a real button: announced wherever the e-stop is shown.
    bool present;                     ///< False: there is no e-stop at all.
} iw_estop_ops_t;

/// `unix:PATH`: the local bus. The echo comes from its hub when the simulated wheels have acknowledged, so it is a
/// proof.
extern const iw_bus_ops_t iw_local_bus_ops;

/// SocketCAN, by the interface's name. NULL if this build has left it out.
extern const iw_bus_ops_t *const iw_socketcan_ops;

/// `unix:PATH`: the simulator's button.
extern const iw_estop_ops_t iw_unix_estop_ops;
/// `none`: always released.
extern const iw_estop_ops_t iw_no_estop_ops;

/// A line of a GPIO chip, by its name or as `gpiochipN:OFFSET`, through libgpiod. NULL if this build has left it out.
extern const iw_estop_ops_t *const iw_gpio_estop_ops;

/// The backend for a name as in the configuration; NULL if this build has none for it.
const iw_bus_ops_t *iw_bus_backend(const char *name);
/// The same for an e-stop's name.
const iw_estop_ops_t *iw_estop_backend(const char *name);

#endif
