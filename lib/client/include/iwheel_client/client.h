// SPDX-License-Identifier: MIT
/// @file
/// A connection to iwheel-gateway for programs in C: connect, send requests, receive events, drive.
///
///     iwc_t *gateway = iwc_new();
///     iwc_terms_t terms;
///     if (iwc_connect(gateway, NULL, 1000) == IWC_OK && iwc_arm(gateway, "example", false, 1000, &terms) == IWC_OK) {
///         // iwc_drive(...) every terms.lease_ms / 3, for as long as the wheels shall turn
///         iwc_stop(gateway, 1000);
///     }
///     iwc_free(gateway);
///
/// Only the caller moves the wheels. No call repeats a drive command. The library has no thread, no timer and no signal
/// handler. It never sends a command later: if a command cannot leave now, the call returns IWC_FULL and discards it.
/// So a program that hangs, is frozen or killed stops the wheels: the gateway ends the lease `lease_ms` after the last
/// command, or immediately with the connection. A lost connection stays lost (IWC_CLOSED) until the caller connects and
/// arms again.
///
/// A call waits at most `timeout_ms`: 0 does not wait, IWC_FOREVER waits without end. A signal handler that runs during
/// the wait ends it (IWC_INTERRUPTED). The library never raises SIGPIPE.
///
/// One handle belongs to one thread at a time; different handles are independent. Only `iwc_new` allocates memory.
/// After fork() the child may call only `iwc_free`; the parent's connection continues.
///
/// The last part of a name is its unit. Speeds are in the machine's sense: positive is forward, on both sides.
#ifndef IWHEEL_CLIENT_H
#define IWHEEL_CLIENT_H

#include <signal.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#if defined(__GNUC__)
#define IWC_API __attribute__((visibility("default"))) ///< Marks the functions that the shared library exports.
#else
#define IWC_API
#endif

/// The northbound protocol that this library knows (`api` in docs/user/northbound.md).
#define IWC_PROTOCOL 1
/// Longest request, without its newline.
#define IWC_REQUEST_MAX 4096U
#define IWC_LINE_MAX    65536U ///< Longest reply or event, without its newline.
/// Most drive commands without a reply. A gateway that replies in time has at most one.
#define IWC_DRIVES_MAX 4U
/// Directory of the gateways' sockets, one per bus.
#define IWC_DIRECTORY "/run/iwheel"
/// Subdirectory with the gateways' watch sockets, which only watch and stop. Each has the name of the drive socket.
#define IWC_WATCH_DIRECTORY "watch"
#define IWC_FOREVER         (-1) ///< As `timeout_ms`: wait without end.

/// Result of a call.
typedef enum {
    IWC_OK = 0,
    IWC_TIMEOUT,     ///< Nothing came within `timeout_ms`.
    IWC_INTERRUPTED, ///< A signal handler ran while waiting.
    IWC_REFUSED,     ///< The gateway refused and applied nothing. `iwc_error` and `iwc_reason` have the details.
    IWC_FULL,        ///< Not sent: the gateway does not read, or IWC_DRIVES_MAX drive commands have no reply.
    IWC_CLOSED,      ///< No connection: never made, ended by the gateway, or broken. The lease has ended with it.
    IWC_GARBLED,     ///< The peer does not use the gateway's protocol. The call has closed the connection.
    IWC_NEWER,       ///< The gateway has a newer protocol: connected, but only for reading, `stop` and `estop`.
    IWC_INVALID,     ///< An argument violates the contract of the function. Nothing was sent.
    IWC_NOT_THERE,   ///< The socket does not exist, or no program listens on it.
    IWC_DENIED,      ///< This user may not use the socket or IWC_DIRECTORY.
    IWC_SEVERAL      ///< More than one gateway is running, and the caller named none.
} iwc_result_t;

/// A handle: one connection, or none. Its contents are private to the library.
typedef struct iwc iwc_t;

/// Returns a handle without a connection; NULL: out of memory. The caller frees it with `iwc_free`.
IWC_API iwc_t *iwc_new(void);

/// Closes the connection, which ends the lease that it holds, and frees the handle. NULL is allowed.
IWC_API void iwc_free(iwc_t *self);

