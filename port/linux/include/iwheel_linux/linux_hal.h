// SPDX-License-Identifier: MIT
/// @file
/// A bus and an e-stop input, opened and tended together, as one HAL for the core.
///
/// A loss or an edge is reported once: asking a second time would take it from the core.
#ifndef IWHEEL_LINUX_HAL_H
#define IWHEEL_LINUX_HAL_H

#include "iwheel_linux/backend.h"

/// A bus and an e-stop, opened. Its members are the port's own.
typedef struct {
    const iwl_estop_ops_t *estop_ops;     ///< The kind of the e-stop, of both its contacts.
    bool two_contacts;                    ///< It has a second one.
    int estop_last;                       ///< The last answer given to the core; -1 before the first.
    int contact_last[IWL_ESTOP_CONTACTS]; ///< What each contact said then; the second says 0 if there is none.
    iw_time_us_t now_us;                  ///< Of the last `poll`.
    iw_estop_pair_t pair;                 ///< What both say together.
    bool estop_quiet; ///< The last wait found no edge at the e-stop's descriptor, and it has not been read since.
    iwl_backend_store_t bus;    ///< State of the bus.
    iwl_backend_store_t estop;  ///< State of the e-stop.
    iwl_backend_store_t estop2; ///< Of its second contact.
} iwl_hal_t;

/// Opens both, by their names in the configuration. 0 or an errno; `*out_cause` is then the name at fault. ENOTSUP:
/// this build has no backend for it; EXDEV: one contact of the e-stop is simulated and the other is not; ENOTUNIQ: both
/// are the same line, under whatever names. Nothing stays open on failure. The names must outlive the HAL.
int iwl_hal_open(iwl_hal_t *self, const char *bus_name, const iwl_estop_config_t *estop, const char **out_cause);
/// Closes both.
void iwl_hal_close(iwl_hal_t *self);

/// The table of functions for the core. It is valid, as `self` is, until the HAL is closed; `self` must not move.
iw_hal_t iwl_hal(iwl_hal_t *self);

/// As `estop_pressed` of iw_hal_t.
int iwl_hal_pressed(iwl_hal_t *self);

/// Descriptor of the bus to watch for reading.
int iwl_hal_bus_fd(const iwl_hal_t *self);
/// The same of the e-stop; -1: there is nothing to watch.
int iwl_hal_estop_fd(const iwl_hal_t *self);
/// The same of its second contact.
int iwl_hal_estop2_fd(const iwl_hal_t *self);

/// What a wait for both descriptors has found readable.
typedef struct {
    bool bus;   ///< That of the bus.
    bool estop; ///< That of the e-stop.
} iwl_reported_t;

/// May be called right after such a wait, which saves reading of what has nothing to tell: edges of the e-stop in the
/// next look, news of other interfaces until the next wait.
void iwl_hal_waited(iwl_hal_t *self, iwl_reported_t told);

/// Call before every step.
void iwl_hal_poll(iwl_hal_t *self, iw_time_us_t now_us);

/// When `poll` has something to do; IW_NEVER if it has not.
iw_time_us_t iwl_hal_next_us(const iwl_hal_t *self);

/// What is known of the link to the bus; valid until the HAL is closed.
const iwl_bus_link_t *iwl_hal_link(const iwl_hal_t *self);

/// What the kernel calls the line of a contact, 0 or 1. False if it cannot be read now, or has no such name.
bool iwl_hal_estop_seen(const iwl_hal_t *self, unsigned contact, iwl_estop_seen_t *out_seen);

/// Why a contact of the e-stop cannot be read, as an errno; 0 while it can.
int iwl_hal_estop_trouble(const iwl_hal_t *self, unsigned contact);

#endif
