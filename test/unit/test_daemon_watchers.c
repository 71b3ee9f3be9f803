// SPDX-License-Identifier: MIT
// Rights of each socket to each request, and quotas: watchers do not reduce the resources of drivers.
#include "answers/answers.h"
#include "daemon_rig.h"
#include "sockets/sock_clients.h"

#include "unit.h"

#include <string.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#define CROWD SOCK_WATCHERS_MAX
/// After this time an additional connection that sent no stop is refused.
#define STOP_MS (SOCK_STOP_US / IW_US_PER_MS + 2U)

typedef struct {
    const char *line;
    bool watch; ///< Allowed on the socket for watching.
} right_t;

/// All commands
static const right_t rights[IWN_CMDS] = {
    [IWN_CMD_HELLO] = {"{\"cmd\":\"hello\"}", true},
    [IWN_CMD_STATUS] = {"{\"cmd\":\"status\"}", true},
    [IWN_CMD_WATCH] = {"{\"cmd\":\"watch\",\"topics\":[\"stop\"]}", true},
    [IWN_CMD_ARM] = {"{\"cmd\":\"arm\"}", false},
    [IWN_CMD_DRIVE] = {"{\"cmd\":\"drive\",\"left_mm_s\":0,\"right_mm_s\":0}", false},
    [IWN_CMD_TWIST] = {"{\"cmd\":\"twist\",\"v_mm_s\":0,\"yaw_mrad_s\":0}", false},
    [IWN_CMD_STOP] = {"{\"cmd\":\"stop\"}", true},
    [IWN_CMD_DISARM] = {"{\"cmd\":\"disarm\"}", true},
    [IWN_CMD_ESTOP] = {"{\"cmd\":\"estop\"}", true},
    [IWN_CMD_RESET] = {"{\"cmd\":\"reset\"}", false},
    [IWN_CMD_RELEASE] = {"{\"cmd\":\"release\"}", false},
    [IWN_CMD_TARE] = {"{\"cmd\":\"tare\"}", false},
    [IWN_CMD_WHY] = {"{\"cmd\":\"why\"}", true},
    [IWN_CMD_RECORDINGS] = {"{\"cmd\":\"recordings\"}", true},
    [IWN_CMD_RECORDING] = {"{\"cmd\":\"recording\",\"name\":\"none.rec\",\"offset\":0}", true},
    [IWN_CMD_RECORD] = {"{\"cmd\":\"record\",\"on\":true}", true},
    [IWN_CMD_CONFIG] = {"{\"cmd\":\"config\"}", false},
    [IWN_CMD_CONFIRM] = {"{\"cmd\":\"confirm\",\"item\":\"track\",\"value\":\"540\"}", false},
};

static int driver;
static int watcher;
static int crowd[CROWD];
static unsigned crowded;

void setUp(void) {
    daemon_rig_begin();
    daemon_rig.daemon->clients.most[SOCK_WATCH] = CROWD;
    driver = daemon_rig_connect();
    watcher = daemon_rig_connect_with(SOCK_WATCH);
    crowded = 0;
}

void tearDown(void) {
    for (unsigned i = 0; i < crowded; i++) {
        (void)close(crowd[i]);
    }
    (void)close(watcher);
    (void)close(driver);
    daemon_rig_end();
}

static void assert_has(const char *reply, const char *part) {
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(reply, part), (reply[0] != '\0') ? reply : part);
}

/// Returns true if the request is refused because of the socket; a recording may be denied for other reasons.
static bool is_denied(const char *reply) {
    TEST_ASSERT_NOT_EQUAL_MESSAGE('\0', reply[0], "no reply");
    return strstr(reply, "\"error\":\"denied\"") != NULL && strstr(reply, "this socket is for watching") != NULL;
}

static void send_line(int client, const char *line) {
    (void)send(client, line, strlen(line), MSG_NOSIGNAL | MSG_DONTWAIT);
}

static void connect_crowd(unsigned count) {
    for (unsigned i = 0; i < count; i++) {
        crowd[crowded++] = daemon_rig_connect_with(SOCK_WATCH);
        daemon_rig_run(3);
    }
}

// Rights --------------------------------------------------------------------------------------------------------------

