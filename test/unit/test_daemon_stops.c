// SPDX-License-Identifier: MIT
// A stop is never refused and never queues, even if all places of both sockets are occupied, in virtual time.
#include "daemon_client.h"

#include "unit.h"

#include <string.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#define STOP_WITHIN_MS 60U ///< Fault 33, on this machine
#define CROWD          160U
#define FOREIGN        65534U

static const char *const stops[] = {"{\"cmd\":\"stop\",\"now\":true}\n", "{\"cmd\":\"estop\",\"reason\":\"crowd\"}\n",
                                    "{\"id\":7,\"cmd\":\"disarm\"}\n"};
static int crowd[CROWD];
static unsigned crowded;
static char text[1U << 17];

static void join(sock_right_t right, unsigned count) {
    for (unsigned i = 0; i < count; i++) {
        crowd[crowded++] = daemon_rig_knock(right);
        daemon_rig_run(2);
    }
}

/// Occupies every ordinary place of both sockets; `client` has one of them.
static void take_all_places(void) {
    sock_clients_t *clients = &daemon_rig.daemon->clients;
    while (crowded > 0U) { // Connections of the test before
        (void)close(crowd[--crowded]);
    }
    clients->most[SOCK_DRIVE] = 16;
    clients->most[SOCK_WATCH] = 16;
    join(SOCK_DRIVE, 15);
    join(SOCK_WATCH, 16);
    TEST_ASSERT_EQUAL_UINT(16, clients->count[SOCK_DRIVE]);
    TEST_ASSERT_EQUAL_UINT(16, clients->count[SOCK_WATCH]);
}

static void send_lines(int fd, const char *lines) {
    (void)send(fd, lines, strlen(lines), MSG_NOSIGNAL | MSG_DONTWAIT);
}

/// Returns the received bytes, terminated.
static const char *receive(int fd) {
    const ssize_t length = recv(fd, text, sizeof text - 1U, MSG_DONTWAIT);
    text[(length > 0) ? length : 0] = '\0';
    return text;
}

static bool has_ended(int fd) {
    char byte;
    return recv(fd, &byte, 1, MSG_DONTWAIT) == 0;
}

/// Starts driving, without time for another cause of a stop.
static void begin_driving(void) {
    if (daemon_rig_state() == IW_STATE_LATCHED) {
        assert_reply("{\"cmd\":\"reset\"}", "\"ok\":true");
    }
    daemon_rig_arm(client);
    daemon_rig_drive(client, 300, 300, 500);
    TEST_ASSERT_EQUAL_INT(300, daemon_rig.commanded_mm_s[IW_LEFT]);
}

/// Checks that the first slower setpoint is sent in time.
static void assert_slower(const char *why) {
    for (unsigned ms = 0; ms < STOP_WITHIN_MS; ms++) {
        daemon_rig_run(1);
        if (daemon_rig.commanded_mm_s[IW_LEFT] < 300 && daemon_rig.commanded_mm_s[IW_RIGHT] < 300) {
            return;
        }
    }
    TEST_FAIL_MESSAGE(why);
}

static void come_to_rest(void) {
    daemon_rig_run(3500);
}

TEST(test_stop_never_refused_with_all_places_idle) {
    take_all_places();
    for (sock_right_t right = SOCK_DRIVE; right < SOCK_RIGHTS; right++) {
        for (size_t i = 0; i < sizeof stops / sizeof stops[0]; i++) {
            begin_driving();
            const int fd = daemon_rig_knock(right);
            send_lines(fd, stops[i]);
            assert_slower(stops[i]);
            daemon_rig_run(2);
            TEST_ASSERT_NOT_NULL_MESSAGE(strstr(receive(fd), "\"ok\":true"), text);
            TEST_ASSERT_TRUE(has_ended(fd));
            (void)close(fd);
            come_to_rest();
        }
    }
    TEST_ASSERT_EQUAL_UINT(16, daemon_rig.daemon->clients.count[SOCK_DRIVE]); // No connection was evicted.
    TEST_ASSERT_EQUAL_UINT(16, daemon_rig.daemon->clients.count[SOCK_WATCH]);
    TEST_ASSERT_EQUAL_UINT(0, daemon_rig.daemon->clients.count[SOCK_STOP]);
}