/// Returns meaning and fix of a result, in one line of English. The text is static.
IWC_API const char *iwc_words(iwc_result_t result);

// ---- the connection -----------------------------------------------------------------------------------------------

/// Finds the socket that is used if the caller names none: $IWHEEL_SOCKET, otherwise the *.sock of the only gateway in
/// `directory`. NULL means IWC_DIRECTORY; only then the function reads the environment. It prefers the drive socket,
/// and finds the watch socket if this user may not use the drive socket. Of several sockets only those count on which a
/// program listens. Returns IWC_OK with the path in `out`; IWC_SEVERAL with all paths, separated by blanks, as far as
/// they fit; IWC_DENIED or IWC_NOT_THERE with an empty text; IWC_INVALID if $IWHEEL_SOCKET does not fit.
IWC_API iwc_result_t iwc_find(const char *directory, char *out, size_t size);

/// Closes an open connection, connects to `path` (NULL: the result of `iwc_find`) and waits for the gateway's greeting.
/// Does not arm. Returns IWC_OK or IWC_NEWER if it is connected; otherwise IWC_NOT_THERE, IWC_DENIED, IWC_SEVERAL,
/// IWC_TIMEOUT, IWC_INTERRUPTED, IWC_GARBLED, IWC_CLOSED, IWC_REFUSED (too many clients) or IWC_INVALID (longer than
/// 107 bytes).
IWC_API iwc_result_t iwc_connect(iwc_t *self, const char *path, int timeout_ms);

/// Uses a connected stream socket instead, which the handle then owns and closes. Otherwise like `iwc_connect` from the
/// greeting on.
IWC_API iwc_result_t iwc_adopt(iwc_t *self, int fd, int timeout_ms);

/// Like `iwc_adopt`, but does not wait for the greeting. In the places that the gateway keeps for stops it sends none and
/// executes stops only. A greeting or a refusal (too many clients) is a message of `iwc_next`. Returns IWC_OK or
/// IWC_INVALID.
IWC_API iwc_result_t iwc_adopt_for_stop(iwc_t *self, int fd);

/// Ends the connection, and with it the lease. Discards messages that were not read.
IWC_API void iwc_close(iwc_t *self);

/// Returns the descriptor for poll(); -1: not connected. Wait for POLLIN, then call `iwc_next` with timeout 0 until it
/// has no more messages. Before the wait read the messages that are already in the buffer, see `iwc_pending`.
IWC_API int iwc_fd(const iwc_t *self);
/// Returns true if `iwc_next` has a message without waiting.
IWC_API bool iwc_pending(const iwc_t *self);

/// Returns true if this connection may only watch, stop and e-stop. The gateway refuses everything else ("denied").
IWC_API bool iwc_watches_only(const iwc_t *self);

/// Returns the path of the last `iwc_connect`; empty: none. Valid until the next `iwc_connect` or `iwc_free`.
IWC_API const char *iwc_path(const iwc_t *self);
/// Returns the errno with which the last `iwc_connect` failed; 0 if it succeeded, or failed without an errno.
IWC_API int iwc_errno(const iwc_t *self);
/// Returns the number that the gateway assigned to this connection; `lease.holder` has it if the connection holds the
/// lease. 0: none.
IWC_API int64_t iwc_number(const iwc_t *self);

/// Sets the signal mask in force while a call waits, as in ppoll(): for programs that block signals elsewhere. NULL:
/// unchanged.
IWC_API void iwc_let_in(iwc_t *self, const sigset_t *mask);

// ---- messages -----------------------------------------------------------------------------------------------------

/// A reply or event. Valid until the next call with the same handle, except `iwc_latest`, `iwc_pending`, `iwc_fd`.
typedef struct {
    const char *text; ///< One JSON object, terminated by a zero byte. Ignore unknown fields.
    size_t length;    ///< Length of `text` in bytes.
    bool is_event;    ///< True: an event. False: a reply.
    int64_t id;       ///< Id of the request that a reply answers; 0 for an event.
    uint64_t skipped; ///< Events dropped before this one, by `iwc_latest` or because the caller did not read in time.
} iwc_message_t;

