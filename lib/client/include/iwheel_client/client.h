// SPDX-License-Identifier: MIT
/// @file
/// A connection to iwheel-gateway for programs in C: connect, ask, listen, drive.
///
///     iwc_t *gateway = iwc_new();
///     iwc_terms_t terms;
///     if (iwc_connect(gateway, NULL, 1000) == IWC_OK && iwc_arm(gateway, "example", false, 1000, &terms) == IWC_OK) {
///         // iwc_drive(...) every terms.lease_ms / 3, for as long as the wheels shall turn
///         iwc_stop(gateway, 1000);
///     }
///     iwc_free(gateway);
///
/// What moves the wheels is the caller, and nobody else. No call repeats a drive command, there is no thread, no timer and no signal
/// handler, and a command that cannot leave now is told (IWC_FULL) and forgotten, never sent later. So a program that hangs, is frozen
/// or killed stops the wheels: the gateway ends its lease `lease_ms` after the last command, or at once with the connection. A lost
/// connection stays lost (IWC_CLOSED) until the caller connects and arms again.
///
/// A call waits no longer than the `timeout_ms` that it is given: 0 does not wait at all, IWC_FOREVER has no end. A signal handler that
/// ran meanwhile ends the wait (IWC_INTERRUPTED). SIGPIPE is never raised.
///
/// One handle belongs to one thread at a time; different handles know nothing of each other. Memory: what `iwc_new` takes, and nothing
/// after it. After fork() the child may call only `iwc_free`; the parent's connection goes on.
///
/// Units are the last part of a name. Speeds are in the machine's sense: positive is forward, on both sides.
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
#define IWC_API __attribute__((visibility("default"))) ///< Marks what the shared library exports.
#else
#define IWC_API
#endif

/// The northbound protocol that this library knows (`api` in docs/user/northbound.md).
#define IWC_PROTOCOL 1
/// Longest request, without its newline.
#define IWC_REQUEST_MAX 4096U
#define IWC_LINE_MAX    65536U ///< Longest reply or event, without its newline.
/// So many drive commands may be without their reply; a gateway that answers has one at the most.
#define IWC_DRIVES_MAX 4U
/// Where gateways put their sockets, one per bus.
#define IWC_DIRECTORY "/run/iwheel"
/// In there: their sockets for who may only watch, each under the name of the one to drive by.
#define IWC_WATCH_DIRECTORY "watch"
#define IWC_FOREVER         (-1) ///< As `timeout_ms`: wait without end.

/// What a call came to.
typedef enum {
    IWC_OK = 0,
    IWC_TIMEOUT,     ///< Nothing came within the time given.
    IWC_INTERRUPTED, ///< A signal handler ran while waiting.
    IWC_REFUSED,     ///< The gateway said no; nothing was applied. `iwc_error` and `iwc_reason` tell more.
    IWC_FULL, ///< Not sent: the gateway does not read, or IWC_DRIVES_MAX drive commands have no reply. Nothing is kept.
    IWC_CLOSED,    ///< There is no connection: never made, ended by the gateway, or broken. The lease went with it.
    IWC_GARBLED,   ///< What came is not the gateway's language, so the connection was closed.
    IWC_NEWER,     ///< The gateway speaks a newer protocol: connected, but only for reading, `stop` and `estop`.
    IWC_INVALID,   ///< An argument is outside what its function says. Nothing was sent.
    IWC_NOT_THERE, ///< Nobody listens on the socket, or there is none.
    IWC_DENIED,    ///< The socket, or IWC_DIRECTORY, may not be used by this user.
    IWC_SEVERAL    ///< More than one gateway is running, and none was named.
} iwc_result_t;

/// A handle: one connection, or none. Only the library knows what is in it.
typedef struct iwc iwc_t;

/// A handle without connection. NULL: out of memory.
IWC_API iwc_t *iwc_new(void);

/// Closes the connection, which ends a lease that is held through it. NULL is allowed.
IWC_API void iwc_free(iwc_t *self);

/// What a result means and what to do, in one line of English.
IWC_API const char *iwc_words(iwc_result_t result);

// ---- the connection -----------------------------------------------------------------------------------------------

