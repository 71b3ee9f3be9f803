// SPDX-License-Identifier: MIT
/// @file
/// The northbound server executes requests on a core, answers them, and reports changes to watchers. It uses no
/// transport, no heap and no stdio, so that the daemon and the microcontroller run the same code. target.h declares the
/// functions that differ between them.
///
/// The caller owns connections and buffers. It sets `request` and `now_us`, and calls iwn_server_request. After every
/// step of the core it calls iwn_server_observe and then iwn_server_arming, and once per cycle iwn_server_periodic.
///
/// The reply to arm follows the decision of the core:
///
///     IDLE --arm granted: iwn_target_granted--> ARMING --decided: iwn_target_settled, reply--> IDLE
#ifndef IWHEEL_SERVER_SERVER_H
#define IWHEEL_SERVER_SERVER_H

#include "iwheel/gateway.h"
#include "iwheel_northbound/contents.h"
#include "iwheel_northbound/refuse.h"

#ifdef __cplusplus
extern "C" {
#endif

/// A repeated software e-stop within this time while its latch holds is answered and changes nothing.
#define IWN_ESTOP_AGAIN_US 100000U
/// Time after the start in which the first telemetry arrives. Before it a wheel without telemetry is not reported as a
/// fault.
#define IWN_FIRST_TELEMETRY_US 1000000U
/// Shortest interval between reports of the fault `rolling`: clients store faults, and people push a walker by hand.
#define IWN_ROLLING_FAULT_US 60000000U

/// Data of one client in the protocol. The order of the members has the least padding.
typedef struct {
    iw_client_t id;               ///< Never reused for another connection.
    uint32_t rate_hz;             ///< Rate of the periodic events.
    iw_time_us_t next_us;         ///< Time of the next periodic event.
    bool watches_only;            ///< The client may only watch, stop and e-stop.
    bool arming;                  ///< An accepted arm request of it has no reply yet.
    bool due;                     ///< A periodic event is due in this cycle.
    uint8_t topics;               ///< Bit mask of the watched topics (iwn_topic_t).
    char name[IWN_NAME_MAX + 1U]; ///< Name from arm; empty if there is none.
} iwn_client_t;

/// Values that watchers have last received. Only changes are sent.
typedef struct {
    iw_state_t state;
    iw_bus_state_t bus;
    iw_client_t holder;
    uint32_t present;        ///< Bit mask of latching causes.
    uint32_t stop_number;    ///< Number of the last stop.
    uint32_t still_moving;   ///< Counter of the core.
    int estop;               ///< Result of the e-stop.
    const char *pressed_at;  ///< Pressed contact of two.
    iw_time_us_t started_us; ///< Time of the first observation.
    iw_time_us_t rolling_us; ///< Last report of the fault `rolling`; 0 if there was none.
    bool started;            ///< There was a first observation.
    bool left_behind;
    bool zeros_ending;
    bool holding;
    bool rolling;
    bool rolling_fault;
} iwn_reported_t;

/// Small members first, because a microcontroller reaches them by shorter instructions.
typedef struct iwn_server {
    // The caller sets these members before the first call.
    iw_gateway_t *core;
    const char *version; ///< Version of the program.
    const char *bus;     ///< Name of the bus.
    uint32_t max_age_ms; ///< Largest age of arm, reset, release and confirm.
    uint32_t rate_max_hz;
    uint8_t topics; ///< Bit mask of the topics that can be watched here (iwn_topic_t).
    /// True: each client has its own times for periodic events, for a line that cannot carry many together. False: all
    /// clients share a grid, so that an event is written once for many.
    bool each_for_itself;

    // The caller sets these members before each call.
    iw_time_us_t now_us;
    iwn_estop_t estop; ///< Set before iwn_server_observe.

    // The caller reads these members.
    /// Times of the last requests of clients; 0 if there was none. `stopped_us` also of an edge of the button.
    iw_time_us_t stopped_us, estopped_us;
    iw_client_t stopped_by, estopped_by; ///< Client of that request.
    iwn_reported_t reported;
    iw_snapshot_t seen;        ///< Snapshot of iwn_server_snapshot.
    iwn_request_t request;     ///< The caller sets it before iwn_server_request.
    iwn_stop_note_t last_stop; ///< The last stop, with its sentence.
    iwn_refusal_t refusal;     ///< Reason of a refusal, written by the function that refuses.
    char estop_reason[IWN_REASON_MAX + 1U];
} iwn_server_t;

/// Initializes the server. The members of the first group are set before.
void iwn_server_begin(iwn_server_t *self);

/// Initializes a new client with its id and right.
void iwn_server_welcome(iwn_client_t *client, iw_client_t id, bool watches_only);

/// Executes `self->request` as a whole or not at all, answers it (arm may be answered later), and reports its effects.
void iwn_server_request(iwn_server_t *self, iwn_client_t *client);

/// Answers the arm requests that the last step decided. `seen`: snapshot after the step.
void iwn_server_arming(iwn_server_t *self, const iw_snapshot_t *seen);

/// Reports changes since the last call to watchers. Call it after every step, and before a client is removed, so that a
/// stop can name it.
void iwn_server_observe(iwn_server_t *self, const iw_snapshot_t *seen);

/// Sends the periodic events that are due.
void iwn_server_periodic(iwn_server_t *self);

/// Returns the time of the next periodic event; IW_NEVER if no client watches state or force.
iw_time_us_t iwn_server_next_us(iwn_server_t *self);

// Functions for replies and events of a target.

/// Returns a snapshot of the core. It is valid until the next call.
const iw_snapshot_t *iwn_server_snapshot(iwn_server_t *self);

/// Returns the client with this id; NULL if it is gone.
iwn_client_t *iwn_server_find(iwn_server_t *self, iw_client_t id);

/// Returns the number of clients that watch the topic.
uint32_t iwn_server_watching(iwn_server_t *self, iwn_topic_t topic);

/// Begins a successful reply; its fields follow.
iwn_out_t iwn_server_begin_reply(iwn_server_t *self, const iwn_id_t *id);

/// Ends the reply and sends it.
void iwn_server_send_reply(iwn_server_t *self, iwn_client_t *client, iwn_out_t *json);

/// Refuses the request with this id for the reason in `self->refusal`.
void iwn_server_refuse(iwn_server_t *self, iwn_client_t *client, const iwn_id_t *id);

/// Refuses `self->request` for a reason of the core.
void iwn_server_refuse_as(iwn_server_t *self, iwn_client_t *client, iw_refusal_t refusal);

/// Begins an event; its fields follow.
iwn_out_t iwn_server_begin_event(iwn_server_t *self, const char *name);

/// Ends the event and sends it to all watchers of the topic. A client that reads too slowly loses it.
void iwn_server_send_event(iwn_server_t *self, iwn_topic_t topic, iwn_out_t *json);

/// Reports that a fault has begun or ended.
void iwn_server_report_fault(iwn_server_t *self, const char *cause, bool present);

/// Writes the fields of a status into an open object.
void iwn_server_write_status(iwn_server_t *self, const iw_snapshot_t *seen, iwn_out_t *json);

/// Sends the event `hello` to a new client.
void iwn_server_hello(iwn_server_t *self, iwn_client_t *client);

#ifdef __cplusplus
}
#endif
#endif
