// SPDX-License-Identifier: MIT
/// @file
/// A bus, and the interface of a kind of e-stop: each kind of either is one file, and the rest of the port does not
/// know which is in use.
///
/// A backend is opened once and stays open for the life of the process. What it stands for may come and go: the backend
/// then says so through its state and comes back by itself from `poll`. It owns one descriptor that never changes (an
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
    uint8_t bytes[8192]; ///< The backend's own.
} iwl_backend_store_t;

/// A bus, by its name: `unix:PATH` is the local bus, any other a SocketCAN interface. 0, or an errno, nothing is open
/// then; ENOTSUP: this build has none of that kind. `name` must outlive the bus, which must not move. A bus that is
/// merely absent is no error: it is down until it comes.
int iwl_bus_open(iwl_backend_store_t *bus, const char *name);
/// Gives back what opening took.
void iwl_bus_close(iwl_backend_store_t *bus);
/// The descriptor to watch for reading; the same from open to close.
int iwl_bus_fd(const iwl_backend_store_t *bus);
/// Reopens a lost interface or connection when the retry is due, and closes a dead one. Call it before every step.
void iwl_bus_poll(iwl_backend_store_t *bus, iw_time_us_t now_us);
/// Whether the last wait has found its descriptor readable; if nobody ever tells, it is always looked at.
void iwl_bus_waited(iwl_backend_store_t *bus, bool told);
/// When `poll` has something to do; IW_NEVER if it has not.
iw_time_us_t iwl_bus_next_us(const iwl_backend_store_t *bus);
/// As `send` of iw_hal_t.
int iwl_bus_send(iwl_backend_store_t *bus, const iw_can_frame_t *frames, uint32_t count);
/// As `receive` of iw_hal_t.
int iwl_bus_receive(iwl_backend_store_t *bus, iw_can_frame_t *out_frame);
/// As `bus_state` of iw_hal_t.
iw_bus_state_t iwl_bus_state(iwl_backend_store_t *bus);
/// As `purge` of iw_hal_t.
int iwl_bus_purge(iwl_backend_store_t *bus);
/// What is known of the link, always up to date.
const iwl_bus_link_t *iwl_bus_link(const iwl_backend_store_t *bus);

/// An e-stop input, as configured.
typedef struct {
    const char *name;     ///< Must outlive the input.
    bool active_high;     ///< Pressed reads high. Only for real lines.
    uint16_t debounce_ms; ///< A release must last this long. Only for real lines.
    /// What the line was called when somebody saw its button work; NULL or "any": not compared. A line that is called
    /// otherwise is not read (EREMCHG), so it counts as pressed. Only for real lines.
    const char *chip;        ///< Label of its chip: numbers of chips change, labels do not.
    const char *chip_line;   ///< Its own name.
    const char *name2;       ///< The second contact of the same button; NULL or "none": it has one.
    bool active_high2;       ///< As `active_high`.
    const char *chip2;       ///< As `chip`.
    const char *chip2_line;  ///< As `chip_line`.
    uint16_t discrepancy_ms; ///< The contacts may say different for so long.
} iwl_estop_config_t;

/// Contacts of a button.
#define IWL_ESTOP_CONTACTS 2U

/// The kernel's names have at most 31 characters.
#define IWL_ESTOP_NAME_SIZE 32U

/// What the kernel calls a line.
typedef struct {
    char chip[IWL_ESTOP_NAME_SIZE]; ///< Label of its chip.
    char line[IWL_ESTOP_NAME_SIZE]; ///< Empty: it has no name of its own.
    char node[IWL_ESTOP_NAME_SIZE]; ///< Of its chip under /dev: no two chips have the same, and it may change.
    unsigned offset;                ///< Of the line on its chip.
} iwl_estop_seen_t;

/// Reads what the line of this name (as in iwl_estop_config_t) is called, also while another program has it. 0, or an
/// errno: ENOTSUP for `unix:PATH` and without libgpiod, else as for opening.
int iwl_estop_see(const char *name, iwl_estop_seen_t *out_seen);

/// A kind of e-stop input. The functions mean the same as those of a bus; `self` is its state, of a type that only it
/// knows.
typedef struct {
    /// 0, or an errno.
    int (*open)(void *self, const iwl_estop_config_t *config);
    void (*close)(void *self);                     ///< Gives back what `open` took.
    int (*watch_fd)(const void *self);             ///< -1: there is nothing to watch.
    void (*poll)(void *self, iw_time_us_t now_us); ///< Call it before every step.
    iw_time_us_t (*next_us)(const void *self);     ///< When `poll` has something to do; IW_NEVER if not.
    /// As `estop_pressed` of iw_hal_t. `quiet`: the wait that has just ended found nothing at the descriptor, so that
    /// there are no edges to be read; the level always is.
    int (*pressed)(void *self, bool quiet);
    int (*trouble)(const void *self); ///< Why it cannot be read, as an errno; 0 while it can.
    /// What the kernel calls the line while it can be read, else NULL. The function is NULL if there is no such name.
    const iwl_estop_seen_t *(*seen)(const void *self);
    bool simulated; ///< Not a real button: announced wherever the e-stop is shown.
    bool present;   ///< False: there is no e-stop at all, always released.
} iwl_estop_ops_t;

/// `unix:PATH`: the simulator's button.
extern const iwl_estop_ops_t iwl_unix_estop_ops;

/// A line of a GPIO chip, by its name or as `gpiochipN:OFFSET`, through libgpiod. NULL if this build has left it out.
extern const iwl_estop_ops_t *const iwl_gpio_estop_ops;

#endif
