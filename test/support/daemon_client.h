// SPDX-License-Identifier: MIT
/// What the daemon's tests with one client begin and end with: setUp and tearDown, for a rig with one client that may drive.
#ifndef TEST_DAEMON_CLIENT_H
#define TEST_DAEMON_CLIENT_H

#include "daemon_rig.h"

/// Its connection. A test that closes it sets it to -1.
extern int client;

/// The reply to its request has that in it.
void assert_reply(const char *line, const char *part);

#endif
