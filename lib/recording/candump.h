// SPDX-License-Identifier: MIT
/// One line of a recording in candump's log form, as can-utils, python-can, cantools and SavvyCAN read and write it:
///
///     (1760000000.123456) can0 10A#0101F40064 T
///
/// That is: time in seconds, interface, id in hexadecimal (3 digits: standard, 8 digits: extended), data; at the end
/// R (received) or T (sent by the program that recorded it), or nothing. `#R` is a remote frame, `##F` with one digit of
/// flags a CAN FD frame, an 8-digit id with bit 29 set the controller's report of an error.
///
/// Pure functions over a line and its length: no state, no heap, no line is read beyond its length.
#ifndef CANDUMP_H
#define CANDUMP_H

#include "iwheel/can_frame.h"
#include "iwheel/types.h"

#define CANDUMP_DATA_MAX 64U
/// With its terminator; a longer name is refused.
#define CANDUMP_INTERFACE_SIZE 32U
/// Room for the longest line that `candump_write` makes, with newline and terminator.
#define CANDUMP_LINE_SIZE 256U
/// An extended id.
#define CANDUMP_ID_MASK 0x1FFFFFFFU

typedef enum {
    CANDUMP_UNMARKED = 0,
    CANDUMP_RECEIVED, ///< R
    CANDUMP_SENT,     ///< T: the echo of a frame of the program that recorded it.
} candump_mark_t;

typedef struct {
    int64_t time_us; ///< As it stands there: since 1970, or since anything. Never negative.
    uint32_t id;     ///< Without any flag.
    candump_mark_t mark;
    uint8_t length; ///< Bytes in `data`; of a remote frame: the length it asks for.
    bool extended;
    bool remote;
    bool error; ///< Not a frame of the bus.
    bool fd;
    uint8_t fd_flags;
    uint8_t data[CANDUMP_DATA_MAX];
    char interface[CANDUMP_INTERFACE_SIZE];
} candump_t;

typedef enum {
    CANDUMP_FRAME = 0,
    CANDUMP_EMPTY, ///< Blank, or a comment (`#` or `;` first).
    CANDUMP_BAD,   ///< `*out_why` tells cause and cure, in one sentence without a period.
} candump_result_t;

/// Reads one line, with or without its line end (LF or CR LF). `*out_frame` is written only for CANDUMP_FRAME.
candump_result_t candump_parse(const char *line, size_t length, candump_t *out_frame, const char **out_why);

/// Writes the line with its newline and a terminator; returns its length. Characters of the interface's name that some
/// reader does not take are left out; nothing left: `can`.
size_t candump_write(const candump_t *frame, char out_line[CANDUMP_LINE_SIZE]);

/// The frame as the core has it: of a CAN FD frame the first 8 bytes. A frame that was sent is an echo.
iw_can_frame_t candump_to_core(const candump_t *frame);

/// A frame of the core at that time, marked as received or sent.
candump_t candump_from_core(const iw_can_frame_t *frame, int64_t time_us, const char *interface);

#endif