/// The socket meant when none is named: $IWHEEL_SOCKET, else the only gateway's *.sock in `directory` (NULL: IWC_DIRECTORY, and only then
/// the environment is looked at): the one to drive by if this user may use it, else the one to watch by. IWC_OK with the path in `out`; IWC_SEVERAL with all of them, separated by blanks, as far as they fit;
/// IWC_DENIED or IWC_NOT_THERE with an empty text; IWC_INVALID if $IWHEEL_SOCKET does not fit.
IWC_API iwc_result_t iwc_find(const char *directory, char *out, size_t size);

/// Closes what is open, connects to `path` (NULL: the one that `iwc_find` finds) and awaits the gateway's greeting. Nothing is armed.
/// IWC_OK and IWC_NEWER: connected. Else it is not: IWC_NOT_THERE, IWC_DENIED, IWC_SEVERAL, IWC_TIMEOUT, IWC_INTERRUPTED, IWC_GARBLED,
/// IWC_CLOSED, IWC_REFUSED (too many clients), IWC_INVALID (longer than 107 bytes).
IWC_API iwc_result_t iwc_connect(iwc_t *self, const char *path, int timeout_ms);

/// Takes a connected stream socket instead, which it closes later. As `iwc_connect` from the greeting on.
IWC_API iwc_result_t iwc_adopt(iwc_t *self, int fd, int timeout_ms);

/// Ends the connection, and with it the lease. What came before and was not taken is forgotten.
IWC_API void iwc_close(iwc_t *self);

/// For poll(): wait for POLLIN on this descriptor, then call `iwc_next` with timeout 0 until it has no more. -1: not connected. First
/// take what is here already: `iwc_pending`.
IWC_API int iwc_fd(const iwc_t *self);
/// True if `iwc_next` has something without waiting.
IWC_API bool iwc_pending(const iwc_t *self);

/// True if this connection may only look, stop and e-stop; all else is refused ("denied", with the words what it takes).
IWC_API bool iwc_watches_only(const iwc_t *self);

/// The path of `iwc_connect`; empty: none.
IWC_API const char *iwc_path(const iwc_t *self);
/// errno of the call that made it fail; 0: another reason.
IWC_API int iwc_errno(const iwc_t *self);
/// The number that the gateway gave this connection, `lease.holder` if it holds the lease; 0: none.
IWC_API int64_t iwc_number(const iwc_t *self);

/// The signal mask in force while a call waits, as ppoll() takes it: for programs that block signals elsewhere. NULL: unchanged.
IWC_API void iwc_let_in(iwc_t *self, const sigset_t *mask);

// ---- messages -----------------------------------------------------------------------------------------------------

/// A reply or event. Valid until the next call with the same handle, except `iwc_latest`, `iwc_pending`, `iwc_fd`.
typedef struct {
    const char *text; ///< One JSON object, terminated; unknown fields are to be ignored.
    size_t length;    ///< Of `text`, bytes.
    bool is_event;    ///< Else a reply.
    int64_t id;       ///< Of the request that a reply answers; 0 for an event.
    uint64_t skipped; ///< Events left out before this one: by `iwc_latest`, or because nobody took them for too long.
} iwc_message_t;

/// The oldest message that was not taken yet: an event, or the reply to an `iwc_send`. IWC_TIMEOUT, IWC_INTERRUPTED; after the last
/// message of a connection that has ended IWC_CLOSED or IWC_GARBLED.
IWC_API iwc_result_t iwc_next(iwc_t *self, int timeout_ms, iwc_message_t *out_message);

/// For a slow reader: reads all that waits and leaves out each event of which a newer one is there, counted in `skipped`, so that
/// `iwc_next` hands out the latest values instead of a backlog. Events are the same thing if their name is, and of `fault` the cause,
/// of `offset` the side, of `ledger` the item, of `frame` id and kind. What the gateway had to leave out itself (`lost`) is counted too.
/// Replies stay, as far as they fit. Never waits. IWC_OK, or IWC_CLOSED or IWC_GARBLED if the connection has ended.
IWC_API iwc_result_t iwc_latest(iwc_t *self);

/// A number of a message; not known: null, not there, or not a whole number of 64 bits.
typedef struct {
    bool known;    ///< There is a value.
    int64_t value; ///< 0 if not known.
} iwc_value_t;

