// SPDX-License-Identifier: MIT
/// The gateway's clients: processes that send it requests over its sockets, correctly or not.
#ifndef DAEMON_CLIENTS_H
#define DAEMON_CLIENTS_H

#include "daemon_world.h"

void clients_begin(uint64_t seed);
/// Starts the client of this event; does nothing if there are too many.
void clients_start(const event_t *event);
void clients_all_gone(void);
iw_time_us_t clients_next_us(void);
void clients_run(void);
/// The gateway has read from this connection: its complete requests go to the judge.
void clients_taken(int stream);
/// Begin of uninterrupted driving by one client; IW_NEVER: no client drives.
iw_time_us_t clients_driving_us(void);

#endif