/// Reads the oldest message: an event, or the reply to an `iwc_send`. Returns IWC_OK, IWC_TIMEOUT or IWC_INTERRUPTED;
/// after the last message of a connection that has ended IWC_CLOSED or IWC_GARBLED.
IWC_API iwc_result_t iwc_next(iwc_t *self, int timeout_ms, iwc_message_t *out_message);

/// For a slow reader: receives everything that is waiting, and drops each event that a newer one supersedes, counted in
/// `skipped`. `iwc_next` then returns the latest values instead of a backlog. An event supersedes another of the same
/// name; in addition the cause must be equal for `fault`, the side for `offset`, the item for `ledger`, id and kind for
/// `frame`. `skipped` also counts the events that the gateway dropped itself (`lost`). Replies stay, as far as they
/// fit. Never waits. Returns IWC_OK; IWC_CLOSED or IWC_GARBLED if the connection has ended.
IWC_API iwc_result_t iwc_latest(iwc_t *self);

/// A number of a message; not known: null, absent, or not an integer of 64 bits.
typedef struct {
    bool known;    ///< There is a value.
    int64_t value; ///< 0 if not known.
} iwc_value_t;

/// Returns the integer at a path such as "left.speed_mm_s"; the path "" is the message. For a boolean use `iwc_truth`.
IWC_API iwc_value_t iwc_integer(const iwc_message_t *message, const char *path);
/// Returns the boolean at a path, as 1 or 0.
IWC_API iwc_value_t iwc_truth(const iwc_message_t *message, const char *path);

/// Copies the string at a path to `out`, cut between two characters if it does not fit. Returns false, with an empty
/// text, if there is no string. Control characters stay escaped (`\uXXXX`), as the gateway wrote them, so that the text
/// is safe on a terminal.
IWC_API bool iwc_text(const iwc_message_t *message, const char *path, char *out, size_t size);

/// Returns true if the string at `path` is equal to `text`.
IWC_API bool iwc_is(const iwc_message_t *message, const char *path, const char *text);

/// Returns the JSON of any field inside the message, with its length; NULL: there is no such field.
IWC_API const char *iwc_json(const iwc_message_t *message, const char *path, size_t *out_length);

/// The position of a caller that reads many fields of a message: `{&message, NULL}` before the first one.
typedef struct {
    const iwc_message_t *message; ///< The message, or an object that `iwc_field` returned.
    const char *rest;             ///< The text behind the last field.
} iwc_cursor_t;

/// Returns a field of the message itself, by its name and not by a path, as a message for the functions above: a path
/// in it begins inside the field, and the path "" is the field. The search begins behind the last field, so that a
/// caller who reads fields in the order of the gateway walks through a message once. Another order only takes longer.
/// If there is no such field, `text` is NULL, and the functions above find nothing in it.
IWC_API iwc_message_t iwc_field(iwc_cursor_t *self, const char *name);

// ---- requests -----------------------------------------------------------------------------------------------------

/// Sends a request, a JSON object of one line without `id`, and waits for its reply only. Stores events that come
/// meanwhile, as far as they fit. Returns IWC_OK or IWC_REFUSED, both with the reply; IWC_FULL, not sent; or without a
/// reply IWC_TIMEOUT, IWC_INTERRUPTED, IWC_CLOSED, IWC_GARBLED: the gateway may have applied the request then.
/// `out_reply` may be NULL.
IWC_API iwc_result_t iwc_ask(iwc_t *self, const char *request, int timeout_ms, iwc_message_t *out_reply);

/// Sends a request without waiting for the reply, which `iwc_next` returns with the id `*out_id`. If the gateway does
/// not read within `timeout_ms`, returns IWC_FULL and discards the request. A request that could leave only in part
/// ends the connection (IWC_CLOSED).
IWC_API iwc_result_t iwc_send(iwc_t *self, const char *request, int timeout_ms, int64_t *out_id);

/// Reads the reply for which the last call waited, with all its fields, such as `warnings` of `iwc_arm`. Returns false
/// if there was none, or if another message was read since.
IWC_API bool iwc_reply(const iwc_t *self, iwc_message_t *out_reply);

