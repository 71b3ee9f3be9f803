// SPDX-License-Identifier: MIT
/// Recordings for clients: passed on to the process that reads them (disk/box_files.h), answered when it answers.
///
/// Nothing waits for it, not even later requests of the same client: a stop behind a slow disk is carried out at once. So a client has
/// one question at a time, and a cycle takes one answer.
#ifndef GATEWAY_RECORDINGS_H
#define GATEWAY_RECORDINGS_H

#include "dispatch.h"

/// Carries out `recordings` or `recording`: refuses it, or leaves its reply to `gw_recordings_take`.
void gw_recordings_ask(const gw_call_t *call);

/// Passes on what has been read, if anything has. False: the process that reads has ended; who waited for it is told.
bool gw_recordings_take(struct gw_box *box, struct gw_clients *clients);

#endif