/// A field by its path, such as "left.speed_mm_s". A truth counts as 1 or 0 in `iwc_truth` only.
IWC_API iwc_value_t iwc_integer(const iwc_message_t *message, const char *path);
/// A truth, as 1 or 0.
IWC_API iwc_value_t iwc_truth(const iwc_message_t *message, const char *path);

/// A text, cut where `size` ends between two characters. False, and an empty text: none is there. What would move a terminal stays as
/// the gateway wrote it, `\uXXXX`.
IWC_API bool iwc_text(const iwc_message_t *message, const char *path, char *out, size_t size);

/// Whether the text at `path` is exactly that.
IWC_API bool iwc_is(const iwc_message_t *message, const char *path, const char *text);

/// The JSON of any field. NULL: it is not there.
IWC_API const char *iwc_json(const iwc_message_t *message, const char *path, size_t *out_length);

// ---- asking -------------------------------------------------------------------------------------------------------

/// Sends a request, a JSON object of one line without `id`, and waits for its reply only. Events that come meanwhile are kept, as far as
/// they fit. IWC_OK, IWC_REFUSED (also with the reply), IWC_FULL, or no reply: IWC_TIMEOUT, IWC_INTERRUPTED, IWC_CLOSED, IWC_GARBLED; it
/// may have been applied then. `out_reply` may be NULL.
IWC_API iwc_result_t iwc_ask(iwc_t *self, const char *request, int timeout_ms, iwc_message_t *out_reply);

/// The same without waiting for the reply, which `iwc_next` brings; `*out_id` is its id. `timeout_ms` is for a gateway that does not
/// read: IWC_FULL after it, and nothing is kept. A request that could leave only in part ends the connection (IWC_CLOSED).
IWC_API iwc_result_t iwc_send(iwc_t *self, const char *request, int timeout_ms, int64_t *out_id);

/// The reply that the last call waited for, for what its function does not hand out, such as `warnings` of `iwc_arm`. False: there was
/// none, or another message was taken since.
IWC_API bool iwc_reply(const iwc_t *self, iwc_message_t *out_reply);

/// Name of the last refusal; empty: there was none.
IWC_API const char *iwc_error(const iwc_t *self);
/// Its words, which tell cause and cure.
IWC_API const char *iwc_reason(const iwc_t *self);

// ---- reading ------------------------------------------------------------------------------------------------------

/// What the gateway does.
typedef enum { IWC_STATE_UNKNOWN = 0, IWC_LISTENING, IWC_ARMED, IWC_STOPPING, IWC_LATCHED } iwc_machine_t;

/// One wheel in a snapshot.
typedef struct {
    bool heard;                   ///< Its speed came within `wheel_silent_ms`.
    iwc_value_t at_rest;          ///< 1: stands.
    iwc_value_t speed_mm_s;       ///< Measured.
    iwc_value_t commanded_mm_s;   ///< What the client wants.
    iwc_value_t applied_mm_s;     ///< What the wheel was told last; not known in silence.
    iwc_value_t distance_mm;      ///< Since the gateway's start; backwards counts down.
    iwc_value_t force_net_mN;     ///< Known only if it is valid: zero known, unit not contradicted, not saturated.
    iwc_value_t battery_dV;       ///< Of its battery.
    iwc_value_t temperature_degC; ///< Of the wheel.
    iwc_value_t speed_age_ms;     ///< Since its last speed frame.
    iwc_value_t force_age_ms;     ///< Since its last force frame.
} iwc_wheel_t;

/// The most wanted of a snapshot: the reply to `status`, the event `state`.
typedef struct {
    int64_t t_us;             ///< CLOCK_MONOTONIC of the gateway's machine.
    iwc_machine_t machine;    ///< Its state.
    char cause[32];           ///< Why it is stopping or latched; empty: it is neither.
    iwc_value_t holder;       ///< Of the lease; not known: nobody holds it.
    bool ours;                ///< This connection holds it.
    iwc_value_t remaining_ms; ///< Of the lease.
    bool estop_released;      ///< False: pressed, unreadable or none.
    bool bus_active;          ///< False: down, bus-off or error passive.
    iwc_wheel_t left;         ///< The left wheel.
    iwc_wheel_t right;        ///< The right wheel.
} iwc_state_t;

/// False, with `*out_state` untouched, if the message is no snapshot.
IWC_API bool iwc_state(const iwc_t *self, const iwc_message_t *message, iwc_state_t *out_state);