/// Returns the name of the last refusal; empty: none.
IWC_API const char *iwc_error(const iwc_t *self);
/// Returns why the last call that failed did so: the gateway's message of a refusal (cause and fix), otherwise the text
/// of `iwc_words`. One line, never empty: before the first connection the text of IWC_CLOSED, and after a connection on
/// which no call has failed that of IWC_OK. `self` may be NULL (iwc_new found no memory). A call that succeeds changes
/// nothing. An `iwc_next` without a message within its timeout is not a failure. Valid until the next call with the
/// same handle.
IWC_API const char *iwc_reason(const iwc_t *self);

// ---- reading ------------------------------------------------------------------------------------------------------

/// State of the gateway.
typedef enum { IWC_STATE_UNKNOWN = 0, IWC_LISTENING, IWC_ARMED, IWC_STOPPING, IWC_LATCHED } iwc_machine_t;

/// One wheel in a snapshot.
typedef struct {
    bool heard;                   ///< Online: a speed frame came within `wheel_silent_ms`.
    iwc_value_t at_rest;          ///< 1: at standstill.
    iwc_value_t speed_mm_s;       ///< Measured speed.
    iwc_value_t commanded_mm_s;   ///< Speed that the client commands.
    iwc_value_t applied_mm_s;     ///< Speed in the last setpoint to the wheel; not known if the gateway sends none.
    iwc_value_t distance_mm;      ///< Distance since the gateway's start; backwards counts down.
    iwc_value_t force_net_mN;     ///< Known only if it is valid: zero known, unit not contradicted, not saturated.
    iwc_value_t battery_dV;       ///< Voltage of the wheel's battery.
    iwc_value_t temperature_degC; ///< Temperature of the wheel.
    iwc_value_t speed_age_ms;     ///< Time since the last speed frame.
    iwc_value_t force_age_ms;     ///< Time since the last force frame.
} iwc_wheel_t;

/// The most important fields of a snapshot: the reply to `status`, or the event `state`.
typedef struct {
    int64_t t_us;             ///< CLOCK_MONOTONIC of the gateway's machine.
    iwc_machine_t machine;    ///< State of the gateway.
    char cause[32];           ///< Why it is stopping or latched; empty: it is neither.
    iwc_value_t holder;       ///< Connection that holds the lease; not known: the lease is free.
    bool ours;                ///< This connection holds the lease.
    iwc_value_t remaining_ms; ///< Remaining time of the lease.
    bool estop_released;      ///< False: pressed, unreadable or no line.
    bool bus_active;          ///< False: down, bus-off or error passive.
    iwc_wheel_t left;         ///< The left wheel.
    iwc_wheel_t right;        ///< The right wheel.
} iwc_state_t;

/// Reads a snapshot. Returns false, with `*out_state` unchanged, if the message is not a snapshot.
IWC_API bool iwc_state(const iwc_t *self, const iwc_message_t *message, iwc_state_t *out_state);

/// Requests a snapshot. Results as in `iwc_ask`.
IWC_API iwc_result_t iwc_status(iwc_t *self, int timeout_ms, iwc_state_t *out_state);

/// Topics of `iwc_watch`, combined with |.
enum {
    IWC_WATCH_STATE = 1,
    IWC_WATCH_BUS = 2,
    IWC_WATCH_ESTOP = 4,
    IWC_WATCH_LEASE = 8,
    IWC_WATCH_STOP = 16,
    IWC_WATCH_FORCE = 32,
    IWC_WATCH_FRAME = 64
};

/// Subscribes to these topics, instead of those before; 0 ends all subscriptions. `rate_hz`, 1..100, is the rate of
/// state and force. Results as in `iwc_ask`.
IWC_API iwc_result_t iwc_watch(iwc_t *self, unsigned topics, int rate_hz, int timeout_ms);

/// Largest piece of a recording, in bytes.
#define IWC_PIECE_MAX 24576U

/// Progress of reading a recording. Set it to zero before the first piece.
typedef struct {
    int64_t next;   ///< Offset of the first byte that is not read yet. Equal to `size`: all is read.
    int64_t size;   ///< Size of the file at the time of the last piece. It may grow for two seconds after its stop.
    size_t length;  ///< Length of the last piece in bytes.
    uint32_t crc32; ///< CRC-32 of all bytes before `next`.
} iwc_piece_t;

