// SPDX-License-Identifier: MIT
/// @file
/// What is said to clients of the wheels: the bodies of replies and events, from a snapshot of the core and from what the
/// caller knows of its surroundings. share/northbound.json describes each object.
///
/// All of these write fields into an object that is open. What is not known is written as null, never as a value.
#ifndef IWHEEL_NORTHBOUND_TELL_H
#define IWHEEL_NORTHBOUND_TELL_H

#include "iwheel_northbound/json_out.h"
#include "iwheel_northbound/request.h"
#include "iwheel_northbound/why.h"

#include "iwheel/gateway.h"

/// Grows when a client of before would be misled.
#define IWN_API_VERSION 1
/// Telemetry other than speed is worth nothing after this: five periods of the status and pose frames.
#define IWN_STATUS_STALE_US 200000U
/// At most so many warnings are told.
#define IWN_WARNINGS 8U
/// A machine without a clock of the day, or one whose clock was never set.
#define IWN_WALL_UNKNOWN INT64_MIN

/// The zero of a force as it was noted when it was taken, for one that came over a restart.
typedef struct {
    iw_offset_provenance_t from; ///< IW_OFFSET_NONE: nothing was noted.
    uint32_t samples;            ///< Of the window it was measured in.
    uint32_t deviation_mN;       ///< Of that window.
    int32_t drift_mN;            ///< Of that window.
    int64_t wall_us;             ///< When; 0 or less: unknown.
} iwn_zero_note_t;

/// Who drives.
typedef struct {
    iw_client_t client; ///< IW_CLIENT_NONE: nobody.
    const char *name;   ///< Null or empty: it gave none.
    int pid;            ///< 0: unknown.
} iwn_holder_t;

/// The bus, as far as the core does not know it.
typedef struct {
    const char *name;               ///< Of the interface.
    const char *timing;             ///< confirmed, near, contradicted or unproven.
    uint32_t bitrate_hz;            ///< 0: not reported.
    uint32_t sample_point_permille; ///< 0: not reported.
    uint32_t load_permille;         ///< Means nothing unless `up`.
    uint32_t lost;                  ///< Frames; means nothing unless `up`.
    bool up;                        ///< It is a CAN interface, and there.
} iwn_bus_t;

/// The e-stop's input.
typedef struct {
    const char *line;       ///< As configured.
    const char *line2;      ///< The same of its second contact; NULL: there is none.
    const char *pressed_at; ///< Which contact is pressed or unreadable: neither, line, line2, both. Only with `line2`.
    int answer;             ///< As `estop_pressed` of iw_hal_t.
    bool present;           ///< False: there is none.
    bool simulated;         ///< A simulator's button.
    int64_t tried_us;       ///< When its button was last seen pressed and released, by the wall clock; 0: never.
} iwn_estop_t;

/// Everything that a snapshot of the core does not have.
typedef struct {
    int64_t wall_us;                   ///< Since 1970, or IWN_WALL_UNKNOWN.
    const char *version;               ///< Of the program.
    iwn_holder_t holder;               ///< Who drives.
    iwn_bus_t bus;                     ///< The bus.
    iwn_estop_t estop;                 ///< The e-stop.
    iwn_zero_note_t zero[IW_SIDES];    ///< By iw_side_t.
    const char *warning[IWN_WARNINGS]; ///< Sentences, as many as `warnings`.
    uint32_t warnings;                 ///< What was found wrong at the start.
    uint32_t clients;                  ///< Connections.
    bool shutting_down;                ///< Nobody can arm any more.
} iwn_surroundings_t;

/// The first part of a status, up to the pose: time, state, lease, bus, e-stop and wheels. What only the caller has comes next:
/// ledger, memory and gaps.
void iwn_tell_machine(const iw_snapshot_t *seen, const iwn_surroundings_t *around, iwn_out_t *json);

/// The last part of a status: stop budget, deviation of the pair, counters, clients and warnings.
void iwn_tell_rest(const iw_snapshot_t *seen, const iwn_surroundings_t *around, iwn_out_t *json);

/// Time, and forces of both wheels: the event `force`.
void iwn_tell_force(const iw_snapshot_t *seen, const iwn_surroundings_t *around, iwn_out_t *json);

/// The last stop, for `why` and the event `stop`. `note->stop.number` 0: there was none.
void iwn_tell_stop(const iwn_stop_note_t *note, iw_time_us_t now_us, iwn_out_t *json);

/// Who speaks, and to whom.
typedef struct {
    const char *version; ///< Of the program.
    const char *bus;     ///< Its name.
    iw_state_t state;    ///< Of the gateway.
    iw_client_t client;  ///< The number of this connection.
    bool watches_only;   ///< It may look, stop and e-stop.
} iwn_hello_t;

/// The reply to `hello`, and the event.
void iwn_tell_hello(const iwn_hello_t *hello, iwn_out_t *json);

/// What happened to the lease, in a word: gained, moved or lost.
const char *iwn_tell_change(iw_client_t holder, iw_client_t former);

/// Who has the lease now, and who had it before, or IW_CLIENT_NONE: the event `lease`, without its time.
void iwn_tell_lease(const iwn_holder_t *holder, iw_client_t former, iwn_out_t *json);

/// The reply to `drive` and `twist`.
void iwn_tell_applied(const iw_applied_t *applied, iwn_out_t *json);

/// The reply to `arm`.
void iwn_tell_terms(const iw_snapshot_t *seen, const iwn_surroundings_t *around, iwn_out_t *json);

/// The reply to `watch`: a bit for each iwn_topic_t, and the rate that was granted.
void iwn_tell_watched(uint8_t topics, uint32_t rate_hz, bool limited, iwn_out_t *json);

/// The zero of one wheel after a tare, over which window it was taken, and the one before.
void iwn_tell_tare(const iw_force_t *force, const iw_force_quality_t *window, const iw_force_t *before,
                   iwn_out_t *json);

/// What was found wrong at the start, in sentences.
void iwn_tell_warnings(const iwn_surroundings_t *around, iwn_out_t *json);

/// The age in ms of something that happened then; null if it never did.
void iwn_tell_age(const char *name, iw_time_us_t now_us, iw_time_us_t then_us, iwn_out_t *json);

/// Begins a reply in `size` bytes at `data`, with its `id` and "ok". The caller closes it: iwn_out_close, iwn_out_finish.
iwn_out_t iwn_tell_reply(char *data, size_t size, const iwn_id_t *id, bool ok);

/// Begins an event in `size` bytes at `data`.
iwn_out_t iwn_tell_event(char *data, size_t size, const char *name);

/// A whole refusal; its length, 0 if it does not fit.
size_t iwn_tell_refusal(char *data, size_t size, const iwn_id_t *id, const iwn_refusal_t *refusal);

#endif
