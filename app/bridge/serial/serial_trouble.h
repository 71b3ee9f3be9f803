// SPDX-License-Identifier: MIT
/// Why no board answers on the port: judged anew every SERIAL_TROUBLE_US by the bytes of that window.
///
///     begin --SERIAL_TROUBLE_US--> judged --each window--> judged again
///
/// Clients get the newest reason. The log gets a reason when its kind changes, and the same kind again after
/// SERIAL_TROUBLE_AGAIN_US, with its new counts (no bytes have none). A line whose kind changes all the time cannot flood the log: SERIAL_TROUBLE_BURST changes are
/// logged without a wait, then one for each SERIAL_TROUBLE_REFILL_US.
///
/// Pure state: counts and time in, decisions and strings out.
#ifndef SERIAL_TROUBLE_H
#define SERIAL_TROUBLE_H

#include "serial_link.h"

#define SERIAL_TROUBLE_US        2500000U
#define SERIAL_TROUBLE_AGAIN_US  600000000U
#define SERIAL_TROUBLE_BURST     8U
#define SERIAL_TROUBLE_REFILL_US 300000000U
/// A device that pauses for less than this keeps the reason that its bytes gave.
#define SERIAL_TROUBLE_PAUSE_US 10000000U

typedef enum {
    SERIAL_TROUBLE_NONE = 0, ///< Not judged yet.
    SERIAL_TROUBLE_NO_BYTES,
    SERIAL_TROUBLE_BAUD,
    SERIAL_TROUBLE_DAMAGED,
    SERIAL_TROUBLE_PROTOCOL,
    SERIAL_TROUBLE_NO_LINE,
} serial_trouble_kind_t;

/// Named in the reasons.
typedef struct {
    const char *port;
    unsigned baud;
} serial_place_t;

/// Who gets the reason of a window.
typedef enum {
    SERIAL_REPORT_KEEP = 0, ///< Nobody: the reason of before still holds.
    SERIAL_REPORT_CLIENTS,
    SERIAL_REPORT_LOG, ///< The log and the clients.
} serial_report_t;

typedef struct {
    serial_trouble_kind_t kind;
    serial_trouble_kind_t logged;
    uint64_t judge_us;    ///< The window ends then.
    uint64_t received_us; ///< The last window with bytes ended then.
    uint64_t logged_us;
    uint64_t spent_us; ///< The burst is whole again then.
} serial_trouble_t;

/// The port was opened, or the board that answered has gone: a window begins.
void serial_trouble_begin(serial_trouble_t *self, uint64_t now_us);

/// Judges the window that ends now; the next one begins. The caller forgets its noise.
serial_report_t serial_trouble_judge(serial_trouble_t *self, const serial_noise_t *noise, uint64_t now_us);

/// The reason that this noise shows, with its fix.
void serial_trouble_write(const serial_noise_t *noise, const serial_place_t *place, char *out, size_t size);

#endif