/// Eight connections wait for their first line; the ninth at the same time is refused without a wait.
TEST(test_stop_places_are_eight_on_each_socket) {
    take_all_places();
    for (sock_right_t right = SOCK_DRIVE; right < SOCK_RIGHTS; right++) {
        for (unsigned i = 0; i < SOCK_STOP_PLACES; i++) {
            crowd[crowded++] = daemon_rig_knock(right);
        }
        const int next = daemon_rig_knock(right);
        daemon_rig_run(SOCK_STOP_LEAST_US / IW_US_PER_MS - 1U);
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(receive(next), "too_many_clients"), text);
        TEST_ASSERT_TRUE(has_ended(next));
        (void)close(next);
        TEST_ASSERT_EQUAL_UINT((right + 1U) * SOCK_STOP_PLACES, daemon_rig.daemon->clients.count[SOCK_STOP]);
    }
}

/// Each connection continuously sends more requests than it reads replies.
TEST(test_stop_never_refused_with_all_places_polling) {
    take_all_places();
    for (sock_right_t right = SOCK_DRIVE; right < SOCK_RIGHTS; right++) {
        begin_driving();
        for (unsigned i = 0; i < crowded; i++) {
            send_lines(crowd[i],
                       "{\"cmd\":\"watch\",\"topics\":[\"state\",\"frame\"],\"rate_hz\":100}\n{\"cmd\":\"status\"}\n"
                       "{\"cmd\":\"why\"}\n{\"cmd\":\"status\"}\n{\"cmd\":\"status\"}\n{\"cmd\":\"why\"}\n");
        }
        const int fd = daemon_rig_knock(right);
        send_lines(fd, stops[1]);
        assert_slower("polling");
        (void)close(fd);
        come_to_rest();
    }
}

/// The line arrives after the connection, in a place that waits for it.
TEST(test_stop_never_refused_if_its_line_comes_later) {
    take_all_places();
    begin_driving();
    const int fd = daemon_rig_knock(SOCK_DRIVE);
    daemon_rig_drive(client, 300, 300, 100);
    TEST_ASSERT_EQUAL_STRING_MESSAGE("", receive(fd), "no greeting: who waits for one does not stop");
    send_lines(fd, "{\"cmd\":");
    daemon_rig_drive(client, 300, 300, 60);
    send_lines(fd, "\"stop\"}\n");
    assert_slower("later");
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(receive(fd), "\"state\":\"stopping\""), text);
    (void)close(fd);
}

TEST(test_stop_never_refused_without_descriptors) {
    struct rlimit before;
    take_all_places();
    begin_driving();
    TEST_ASSERT_EQUAL_INT(0, getrlimit(RLIMIT_NOFILE, &before));
    const int fd = daemon_rig_knock(SOCK_WATCH);
    send_lines(fd, stops[1]);
    const int lowest = dup(fd);
    (void)close(lowest);
    const struct rlimit none = {.rlim_cur = (rlim_t)lowest, .rlim_max = before.rlim_max};
    TEST_ASSERT_EQUAL_INT(0, setrlimit(RLIMIT_NOFILE, &none));
    daemon_rig_run(STOP_WITHIN_MS);
    TEST_ASSERT_EQUAL_INT(0, setrlimit(RLIMIT_NOFILE, &before));
    TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, daemon_rig_state());
    (void)close(fd);
}

/// Opens a thousand idle connections of the same user per second, which stay open as long as possible.
static void flood(sock_right_t right, unsigned for_ms) {
    static int open_ones[64];
    static unsigned next;
    for (unsigned ms = 0; ms < for_ms; ms++) {
        if (open_ones[next] > 0) {
            (void)close(open_ones[next]);
        }
        open_ones[next] = daemon_rig_knock(right);
        next = (next + 1U) % 64U;
        daemon_rig_run(1);
    }
}

