// SPDX-License-Identifier: MIT
/// What a replay decides, in lines for people or as JSON. Private to the replay.
#ifndef REPLAY_TELL_H
#define REPLAY_TELL_H

#include "replay.h"

/// What the last step has changed.
void replay_tell_step(replay_t *self);

/// A request and what became of it. A drive command that says the same as the one before is not told again.
void replay_tell_request(replay_t *self, const blackbox_entry_t *entry, iw_refusal_t refusal);

/// An answer of the port that has changed; before it is taken over.
void replay_tell_answer(const replay_t *self, const blackbox_entry_t *entry);

/// A decision was recorded that is not ours.
void replay_tell_difference(const replay_t *self, const blackbox_entry_t *entry);

/// A remark that belongs to no time.
__attribute__((format(printf, 2, 3))) void replay_note(const replay_out_t *out, const char *format, ...);

#endif
