// SPDX-License-Identifier: MIT
/// State of the board at the other end of the line: whether it answers, its boot id, the arrival of its stamps, and
/// bytes that were not understood (serial_trouble.h judges them).
///
///     SILENT --event link--> LINKED --no good line for SERIAL_SILENT_US--> SILENT
///                              '--another boot, a stamp that decreases--> SILENT (LINKED again with the other boot)
///
/// Pure state machine: the inputs are bytes and times.
#ifndef SERIAL_LINK_H
#define SERIAL_LINK_H

#include "iwheel_northbound/json_in.h"
#include "iwheel_northbound/line.h"

#include <stdio.h>

/// The board sends `link` once a second. After three missing ones the board is gone.
#define SERIAL_SILENT_US 3200000U
/// Largest line of a board.
#define SERIAL_LINE_MAX 65600U
/// Number and shortest distance of stored stamps: 32 of them cover more time than the largest age of a command.
#define SERIAL_STAMPS   32U
#define SERIAL_STAMP_US 10000U
/// Size of the sample of bytes that were not understood.
#define SERIAL_SAMPLE 48U

typedef struct {
    uint64_t received_us; ///< Time of this computer.
    uint64_t t_us;        ///< Time of the board.
} serial_stamp_t;

/// Bytes since the port was opened, since the last good line, or since the last judgement.
typedef struct {
    uint64_t bytes;
    uint64_t odd;                      ///< Bytes that are neither printable ASCII nor a newline.
    uint64_t lines[IWN_LINE_VERDICTS]; ///< Lines by verdict.
    char sample[SERIAL_SAMPLE + 1U];   ///< Sample of the last line without a CRC, in printable form.
    size_t sampled;
} serial_noise_t;

typedef enum { SERIAL_SILENT, SERIAL_LINKED } serial_link_state_t;

typedef struct {
    iwn_receiver_t receiver;
    iwn_work_t work;
    serial_link_state_t state;
    char boot[IWN_LINE_BOOT + 1U];
    char version[33];
    int64_t fault_cause; ///< Fault that ended an earlier run of the board (fault.h of the port); 0: none.
    int64_t fault_pc;
    uint64_t received_us; ///< Time of the last good line, or of opening the port.
    serial_stamp_t stamp[SERIAL_STAMPS];
    unsigned stamps; ///< Number of stamps since the boot id is known.
    serial_noise_t noise;
    uint64_t refused;    ///< Total number of lines that could not be parsed.
    uint64_t complaints; ///< Total number of complaints of the board about lines of this relay.
    char buffer[SERIAL_LINE_MAX];
} serial_link_t;

/// Meaning of a good line for the relay.
typedef enum {
    SERIAL_NEWS_NONE = 0,
    SERIAL_NEWS_LINE,   ///< For a client: `out_line`.
    SERIAL_NEWS_LINKED, ///< A board has appeared, or has restarted: all former clients are gone.
    SERIAL_NEWS_LOST,   ///< The board has restarted without a boot id yet: ask for it. All former clients are gone.
} serial_news_t;

/// Initializes the link after the port was opened.
void serial_link_init(serial_link_t *self, uint64_t now_us);

/// Receives one byte of the port.
serial_news_t serial_link_put(serial_link_t *self, char byte, uint64_t now_us, iwn_line_t *out_line);

/// Returns true once, when no good line of a board has arrived for SERIAL_SILENT_US.
bool serial_link_fell_silent(serial_link_t *self, uint64_t now_us);

/// Writes the newest stamp that had arrived at that time. Returns false if there was none.
bool serial_link_stamp(const serial_link_t *self, uint64_t then_us, uint64_t *out_t_us);

/// Returns the board's time then, as far as known: by the newest stamp, and not later than this. The line delays stamps,
/// so the true time may be later. 0: unknown.
uint64_t serial_link_time(const serial_link_t *self, uint64_t then_us);

/// Resets the counters of bytes that were not understood.
void serial_link_forget_noise(serial_link_t *self);

#endif