TEST(test_stop_never_refused_with_1000_connections_a_second) {
    take_all_places();
    for (sock_right_t right = SOCK_DRIVE; right < SOCK_RIGHTS; right++) {
        for (unsigned later_ms = 0; later_ms < 4U; later_ms++) { // Time of the line after its connection
            flood(right, 300);
            begin_driving();
            flood(right, 100);
            const int fd = daemon_rig_knock(right);
            flood(right, later_ms);
            send_lines(fd, stops[later_ms % 3U]);
            flood(right, 30);
            TEST_ASSERT_LESS_THAN_INT_MESSAGE(300, daemon_rig.commanded_mm_s[IW_LEFT], "during a flood");
            TEST_ASSERT_NOT_NULL_MESSAGE(strstr(receive(fd), "\"ok\":true"), text);
            (void)close(fd);
            come_to_rest();
        }
    }
}

// Requests that a stop place refuses ----------------------------------------------------------------------------------

TEST(test_stop_place_for_anything_else_is_refused) {
    static const char *const others[] = {"{\"cmd\":\"status\"}\n",
                                         "{\"cmd\":\"hello\"}\n",
                                         "{\"cmd\":\"arm\"}\n",
                                         "{\"cmd\":\"reset\"}\n{\"cmd\":\"status\"}\n",
                                         "{\"cmd\":\"drive\",\"left_mm_s\":300,\"right_mm_s\":300}\n",
                                         "{\"cmd\":\"watch\",\"topics\":[\"frame\"]}\n",
                                         "stop\n",
                                         "\n",
                                         "{\"cmd\":\"stop,}\n"};
    take_all_places();
    begin_driving();
    for (sock_right_t right = SOCK_DRIVE; right < SOCK_RIGHTS; right++) {
        for (size_t i = 0; i < sizeof others / sizeof others[0]; i++) {
            const int fd = daemon_rig_knock(right);
            send_lines(fd, others[i]);
            daemon_rig_drive(client, 300, 300, 20);
            TEST_ASSERT_NOT_NULL_MESSAGE(strstr(receive(fd), "\"error\":\"too_many_clients\""), others[i]);
            TEST_ASSERT_NOT_NULL(strstr(text, (right == SOCK_DRIVE) ? "max_clients" : "max_watchers"));
            TEST_ASSERT_TRUE_MESSAGE(has_ended(fd), others[i]);
            (void)close(fd);
        }
    }
    TEST_ASSERT_EQUAL_INT(300, daemon_rig.commanded_mm_s[IW_LEFT]);
}

TEST(test_stop_after_another_line_is_executed) {
    take_all_places();
    for (sock_right_t right = SOCK_DRIVE; right < SOCK_RIGHTS; right++) {
        begin_driving();
        const int fd = daemon_rig_knock(right);
        send_lines(
            fd,
            "{\"cmd\":\"reset\"}\n\n{\"cmd\":\"hello\"}\n{\"cmd\":\"status\"}\nstop\n{\"id\":7,\"cmd\":\"estop\"}\n");
        assert_slower("a place");
        TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, daemon_rig_state());
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(receive(fd), "\"error\":\"too_many_clients\""), text);
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, "\"id\":7,\"ok\":true"), text);
        TEST_ASSERT_TRUE(has_ended(fd));
        (void)close(fd);
        come_to_rest();
    }
}

// Stops in lines that are refused ------------------------------------------------------------------------------------

#define BAD_STOP  "{\"cmd\":\"stop\",\"reason\":\"\\ud83d\"}\n"
#define BAD_ESTOP "{\"cmd\":\"estop\",\"id\":1,\"id\":1}\n"

/// The line in `text` is the only reply: a refusal with this error.
static void assert_refused_once(const char *error) {
    const char *const reply = strstr(text, "\"ok\":false");
    TEST_ASSERT_NOT_NULL_MESSAGE(reply, text);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(reply, error), text);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(reply, "its stop is executed"), text);
    TEST_ASSERT_NULL_MESSAGE(strstr(reply + 1, "\"ok\":"), text);
}