TEST(test_right_to_each_request_on_each_socket_is_as_listed) {
    for (unsigned cmd = 0; cmd < IWN_CMDS; cmd++) {
        TEST_ASSERT_NOT_NULL_MESSAGE(rights[cmd].line, "a command is missing in the table of this test");
        TEST_ASSERT_EQUAL_INT_MESSAGE(!rights[cmd].watch, is_denied(daemon_rig_ask(watcher, rights[cmd].line)),
                                      rights[cmd].line);
        TEST_ASSERT_FALSE_MESSAGE(is_denied(daemon_rig_ask(driver, rights[cmd].line)), rights[cmd].line);
    }
}

TEST(test_denial_names_the_socket_and_the_group_to_use) {
    const char *reply = daemon_rig_ask(watcher, "{\"id\":7,\"cmd\":\"arm\"}");
    assert_has(reply, "\"id\":7");
    assert_has(reply, daemon_rig.daemon->config.northbound.socket);
    assert_has(reply, "usermod -aG iwheel USER");
    (void)snprintf(daemon_rig.daemon->config.northbound.group, 8, "none");
    reply = daemon_rig_ask(watcher, "{\"cmd\":\"arm\"}");
    assert_has(reply, daemon_rig.daemon->config.northbound.socket);
    TEST_ASSERT_NULL(strstr(reply, "none"));
}

TEST(test_hello_contains_the_right) {
    assert_has(daemon_rig_ask(driver, "{\"cmd\":\"hello\"}"), "\"rights\":\"drive\"");
    assert_has(daemon_rig_ask(watcher, "{\"cmd\":\"hello\"}"), "\"rights\":\"watch\"");
}

TEST(test_watcher_request_to_drive_changes_nothing) {
    daemon_rig_arm(driver);
    daemon_rig_drive(driver, 300, 300, 500);
    assert_has(daemon_rig_ask(watcher, "{\"cmd\":\"arm\",\"takeover\":true}"), "\"denied\"");
    assert_has(daemon_rig_ask(watcher, "{\"cmd\":\"drive\",\"left_mm_s\":900,\"right_mm_s\":900}"), "\"denied\"");
    daemon_rig_drive(driver, 300, 300, 100);
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, daemon_rig_state());
    TEST_ASSERT_EQUAL_INT(300, daemon_rig.commanded_mm_s[IW_LEFT]);
    (void)daemon_rig_ask(driver, "{\"cmd\":\"stop\"}");
    daemon_rig_run(2000);
    (void)daemon_rig_ask(watcher, "{\"cmd\":\"drive\",\"left_mm_s\":900,\"right_mm_s\":900}");
    daemon_rig_arm(driver); // A drive of a watcher is no command and does not prevent arm.
}

TEST(test_stop_of_a_watcher_stops_the_driver) {
    daemon_rig_arm(driver);
    daemon_rig_drive(driver, 300, 300, 500);
    assert_has(daemon_rig_ask(watcher, "{\"cmd\":\"stop\"}"), "\"ok\":true");
    daemon_rig_run(2000);
    TEST_ASSERT_EQUAL_INT(0, daemon_rig.commanded_mm_s[IW_LEFT]);
    const char *reply = daemon_rig_ask(driver, "{\"cmd\":\"drive\",\"left_mm_s\":300,\"right_mm_s\":300}");
    char who[64];
    (void)snprintf(who, sizeof who, "user %u (process %d)", (unsigned)getuid(), (int)getpid());
    assert_has(reply, "client_stop");
    assert_has(reply, who);
}

TEST(test_reset_refused_by_a_new_estop_names_user_and_process) {
    char who[64];
    (void)snprintf(who, sizeof who, "user %u (process %d)", (unsigned)getuid(), (int)getpid());
    assert_has(daemon_rig_ask(watcher, "{\"cmd\":\"estop\"}"), "\"latched\"");
    daemon_rig_run(900);
    (void)daemon_rig_ask(watcher, "{\"cmd\":\"estop\"}");
    daemon_rig_run(500);
    const char *reply = daemon_rig_ask(driver, "{\"cmd\":\"reset\"}");
    assert_has(reply, "\"cause_present\"");
    assert_has(reply, who);
    daemon_rig_run(1000);
    assert_has(daemon_rig_ask(driver, "{\"cmd\":\"reset\"}"), "\"ok\":true");
}

// Quotas --------------------------------------------------------------------------------------------------------------

