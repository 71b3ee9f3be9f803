// SPDX-License-Identifier: MIT
/// Carries out a client's requests and answers them.
#ifndef GATEWAY_DISPATCH_H
#define GATEWAY_DISPATCH_H

#include "daemon.h"

/// Lines of one client that are carried out in one cycle.
#define GW_LINES_PER_CYCLE 4U

/// An e-stop that is asked for again this soon while its latch holds changes nothing.
#define GW_ESTOP_AGAIN_US 100000U

/// Carries out one line. It is applied whole or not at all, and answered; the reply to `arm` may come later.
void gw_dispatch_line(gw_daemon_t *daemon, gw_client_t *client, const char *line, size_t length);

/// A reply that says yes, open for its fields; close its bracket.
iwn_out_t gw_dispatch_begin_reply(gw_daemon_t *daemon, const iwn_id_t *id);

/// Answers the arms that have been decided by the last step.
void gw_dispatch_arming(gw_daemon_t *daemon);

/// Refuses without a request: `line_too_long` and `too_many_clients`. Writes the line, returns its length.
size_t gw_dispatch_write_refusal(gw_daemon_t *daemon, const iwn_id_t *id, const iwn_refusal_t *refusal);

#endif
