// SPDX-License-Identifier: MIT
/// What the two files of the service share: service.c reads, carries out and sends; arrivals.c takes newcomers.
#ifndef GATEWAY_SLOTS_H
#define GATEWAY_SLOTS_H

#include "clients.h"

/// The slots of one right in the table.
typedef struct {
    uint32_t first;
    uint32_t slots;
} gw_part_t;

extern const gw_part_t gw_parts[GW_PARTS];

/// It holds no lease any more, and is closed when it has taken what is left for it.
void gw_service_finish(gw_clients_t *self, gw_client_t *client);

/// Closes it and frees its slot.
void gw_service_release(gw_clients_t *self, gw_client_t *client);

/// Reads from it and carries out its next lines.
void gw_service_serve(gw_clients_t *self, gw_client_t *client);

/// Sends what is queued for it, releases it if it is finished. True if something was queued.
bool gw_service_flush_one(gw_clients_t *self, gw_client_t *client);

/// Ends the time of those beyond the maximum, and lets in newcomers again where a pause is over.
void gw_service_tend_arrivals(gw_clients_t *self);

#endif