TEST(test_watchers_use_no_slot_of_a_driver) {
    daemon_rig.daemon->clients.most[SOCK_DRIVE] = 2;
    connect_crowd(CROWD - 1U);
    TEST_ASSERT_EQUAL_UINT(CROWD, daemon_rig.daemon->clients.count[SOCK_WATCH]);
    const int second = daemon_rig_connect();
    assert_has(daemon_rig_ask(second, "{\"cmd\":\"hello\"}"), "\"rights\":\"drive\"");
    const int third = daemon_rig_connect();
    daemon_rig_run(STOP_MS);
    assert_has(daemon_rig_receive(third), "raise max_clients");
    (void)close(second);
    (void)close(third);
}

TEST(test_watcher_beyond_the_limit_is_refused_until_one_ends) {
    daemon_rig.daemon->clients.most[SOCK_WATCH] = 2;
    connect_crowd(2);
    daemon_rig_run(STOP_MS);
    const char *text = daemon_rig_receive(crowd[1]);
    assert_has(text, "2 watchers are connected");
    assert_has(text, "raise max_watchers");
    (void)close(crowd[0]);
    crowd[0] = -1;
    daemon_rig_run(10);
    connect_crowd(1);
    assert_has(daemon_rig_ask(crowd[2], "{\"cmd\":\"hello\"}"), "\"rights\":\"watch\"");
    TEST_ASSERT_EQUAL_UINT(2, daemon_rig.daemon->clients.count[SOCK_WATCH]);
    TEST_ASSERT_EQUAL_UINT(3, sock_clients_count(&daemon_rig.daemon->clients));
}

TEST(test_watchers_with_many_requests_do_not_delay_a_driver) {
    connect_crowd(CROWD - 1U);
    for (unsigned i = 0; i < crowded; i++) {
        send_line(crowd[i], "{\"cmd\":\"watch\",\"topics\":[\"state\",\"force\",\"frame\"],\"rate_hz\":100}\n");
    }
    daemon_rig_arm(driver);
    const uint32_t sent = daemon_rig.sent[IW_LEFT];
    const iw_time_us_t begin_us = daemon_rig.now_us;
    for (unsigned n = 0; n < 50U; n++) {
        for (unsigned i = 0; i < crowded; i++) {
            send_line(crowd[i], "{\"cmd\":\"status\"}\n{\"cmd\":\"arm\"}\n{\"cmd\":\"why\"}\n");
        }
        daemon_rig_drive(driver, 300, 300, 20); // Fails if a command has no reply within 20 ms.
    }
    const uint32_t periods = (uint32_t)((daemon_rig.now_us - begin_us) / 20000U);
    TEST_ASSERT_UINT_WITHIN(2, periods, daemon_rig.sent[IW_LEFT] - sent);
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, daemon_rig_state());
}

/// Receives all bytes of this client and counts `words` in them.
static unsigned taken_with(int client, const char *words) {
    return daemon_rig_count(daemon_rig_receive(client), words);
}

static unsigned replies_of(int client) {
    return taken_with(client, "\"ok\":");
}

static unsigned frames_of(int client) {
    return taken_with(client, "\"event\":\"frame\"");
}

/// Counts in how many of the next 200 ms frames arrive at this client, and the frames.
static unsigned moments_with_frames(int client, unsigned *out_frames) {
    unsigned moments = 0;
    *out_frames = 0;
    (void)frames_of(client);
    for (unsigned ms = 0; ms < 200U; ms++) {
        daemon_rig_run(1);
        const unsigned frames = frames_of(client);
        moments += (frames > 0U) ? 1U : 0U;
        *out_frames += frames;
    }
    return moments;
}

TEST(test_frames_are_sent_singly_to_few_and_grouped_to_many) {
    unsigned to_few;
    unsigned to_many;
    connect_crowd(GW_FRAMES_ONE_BY_ONE + 1U);
    for (unsigned i = 1; i < crowded; i++) {
        send_line(crowd[i], "{\"cmd\":\"watch\",\"topics\":[\"frame\"]}\n");
    }
    daemon_rig_run(20);
    TEST_ASSERT_GREATER_THAN_UINT(60, moments_with_frames(crowd[1], &to_few));
    send_line(crowd[0], "{\"cmd\":\"watch\",\"topics\":[\"frame\"]}\n");
    daemon_rig_run(20);
    TEST_ASSERT_UINT_WITHIN(1, 200000U / GW_FRAMES_TOGETHER_US, moments_with_frames(crowd[1], &to_many));
    TEST_ASSERT_UINT_WITHIN_MESSAGE(4, to_few, to_many, "each of them, once");
}