/// Asks for a snapshot. As `iwc_ask`.
IWC_API iwc_result_t iwc_status(iwc_t *self, int timeout_ms, iwc_state_t *out_state);

/// Topics of `iwc_watch`, to be or'ed.
enum {
    IWC_WATCH_STATE = 1,
    IWC_WATCH_BUS = 2,
    IWC_WATCH_ESTOP = 4,
    IWC_WATCH_LEASE = 8,
    IWC_WATCH_STOP = 16,
    IWC_WATCH_FORCE = 32,
    IWC_WATCH_FRAME = 64
};

/// Which events come from now on, instead of those before; 0 ends it. `rate_hz` 1..100 is for state and force. As `iwc_ask`.
IWC_API iwc_result_t iwc_watch(iwc_t *self, unsigned topics, int rate_hz, int timeout_ms);

/// Of the pieces in which recordings come.
#define IWC_PIECE_MAX 24576U

/// How far a recording is read; all zero before its first piece.
typedef struct {
    int64_t next;   ///< Offset of the first byte that is not read yet. At `size`: that was all.
    int64_t size;   ///< Of the file, as of the last piece; it may grow for two seconds after its stop.
    size_t length;  ///< Bytes of the last piece.
    uint32_t crc32; ///< Of all before `next`.
} iwc_piece_t;

/// Reads the next piece of a recording's file: `name` as the request `recordings` tells it, with .log, .jsonl or .conf behind it. `out` has
/// room for IWC_PIECE_MAX bytes. As `iwc_ask`; IWC_GARBLED also for a piece that is not as its checksum says, and for a last one with
/// which the whole is not.
IWC_API iwc_result_t iwc_recording(iwc_t *self, const char *name, int timeout_ms, void *out, iwc_piece_t *piece);

/// The same for a reply that came another way, such as by MQTT. False: it is not the piece that comes next, or not as its checksum says, or
/// with it the whole is not; `*piece` is of no use then.
IWC_API bool iwc_piece_take(const iwc_message_t *reply, void *out, iwc_piece_t *piece);

// ---- driving and stopping -----------------------------------------------------------------------------------------

/// On what terms an arm was granted.
typedef struct {
    int32_t lease_ms;       ///< Each accepted command holds so long. Send three in that time.
    int32_t first_lease_ms; ///< The first one must come within this.
    int32_t stop_budget_ms; ///< How long the machine goes on at most after the last command,
    int32_t stop_budget_mm; ///< and how far.
} iwc_terms_t;

/// Asks for permission to drive; moves nothing. `name` (up to 64 bytes, no control characters) is shown to others, NULL: none.
/// `takeover` takes the lease from another holder, with both wheels at rest. As `iwc_ask`.
IWC_API iwc_result_t iwc_arm(iwc_t *self, const char *name, bool takeover, int timeout_ms, iwc_terms_t *out_terms);

/// Room for the key of a lease: 32 hexadecimal digits, terminated.
#define IWC_KEY_SIZE 33U

/// What an arm says. All zero: the same as `iwc_arm` without name and takeover.
typedef struct {
    const char *name; ///< As of `iwc_arm`.
    bool takeover;    ///< As of `iwc_arm`.
    iwc_value_t t_us; ///< Since when it is wanted, by the clock of the gateway's events; not known: not sent.
} iwc_arm_t;

/// As `iwc_arm`, for programs that pass on what a person wants: the gateway refuses ("stale_command") what is older than its limit.
/// `out_key` (may be NULL) is the key of this lease, a secret between the gateway and the person who drives; empty: the gateway, a
/// microcontroller, gives none.
IWC_API iwc_result_t iwc_arm_as(iwc_t *self, const iwc_arm_t *arm, int timeout_ms, iwc_terms_t *out_terms,
                                char out_key[IWC_KEY_SIZE]);

/// A drive command.
typedef struct {
    int32_t left_mm_s;  ///< -32768..32767.
    int32_t right_mm_s; ///< -32768..32767.
    bool has_current;   ///< The currents are told; needed where current_role is setpoint.
    int32_t left_mA;    ///< -2000..2000.
    int32_t right_mA;   ///< -2000..2000.
} iwc_drive_t;

