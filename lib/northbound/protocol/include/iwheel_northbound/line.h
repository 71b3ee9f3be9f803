// SPDX-License-Identifier: MIT
/// @file
/// Lines of the northbound protocol on a serial wire, for several clients. The wire may lose, double and invent bytes.
///
///     host to board:   CH JSON*CRC\n            0 {"cmd":"link"}*e2d27f9b
///     board to host:   CH T_US JSON*CRC\n       3 1250000 {"ok":true}*e0f15d9c
///
/// CH is one digit: 0 is the wire itself, 1 to 8 are clients. T_US is the time of the board when it wrote the line, in
/// decimal digits without leading zeros. CRC is CRC-32/ISO-HDLC of every byte before the `*`, in 8 lower-case
/// hexadecimal digits. Each line has one valid form; any other is refused. An empty line is ignored: either side may
/// send a newline to end an incomplete line.
///
/// The functions use no heap, and of libc only mem*. They are not re-entrant on the same receiver.
#ifndef IWHEEL_NORTHBOUND_LINE_H
#define IWHEEL_NORTHBOUND_LINE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define IWN_LINE_CHANNELS  8U   ///< Highest channel of a client; channel 0 is the wire itself.
#define IWN_LINE_BOARD_MAX 512U ///< Bytes of a line to the board, with its newline.
#define IWN_LINE_PREFIX    23U  ///< Largest number of bytes before the JSON: channel, stamp and two spaces.
#define IWN_LINE_SUFFIX    10U  ///< Number of bytes after the JSON: `*`, CRC and newline.
#define IWN_LINE_BOOT      16U  ///< Hexadecimal digits of the id of a board's start.
#define IWN_LINE_SILENT_MS 500U ///< A board that receives no good line for this time ends all channels.

/// Result of receiving. NOTHING and GOOD are no faults.
typedef enum {
    IWN_LINE_NOTHING = 0, ///< No line has ended yet.
    IWN_LINE_GOOD,
    IWN_LINE_TOO_BIG,   ///< The line does not fit the buffer.
    IWN_LINE_LOST,      ///< The hardware lost a part of it: iwn_receiver_spoil.
    IWN_LINE_UNCHECKED, ///< The line does not end in `*` and 8 lower-case hexadecimal digits.
    IWN_LINE_CORRUPT,   ///< The CRC does not match.
    IWN_LINE_MISFORMED, ///< The CRC matches, but channel, stamp or braces are wrong: another protocol.
    IWN_LINE_VERDICTS,
} iwn_line_verdict_t;

/// A line.
typedef struct {
    uint64_t t_us;    ///< Time of the board; only with `stamped`.
    const char *json; ///< An object, checked by its braces only; not terminated.
    size_t length;    ///< Length of `json` in bytes.
    uint8_t channel;  ///< 0 to IWN_LINE_CHANNELS.
    bool stamped;     ///< The line comes from the board.
} iwn_line_t;

/// Returns the reason in a `line_error`, for example "corrupt".
const char *iwn_line_verdict_name(iwn_line_verdict_t verdict);

/// Returns the CRC-32/ISO-HDLC. `crc` is 0, or the CRC of the bytes before.
uint32_t iwn_line_crc(uint32_t crc, const void *bytes, size_t length);

/// Writes the part of a line before its JSON: channel, and stamp if it has one. Returns its length; 0 if it does not
/// fit `size`. The caller appends the JSON.
size_t iwn_line_begin(const iwn_line_t *line, char *out, size_t size);

/// Ends a line of which `length` bytes are in `out`: appends `*`, CRC and newline. Returns the length of the line; 0 if
/// it does not fit `size`.
size_t iwn_line_end(char *out, size_t length, size_t size);

/// Writes a whole line. Returns its length with the newline; 0 if it does not fit.
size_t iwn_line_write(const iwn_line_t *line, char *out, size_t size);

/// Judges `length` bytes of a line without newline, with or without a stamp. Writes `*out_line`, which points into
/// `bytes`, for IWN_LINE_GOOD only.
iwn_line_verdict_t iwn_line_read(const char *bytes, size_t length, bool stamped, iwn_line_t *out_line);

/// Receiver of bytes. It holds one line at most, and synchronises at the next newline.
typedef struct {
    char *data;               ///< Buffer of the owner.
    size_t size;              ///< Size of the buffer; a line with its newline must fit.
    size_t length;            ///< Length of the present line.
    bool stamped;             ///< Lines of a board, with stamps.
    iwn_line_verdict_t fault; ///< TOO_BIG or LOST: the line is dropped up to its end; otherwise NOTHING.
} iwn_receiver_t;

/// Initializes an empty receiver. `size` is at least 1.
void iwn_receiver_init(iwn_receiver_t *self, char *data, size_t size, bool stamped);

/// Receives a byte. Returns the verdict at the end of a line that is not empty, otherwise NOTHING. A good line points
/// into the buffer and is valid until the next call.
iwn_line_verdict_t iwn_receiver_put(iwn_receiver_t *self, char byte, iwn_line_t *out_line);

/// Reports lost bytes (framing, overrun, a full ring): the present line is not valid.
void iwn_receiver_spoil(iwn_receiver_t *self);

/// Identifies a command, so that the board never executes an old command as a new one: the start of the board, the
/// number of the command on its channel, and the newest stamp at the time of the command.
typedef struct {
    char boot[IWN_LINE_BOOT + 1U]; ///< Lower-case hexadecimal digits, terminated.
    uint64_t seq;                  ///< Increases with each command on its channel.
    uint64_t t_us;                 ///< Stamp of the board.
} iwn_quote_t;

/// Size of the longest quote before the other fields of a request.
#define IWN_QUOTE_SIZE 84U

/// Writes a request with a quote before its other fields: `{"boot":"..","seq":1,"t_us":2,"cmd":..}`. `json` is an
/// object with at least one field, and begins with its brace. Returns the length; 0 if it does not fit.
size_t iwn_quote_write(const iwn_quote_t *quote, const char *json, size_t length, char *out, size_t size);

/// Removes the quote from a request: `*json` and `*length` then are the request alone, with its brace before the first
/// field. Returns false and changes nothing if the first three fields are not a quote in exactly this form.
bool iwn_quote_take(char **json, size_t *length, iwn_quote_t *out_quote);

#ifdef __cplusplus
}
#endif
#endif