TEST(test_state_events_for_many_clients_are_equal) {
    char first[SOCK_REPLY_MAX];
    char second[SOCK_REPLY_MAX];
    connect_crowd(2);
    for (unsigned i = 0; i < crowded; i++) {
        send_line(crowd[i], "{\"cmd\":\"watch\",\"topics\":[\"force\"],\"rate_hz\":50}\n");
        daemon_rig_run(7); // The clients subscribe at different times.
    }
    daemon_rig_run(100);
    (void)recv(crowd[0], first, sizeof first - 1U, MSG_DONTWAIT);
    (void)recv(crowd[1], second, sizeof second - 1U, MSG_DONTWAIT);
    daemon_rig_run(20);
    const ssize_t length = recv(crowd[0], first, sizeof first - 1U, MSG_DONTWAIT);
    TEST_ASSERT_GREATER_THAN_INT(0, length);
    TEST_ASSERT_EQUAL_INT(length, recv(crowd[1], second, sizeof second - 1U, MSG_DONTWAIT));
    TEST_ASSERT_EQUAL_MEMORY(first, second, (size_t)length);
}

TEST(test_flood_of_requests_of_a_watcher_is_served_at_its_rate) {
    for (unsigned i = 0; i < 100U; i++) {
        send_line(watcher, "{\"cmd\":\"hello\"}\n");
    }
    daemon_rig_run(1);
    TEST_ASSERT_EQUAL_UINT(SOCK_LINES_PER_CYCLE, replies_of(watcher));
    const uint32_t waits = daemon_rig.waits;
    daemon_rig_run(100);
    TEST_ASSERT_UINT_WITHIN(1, 100000U / SOCK_WATCHER_LINE_US, replies_of(watcher));
    TEST_ASSERT_LESS_THAN_UINT_MESSAGE(400, daemon_rig.waits - waits, "waiting lines do not wake the loop");
    daemon_rig_run(1000);
    TEST_ASSERT_UINT_WITHIN(2, 100U - SOCK_LINES_PER_CYCLE - 10U, replies_of(watcher));
    for (unsigned i = 0; i < 10U; i++) {
        send_line(watcher, "{\"cmd\":\"hello\"}\n");
    }
    daemon_rig_run(1);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(SOCK_LINES_PER_CYCLE, replies_of(watcher), "after a pause");
}

TEST(test_stop_of_a_watcher_precedes_its_waiting_requests) {
    static const char *const stops[] = {"{\"cmd\":\"stop\"}\n", "{\"cmd\":\"estop\",\"reason\":\"late\"}\n"};
    for (unsigned n = 0; n < 2U; n++) {
        daemon_rig_arm(driver);
        daemon_rig_drive(driver, 300, 300, 500);
        for (unsigned i = 0; i < 150U; i++) {
            send_line(watcher, (i % 15U == 0U) ? "{\"cmd\":\"hello\",\"id\":\"stop\"}\n" : "{\"cmd\":\"hello\"}\n");
        }
        daemon_rig_run(1);
        send_line(watcher, stops[n]);
        const uint32_t number = gw_wheels_snapshot(&daemon_rig.daemon->wheels).stop->number;
        daemon_rig_run(SOCK_WATCHER_LINE_US / IW_US_PER_MS + 5U);
        TEST_ASSERT_EQUAL_UINT32(number + 1U, gw_wheels_snapshot(&daemon_rig.daemon->wheels).stop->number);
        daemon_rig_run(4000); // The other lines are executed in their order, at their rate, and none stops again.
        TEST_ASSERT_EQUAL_UINT32(number + 1U, gw_wheels_snapshot(&daemon_rig.daemon->wheels).stop->number);
        (void)replies_of(watcher);
    }
}

