// SPDX-License-Identifier: MIT
/// @file
/// HAL of the core on Linux: a bus and an e-stop input, opened and polled together.
///
/// The HAL reports a loss or an edge once, to the first caller. Only the core may call these functions of the HAL.
#ifndef IWHEEL_LINUX_HAL_H
#define IWHEEL_LINUX_HAL_H

#include "iwheel_linux/backend.h"

#ifdef __cplusplus
extern "C" {
#endif

/// An open bus and an open e-stop. Only the port may use the members.
typedef struct {
    const iwl_estop_ops_t *estop_ops;     ///< Kind of the e-stop, the same for both contacts.
    bool two_contacts;                    ///< The e-stop has a second contact.
    int estop_last;                       ///< Last result for the core; -1 before the first.
    int contact_last[IWL_ESTOP_CONTACTS]; ///< Last reading of each contact; 0 for a second contact that does not exist.
    iw_time_us_t now_us;                  ///< Time of the last `poll`.
    iw_estop_pair_t pair;                 ///< Combination of both contacts.
    bool estop_quiet; ///< The last wait found no edge at the descriptor of the e-stop, and it has not been read since.
    iwl_backend_store_t bus;    ///< State of the bus.
    iwl_backend_store_t estop;  ///< State of the e-stop.
    iwl_backend_store_t estop2; ///< State of its second contact.
} iwl_hal_t;

/// Opens the bus and the e-stop by their configured names, which must exist as long as the HAL. Returns 0 or an errno;
/// then nothing is open and `*out_cause` is the name at fault. ENOTSUP: this build has no backend for it. EXDEV: one
/// contact of the e-stop is simulated and the other is not. ENOTUNIQ: both contacts are the same line.
int iwl_hal_open(iwl_hal_t *self, const char *bus_name, const iwl_estop_config_t *estop, const char **out_cause);
/// Closes the bus and the e-stop.
void iwl_hal_close(iwl_hal_t *self);

/// Returns the functions for the core. They are valid until the HAL is closed. `self` must not move.
iw_hal_t iwl_hal(iwl_hal_t *self);

/// Implements `estop_pressed` of iw_hal_t.
int iwl_hal_pressed(iwl_hal_t *self);

/// Returns the descriptor of the bus to watch for reading.
int iwl_hal_bus_fd(const iwl_hal_t *self);
/// Returns the descriptor of the e-stop to watch for reading; -1 if there is none.
int iwl_hal_estop_fd(const iwl_hal_t *self);
/// Returns the descriptor of the second contact; -1 if there is none.
int iwl_hal_estop2_fd(const iwl_hal_t *self);

/// Descriptors that a wait found readable.
typedef struct {
    bool bus;   ///< The descriptor of the bus.
    bool estop; ///< The descriptor of the e-stop.
} iwl_reported_t;

/// Reports the result of a wait for both descriptors. Calling it directly after the wait saves system calls: the next
/// reading of the e-stop reads no edges, and the bus reads no interface events until the next wait.
void iwl_hal_waited(iwl_hal_t *self, iwl_reported_t woken);

/// Polls bus and e-stop. Call it before every step.
void iwl_hal_poll(iwl_hal_t *self, iw_time_us_t now_us);

/// Returns the time at which `poll` must be called; IW_NEVER if it need not.
iw_time_us_t iwl_hal_next_us(const iwl_hal_t *self);

/// Returns the state of the link. It is valid until the HAL is closed.
const iwl_bus_link_t *iwl_hal_link(const iwl_hal_t *self);

/// Reads the identity of the line of a contact (0 or 1). Returns false if it cannot be read now, or has none.
bool iwl_hal_estop_seen(const iwl_hal_t *self, unsigned contact, iwl_estop_seen_t *out_seen);

/// Returns the errno of the reason why a contact cannot be read; 0 while it can.
int iwl_hal_estop_trouble(const iwl_hal_t *self, unsigned contact);

#ifdef __cplusplus
}
#endif
#endif
