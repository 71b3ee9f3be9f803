// SPDX-License-Identifier: MIT
/// Shared functions of the two files of the service: sock_service.c reads, executes and sends; arrivals.c accepts.
#ifndef GATEWAY_SLOTS_H
#define GATEWAY_SLOTS_H

#include "sock_clients.h"

/// Slots of one right in the table.
typedef struct {
    uint32_t first;
    uint32_t slots;
} sock_part_t;

extern const sock_part_t sock_parts[SOCK_PARTS];

/// Closes the client and frees its slot.
void sock_service_release(sock_clients_t *self, sock_client_t *client);

/// Reads from the client and executes its next lines.
void sock_service_serve(sock_clients_t *self, sock_client_t *client);

/// Sends the queue of the client, and frees its slot if it is finished. Returns true if something was queued.
bool sock_service_flush_one(sock_clients_t *self, sock_client_t *client);

/// Closes clients beyond the maximum whose time has expired, and accepts again after a pause.
void sock_service_poll_arrivals(sock_clients_t *self);

#endif
