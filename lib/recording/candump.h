// SPDX-License-Identifier: MIT
/// Reads and writes one line of candump's log form, which can-utils, python-can, cantools and SavvyCAN also use:
///
///     (1760000000.123456) can0 10A#0101F40064 T
///
/// The fields are: time in seconds, interface, id in hexadecimal (3 digits: standard, 8 digits: extended), data; at the
/// end R (received), T (sent by the recording program), or nothing. `#R` is a remote frame, `##F` with one digit of
/// flags a CAN FD frame, and an 8-digit id with bit 29 set an error report of the controller.
///
/// Pure functions of a line and its length: no state, no heap, no access beyond the length.
#ifndef CANDUMP_H
#define CANDUMP_H

#include "iwheel/can_frame.h"
#include "iwheel/types.h"

#define CANDUMP_DATA_MAX 64U
/// Size of an interface name with its terminator. A longer name is refused.
#define CANDUMP_INTERFACE_SIZE 32U
/// Size of the longest line of `candump_write`, with newline and terminator.
#define CANDUMP_LINE_SIZE 256U
/// Mask of an extended id.
#define CANDUMP_ID_MASK 0x1FFFFFFFU

typedef enum {
    CANDUMP_UNMARKED = 0,
    CANDUMP_RECEIVED, ///< Mark R.
    CANDUMP_SENT,     ///< Mark T: the echo of a frame of the recording program.
} candump_mark_t;

typedef struct {
    int64_t time_us; ///< Time as in the line: since 1970, or since another instant. Never negative.
    uint32_t id;     ///< Id without flags.
    candump_mark_t mark;
    uint8_t length; ///< Number of bytes in `data`; for a remote frame the requested length.
    bool extended;
    bool remote;
    bool error; ///< Error report of the controller, not a frame of the bus.
    bool fd;
    uint8_t fd_flags;
    uint8_t data[CANDUMP_DATA_MAX];
    char interface[CANDUMP_INTERFACE_SIZE];
} candump_t;

typedef enum {
    CANDUMP_FRAME = 0,
    CANDUMP_EMPTY, ///< Blank line, or comment (begins with `#` or `;`).
    CANDUMP_BAD,   ///< `*out_why` has cause and fix, in one sentence without a period.
} candump_result_t;

/// Reads one line, with or without its line end (LF or CR LF). Writes `*out_frame` only for CANDUMP_FRAME.
candump_result_t candump_parse(const char *line, size_t length, candump_t *out_frame, const char **out_why);

/// Writes the line with newline and terminator, and returns its length. It omits characters of the interface name that
/// some readers do not accept. If none is left, the name is `can`.
size_t candump_write(const candump_t *frame, char out_line[CANDUMP_LINE_SIZE]);

/// Converts a line to a frame of the core: the first 8 bytes of a CAN FD frame. A sent frame becomes an echo.
iw_can_frame_t candump_to_core(const candump_t *frame);

/// Converts a frame of the core to a line with that time, marked as received or sent.
candump_t candump_from_core(const iw_can_frame_t *frame, int64_t time_us, const char *interface);

#endif
