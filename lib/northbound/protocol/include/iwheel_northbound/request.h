// SPDX-License-Identifier: MIT
/// @file
/// Reads a line of a client. The result is a request with a valid form, or a refusal.
///
/// It is a pure function of the bytes without heap and stdio, so that it can be tested and fuzzed alone. The core later
/// judges what depends on the state of the wheels. share/northbound.json lists the fields of each request.
///
/// The line is read once: one pass checks every byte and stores the position of each name; then each value is read at
/// its place. The pass cannot read the values, because `cmd`, which determines their meaning, may come last, and
/// because a fault of the line as a whole takes precedence.
#ifndef IWHEEL_NORTHBOUND_REQUEST_H
#define IWHEEL_NORTHBOUND_REQUEST_H

#include "iwheel_northbound/json_in.h"
#include "iwheel_northbound/request_fields.h"
#include "iwheel_northbound/words.h"

#ifdef __cplusplus
extern "C" {
#endif

/// Largest number of bytes of a request without its newline.
#define IWN_LINE_MAX        4096U
#define IWN_ID_TEXT_MAX     64U  ///< Bytes of an id that is a text.
#define IWN_NAME_MAX        64U  ///< Bytes of a client's name.
#define IWN_REASON_MAX      200U ///< Bytes of the reason of an estop.
#define IWN_FILE_MAX        63U  ///< Bytes of the name of a recording's file.
#define IWN_KEY_MAX         40U  ///< Bytes of a key of the configuration.
#define IWN_LEASE_KEY_MAX   32U  ///< Hexadecimal digits of a lease key.
#define IWN_RATE_MAX_HZ     100  ///< Highest rate of events.
#define IWN_RATE_DEFAULT_HZ 10   ///< Rate without `rate_hz`.

/// One command of `iwn_cmd_t`.
#define IWN_REQUEST_CMD(cmd, name) IWN_CMD_##cmd,
/// Commands in the order of share/northbound.json: IWN_CMD_HELLO, IWN_CMD_STATUS and so on.
typedef enum { IWN_REQUEST_NAMES(IWN_REQUEST_CMD) IWN_CMDS } iwn_cmd_t;

/// Returns true for commands of a client that may only watch: read, stop and e-stop.
bool iwn_cmd_watches(iwn_cmd_t cmd);

/// Returns true for commands that stop the wheels. A stop is never refused.
bool iwn_cmd_stops(iwn_cmd_t cmd);

/// Type of the id of a request.
typedef enum { IWN_ID_NONE = 0, IWN_ID_NUMBER, IWN_ID_TEXT } iwn_id_kind_t;

/// Id that the reply repeats. The order of the members has the least padding.
typedef struct {
    int64_t number;                  ///< As sent.
    char text[IWN_ID_TEXT_MAX + 1U]; ///< As sent.
    iwn_id_kind_t kind;              ///< Type of the id, or none.
} iwn_id_t;

/// Only the fields of its `cmd` are valid. Numbers are as sent: any 64-bit integer.
typedef struct {
    iwn_id_t id;                            ///< Id for the reply.
    iwn_cmd_t cmd;                          ///< Command, which determines the valid fields.
    iwn_error_t refused;                    ///< IWN_OK; otherwise the line is refused, but its stop is executed.
    int64_t left_mm_s;                      ///< drive.
    int64_t right_mm_s;                     ///< drive.
    int64_t left_mA;                        ///< drive, with `has_current`.
    int64_t right_mA;                       ///< drive, with `has_current`.
    int64_t v_mm_s;                         ///< twist: forward speed.
    int64_t yaw_mrad_s;                     ///< twist: yaw rate, positive to the left.
    int64_t rate_hz;                        ///< watch: at least 1; not limited yet.
    int64_t offset;                         ///< recording: in bytes; may be negative.
    int64_t t_us;                           ///< arm, reset, release and confirm, with `has_t_us`: time of the request.
    int64_t stop;                           ///< reset, with `has_stop`: number of the stop to reset.
    bool has_t_us;                          ///< `t_us` is present.
    bool has_stop;                          ///< `stop` is present.
    bool has_current;                       ///< Both currents are present.
    bool takeover;                          ///< arm.
    bool on;                                ///< record: begin; otherwise end.
    bool has_commit;                        ///< config: `commit` is present.
    bool commit;                            ///< config, with `has_commit`.
    uint8_t topics;                         ///< watch: bit mask of iwn_topic_t.
    uint8_t sides;                          ///< tare: IW_SIDES_...
    iw_assumption_item_t item;              ///< confirm.
    char value[IWN_VALUE_SIZE];             ///< confirm and config, a number as decimal digits; empty if absent.
    char how[IWN_HOW_SIZE];                 ///< confirm; empty if absent.
    char name[IWN_NAME_MAX + 1U];           ///< Empty if absent.
    char reason[IWN_REASON_MAX + 1U];       ///< Empty if absent.
    char file[IWN_FILE_MAX + 1U];           ///< recording: name of the file.
    char key[IWN_KEY_MAX + 1U];             ///< config; empty if absent.
    char lease_key[IWN_LEASE_KEY_MAX + 1U]; ///< drive and twist; empty if absent.
} iwn_request_t;

/// Reason of a refusal: its name, and a message with cause and fix.
typedef struct {
    iwn_error_t error; ///< Name of the error.
    char message[512]; ///< Message, terminated.
} iwn_refusal_t;

/// Writes a refusal whose message is the concatenation of the texts; the last one is NULL. Returns false, so that the
/// caller can return it.
bool iwn_refuse(iwn_refusal_t *out_refusal, iwn_error_t error, const char *const *texts);
/// Does the same with the texts as arguments.
#define IWN_REFUSE(out_refusal, error, ...) iwn_refuse((out_refusal), (error), (const char *const[]){__VA_ARGS__, NULL})

/// Reads `length` bytes without newline. Returns true if `*out_request` is to be executed. Returns false and writes
/// `*out_refusal` otherwise; `out_request->id` then has the id if it could be read. Errors are reported in this order:
/// the line as a whole, the id, the command, its fields in their order, missing fields.
///
/// An object that names a stop (`iwn_cmd_stops`) is always accepted. Its unknown fields and an invalid id are ignored. A
/// reason that is too long is cut, and in an invalid one each byte of a character that is not allowed becomes a space.
///
/// A line that is not one valid JSON object, or is too long, is searched for `"cmd"`, a colon and the name of a stop, at
/// any place and depth; an estop has priority. If there is one, the function returns true with this `cmd`, with the
/// error in `out_request->refused`, and without other fields. It also writes `*out_refusal`: the caller executes the
/// stop, and replies with the refusal. `"cmd"` without escapes is found, its value also with escapes.
bool iwn_request_read(const char *line, size_t length, iwn_work_t *work, iwn_request_t *out_request,
                      iwn_refusal_t *out_refusal);

/// Does the same for a line of which the caller knows that it has at most IWN_LINE_MAX bytes.
bool iwn_request_read_short(const char *line, size_t length, iwn_work_t *work, iwn_request_t *out_request,
                            iwn_refusal_t *out_refusal);

#ifdef __cplusplus
}
#endif
#endif
