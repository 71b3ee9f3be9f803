// SPDX-License-Identifier: MIT
/// The event `state` for a watcher, from a gateway that drives two wheels, for a counter of instructions.
///
///     bench_status same ROUNDS       no assumption has changed since the previous event
///     bench_status changed ROUNDS    an assumption has changed each time
///     bench_status line              prints one event
///
/// Two runs with different ROUNDS differ only in the events. Exit status 1 if the gateway does not drive or an event is incomplete.
#include "answers/answers.h"
#include "daemon_rig.h"
#include "sockets/sock_clients.h"

#include "unity.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static unsigned rounds;
static bool changes;
static bool prints;

void setUp(void) {
    daemon_rig_begin();
}

void tearDown(void) {
    daemon_rig_end();
}

static size_t write_event(gw_daemon_t *daemon, const char **out_line) {
    iwn_out_t json = iwn_server_begin_event(&daemon->answers.server, "state");
    iwn_server_write_status(&daemon->answers.server, iwn_server_snapshot(&daemon->answers.server), &json);
    iwn_out_close(&json, '}');
    *out_line = json.data;
    return iwn_out_finish(&json);
}

static void bench_status(void) {
    gw_daemon_t *const daemon = daemon_rig.daemon;
    const char *line = NULL;
    const int client = daemon_rig_connect();
    daemon_rig_arm(client);
    daemon_rig_drive(client, 300, 300, 500);
    iw_assumption_entry_t *const entry = &daemon->wheels.core.assumptions.entry[IW_ASSUMPTION_GEAR_RATIO];
    for (unsigned i = 0; i < rounds; i++) {
        entry->figure += changes ? 1 : 0;
        TEST_ASSERT_GREATER_THAN_size_t(0, write_event(daemon, &line));
    }
    if (prints) {
        const size_t length = write_event(daemon, &line);
        (void)fwrite(line, 1, length, stdout);
    }
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, daemon_rig_state());
    (void)close(client);
}

int main(int argc, char **argv) {
    rounds = (argc > 2) ? (unsigned)strtoul(argv[2], NULL, 10) : 0U;
    changes = argc > 1 && strcmp(argv[1], "changed") == 0;
    prints = argc > 1 && strcmp(argv[1], "line") == 0;
    UNITY_BEGIN();
    RUN_TEST(bench_status);
    return UNITY_END();
}