TEST(test_flood_of_estop_latches_and_adds_few_stops) {
    daemon_rig_arm(driver);
    daemon_rig_drive(driver, 300, 300, 500);
    connect_crowd(CROWD - 1U);
    const uint32_t stops = gw_wheels_snapshot(&daemon_rig.daemon->wheels).stop->number;
    for (unsigned n = 0; n < 50U; n++) {
        for (unsigned i = 0; i < crowded; i++) {
            send_line(crowd[i], "{\"cmd\":\"estop\"}\n");
        }
        daemon_rig_run(20);
        TEST_ASSERT_EQUAL_INT(0, daemon_rig.commanded_mm_s[IW_LEFT]);
    }
    const iw_snapshot_t seen = gw_wheels_snapshot(&daemon_rig.daemon->wheels);
    TEST_ASSERT_TRUE(daemon_rig.now_us - seen.seen_us[IW_CAUSE_ESTOP_SOFTWARE] <= IWN_ESTOP_AGAIN_US + MS(20));
    TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, seen.state);
    TEST_ASSERT_LESS_OR_EQUAL_UINT(stops + 2U, seen.stop->number);
    assert_has(daemon_rig_ask(driver, "{\"cmd\":\"reset\"}"), "\"cause_present\"");
    daemon_rig_run(2000);
    assert_has(daemon_rig_ask(driver, "{\"cmd\":\"reset\"}"), "\"ok\":true");
}

static iw_time_us_t estop_seen_us(void) {
    return gw_wheels_snapshot(&daemon_rig.daemon->wheels).seen_us[IW_CAUSE_ESTOP_SOFTWARE];
}

TEST(test_estop_repeated_within_100_ms_is_answered_without_effect) {
    assert_has(daemon_rig_ask(watcher, "{\"cmd\":\"estop\"}"), "\"latched\"");
    const iw_time_us_t first_us = estop_seen_us();
    daemon_rig_run(50);
    assert_has(daemon_rig_ask(watcher, "{\"cmd\":\"estop\"}"), "\"latched\"");
    TEST_ASSERT_EQUAL_UINT64(first_us, estop_seen_us());
    daemon_rig_run(60);
    assert_has(daemon_rig_ask(watcher, "{\"cmd\":\"estop\"}"), "\"latched\"");
    TEST_ASSERT_GREATER_THAN_UINT64(first_us, estop_seen_us());
}

TEST(test_estop_of_a_watcher_that_ends_immediately_latches) {
    send_line(watcher, "{\"cmd\":\"status\"}\n{\"cmd\":\"status\"}\n{\"cmd\":\"estop\"}\n");
    (void)close(watcher);
    watcher = -1;
    const uint32_t waits = daemon_rig.waits;
    daemon_rig_run(100);
    TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, daemon_rig_state());
    TEST_ASSERT_EQUAL_UINT(0, daemon_rig.daemon->clients.count[SOCK_WATCH]);
    TEST_ASSERT_LESS_THAN_UINT_MESSAGE(400, daemon_rig.waits - waits, "a client that has gone does not wake the loop");
}

TEST(test_flood_of_new_watchers_is_accepted_at_its_rate) {
    daemon_rig_keep_log();
    daemon_rig_run(10);
    for (; crowded < 60U; crowded++) {
        crowd[crowded] = daemon_rig_knock(SOCK_WATCH);
    }
    daemon_rig.waits = 0;
    daemon_rig_run(9);
    TEST_ASSERT_EQUAL_UINT(1U + SOCK_ACCEPTS_PER_CYCLE * (9000U / SOCK_WATCHER_ACCEPT_US + 1U),
                           daemon_rig.daemon->clients.count[SOCK_WATCH]);
    TEST_ASSERT_LESS_THAN_UINT_MESSAGE(40, daemon_rig.waits, "waiting clients do not wake the loop");
    daemon_rig_run(20);
    TEST_ASSERT_EQUAL_UINT(61, daemon_rig.daemon->clients.count[SOCK_WATCH]);
    TEST_ASSERT_EQUAL_UINT(0, daemon_rig_logged("refused a client"));
}

TEST(test_refused_watcher_is_logged_once_until_one_is_accepted) {
    daemon_rig_keep_log();
    daemon_rig.daemon->clients.most[SOCK_WATCH] = 2;
    connect_crowd(3);
    daemon_rig_run(STOP_MS);
    TEST_ASSERT_EQUAL_UINT(1, daemon_rig_logged("refused a client: 2 watchers are connected"));
    (void)close(crowd[0]);
    crowd[0] = -1;
    daemon_rig_run(10);
    connect_crowd(2);
    daemon_rig_run(STOP_MS);
    TEST_ASSERT_EQUAL_UINT(2, daemon_rig_logged("refused a client: 2 watchers are connected"));
}

