// SPDX-License-Identifier: MIT
/// @file
/// Interface of the backends: the bus, and the kinds of e-stop. Each kind is one file. The rest of the port does not
/// depend on the kind.
///
/// A backend is opened once and stays open for the life of the process. The interface or line behind it may disappear
/// and return: the state of the backend reports it, and `poll` reopens it. A backend owns one descriptor that never
/// changes (an epoll set, if the descriptor behind it changes). The owner watches it for reading and then runs a step.
///
/// After open no function blocks or allocates; open itself may wait for half a second. All calls must come from one
/// thread.
#ifndef IWHEEL_LINUX_BACKEND_H
#define IWHEEL_LINUX_BACKEND_H

#include "iwheel/hal.h"
#include "iwheel_linux/bus_link.h"

#ifdef __cplusplus
extern "C" {
#endif

/// Storage for the state of any backend, so that its owner need not know the size.
typedef union {
    uint64_t align;      ///< Sets the strictest alignment that a backend needs.
    uint8_t bytes[8192]; ///< State of the backend.
} iwl_backend_store_t;

/// Opens a bus by its name: `unix:PATH` is the local bus, any other name is a SocketCAN interface. Returns 0 or an
/// errno; then nothing is open. ENOTSUP: this build has no bus of that kind. An absent interface is not an error: the
/// bus is down until the interface appears. `name` must exist as long as the bus, and the bus must not move.
int iwl_bus_open(iwl_backend_store_t *bus, const char *name);
/// Closes the bus and releases its resources.
void iwl_bus_close(iwl_backend_store_t *bus);
/// Returns the descriptor to watch for reading. It is the same from open to close.
int iwl_bus_fd(const iwl_backend_store_t *bus);
/// Reopens a lost interface or connection when the retry is due, and closes one that has failed. Call it before every
/// step.
void iwl_bus_poll(iwl_backend_store_t *bus, iw_time_us_t now_us);
/// Reports whether the last wait found the descriptor readable. Without such reports the bus reads its events in every
/// step.
void iwl_bus_waited(iwl_backend_store_t *bus, bool woken);
/// Returns the time at which `poll` must be called; IW_NEVER if it need not.
iw_time_us_t iwl_bus_next_us(const iwl_backend_store_t *bus);
/// Implements `send` of iw_hal_t.
int iwl_bus_send(iwl_backend_store_t *bus, const iw_can_frame_t *frames, uint32_t count);
/// Implements `receive` of iw_hal_t.
int iwl_bus_receive(iwl_backend_store_t *bus, iw_can_frame_t *out_frame);
/// Implements `bus_state` of iw_hal_t.
iw_bus_state_t iwl_bus_state(iwl_backend_store_t *bus);
/// Implements `purge` of iw_hal_t.
int iwl_bus_purge(iwl_backend_store_t *bus);
/// Returns the state of the link. The pointer is valid until close, and its target is always up to date.
const iwl_bus_link_t *iwl_bus_link(const iwl_backend_store_t *bus);

/// Configuration of an e-stop input.
typedef struct {
    const char *name;     ///< Name of the line. It must exist as long as the input.
    bool active_high;     ///< Pressed reads high. For GPIO lines only.
    uint16_t debounce_ms; ///< Shortest release that counts. For GPIO lines only.
    /// Names that the line had when its button was tested; NULL or "any" to accept every name. A line with another name
    /// is not read (EREMCHG) and counts as pressed. For GPIO lines only.
    const char *chip;        ///< Label of the chip: the number of a chip may change, its label does not.
    const char *chip_line;   ///< Name of the line on its chip.
    const char *name2;       ///< Second contact of the same button; NULL or "none" if there is none.
    bool active_high2;       ///< `active_high` of the second contact.
    const char *chip2;       ///< `chip` of the second contact.
    const char *chip2_line;  ///< `chip_line` of the second contact.
    uint16_t discrepancy_ms; ///< Longest difference between the contacts that is not a fault.
} iwl_estop_config_t;

/// Number of contacts of a button.
#define IWL_ESTOP_CONTACTS 2U

/// The kernel limits these names to 31 characters.
#define IWL_ESTOP_NAME_SIZE 32U

/// Identity of a line as the kernel reports it.
typedef struct {
    char chip[IWL_ESTOP_NAME_SIZE]; ///< Label of the chip.
    char line[IWL_ESTOP_NAME_SIZE]; ///< Name of the line; empty if it has none.
    char node[IWL_ESTOP_NAME_SIZE]; ///< Device name of the chip under /dev. It is unique, but may change.
    unsigned offset;                ///< Offset of the line on its chip.
} iwl_estop_seen_t;

/// Reads the identity of the line `name` (as in iwl_estop_config_t), even if another program uses it. Returns 0 or an
/// errno: ENOTSUP for `unix:PATH` and without libgpiod, otherwise as for opening.
int iwl_estop_see(const char *name, iwl_estop_seen_t *out_seen);

/// Functions of a kind of e-stop input. They correspond to those of a bus. `self` is the state; only the kind knows its
/// type.
typedef struct {
    /// Returns 0 or an errno.
    int (*open)(void *self, const iwl_estop_config_t *config);
    void (*close)(void *self);                     ///< Releases the resources of `open`.
    int (*watch_fd)(const void *self);             ///< Returns the descriptor to watch; -1 if there is none.
    void (*poll)(void *self, iw_time_us_t now_us); ///< Call it before every step.
    iw_time_us_t (*next_us)(const void *self);     ///< Time at which `poll` must be called; IW_NEVER if not.
    /// Implements `estop_pressed` of iw_hal_t. `quiet`: the last wait found the descriptor not readable, so there are
    /// no edges to read. The level is always read.
    int (*pressed)(void *self, bool quiet);
    int (*trouble)(const void *self); ///< Errno of the reason why it cannot be read; 0 while it can.
    /// Returns the identity of the line while it can be read, otherwise NULL. The function pointer is NULL for kinds
    /// without identity.
    const iwl_estop_seen_t *(*seen)(const void *self);
    bool simulated; ///< Not a real button. Every display of the e-stop shows that.
    bool present;   ///< False if there is no e-stop: always released.
} iwl_estop_ops_t;

/// E-stop `unix:PATH`: the button of the simulator.
extern const iwl_estop_ops_t iwl_unix_estop_ops;

/// E-stop on a GPIO line, by its name or as `gpiochipN:OFFSET`, through libgpiod. NULL if this build has no libgpiod.
extern const iwl_estop_ops_t *const iwl_gpio_estop_ops;

#ifdef __cplusplus
}
#endif
#endif
