// SPDX-License-Identifier: MIT
/// @file
/// What a program adds to the server. Each program defines these functions once, at link time. There are no function pointers, so the
/// worst-case stack can be computed from the calls.
#ifndef IWHEEL_SERVER_TARGET_H
#define IWHEEL_SERVER_TARGET_H

#include "iwheel_server/server.h"

// Clients and lines.

/// The connected client after this one, in a fixed order; NULL: the first one. Returns NULL at the end.
iwn_client_t *iwn_target_next(iwn_server_t *self, const iwn_client_t *after);

/// Where the next reply or event is written: `*out_size` bytes.
char *iwn_target_line(iwn_server_t *self, size_t *out_size);

/// Sends a line written there, with its newline. `length` 0: it did not fit.
void iwn_target_reply(iwn_server_t *self, iwn_client_t *client, char *line, size_t length);

/// The same for an event: a client without room loses it.
void iwn_target_event(iwn_server_t *self, iwn_client_t *client, char *line, size_t length);

/// Answers `self->request`, which is `status`; iwn_server_write_status writes its fields.
void iwn_target_status(iwn_server_t *self, iwn_client_t *client);

/// The event `state` is due: for clients with `due`, or for all who watch it.
void iwn_target_state(iwn_server_t *self, const iw_snapshot_t *seen, bool due_only);

// What may be carried out.

/// True if `self->request`, which is arm, reset or release, may go to the core. Otherwise `self->refusal` says why not.
bool iwn_target_permits(iwn_server_t *self, iwn_client_t *client);

/// The message for a client that may only watch, into `self->refusal.message`.
void iwn_target_say_right(iwn_server_t *self);

/// True if this is the key of the client's lease. Otherwise `self->refusal` says why not. The key is not empty, and the client holds
/// the lease.
bool iwn_target_is_key(iwn_server_t *self, const iwn_client_t *client, const char *key);

/// When the command in `self->request` was sent at the latest: the lease runs from then. False: it is too old or cannot show its age,
/// and `self->refusal` says why.
bool iwn_target_is_fresh(iwn_server_t *self, iwn_client_t *client, iw_time_us_t *out_sent_us);

// What was carried out.

/// A client asks for `stop`, `disarm` or `estop`, whether it changes anything or not.
void iwn_target_asked_to_stop(iwn_server_t *self, const iwn_client_t *client);

/// The core has judged `self->request` (arm, stop, disarm, estop, reset, release).
void iwn_target_judged(iwn_server_t *self, const iwn_client_t *client, iw_refusal_t refusal);

/// The core has judged a command.
void iwn_target_driven(iwn_server_t *self, const iwn_client_t *client, const iw_drive_t *wanted, iw_time_us_t sent_us,
                       iw_refusal_t refusal);

/// An arm was granted; the id of `self->request` is kept until the answer.
void iwn_target_granted(iwn_server_t *self, iwn_client_t *client);

/// The arm is decided. The id that was kept; valid until the next call.
const iwn_id_t *iwn_target_settled(iwn_server_t *self, iwn_client_t *client);

/// The zero of a wheel was taken over a window of this quality.
void iwn_target_tared(iwn_server_t *self, const iwn_client_t *client, iw_side_t side, const iw_force_quality_t *window);

/// Carries out a request that only some programs know (confirm, config, recordings, recording), or refuses it.
void iwn_target_other(iwn_server_t *self, iwn_client_t *client);

// What is told.

typedef enum {
    IWN_CHANGE_BUS = 0,     ///< `word`: its state.
    IWN_CHANGE_ESTOP,       ///< `word`: its state.
    IWN_CHANGE_FAULT,       ///< `word`: the cause; `present`: it has come.
    IWN_CHANGE_LEFT_BEHIND, ///< A setpoint may wait in the queue of the bus.
    IWN_CHANGE_ROLLING,     ///< `present`: a wheel turns although nothing is sent to it.
    IWN_CHANGE_ROLLS_AWAY,  ///< `present`: the same soon after the last setpoint, which is a fault.
    IWN_CHANGE_STOP,        ///< `self->last_stop` is the new one.
    IWN_CHANGE_LEASE,       ///< `word`: gained, moved or lost; `self->told.holder` has it now.
    IWN_CHANGE_STATE,       ///< `word`: the new state; `self->told.state` is the one before.
    IWN_CHANGE_HOLDING,     ///< `present`: zeros hold the wheels.
} iwn_change_t;

/// Something has changed, right before watchers are told.
void iwn_target_changed(iwn_server_t *self, const iw_snapshot_t *seen, iwn_change_t change, const char *word,
                        bool present);

/// Microseconds since 1970, or IWN_WALL_UNKNOWN.
int64_t iwn_target_wall_us(void);

/// A client as messages show it, "joystick" (client 3), even if it is gone. Valid until the next call.
const char *iwn_target_name(iwn_server_t *self, iw_client_t id);

/// Everything that a status shows beside the core.
iwn_surroundings_t iwn_target_around(iwn_server_t *self, const iw_snapshot_t *seen);

/// Fills in what only the target knows; `seen`, `last_stop`, `estop`, `bus` and the times are set.
void iwn_target_describe(iwn_server_t *self, iw_refusal_t refusal, iwn_refuse_context_t *context);

/// What contradicts the assumption, and what it costs, as a message.
void iwn_target_contradiction(iwn_server_t *self, iw_assumption_item_t item, char *out_text, size_t size);

/// The objects `ledger`, `memory` and `gaps` of a status.
void iwn_target_write_assumptions(iwn_server_t *self, const iw_snapshot_t *seen, iwn_out_t *json);

/// More fields of the reply to `arm`.
void iwn_target_write_terms(iwn_server_t *self, const iwn_client_t *client, iwn_out_t *json);

/// More fields of the reply to `why`: recording and frames.
void iwn_target_write_why(iwn_server_t *self, iwn_out_t *json);

#endif