TEST(test_client_without_descriptor_is_accepted_later) {
    sock_listener_t *listener = &daemon_rig.daemon->clients.listener[SOCK_DRIVE];
    struct rlimit before;
    daemon_rig_keep_log();
    if (listener->reserve_fd >= 0) {
        (void)close(listener->reserve_fd);
        listener->reserve_fd = -1;
    }
    crowd[crowded++] = daemon_rig_knock(SOCK_DRIVE);
    TEST_ASSERT_EQUAL_INT(0, getrlimit(RLIMIT_NOFILE, &before));
    const int lowest = dup(watcher);
    (void)close(lowest);
    const struct rlimit none = {.rlim_cur = (rlim_t)lowest, .rlim_max = before.rlim_max};
    TEST_ASSERT_EQUAL_INT(0, setrlimit(RLIMIT_NOFILE, &none));
    daemon_rig.waits = 0;
    daemon_rig_run(SOCK_LISTENER_PAUSE_US / IW_US_PER_MS - 5U);
    const unsigned count = daemon_rig.daemon->clients.count[SOCK_DRIVE];
    const unsigned lines = daemon_rig_logged("cannot accept clients: no free descriptor; trying again in 200 ms");
    const uint32_t waits = daemon_rig.waits;
    TEST_ASSERT_EQUAL_INT(0, setrlimit(RLIMIT_NOFILE, &before));
    TEST_ASSERT_EQUAL_UINT(1, count);
    TEST_ASSERT_EQUAL_UINT(1, lines);
    TEST_ASSERT_LESS_THAN_UINT32_MESSAGE(100, waits, "meanwhile it does not wake the loop");
    TEST_ASSERT_EQUAL_UINT(1, daemon_rig.daemon->clients.count[SOCK_DRIVE]);
    daemon_rig_run(10);
    TEST_ASSERT_EQUAL_UINT(2, daemon_rig.daemon->clients.count[SOCK_DRIVE]);
}

TEST(test_requests_sent_together_are_answered_in_order) {
    send_line(driver, "{\"id\":71,\"cmd\":\"why\"}\n{\"id\":72,\"cmd\":\"hello\"}\n");
    daemon_rig_run(1);
    const char *text = daemon_rig_receive(driver);
    const char *first = strstr(text, "\"id\":71");
    TEST_ASSERT_NOT_NULL_MESSAGE(first, text);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(first, "\"id\":72"), text);
}

TEST(test_round_of_sending_ends_after_its_time) {
    connect_crowd(CROWD - 1U);
    for (unsigned i = 0; i < crowded; i++) {
        send_line(crowd[i], "{\"cmd\":\"watch\",\"topics\":[\"state\"]}\n");
    }
    daemon_rig_run(50);
    for (unsigned i = 0; i < crowded; i++) {
        (void)daemon_rig_receive(crowd[i]);
    }
    sock_clients_t *clients = &daemon_rig.daemon->clients;
    iwn_server_t *server = &daemon_rig.daemon->answers.server;
    iwn_out_t json = iwn_server_begin_event(server, "state");
    iwn_server_send_event(server, IWN_TOPIC_STATE, &json);
    daemon_rig.poll_takes_us = 100U;
    sock_service_flush(clients, IW_CLIENT_NONE);
    daemon_rig.poll_takes_us = 0;
    unsigned reached = 0;
    for (unsigned i = 0; i < crowded; i++) {
        reached += (daemon_rig_receive(crowd[i])[0] != '\0') ? 1U : 0U;
    }
    TEST_ASSERT_UINT_WITHIN(1, SOCK_ROUND_US / 100U, reached);
    TEST_ASSERT_TRUE(sock_service_is_busy(clients));
    daemon_rig_run(20); // All is sent: a client without waiting bytes needs no time.
    daemon_rig.poll_takes_us = 2U * SOCK_ROUND_US;
    sock_service_flush(clients, IW_CLIENT_NONE);
    daemon_rig.poll_takes_us = 0;
    TEST_ASSERT_FALSE(clients->lines_wait);
}