TEST(test_stop_never_refused_in_a_bad_line_of_any_socket) {
    for (sock_right_t right = SOCK_DRIVE; right < SOCK_RIGHTS; right++) {
        const int fd = daemon_rig_knock(right);
        begin_driving();
        send_lines(fd, BAD_STOP);
        assert_slower("a stop in bad JSON");
        TEST_ASSERT_EQUAL_INT(IW_STATE_STOPPING, daemon_rig_state());
        (void)receive(fd);
        assert_refused_once("\"error\":\"bad_json\"");
        come_to_rest();
        begin_driving();
        send_lines(fd, BAD_ESTOP);
        assert_slower("an estop in bad JSON");
        TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, daemon_rig_state());
        (void)receive(fd);
        assert_refused_once("\"error\":\"bad_json\"");
        (void)close(fd);
        come_to_rest();
    }
}

TEST(test_stop_never_refused_in_a_bad_line_without_a_place) {
    take_all_places();
    begin_driving();
    const int fd = daemon_rig_knock(SOCK_WATCH);
    send_lines(fd, BAD_ESTOP);
    assert_slower("a stop place");
    TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, daemon_rig_state());
    (void)receive(fd);
    assert_refused_once("\"error\":\"bad_json\"");
    TEST_ASSERT_TRUE(has_ended(fd));
    (void)close(fd);
    come_to_rest();
}

/// The connection ends as with any line that is too long.
TEST(test_stop_never_refused_in_an_endless_line) {
    static char line[2U * IWN_LINE_MAX];
    static const char *const where[] = {"at the beginning", "at the end of the part that is read"};
    const size_t begins[] = {0U, IWN_LINE_MAX + 1U - strlen("{\"cmd\":\"estop\"")};
    for (size_t i = 0; i < 2U; i++) {
        begin_driving();
        const int fd = daemon_rig_knock(SOCK_DRIVE);
        daemon_rig_run(2);
        (void)receive(fd);
        memset(line, ' ', sizeof line);
        memcpy(&line[begins[i]], "{\"cmd\":\"estop\"", strlen("{\"cmd\":\"estop\""));
        (void)send(fd, line, sizeof line, MSG_NOSIGNAL | MSG_DONTWAIT);
        assert_slower(where[i]);
        TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, daemon_rig_state());
        (void)receive(fd);
        assert_refused_once("\"error\":\"line_too_long\"");
        TEST_ASSERT_TRUE(has_ended(fd));
        (void)close(fd);
        come_to_rest();
    }
}

TEST(test_stop_absent_in_an_endless_line_stops_nothing) {
    static char line[IWN_LINE_MAX + 1U];
    begin_driving();
    const int fd = daemon_rig_knock(SOCK_DRIVE);
    memset(line, ' ', sizeof line);
    memcpy(line, "{\"cmd\":\"why\"", strlen("{\"cmd\":\"why\""));
    (void)send(fd, line, sizeof line, MSG_NOSIGNAL | MSG_DONTWAIT);
    daemon_rig_drive(client, 300, 300, 100);
    TEST_ASSERT_EQUAL_INT(300, daemon_rig.commanded_mm_s[IW_LEFT]);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(receive(fd), "\"error\":\"line_too_long\""), text);
    TEST_ASSERT_NULL_MESSAGE(strstr(text, "stop is executed"), text);
    TEST_ASSERT_TRUE(has_ended(fd));
    (void)close(fd);
    come_to_rest();
}

/// Sends more requests than the client reads; the stop follows the request whose reply has no more space.
static void ask_too_much_and_stop(int fd, const sock_client_t *greedy) {
    for (unsigned i = 0; i < 5000U && greedy->out_end - greedy->out_start < sizeof greedy->out / 2U; i++) {
        send_lines(fd, "{\"cmd\":\"status\"}\n");
        send_lines(client, "{\"cmd\":\"drive\",\"left_mm_s\":300,\"right_mm_s\":300}\n");
        daemon_rig_run(1);
        (void)((fd != client) ? receive(client) : NULL);
    }
    TEST_ASSERT_GREATER_THAN_size_t(sizeof greedy->out / 2U, greedy->out_end - greedy->out_start);
    for (unsigned i = 0; i < 100U; i++) {
        (void)snprintf(&text[i * 17U], sizeof text - i * 17U, "{\"cmd\":\"status\"}\n");
    }
    (void)strcat(text, "{\"cmd\":\"stop\"}\n");
    send_lines(fd, text);
}

