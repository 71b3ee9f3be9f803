// SPDX-License-Identifier: MIT
/// Functions shared by the files of the server.
#ifndef IWHEEL_SERVER_CALLS_H
#define IWHEEL_SERVER_CALLS_H

#include "iwheel_server/target.h"

/// Executes `drive` and `twist`.
void iwn_server_drive(iwn_server_t *self, iwn_client_t *client);
void iwn_server_twist(iwn_server_t *self, iwn_client_t *client);

/// Writes the fields of the reply to `hello`, and of the event.
void iwn_server_write_hello(iwn_server_t *self, const iwn_client_t *client, iwn_out_t *json);

#endif
