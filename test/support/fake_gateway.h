// SPDX-License-Identifier: MIT
/// A gateway's socket for tests of clients, in the test's own thread: it greets, stores the requests, and replies when the test calls it.
#ifndef FAKE_GATEWAY_H
#define FAKE_GATEWAY_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define FAKE_CONNECTIONS 32

typedef struct {
    int listen_fd;
    int fd[FAKE_CONNECTIONS]; ///< -1: closed.
    int count;                ///< Connections accepted so far.
    bool greets;              ///< False: it accepts connections and sends nothing.
    char path[108];
} fake_gateway_t;

void fake_gateway_open(fake_gateway_t *self);
void fake_gateway_close(fake_gateway_t *self);

/// Accepts all waiting connections.
void fake_gateway_accept(fake_gateway_t *self);

/// Writes the next line of this connection to `out`. Returns false if there is none or the connection is closed.
bool fake_gateway_read(fake_gateway_t *self, int connection, char *out, size_t size);

/// Returns true if the client closed the connection.
bool fake_gateway_is_closed(const fake_gateway_t *self, int connection);

/// Sends a reply to a line that was read: `fields` come after id and ok.
void fake_gateway_reply(fake_gateway_t *self, int connection, const char *line, bool ok, const char *fields);

/// Sends a line unchanged.
void fake_gateway_send(fake_gateway_t *self, int connection, const char *line);
void fake_gateway_hang_up(fake_gateway_t *self, int connection);

#endif
