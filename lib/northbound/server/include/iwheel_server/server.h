// SPDX-License-Identifier: MIT
/// @file
/// The northbound server: carries out requests against a core, answers them, and tells watchers what has changed. It knows no
/// transport, no heap and no stdio, so the daemon and the microcontroller run the same code. What differs between them is declared
/// in target.h.
///
/// The caller owns connections and buffers. It puts a request into `request`, sets `now_us`, and calls iwn_server_request. After every
/// step of the core it calls iwn_server_observe and then iwn_server_arming, and once per cycle iwn_server_periodic.
///
/// An arm is answered when the core has decided it:
///
///     IDLE --arm granted: iwn_target_granted--> ARMING --decided: iwn_target_settled, reply--> IDLE
#ifndef IWHEEL_SERVER_SERVER_H
#define IWHEEL_SERVER_SERVER_H

#include "iwheel/gateway.h"
#include "iwheel_northbound/refuse.h"
#include "iwheel_northbound/tell.h"

/// A software e-stop that is repeated within this time while its latch holds is answered and changes nothing.
#define IWN_ESTOP_AGAIN_US 100000U
/// A wheel that has power is received within this time after the start; before that a silent wheel is not reported as a fault.
#define IWN_FIRST_TELEMETRY_US 1000000U
/// The fault `rolling` is reported at most once in this time: clients store faults, and people push a walker by hand.
#define IWN_ROLLING_FAULT_US 60000000U

/// One client, as far as the protocol knows it.
typedef struct {
    iw_client_t id;               ///< Never used again for another connection.
    bool watches_only;            ///< It may watch, stop and e-stop.
    bool arming;                  ///< An arm of it was granted and is not answered yet.
    bool due;                     ///< A periodic event is due in this cycle.
    uint8_t topics;               ///< What it watches: a bit for each iwn_topic_t.
    uint32_t rate_hz;             ///< Of the periodic events.
    iw_time_us_t next_us;         ///< When the next of them is due.
    char name[IWN_NAME_MAX + 1U]; ///< As given with arm; empty: none.
} iwn_client_t;

/// What watchers were told last: only changes are told.
typedef struct {
    iw_state_t state;
    iw_bus_state_t bus;
    iw_client_t holder;
    uint32_t present;        ///< Causes that latch, a bit for each.
    uint32_t stop_number;    ///< Of the last stop.
    uint32_t still_moving;   ///< Count of the core.
    int estop;               ///< Answer of the e-stop.
    const char *pressed_at;  ///< Of two contacts.
    iw_time_us_t started_us; ///< When the first observation was.
    iw_time_us_t rolling_us; ///< When the fault `rolling` was reported last; 0: never.
    bool started;            ///< There was a first observation.
    bool left_behind;
    bool zeros_ending;
    bool holding;
    bool rolling;
    bool rolling_fault;
} iwn_reported_t;

/// Small members first: a microcontroller reaches them by shorter instructions.
typedef struct iwn_server {
    // Set by the caller before the first call.
    iw_gateway_t *core;
    const char *version; ///< Of the program.
    const char *bus;     ///< Name of the bus.
    uint32_t max_age_ms; ///< Of arm, reset, release and confirm.
    uint32_t rate_max_hz;
    uint8_t topics; ///< What can be watched here: a bit for each iwn_topic_t.
    /// Periodic events of each client come at times of its own, for a line without room for many at once. Otherwise on a grid that all
    /// share, so that an event is written once for many.
    bool each_for_itself;

    // Set by the caller before each call.
    iw_time_us_t now_us;
    iwn_estop_t estop; ///< Before iwn_server_observe.

    // Read by the caller.
    iw_time_us_t stopped_us, estopped_us; ///< When a client asked last; 0: never.
    iw_client_t stopped_by, estopped_by;  ///< Which client that was.
    iwn_reported_t told;
    iw_snapshot_t seen;        ///< Of iwn_server_look.
    iwn_request_t request;     ///< Set by the caller before iwn_server_request.
    iwn_stop_note_t last_stop; ///< The last stop, with its sentence.
    iwn_refusal_t refusal;     ///< Why the request is refused; written by whoever refuses it.
    char estop_reason[IWN_REASON_MAX + 1U];
} iwn_server_t;

/// Before anything else; the members of the first group are set.
void iwn_server_begin(iwn_server_t *self);

/// A new client: empty except for its number and right.
void iwn_server_welcome(iwn_client_t *client, iw_client_t id, bool watches_only);

/// Carries out `self->request` whole or not at all, answers it (an arm may be answered later), and tells what came of it.
void iwn_server_request(iwn_server_t *self, iwn_client_t *client);

/// Answers the arms that the last step decided. `seen` is the snapshot after it.
void iwn_server_arming(iwn_server_t *self, const iw_snapshot_t *seen);

/// Tells watchers what has changed since the last call. After every step, and before a client is forgotten, so that a stop can name it.
void iwn_server_observe(iwn_server_t *self, const iw_snapshot_t *seen);

/// Sends the periodic events that are due.
void iwn_server_periodic(iwn_server_t *self);

/// When iwn_server_periodic has something to do; IW_NEVER if nobody watches state or force.
iw_time_us_t iwn_server_next_us(iwn_server_t *self);

// For what a target answers and tells by itself.

/// The state of the core now. Valid until the next call of it.
const iw_snapshot_t *iwn_server_look(iwn_server_t *self);

/// The client with this number; NULL: it is gone.
iwn_client_t *iwn_server_find(iwn_server_t *self, iw_client_t id);

/// How many clients watch the topic.
uint32_t iwn_server_watching(iwn_server_t *self, iwn_topic_t topic);

/// Begins a reply that says yes; its fields follow.
iwn_out_t iwn_server_begin_reply(iwn_server_t *self, const iwn_id_t *id);

/// Closes the reply and sends it.
void iwn_server_send_reply(iwn_server_t *self, iwn_client_t *client, iwn_out_t *json);

/// Refuses the request with this id for the reason in `self->refusal`.
void iwn_server_refuse(iwn_server_t *self, iwn_client_t *client, const iwn_id_t *id);

/// Refuses `self->request` for a reason of the core.
void iwn_server_refuse_as(iwn_server_t *self, iwn_client_t *client, iw_refusal_t refusal);

/// Begins an event; its fields follow.
iwn_out_t iwn_server_begin_event(iwn_server_t *self, const char *name);

/// Closes the event and sends it to all who watch the topic; a client that reads too slowly loses it.
void iwn_server_send_event(iwn_server_t *self, iwn_topic_t topic, iwn_out_t *json);

/// Reports that a fault has come or gone.
void iwn_server_tell_fault(iwn_server_t *self, const char *cause, bool present);

/// Writes the fields of a status into an open object.
void iwn_server_write_status(iwn_server_t *self, const iw_snapshot_t *seen, iwn_out_t *json);

/// Sends the event `hello` to a new client.
void iwn_server_hello(iwn_server_t *self, iwn_client_t *client);

#endif