/// What a drive command came to.
typedef struct {
    int32_t left_mm_s;  ///< The target after limits; ramps come on top.
    int32_t right_mm_s; ///< As the left.
    int32_t left_mA;    ///< The target after limits.
    int32_t right_mA;   ///< As the left.
    bool limited;       ///< Both wheels were scaled by one factor.
} iwc_applied_t;

/// One drive command, once: it holds one lease. With `timeout_ms` 0 it is handed over and its reply comes with `iwc_next`; else waits
/// for the reply, as `iwc_ask`, and tells what it applied (`out_applied` may be NULL). Before the reply to `iwc_arm` it is refused.
IWC_API iwc_result_t iwc_drive(iwc_t *self, const iwc_drive_t *command, int timeout_ms, iwc_applied_t *out_applied);

/// The same as forward speed and turning rate, positive to the left (mrad/s).
IWC_API iwc_result_t iwc_twist(iwc_t *self, int32_t v_mm_s, int32_t yaw_mrad_s, int timeout_ms,
                               iwc_applied_t *out_applied);

/// As `iwc_drive`, with the key of the lease (up to 32 bytes, NULL: none): with another key than that of the last arm it is refused
/// ("not_holder") and feeds nothing.
IWC_API iwc_result_t iwc_drive_as(iwc_t *self, const iwc_drive_t *command, const char *key, int timeout_ms,
                                  iwc_applied_t *out_applied);

/// A drive command as speed and turning rate.
typedef struct {
    int32_t v_mm_s;     ///< Forward.
    int32_t yaw_mrad_s; ///< Positive to the left.
} iwc_twist_t;

/// As `iwc_twist`, with the key of the lease as `iwc_drive_as`.
IWC_API iwc_result_t iwc_twist_as(iwc_t *self, const iwc_twist_t *command, const char *key, int timeout_ms,
                                  iwc_applied_t *out_applied);

/// Ramp to zero, whoever drives. If it cannot be handed over or is not answered in time, or a signal ends the wait, the
/// connection is closed, which stops the wheels if the lease was ours. As `iwc_ask`.
IWC_API iwc_result_t iwc_stop(iwc_t *self, int timeout_ms);

/// Zero without ramp, latched until `iwc_reset`; otherwise as `iwc_stop`. `reason`: up to 200 bytes, no control characters; NULL: none.
/// No substitute for the button that cuts power.
IWC_API iwc_result_t iwc_estop(iwc_t *self, const char *reason, int timeout_ms);

/// Ramp to zero, through a connection of its own: whatever `self` was connected to is closed before, and this one afterwards. For a
/// program that is not connected: the gateway takes a stop even when all its places are taken, and awaits no greeting of ours. If the
/// socket `path` (NULL: as `iwc_connect`) takes no connection or has no place, the gateway's other one is tried, which is watch/NAME.sock
/// beside NAME.sock, and both again until the time is over. As `iwc_ask`, and the reasons of `iwc_connect`, those of `path`.
IWC_API iwc_result_t iwc_stop_at(iwc_t *self, const char *path, int timeout_ms);

/// The same with zero without ramp, latched; `reason` as of `iwc_estop`.
IWC_API iwc_result_t iwc_estop_at(iwc_t *self, const char *path, const char *reason, int timeout_ms);

/// Leaves the latch, if its cause is gone. Moves nothing. As `iwc_ask`.
IWC_API iwc_result_t iwc_reset(iwc_t *self, int timeout_ms);

/// What a reset says. All zero: the same as `iwc_reset`.
typedef struct {
    iwc_value_t
        stop; ///< The number of the stop that is meant, as `why` and the event `stop` give it; not known: not sent.
    iwc_value_t t_us; ///< As of `iwc_arm_t`.
} iwc_reset_t;

/// As `iwc_reset`; refused ("stale_command") if another stop is the last one, or the request is too old. As `iwc_ask`.
IWC_API iwc_result_t iwc_reset_as(iwc_t *self, const iwc_reset_t *reset, int timeout_ms);

/// Ends a hold of zeros (after_stop = hold): on a slope the wheels roll then. Only on the socket that may drive. `t_us` as of
/// `iwc_arm_t`. As `iwc_ask`.
IWC_API iwc_result_t iwc_release(iwc_t *self, iwc_value_t t_us, int timeout_ms);

#ifdef __cplusplus
}
#endif
#endif
