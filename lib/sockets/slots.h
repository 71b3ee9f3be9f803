// SPDX-License-Identifier: MIT
/// What the two files of the service share: sock_service.c reads, carries out and sends; arrivals.c takes newcomers.
#ifndef GATEWAY_SLOTS_H
#define GATEWAY_SLOTS_H

#include "sock_clients.h"

/// The slots of one right in the table.
typedef struct {
    uint32_t first;
    uint32_t slots;
} sock_part_t;

extern const sock_part_t sock_parts[SOCK_PARTS];

/// It holds no lease any more, and is closed when it has taken what is left for it.
void sock_service_finish(sock_clients_t *self, sock_client_t *client);

/// Closes it and frees its slot.
void sock_service_release(sock_clients_t *self, sock_client_t *client);

/// Reads from it and carries out its next lines.
void sock_service_serve(sock_clients_t *self, sock_client_t *client);

/// Sends what is queued for it, releases it if it is finished. True if something was queued.
bool sock_service_flush_one(sock_clients_t *self, sock_client_t *client);

/// Ends the time of those beyond the maximum, and lets in newcomers again where a pause is over.
void sock_service_poll_arrivals(sock_clients_t *self);

#endif
