// SPDX-License-Identifier: MIT
/// @file
/// Writes the contents of replies and events, from a snapshot of the core and from the caller's data.
/// share/northbound.json describes each object.
///
/// All functions write fields into an open object. An unknown value is written as null, never as a number.
#ifndef IWHEEL_NORTHBOUND_CONTENTS_H
#define IWHEEL_NORTHBOUND_CONTENTS_H

#include "iwheel_northbound/json_out.h"
#include "iwheel_northbound/request.h"
#include "iwheel_northbound/why.h"

#include "iwheel/gateway.h"

#ifdef __cplusplus
extern "C" {
#endif

/// Increases if an earlier client would misunderstand the protocol.
#define IWN_API_VERSION 1
/// Telemetry other than speed is unknown after this time: five periods of status and pose.
#define IWN_STATUS_STALE_US 200000U
/// Largest number of warnings in a status.
#define IWN_WARNINGS 8U
/// Time of a machine without a wall clock, or whose clock was never set.
#define IWN_WALL_UNKNOWN INT64_MIN

/// Record of a force offset from an earlier run.
typedef struct {
    iw_offset_provenance_t from; ///< IW_OFFSET_NONE if there is no record.
    uint32_t samples;            ///< Samples in its window.
    uint32_t deviation_mN;       ///< Deviation of its window.
    int32_t drift_mN;            ///< Drift of its window.
    int64_t wall_us;             ///< Time of the offset; 0 or less if unknown.
} iwn_zero_note_t;

/// Lease holder.
typedef struct {
    iw_client_t client; ///< IW_CLIENT_NONE if there is none.
    const char *name;   ///< NULL or empty if it has no name.
    int pid;            ///< 0 if unknown.
} iwn_holder_t;

/// State of the bus outside the core.
typedef struct {
    const char *name;               ///< Name of the interface.
    const char *timing;             ///< confirmed, near, contradicted or unproven.
    uint32_t bitrate_hz;            ///< 0 if not reported.
    uint32_t sample_point_permille; ///< 0 if not reported.
    uint32_t load_permille;         ///< Valid only with `up`.
    uint32_t lost;                  ///< Lost frames; valid only with `up`.
    bool up;                        ///< A CAN interface that exists.
} iwn_bus_t;

/// E-stop input.
typedef struct {
    const char *line;       ///< Configured name.
    const char *line2;      ///< Configured name of the second contact; NULL if there is none.
    const char *pressed_at; ///< Contact that is pressed or unreadable: neither, line, line2, both. Only with `line2`.
    int answer;             ///< Result of `estop_pressed` of iw_hal_t.
    bool present;           ///< False if there is no e-stop.
    bool simulated;         ///< Button of the simulator.
    int64_t tried_us;       ///< Wall clock time of the last test of its button; 0 if there was none.
} iwn_estop_t;

/// State outside the snapshot of the core.
typedef struct {
    int64_t wall_us;                   ///< Since 1970, or IWN_WALL_UNKNOWN.
    const char *version;               ///< Version of the program.
    iwn_holder_t holder;               ///< Lease holder.
    iwn_bus_t bus;                     ///< Bus.
    iwn_estop_t estop;                 ///< E-stop.
    iwn_zero_note_t zero[IW_SIDES];    ///< Indexed by iw_side_t.
    const char *warning[IWN_WARNINGS]; ///< `warnings` sentences.
    uint32_t warnings;                 ///< Number of warnings from the start.
    uint32_t clients;                  ///< Number of connections.
    bool shutting_down;                ///< No client can arm any more.
} iwn_surroundings_t;

/// Writes the first part of a status, up to the pose: time, state, lease, bus, e-stop and wheels. The caller's objects
/// follow: ledger, memory and gaps.
void iwn_write_machine(const iw_snapshot_t *seen, const iwn_surroundings_t *around, iwn_out_t *json);

/// Writes the last part of a status: stop budget, deviation of the pair, counters, clients and warnings.
void iwn_write_rest(const iw_snapshot_t *seen, const iwn_surroundings_t *around, iwn_out_t *json);

/// Writes the event `force`: time, and forces of both wheels.
void iwn_write_force(const iw_snapshot_t *seen, const iwn_surroundings_t *around, iwn_out_t *json);

/// Writes the last stop, for `why` and the event `stop`. `note->stop.number` 0: there was none.
void iwn_write_stop(const iwn_stop_note_t *note, iw_time_us_t now_us, iwn_out_t *json);

/// Sender and receiver of `hello`.
typedef struct {
    const char *version; ///< Version of the program.
    const char *bus;     ///< Name of the bus.
    iw_state_t state;    ///< State of the gateway.
    iw_client_t client;  ///< Id of this connection.
    bool watches_only;   ///< The client may only watch, stop and e-stop.
} iwn_hello_t;

/// Writes the reply to `hello`, and the event.
void iwn_write_hello(const iwn_hello_t *hello, iwn_out_t *json);

/// Returns the change of the lease: gained, moved or lost.
const char *iwn_write_change(iw_client_t holder, iw_client_t former);

/// Writes the event `lease`, without its time: the present holder and the one before, or IW_CLIENT_NONE.
void iwn_write_lease(const iwn_holder_t *holder, iw_client_t former, iwn_out_t *json);

/// Writes the reply to `drive` and `twist`.
void iwn_write_applied(const iw_applied_t *applied, iwn_out_t *json);

/// Writes the reply to `arm`.
void iwn_write_terms(const iw_snapshot_t *seen, const iwn_surroundings_t *around, iwn_out_t *json);

/// Writes the reply to `watch`: a bit mask of iwn_topic_t, and the accepted rate.
void iwn_write_watched(uint8_t topics, uint32_t rate_hz, bool limited, iwn_out_t *json);

/// Writes the offset of a wheel after a tare, the statistics of its window, and the offset before.
void iwn_write_tare(const iw_force_t *force, const iw_force_quality_t *window, const iw_force_t *before,
                    iwn_out_t *json);

/// Writes the warnings from the start as sentences.
void iwn_write_warnings(const iwn_surroundings_t *around, iwn_out_t *json);

/// Writes the age of an event in ms; null if it never occurred.
void iwn_write_age(const char *name, iw_time_us_t now_us, iw_time_us_t then_us, iwn_out_t *json);

/// Begins a reply in `size` bytes at `data`, with its `id` and "ok". The caller ends it: iwn_out_close, iwn_out_finish.
iwn_out_t iwn_write_reply(char *data, size_t size, const iwn_id_t *id, bool ok);

/// Begins an event in `size` bytes at `data`.
iwn_out_t iwn_write_event(char *data, size_t size, const char *name);

/// Writes a whole refusal. Returns its length; 0 if it does not fit.
size_t iwn_write_refusal(char *data, size_t size, const iwn_id_t *id, const iwn_refusal_t *refusal);

/// Returns true if speeds in mm/s are valid: they depend on the radius, and on the gear ratio if the wheels report the
/// rpm of the rotor. Inline: the writer of a snapshot is its main user.
static inline bool iwn_is_speed_known(const iw_snapshot_t *seen) {
    return seen->assumed[IW_ASSUMPTION_WHEEL_RADIUS].state != IW_CONTRADICTED &&
           !(seen->config->rpm_of_rotor && seen->assumed[IW_ASSUMPTION_GEAR_RATIO].state == IW_CONTRADICTED);
}

#ifdef __cplusplus
}
#endif
#endif