/// Reads the next piece of a recording's file to `out`, a buffer of IWC_PIECE_MAX bytes. `name` is a name from the
/// reply to `recordings`, with .log, .jsonl or .conf added. Results as in `iwc_ask`; IWC_GARBLED also if the checksum
/// of the piece, or with the last piece that of the whole file, is wrong.
IWC_API iwc_result_t iwc_recording(iwc_t *self, const char *name, int timeout_ms, void *out, iwc_piece_t *piece);

/// Reads a piece from a reply that came another way, such as by MQTT. Returns false if it is not the next piece, or a
/// checksum is wrong; `*piece` is invalid then.
IWC_API bool iwc_piece_take(const iwc_message_t *reply, void *out, iwc_piece_t *piece);

// ---- driving and stopping -----------------------------------------------------------------------------------------

/// Terms of a granted arm.
typedef struct {
    int32_t lease_ms;       ///< Each accepted command extends the lease to this time. Send three commands in it.
    int32_t first_lease_ms; ///< The first command must come within this time.
    int32_t stop_budget_ms; ///< Longest time of motion after the last command.
    int32_t stop_budget_mm; ///< Longest distance of motion after the last command.
} iwc_terms_t;

/// Requests the lease; moves nothing. Other clients can read `name` (up to 64 bytes, no control characters; NULL:
/// none). `takeover` transfers the lease from another holder, with both wheels at standstill. Results as in `iwc_ask`.
IWC_API iwc_result_t iwc_arm(iwc_t *self, const char *name, bool takeover, int timeout_ms, iwc_terms_t *out_terms);

/// Size of the key of a lease: 32 hexadecimal digits, terminated.
#define IWC_KEY_SIZE 33U

/// Arguments of `iwc_arm_as`. All zero: `iwc_arm` without name and takeover.
typedef struct {
    const char *name; ///< As in `iwc_arm`.
    bool takeover;    ///< As in `iwc_arm`.
    iwc_value_t t_us; ///< Time of the person's request, by the clock of the gateway's events; not known: not sent.
} iwc_arm_t;

/// Like `iwc_arm`, for programs that forward a person's request: the gateway refuses ("stale_command") a request that
/// is older than its limit. Writes the key of this lease to `out_key` (may be NULL): a secret between the gateway and
/// the person who drives. Empty: the gateway, a microcontroller, has no keys.
IWC_API iwc_result_t iwc_arm_as(iwc_t *self, const iwc_arm_t *arm, int timeout_ms, iwc_terms_t *out_terms,
                                char out_key[IWC_KEY_SIZE]);

/// A drive command.
typedef struct {
    int32_t left_mm_s;  ///< -32768..32767.
    int32_t right_mm_s; ///< -32768..32767.
    bool has_current;   ///< Send the currents; required if current_role is setpoint.
    int32_t left_mA;    ///< -2000..2000.
    int32_t right_mA;   ///< -2000..2000.
} iwc_drive_t;

/// Targets that the gateway applies for a drive command.
typedef struct {
    int32_t left_mm_s;  ///< Target after limits. Ramps lead to it.
    int32_t right_mm_s; ///< Target after limits.
    int32_t left_mA;    ///< Target after limits.
    int32_t right_mA;   ///< Target after limits.
    bool limited;       ///< Both wheels were scaled by one factor, or a current limit was raised.
} iwc_applied_t;

/// Sends one drive command, once. It is valid for `iwc_terms_t::lease_ms` from now; without a newer one the wheels then
/// stop by a ramp. The connection must hold the lease: a command before the reply to `iwc_arm` is refused. A value out
/// of range is refused ("out_of_range") for both wheels; a speed above a limit is scaled (`iwc_applied_t::limited`). A
/// refused command does not extend the lease, and the last accepted one stays in force until the lease ends.
///
/// With `timeout_ms` 0 the call only sends: IWC_OK means sent, IWC_FULL not sent, and `iwc_next` returns the reply.
/// Otherwise it waits as `iwc_ask`, with the same results. Writes `*out_applied` (may be NULL) only if it has waited
/// and returns IWC_OK.
IWC_API iwc_result_t iwc_drive(iwc_t *self, const iwc_drive_t *command, int timeout_ms, iwc_applied_t *out_applied);

