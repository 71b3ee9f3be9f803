// SPDX-License-Identifier: MIT
/// @file
/// Functions that a program adds to the server. Each program defines them once, at link time. There are no function
/// pointers, so that the worst-case stack can be computed from the calls.
///
/// The server calls them from its own functions, in the context of its caller. They must not wait, and must not call
/// `iwn_server_request`. Pointers that they receive are valid until they return.
#ifndef IWHEEL_SERVER_TARGET_H
#define IWHEEL_SERVER_TARGET_H

#include "iwheel_server/server.h"

#ifdef __cplusplus
extern "C" {
#endif

// Clients and lines.

/// Returns the connected client after `after` in a fixed order; the first one if it is NULL. Returns NULL at the end.
iwn_client_t *iwn_target_next(iwn_server_t *self, const iwn_client_t *after);

/// Returns the buffer of the next reply or event, of `*out_size` bytes. There is one buffer: a call discards a line
/// that was not sent.
char *iwn_target_line(iwn_server_t *self, size_t *out_size);

/// Sends the line in the buffer, with its newline. `length` 0: the line did not fit. After a reply that cannot be sent
/// the daemon closes the connection; the board counts it and reports the number in the event `lost`.
void iwn_target_reply(iwn_server_t *self, iwn_client_t *client, char *line, size_t length);

/// Sends an event in the same way. A client without space loses it.
void iwn_target_event(iwn_server_t *self, iwn_client_t *client, char *line, size_t length);

/// Answers `self->request`, which is `status`; iwn_server_write_status writes the fields.
void iwn_target_status(iwn_server_t *self, iwn_client_t *client);

/// Sends the event `state` to clients with `due`, or to all that watch it.
void iwn_target_state(iwn_server_t *self, const iw_snapshot_t *seen, bool due_only);

// Decisions whether a request may be executed.

/// Returns true if `self->request` (arm, reset or release) may be passed to the core. Otherwise `self->refusal` has the
/// reason.
bool iwn_target_permits(iwn_server_t *self, iwn_client_t *client);

/// Writes the message for a client that may only watch to `self->refusal.message`.
void iwn_target_refuse_right(iwn_server_t *self);

/// Returns true if `key` is the key of the client's lease. Otherwise `self->refusal` has the reason. The key is not
/// empty, and the client holds the lease.
bool iwn_target_is_key(iwn_server_t *self, const iwn_client_t *client, const char *key);

/// Writes the latest possible send time of the command in `self->request`, at which its lease starts. The caller sets
/// `*out_sent_us` to the time of the request before; a target without a better value leaves it unchanged. Returns false
/// if the command is too old or cannot show its age; `self->refusal` has the reason.
bool iwn_target_is_fresh(iwn_server_t *self, iwn_client_t *client, iw_time_us_t *out_sent_us);

// Reports of executed requests.

/// Reports a request of a client for `stop`, `disarm` or `estop`, even if it changes nothing.
void iwn_target_asked_to_stop(iwn_server_t *self, const iwn_client_t *client);

/// Reports the decision of the core about `self->request` (arm, stop, disarm, estop, reset, release).
void iwn_target_judged(iwn_server_t *self, const iwn_client_t *client, iw_refusal_t refusal);

/// Reports the decision of the core about a command.
void iwn_target_driven(iwn_server_t *self, const iwn_client_t *client, const iw_drive_t *wanted, iw_time_us_t sent_us,
                       iw_refusal_t refusal);

/// Reports an accepted arm request. The target stores the id of `self->request` until the reply.
void iwn_target_granted(iwn_server_t *self, iwn_client_t *client);

/// Returns the stored id when the arm is decided. It is valid until the next call.
const iwn_id_t *iwn_target_settled(iwn_server_t *self, iwn_client_t *client);

/// Reports a tare of a wheel, with the statistics of its window.
void iwn_target_tared(iwn_server_t *self, const iwn_client_t *client, iw_side_t side, const iw_force_quality_t *window);

/// Executes a request that only some programs know (confirm, config, recordings, recording, record), or refuses it.
void iwn_target_other(iwn_server_t *self, iwn_client_t *client);

// Contents of events and replies.

typedef enum {
    IWN_CHANGE_BUS = 0,     ///< `word`: its state.
    IWN_CHANGE_ESTOP,       ///< `word`: its state.
    IWN_CHANGE_FAULT,       ///< `word`: the cause; `present`: it has begun.
    IWN_CHANGE_LEFT_BEHIND, ///< A setpoint may wait in the queue of the bus.
    IWN_CHANGE_ROLLING,     ///< `present`: a wheel turns while nothing is sent to it.
    IWN_CHANGE_ROLLS_AWAY,  ///< `present`: the same shortly after the last setpoint, which is a fault.
    IWN_CHANGE_STOP,        ///< `self->last_stop` is the new stop.
    IWN_CHANGE_LEASE,       ///< `word`: gained, moved or lost; `self->reported.holder` is the present holder.
    IWN_CHANGE_STATE,       ///< `word`: the new state; `self->reported.state` is the state before.
    IWN_CHANGE_HOLDING,     ///< `present`: zeros hold the wheels.
} iwn_change_t;

/// Reports a change, directly before watchers receive it.
void iwn_target_changed(iwn_server_t *self, const iw_snapshot_t *seen, iwn_change_t change, const char *word,
                        bool present);

/// Returns microseconds since 1970, or IWN_WALL_UNKNOWN.
int64_t iwn_target_wall_us(void);

/// Returns a client as in messages, "joystick" (client 3), even if it is gone. It is valid until the next call.
const char *iwn_target_name(iwn_server_t *self, iw_client_t id);

/// Returns the part of a status that is outside the core.
iwn_surroundings_t iwn_target_around(iwn_server_t *self, const iw_snapshot_t *seen);

/// Sets the members that only the target knows; `seen`, `last_stop`, `estop`, `bus` and the times are set.
void iwn_target_describe(iwn_server_t *self, iw_refusal_t refusal, iwn_refuse_context_t *context);

/// Writes a message: what contradicts the assumption, and the consequence.
void iwn_target_contradiction(iwn_server_t *self, iw_assumption_item_t item, char *out_text, size_t size);

/// Writes the objects `ledger`, `memory` and `gaps` of a status.
void iwn_target_write_assumptions(iwn_server_t *self, const iw_snapshot_t *seen, iwn_out_t *json);

/// Writes more fields of the reply to `arm`.
void iwn_target_write_terms(iwn_server_t *self, const iwn_client_t *client, iwn_out_t *json);

/// Writes more fields of the reply to `why`: recording and frames.
void iwn_target_write_why(iwn_server_t *self, iwn_out_t *json);

#ifdef __cplusplus
}
#endif
#endif
