// SPDX-License-Identifier: MIT
/// setUp and tearDown of the daemon's tests with one client: a rig with one connection that may drive.
#ifndef TEST_DAEMON_CLIENT_H
#define TEST_DAEMON_CLIENT_H

#include "daemon_rig.h"

/// The client's connection. A test that closes it sets it to -1.
extern int client;

/// Asserts that the reply to the client's request contains this text.
void assert_reply(const char *line, const char *part);

/// The same for another connection.
void assert_reply_to(int who, const char *line, const char *part);

#endif