TEST(test_stop_of_an_overflowing_connection_is_executed) {
    take_all_places();
    begin_driving();
    ask_too_much_and_stop(crowd[0], &daemon_rig.daemon->clients.client[1]);
    assert_slower("closed");
    TEST_ASSERT_EQUAL_UINT(15, daemon_rig.daemon->clients.count[SOCK_DRIVE]);
}

/// A reply has no space in the step, before the stop of the connection is read.
TEST(test_stop_not_yet_read_of_a_broken_connection_is_executed) {
    take_all_places();
    begin_driving();
    send_lines(crowd[0], "{\"cmd\":\"stop\"}\n");
    sock_client_break(&daemon_rig.daemon->clients.client[1]);
    assert_slower("broken");
    TEST_ASSERT_EQUAL_UINT(15, daemon_rig.daemon->clients.count[SOCK_DRIVE]);
}

/// The stop counts before the end of the connection.
TEST(test_stop_of_an_overflowing_holder_has_cause_client_stop) {
    begin_driving();
    ask_too_much_and_stop(client, &daemon_rig.daemon->clients.client[0]);
    assert_slower("closed");
    TEST_ASSERT_EQUAL_INT(IW_CAUSE_CLIENT_STOP, gw_wheels_snapshot(&daemon_rig.daemon->wheels).stop->cause);
}

TEST(test_stop_place_answers_one_line_and_all_stops) {
    take_all_places();
    const int fd = daemon_rig_knock(SOCK_DRIVE);
    send_lines(fd,
               "{\"id\":1,\"cmd\":\"stop\"}\n{\"id\":2,\"cmd\":\"estop\"}\n{\"id\":3,\"cmd\":\"reset\",\"stop\":1}\n");
    daemon_rig_run(20);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(receive(fd), "\"id\":1,\"ok\":true"), text);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, "\"id\":2,\"ok\":true"), text);
    TEST_ASSERT_NULL_MESSAGE(strstr(text, "\"id\":3"), text);
    TEST_ASSERT_TRUE(has_ended(fd));
    TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, daemon_rig_state());
    (void)close(fd);
}

TEST(test_stop_place_of_a_silent_connection_is_free_after_200_ms) {
    sock_clients_t *clients = &daemon_rig.daemon->clients;
    take_all_places();
    const unsigned before = crowded;
    join(SOCK_DRIVE, SOCK_STOP_PLACES);
    TEST_ASSERT_EQUAL_UINT(SOCK_STOP_PLACES, clients->count[SOCK_STOP]);
    daemon_rig.waits = 0;
    daemon_rig_run(150);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(SOCK_STOP_PLACES, clients->count[SOCK_STOP],
                                   "while no client needs its place it stays");
    TEST_ASSERT_LESS_THAN_UINT_MESSAGE(400, daemon_rig.waits, "and does not wake the loop");
    daemon_rig_run(60);
    TEST_ASSERT_EQUAL_UINT(0, clients->count[SOCK_STOP]);
    for (unsigned i = before; i < crowded; i++) {
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(receive(crowd[i]), "\"error\":\"too_many_clients\""), text);
        TEST_ASSERT_TRUE(has_ended(crowd[i]));
    }
}

// Share of each user --------------------------------------------------------------------------------------------------

/// Connects as another user. Returns -1 if the user of this test cannot change its id.
static int knock_as(uid_t uid, sock_right_t right) {
    if (geteuid() != 0 || seteuid(uid) != 0) {
        return -1;
    }
    const int fd = daemon_rig_knock(right); // The socket has no name in the file system.
    TEST_ASSERT_EQUAL_INT(0, seteuid(0));
    return fd;
}

