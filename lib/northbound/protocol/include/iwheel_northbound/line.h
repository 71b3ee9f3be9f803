// SPDX-License-Identifier: MIT
/// @file
/// Lines of the northbound protocol on a serial wire: several clients on one wire that loses, doubles and invents bytes.
///
///     host to board:   CH JSON*CRC\n            0 {"cmd":"link"}*e2d27f9b
///     board to host:   CH T_US JSON*CRC\n       3 1250000 {"ok":true}*e0f15d9c
///
/// CH is one digit: 0 is the wire itself, 1 to 8 are clients. T_US is the board's time when it wrote the line, decimal digits
/// without leading zeros. CRC is CRC-32/ISO-HDLC of every byte before the `*`, 8 lower-case hexadecimal digits. There is one
/// spelling of each line: whatever differs from it by a bit is refused. An empty line means nothing and is not answered: either
/// side may send a newline to end half a line of before.
///
/// No heap, no libc beyond mem*; for a microcontroller too. Not re-entrant on the same receiver.
#ifndef IWHEEL_NORTHBOUND_LINE_H
#define IWHEEL_NORTHBOUND_LINE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define IWN_LINE_CHANNELS  8U   ///< The highest channel of a client; the wire itself is 0.
#define IWN_LINE_BOARD_MAX 512U ///< Bytes of a line to the board, with its newline.
#define IWN_LINE_PREFIX    23U  ///< The most that stands before the JSON: channel, stamp and two spaces.
#define IWN_LINE_SUFFIX    10U  ///< What stands behind it: `*`, CRC and newline.
#define IWN_LINE_BOOT      16U  ///< Hexadecimal digits that name a start of the board.
#define IWN_LINE_SILENT_MS 500U ///< A board that hears no good line for so long ends all channels.

/// What has been received. NOTHING and GOOD are no faults.
typedef enum {
    IWN_LINE_NOTHING = 0, ///< No line has ended yet.
    IWN_LINE_GOOD,
    IWN_LINE_TOO_BIG,   ///< It did not fit the buffer.
    IWN_LINE_LOST,      ///< The hardware lost some of it: iwn_receiver_spoil.
    IWN_LINE_UNCHECKED, ///< It does not end in `*` and 8 lower-case hexadecimal digits.
    IWN_LINE_CORRUPT,   ///< Its CRC is another.
    IWN_LINE_MISFORMED, ///< The CRC is right, but channel, stamp or braces are not: another protocol.
    IWN_LINE_VERDICTS,
} iwn_line_verdict_t;

/// A line.
typedef struct {
    uint64_t t_us;    ///< The board's time; only with `stamped`.
    const char *json; ///< An object, by its braces only; no zero byte behind it.
    size_t length;    ///< Of `json`, bytes.
    uint8_t channel;  ///< 0 to IWN_LINE_CHANNELS.
    bool stamped;     ///< From the board.
} iwn_line_t;

/// Such as "corrupt": the reason in a `line_error`.
const char *iwn_line_verdict_name(iwn_line_verdict_t verdict);

/// CRC-32/ISO-HDLC, continued: `crc` is 0 or what the bytes before gave.
uint32_t iwn_line_crc(uint32_t crc, const void *bytes, size_t length);

/// Writes what stands before the JSON of a line with this channel, and this stamp if it has one, into `size` bytes. How many
/// it wrote; 0 if it does not fit. The caller puts its JSON behind it.
size_t iwn_line_begin(const iwn_line_t *line, char *out, size_t size);

/// `length` bytes of a line stand in `out`, JSON and what is before it: adds `*`, CRC and newline. The whole length; 0 if it
/// does not fit `size`.
size_t iwn_line_end(char *out, size_t length, size_t size);

/// Writes a whole line. Its length with the newline; 0 if it does not fit.
size_t iwn_line_write(const iwn_line_t *line, char *out, size_t size);

/// Judges `length` bytes, without newline, of a line that has a stamp or has not. `*out_line`, which points into `bytes`, is
/// written for IWN_LINE_GOOD only.
iwn_line_verdict_t iwn_line_read(const char *bytes, size_t length, bool stamped, iwn_line_t *out_line);

/// Bytes on their way to become lines. It holds one line at most, and finds its way back at the next newline.
typedef struct {
    char *data;               ///< The owner's buffer.
    size_t size;              ///< Of the buffer; a line with its newline must fit.
    size_t length;            ///< Of the line so far.
    bool stamped;             ///< Lines of a board are expected.
    iwn_line_verdict_t fault; ///< The line is thrown away up to its end: TOO_BIG or LOST; else NOTHING.
} iwn_receiver_t;

/// Empty. `size` is at least 1.
void iwn_receiver_init(iwn_receiver_t *self, char *data, size_t size, bool stamped);

/// Takes a byte. At the end of a line that is not empty its verdict, else NOTHING. A good line points into the buffer: it is
/// there until the next call.
iwn_line_verdict_t iwn_receiver_put(iwn_receiver_t *self, char byte, iwn_line_t *out_line);

/// Bytes were lost before they came here (framing, overrun, a full ring): the line that they were of is not to be trusted.
void iwn_receiver_spoil(iwn_receiver_t *self);

/// What a command quotes, so that no old one can be taken for a new one: which start of the board it was meant for, the how
/// manieth of its channel it is, and the newest stamp that had been heard when the command was read.
typedef struct {
    char boot[IWN_LINE_BOOT + 1U]; ///< Lower-case hexadecimal digits, terminated.
    uint64_t seq;                  ///< Rises with each on its channel.
    uint64_t t_us;                 ///< A stamp of the board's.
} iwn_quote_t;

/// Room for the longest quote in front of a request's other fields.
#define IWN_QUOTE_SIZE 84U

/// Writes a request with a quote before its other fields: `{"boot":"..","seq":1,"t_us":2,"cmd":..}`. `json` is an object with
/// one field at least, whose first byte is its brace. The length, 0 if it does not fit.
size_t iwn_quote_write(const iwn_quote_t *quote, const char *json, size_t length, char *out, size_t size);

/// Takes the quote off a request: what is left, `*json` and `*length`, is the request alone, whose brace is put before its
/// first field. False, with nothing changed, if the first three fields are not a quote in exactly that spelling.
bool iwn_quote_take(char **json, size_t *length, iwn_quote_t *out_quote);

#endif
