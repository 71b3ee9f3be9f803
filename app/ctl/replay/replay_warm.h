// SPDX-License-Identifier: MIT
/// Brings a replay to where the recorded gateway was when its recording begins: to the state, the lease and the speed that the
/// recording tells, on wheels made up for it. What it had learned before (force offsets, assumptions) stays unknown.
#ifndef REPLAY_WARM_H
#define REPLAY_WARM_H

#include "replay.h"

/// `state` is a BLACKBOX_STATE; `self->estop` and `self->bus` are the answers at its time. Nothing of this is told. False: the
/// core could not be brought there.
bool replay_warm(replay_t *self, const iw_config_t *config, const blackbox_entry_t *state);

#endif