static unsigned held_by(uid_t uid) {
    unsigned held = 0;
    sock_clients_t *clients = &daemon_rig.daemon->clients;
    for (uint32_t i = SOCK_DRIVERS_MAX + SOCK_WATCHERS_MAX; i < SOCK_CLIENTS_MAX; i++) {
        held += (clients->client[i].id != IW_CLIENT_NONE && clients->client[i].uid == uid) ? 1U : 0U;
    }
    return held;
}

TEST(test_stop_places_of_one_user_are_at_most_half) {
    take_all_places();
    for (unsigned i = 0; i < 12U; i++) {
        const int fd = knock_as(FOREIGN, SOCK_DRIVE);
        if (fd < 0) {
            TEST_IGNORE_MESSAGE("only root can connect as another user");
        }
        crowd[crowded++] = fd;
        daemon_rig_run(10);
        TEST_ASSERT_LESS_OR_EQUAL_UINT(SOCK_STOP_PLACES / 2U, held_by(FOREIGN));
    }
    TEST_ASSERT_EQUAL_UINT(SOCK_STOP_PLACES / 2U, held_by(FOREIGN));
    const char *oldest = receive(crowd[crowded - 12U]);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(oldest, "\"error\":\"too_many_clients\""), oldest);
    TEST_ASSERT_EQUAL_STRING_MESSAGE("", receive(crowd[crowded - 1U]), "the newest replaces it");
    join(SOCK_DRIVE, SOCK_STOP_PLACES / 2U); // The other half is for other users, who are not evicted.
    TEST_ASSERT_EQUAL_UINT(SOCK_STOP_PLACES / 2U, held_by(0));
    crowd[crowded++] = knock_as(FOREIGN, SOCK_DRIVE);
    daemon_rig_run(10);
    TEST_ASSERT_EQUAL_UINT(SOCK_STOP_PLACES / 2U, held_by(0));
    begin_driving();
    const int fd = knock_as(FOREIGN, SOCK_DRIVE); // A stop of this user needs no place.
    send_lines(fd, stops[0]);
    assert_slower("beyond its share");
    (void)close(fd);
}

/// Most of the lines are still in the socket when the gateway detects that the client has gone.
TEST(test_stop_behind_other_lines_of_a_client_that_has_gone) {
    static const char *const others[] = {"{\"cmd\":\"status\"}\n", "{\"cmd\":\"hello\"}\n"};
    for (unsigned n = 0; n < 4U; n++) {
        begin_driving();
        const int fd = daemon_rig_knock((n < 2U) ? SOCK_DRIVE : SOCK_WATCH);
        daemon_rig_run(2);
        static char lines[16384];
        lines[0] = '\0';
        for (unsigned i = 0; i < 600U; i++) {
            (void)strcat(lines, others[n % 2U]);
        }
        send_lines(fd, strcat(lines, stops[n % 2U]));
        (void)close(fd);
        assert_slower(others[n % 2U]);
        come_to_rest();
    }
}

/// One line and a part of the next fit into the buffer: each read gains one line.
TEST(test_stop_behind_70_long_lines_of_a_client_that_has_gone) {
    static char lines[150000];
    size_t length = 0;
    begin_driving();
    const int fd = daemon_rig_knock(SOCK_DRIVE);
    daemon_rig_run(2);
    for (unsigned i = 0; i < 70U; i++) {
        length +=
            (size_t)snprintf(&lines[length], sizeof lines - length, "{\"cmd\":\"status\",\"pad\":\"%02040d\"}\n", 0);
    }
    send_lines(fd, strcat(lines, stops[0]));
    (void)close(fd);
    assert_slower("70 long lines");
}

TEST(test_stop_in_a_stop_place_names_its_process) {
    char who[64];
    take_all_places();
    begin_driving();
    const int fd = daemon_rig_knock(SOCK_WATCH);
    send_lines(fd, stops[0]);
    assert_slower("named");
    (void)close(fd);
    come_to_rest();
    (void)snprintf(who, sizeof who, "(pid %d)", (int)getpid());
    assert_reply("{\"cmd\":\"why\"}", who);
}
