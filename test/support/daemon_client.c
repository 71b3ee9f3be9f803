// SPDX-License-Identifier: MIT
#include "daemon_client.h"

#include "unity.h"

#include <string.h>
#include <unistd.h>

int client;

void setUp(void) {
    daemon_rig_begin();
    client = daemon_rig_connect();
}

void tearDown(void) {
    (void)close(client);
    daemon_rig_end();
}

void assert_reply_to(int who, const char *line, const char *part) {
    const char *reply = daemon_rig_ask(who, line);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(reply, part), (reply[0] != '\0') ? reply : line);
}

void assert_reply(const char *line, const char *part) {
    assert_reply_to(client, line, part);
}
