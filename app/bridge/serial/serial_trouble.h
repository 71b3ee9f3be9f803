// SPDX-License-Identifier: MIT
/// Reason why no board answers on the port, judged every SERIAL_TROUBLE_US by the bytes of that window.
///
///     begin --SERIAL_TROUBLE_US--> judged --each window--> judged again
///
/// Clients receive the newest reason. The log receives a reason when its kind changes, and the same kind again after
/// SERIAL_TROUBLE_AGAIN_US, with its new counts. A line whose kind changes often cannot flood the log: it receives
/// SERIAL_TROUBLE_BURST changes without delay, and then one per SERIAL_TROUBLE_REFILL_US.
///
/// Pure state machine: the inputs are counts and times.
#ifndef SERIAL_TROUBLE_H
#define SERIAL_TROUBLE_H

#include "serial_link.h"

#define SERIAL_TROUBLE_US        2500000U
#define SERIAL_TROUBLE_AGAIN_US  600000000U
#define SERIAL_TROUBLE_BURST     8U
#define SERIAL_TROUBLE_REFILL_US 300000000U
/// A device that pauses for less than this time retains its reason.
#define SERIAL_TROUBLE_PAUSE_US 10000000U

typedef enum {
    SERIAL_TROUBLE_NONE = 0, ///< Not judged yet.
    SERIAL_TROUBLE_NO_BYTES,
    SERIAL_TROUBLE_BAUD,
    SERIAL_TROUBLE_DAMAGED,
    SERIAL_TROUBLE_PROTOCOL,
    SERIAL_TROUBLE_NO_LINE,
} serial_trouble_kind_t;

/// Names for the reasons.
typedef struct {
    const char *port;
    unsigned baud;
} serial_place_t;

/// Receivers of the reason of a window.
typedef enum {
    SERIAL_REPORT_KEEP = 0, ///< None: the reason has not changed.
    SERIAL_REPORT_CLIENTS,
    SERIAL_REPORT_LOG, ///< The log and the clients.
} serial_report_t;

typedef struct {
    serial_trouble_kind_t kind;
    serial_trouble_kind_t logged;
    uint64_t judge_us;    ///< End of the window.
    uint64_t received_us; ///< End of the last window with bytes.
    uint64_t logged_us;
    uint64_t spent_us; ///< Time at which the number of logged changes is reset.
} serial_trouble_t;

/// Begins a window after the port was opened, or the board was lost.
void serial_trouble_begin(serial_trouble_t *self, uint64_t now_us);

/// Judges the window that ends now and begins the next one. The caller resets its counters.
serial_report_t serial_trouble_judge(serial_trouble_t *self, const serial_noise_t *noise, uint64_t now_us);

/// Writes the reason for these counters, with its fix.
void serial_trouble_write(const serial_noise_t *noise, const serial_place_t *place, char *out, size_t size);

#endif
