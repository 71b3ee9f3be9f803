// SPDX-License-Identifier: MIT
/// Recordings for clients: passed on to the process that reads them (box/box_files.h), answered when it answers.
///
/// Nothing waits for it, not even later requests of the same client: a stop behind a slow disk is carried out at once. So a client has
/// one question at a time, and a cycle takes one answer.
#ifndef GATEWAY_RECORDINGS_H
#define GATEWAY_RECORDINGS_H

#include "daemon.h"

/// Carries out `recordings` or `recording`: refuses it, or leaves its reply to `gw_recordings_take`.
void gw_recordings_ask(gw_daemon_t *daemon, gw_client_t *client, const iwn_request_t *request);

/// Passes on what has been read, if anything has.
void gw_recordings_take(gw_daemon_t *daemon);

#endif
