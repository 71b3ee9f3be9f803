// SPDX-License-Identifier: MIT
/// What is known of the board at the other end of the line: is it there, which start of it, which stamps came when, and what came
/// that was not understood (serial_trouble.h judges it).
///
///     SILENT --event link--> LINKED --no good line for SERIAL_SILENT_US--> SILENT
///                              '--another boot, a stamp that falls--> SILENT (and at once LINKED with the other boot)
///
/// Pure: bytes and time in, lines out.
#ifndef SERIAL_LINK_H
#define SERIAL_LINK_H

#include "iwheel_northbound/json_in.h"
#include "iwheel_northbound/line.h"

#include <stdio.h>

/// The board says `link` once a second; three of them missed are a board that has gone.
#define SERIAL_SILENT_US 3200000U
/// The longest line of a board that is read.
#define SERIAL_LINE_MAX 65600U
/// Stamps that are remembered, and how far apart at least: 32 of them reach back further than a command may be old.
#define SERIAL_STAMPS   32U
#define SERIAL_STAMP_US 10000U
/// The beginning of what was not understood, for people.
#define SERIAL_SAMPLE 48U

typedef struct {
    uint64_t received_us; ///< By our clock.
    uint64_t t_us;        ///< By the board's.
} serial_stamp_t;

/// What came over the line since it was opened, last understood or last judged.
typedef struct {
    uint64_t bytes;
    uint64_t odd;                      ///< Of them neither printable ASCII nor a newline.
    uint64_t lines[IWN_LINE_VERDICTS]; ///< By verdict.
    char sample[SERIAL_SAMPLE + 1U];   ///< Of the last line without a CRC, made printable.
    size_t sampled;
} serial_noise_t;

typedef enum { SERIAL_SILENT, SERIAL_LINKED } serial_link_state_t;

typedef struct {
    iwn_receiver_t receiver;
    iwn_work_t work;
    serial_link_state_t state;
    char boot[IWN_LINE_BOOT + 1U];
    char version[33];
    uint64_t received_us; ///< The last good line, or when the port was opened.
    serial_stamp_t stamp[SERIAL_STAMPS];
    unsigned stamps; ///< Ever noted since the boot was learnt.
    serial_noise_t noise;
    uint64_t refused;    ///< Lines that could not be understood, ever.
    uint64_t complaints; ///< Of the board about lines of ours, ever.
    char buffer[SERIAL_LINE_MAX];
} serial_link_t;

/// What a good line means to the relay.
typedef enum {
    SERIAL_NEWS_NONE = 0,
    SERIAL_NEWS_LINE,   ///< For a client: `out_line`.
    SERIAL_NEWS_LINKED, ///< A board is there that was not, or that has started anew: all clients of before have gone.
    SERIAL_NEWS_LOST,   ///< It has started anew, but has not said its boot yet: ask. All clients of before have gone.
} serial_news_t;

/// The port was opened, or opened again.
void serial_link_init(serial_link_t *self, uint64_t now_us);

/// Takes one byte of the port.
serial_news_t serial_link_put(serial_link_t *self, char byte, uint64_t now_us, iwn_line_t *out_line);

/// True once, when a board that was there has not been heard for SERIAL_SILENT_US.
bool serial_link_fell_silent(serial_link_t *self, uint64_t now_us);

/// The newest stamp that had been heard at that time; false if none had.
bool serial_link_stamp(const serial_link_t *self, uint64_t then_us, uint64_t *out_t_us);

/// Begins to count anew what is not understood.
void serial_link_forget_noise(serial_link_t *self);

#endif