/// Like `iwc_drive`, with forward speed in mm/s and turning rate in mrad/s, positive to the left. The gateway
/// calculates both wheel speeds from its `track_mm`; they have the range of `iwc_drive_t`. The command has no currents,
/// so the gateway refuses it ("missing_field") if current_role is setpoint. It refuses a turn ("denied") while `track`
/// is contradicted.
IWC_API iwc_result_t iwc_twist(iwc_t *self, int32_t v_mm_s, int32_t yaw_mrad_s, int timeout_ms,
                               iwc_applied_t *out_applied);

/// Like `iwc_drive`, with the key of the lease (up to 32 bytes, NULL: none). The gateway refuses a key that is not that
/// of the last arm ("not_holder"), and does not extend the lease.
IWC_API iwc_result_t iwc_drive_as(iwc_t *self, const iwc_drive_t *command, const char *key, int timeout_ms,
                                  iwc_applied_t *out_applied);

/// A drive command as speed and turning rate.
typedef struct {
    int32_t v_mm_s;     ///< Positive is forward.
    int32_t yaw_mrad_s; ///< Positive is to the left.
} iwc_twist_t;

/// Like `iwc_twist`, with the key of the lease as in `iwc_drive_as`.
IWC_API iwc_result_t iwc_twist_as(iwc_t *self, const iwc_twist_t *command, const char *key, int timeout_ms,
                                  iwc_applied_t *out_applied);

/// Stops the wheels with the ramp, whichever client drives. If the request cannot be sent, or no reply comes in time,
/// or a signal ends the wait, the call closes the connection, which stops the wheels if this connection holds the
/// lease. Results as in `iwc_ask`.
IWC_API iwc_result_t iwc_stop(iwc_t *self, int timeout_ms);

/// Stops the wheels without a ramp, latched until `iwc_reset`; otherwise like `iwc_stop`. `reason`: a text in UTF-8; NULL:
/// none. It is cut after 200 bytes, and each byte of a character that is not allowed becomes a space; no reason prevents
/// the stop. It does not replace the button that cuts power.
IWC_API iwc_result_t iwc_estop(iwc_t *self, const char *reason, int timeout_ms);

/// Stops the wheels with the ramp, through a connection of its own: it closes the connection of `self` before, and the
/// new connection afterwards. For a program that is not connected: the gateway accepts a stop even if it has no place
/// for another client, and the call does not wait for the greeting. If the socket `path` (NULL: as in `iwc_connect`)
/// accepts no connection or has no place, the call tries the gateway's other socket, which is watch/NAME.sock for
/// NAME.sock, and then both again until the time is over. Results as in `iwc_ask`, and those of `iwc_connect` for
/// `path`.
///
/// If `path` is NULL and several gateways run, the call stops all of them. It returns IWC_OK if at least one executed the
/// stop; `iwc_reply` then has a reply only if the gateway that was called last sent one.
IWC_API iwc_result_t iwc_stop_at(iwc_t *self, const char *path, int timeout_ms);

/// Like `iwc_stop_at`, without a ramp and latched; `reason` as in `iwc_estop`.
IWC_API iwc_result_t iwc_estop_at(iwc_t *self, const char *path, const char *reason, int timeout_ms);

/// Ends the latched state, if its cause is gone. Moves nothing. Results as in `iwc_ask`.
IWC_API iwc_result_t iwc_reset(iwc_t *self, int timeout_ms);

/// Arguments of `iwc_reset_as`. All zero: the same as `iwc_reset`.
typedef struct {
    iwc_value_t stop; ///< Number of the stop to reset, from `why` or the event `stop`; not known: not sent.
    iwc_value_t t_us; ///< As in `iwc_arm_t`.
} iwc_reset_t;

/// Like `iwc_reset`. The gateway refuses it ("stale_command") if another stop is the last one, or if the request is too
/// old.
IWC_API iwc_result_t iwc_reset_as(iwc_t *self, const iwc_reset_t *reset, int timeout_ms);

/// Ends the hold of zeros (after_stop = hold); on a slope the wheels then roll. Only through the drive socket. `t_us`
/// as in `iwc_arm_t`. Results as in `iwc_ask`.
IWC_API iwc_result_t iwc_release(iwc_t *self, iwc_value_t t_us, int timeout_ms);

#ifdef __cplusplus
}
#endif
#endif
