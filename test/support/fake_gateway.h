// SPDX-License-Identifier: MIT
/// A gateway's socket for tests of clients, in the test's own thread: it greets, stores the requests, and replies when the test says so.
#ifndef FAKE_GATEWAY_H
#define FAKE_GATEWAY_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define FAKE_CONNECTIONS 32

typedef struct {
    int listen_fd;
    int fd[FAKE_CONNECTIONS]; ///< -1: closed.
    int count;                ///< Connections ever.
    bool greets;              ///< False: it accepts, and sends nothing.
    char path[108];
} fake_gateway_t;

void fake_gateway_open(fake_gateway_t *self);
void fake_gateway_close(fake_gateway_t *self);

/// Accepts all who wait.
void fake_gateway_accept(fake_gateway_t *self);

/// The next line that came on this connection, within the text of `out`; false: there is none, or it is closed.
bool fake_gateway_read(fake_gateway_t *self, int connection, char *out, size_t size);

/// True if the client closed it.
bool fake_gateway_is_closed(const fake_gateway_t *self, int connection);

/// Sends a reply to a line that was read: `fields` follow id and ok.
void fake_gateway_reply(fake_gateway_t *self, int connection, const char *line, bool ok, const char *fields);

/// Sends a line as it is.
void fake_gateway_send(fake_gateway_t *self, int connection, const char *line);
void fake_gateway_hang_up(fake_gateway_t *self, int connection);

#endif
