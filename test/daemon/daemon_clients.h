// SPDX-License-Identifier: MIT
/// The gateway's clients: processes that ask it for something over its sockets, well or badly behaved.
#ifndef DAEMON_CLIENTS_H
#define DAEMON_CLIENTS_H

#include "daemon_world.h"

void clients_begin(uint64_t seed);
/// One begins what the event says; none does if there are too many.
void clients_start(const event_t *event);
void clients_all_gone(void);
iw_time_us_t clients_next_us(void);
void clients_run(void);
/// The gateway has read from this connection: what of it is a whole request now goes to the judge.
void clients_taken(int stream);
/// Since when one of them is driving without a break; IW_NEVER: none is.
iw_time_us_t clients_driving_us(void);

#endif
