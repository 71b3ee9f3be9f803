// SPDX-License-Identifier: MIT
// The complete loop of the relay with a simulated board.
#include "relay_rig.h"

#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#define LATE 900000

/// The client disconnects while the line is full, before its `open` could be written.
static bool client_goes_before_open(void) {
    switch (step) {
    case 2:
        board_links(EARLY);
        break;
    case 10:
        port_is_full = true;
        client_connects();
        break;
    case 20:
        (void)close(client_fd);
        client_fd = -1;
        break;
    case 30:
        port_is_full = false;
        break;
    default:
        break;
    }
    return step == 500U;
}

static void test_relay_client_disconnected_before_open_leaves_none_open(void) {
    run(client_goes_before_open);
    // A line that the port has partly accepted may still be sent. No channel may stay open.
    TEST_ASSERT_LESS_OR_EQUAL_UINT(1, written("\"cmd\":\"open\""));
    TEST_ASSERT_GREATER_OR_EQUAL_UINT(1, written("\"cmd\":\"close\",\"channel\":1"));
    const char *last_open = strstr(to_board, "\"cmd\":\"open\"");
    TEST_ASSERT_TRUE(last_open == NULL || strstr(last_open, "\"cmd\":\"close\"") != NULL);
}

/// A client disconnects, and the next one connects before the line accepts a byte.
static bool client_follows_another(void) {
    switch (step) {
    case 2:
        board_links(EARLY);
        break;
    case 10:
        client_connects();
        break;
    case 20:
        board_writes(1, EARLY + 1, "{\"event\":\"hello\"}");
        break;
    case 30:
        port_is_full = true;
        (void)close(client_fd);
        break;
    case 40:
        client_connects();
        break;
    case 50:
        port_is_full = false;
        break;
    default:
        break;
    }
    return step == 150U;
}

static void test_relay_closes_a_channel_before_it_opens_the_next(void) {
    run(client_follows_another);
    TEST_ASSERT_EQUAL_UINT(2, written("\"cmd\":\"open\""));
    const char *close_at = strstr(to_board, "\"cmd\":\"close\",\"channel\":1");
    TEST_ASSERT_NOT_NULL(close_at);
    TEST_ASSERT_NOT_NULL(strstr(close_at, "\"cmd\":\"open\""));
}

/// One wake-up brings a newer stamp of the board and a command that was sent before it.
static bool stamp_and_command_together(void) {
    switch (step) {
    case 2:
        board_links(EARLY);
        break;
    case 10:
        client_connects();
        break;
    case 20:
        board_writes(1, EARLY + 1, "{\"event\":\"hello\"}");
        break;
    case 30:
        client_writes("{\"cmd\":\"arm\",\"id\":1}\n");
        break;
    case 40:
        board_writes(1, EARLY + 2, "{\"id\":1,\"ok\":true}");
        break;
    case 100:
        client_writes("{\"cmd\":\"drive\",\"left_mm_s\":1,\"right_mm_s\":1}\n");
        board_links(LATE);
        break;
    default:
        break;
    }
    return step == 150U;
}

static void test_relay_command_quotes_the_stamp_before_its_wake_up(void) {
    char early[32];
    char late[32];
    run(stamp_and_command_together);
    (void)snprintf(early, sizeof early, "\"t_us\":%u", EARLY + 2U);
    (void)snprintf(late, sizeof late, "\"t_us\":%u", (unsigned)LATE);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(1, written("\"cmd\":\"drive\""), to_board);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(0, written(late), to_board);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(1, written(early), to_board);
}

/// The relay stalls for 0.3 s while its client requests the lease.
static bool relay_stands_still(void) {
    if (step < 30U) {
        return stamp_and_command_together();
    }
    if (step == 60U) {
        client_writes("{\"cmd\":\"arm\",\"id\":1}\n");
        now_us += 300000U;
    }
    return step == 150U;
}

static void test_relay_arm_during_a_stall_is_not_sent(void) {
    run(relay_stands_still);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(0, written("\"cmd\":\"arm\""), to_board);
}

static bool watcher_commands(void) {
    switch (step) {
    case 2:
        board_links(EARLY);
        break;
    case 10:
        connect_to(settings.northbound.watch_socket);
        break;
    case 20:
        board_writes(1, EARLY + 1, "{\"event\":\"hello\"}");
        break;
    case 30:
        client_writes("{\"cmd\":\"arm\",\"id\":1}\n");
        break;
    case 60:
        client_writes("{\"cmd\":\"stop\",\"id\":2}\n");
        break;
    default:
        break;
    }
    return step == 100U;
}

static void test_relay_watcher_may_stop_and_not_arm(void) {
    settings.northbound.watch_mode = 0600;
    settings.northbound.watch_group[0] = '\0';
    (void)snprintf(settings.northbound.watch_socket, sizeof settings.northbound.watch_socket, "%s/watch", folder);
    run(watcher_commands);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(0, written("\"cmd\":\"arm\""), to_board);
    TEST_ASSERT_GREATER_OR_EQUAL_UINT_MESSAGE(1, written("\"cmd\":\"stop\""), to_board);
}

/// An event for the previous client arrives on the channel before the hello.
static bool event_before_hello(void) {
    switch (step) {
    case 2:
        board_links(EARLY);
        break;
    case 10:
        client_connects();
        break;
    case 20:
        board_writes(1, EARLY + 1, "{\"event\":\"lease\",\"holder\":7}");
        break;
    case 30:
        board_writes(1, EARLY + 2, "{\"event\":\"hello\"}");
        break;
    case 150:
        (void)recv(client_fd, received, sizeof received - 1U, MSG_DONTWAIT);
        break;
    default:
        break;
    }
    return step == 150U;
}

static void test_relay_event_before_hello_is_dropped(void) {
    memset(received, 0, sizeof received);
    run(event_before_hello);
    TEST_ASSERT_EQUAL_STRING("{\"event\":\"hello\"}\n", received);
    TEST_ASSERT_GREATER_OR_EQUAL_UINT_MESSAGE(1, written("\"cmd\":\"alive\""), to_board);
}

/// The greeting of the previous client arrives before the open of this one could be written.
static bool hello_before_open(void) {
    switch (step) {
    case 2:
        board_links(EARLY);
        break;
    case 10:
        relay.free_us = now_us + 50000U;
        client_connects();
        break;
    case 20:
        board_writes(1, EARLY + 1, "{\"event\":\"hello\"}");
        break;
    case 30:
        client_receives();
        break;
    default:
        break;
    }
    return step == 40U;
}

static void test_relay_hello_before_open_is_dropped(void) {
    run(hello_before_open);
    TEST_ASSERT_EQUAL_STRING("", received);
}

/// The clock of the board decreases: the board has restarted, whatever it sends.
static bool board_restarts(void) {
    if (step == 40U) {
        board_writes(1, 5, "{\"event\":\"state\"}");
    }
    if (step == 45U) {
        TEST_ASSERT_EQUAL_UINT(IW_CLIENT_NONE, relay.channel[1].client);
    }
    if (step == 39U) {
        TEST_ASSERT_NOT_EQUAL_UINT(IW_CLIENT_NONE, relay.channel[1].client);
    }
    return (step < 40U) ? event_before_hello() : step == 50U;
}

static void test_relay_client_is_closed_by_a_restart_of_the_board(void) {
    run(board_restarts);
}

static bool board_comes(void) {
    if (step == 2U) {
        board_links(EARLY);
    }
    return step == 20U;
}

static void test_relay_log_without_a_reader_does_not_end_the_relay(void) {
    const int saved = dup(STDERR_FILENO);
    int ends[2];
    TEST_ASSERT_EQUAL_INT(0, pipe(ends));
    (void)close(ends[0]);
    (void)dup2(ends[1], STDERR_FILENO);
    (void)signal(SIGPIPE, SIG_DFL);
    const int code = run_code(board_comes);
    (void)dup2(saved, STDERR_FILENO);
    (void)close(saved);
    (void)close(ends[1]);
    TEST_ASSERT_EQUAL_INT(0, code);
}

/// The only place is in use, and a stop arrives on another connection.
static bool stop_beyond_the_places(void) {
    switch (step) {
    case 2:
        board_links(EARLY);
        break;
    case 10:
        client_connects();
        break;
    case 20:
        board_writes(1, EARLY + 1, "{\"event\":\"hello\"}");
        break;
    case 30:
        guest_sends("{\"cmd\":\"stop\",\"id\":\"guest\"}\n");
        break;
    case 40:
        TEST_ASSERT_EQUAL_UINT_MESSAGE(1, written("\"cmd\":\"stop\""), to_board);
        board_writes(1, EARLY + 2, "{\"id\":1,\"ok\":true,\"state\":\"stopping\"}");
        break;
    case 60:
        guest_reads();
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(guest_got, "{\"id\":\"guest\",\"ok\":true,\"state\":\"stopping\"}"),
                                     guest_got);
        guest_sends("{\"cmd\":\"reset\",\"id\":\"guest\"}\n");
        break;
    case 80:
        guest_reads();
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(guest_got, "too_many_clients"), guest_got);
        break;
    default:
        break;
    }
    return step == 350U;
}

static void test_stop_never_refused_by_a_relay_without_a_place(void) {
    settings.northbound.max_clients = 1;
    run(stop_beyond_the_places);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(1, written("\"cmd\":\"open\""), to_board);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(0, written("\"cmd\":\"reset\""), to_board);
    char text[512];
    const ssize_t length = recv(client_fd, text, sizeof text - 1U, MSG_DONTWAIT);
    text[(length > 0) ? length : 0] = '\0';
    TEST_ASSERT_NULL_MESSAGE(strstr(text, "\"ok\""), text); // The guest has requested nothing.
}

static char complaints[4096]; // Captured log.

/// Runs the relay and captures its log.
static void run_logged(bool (*play)(void)) {
    char path[64];
    (void)snprintf(path, sizeof path, "%s/log", folder);
    const int saved = dup(STDERR_FILENO);
    const int file = open(path, O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
    (void)dup2(file, STDERR_FILENO);
    const int code = run_code(play);
    (void)dup2(saved, STDERR_FILENO);
    (void)close(saved);
    const ssize_t length = pread(file, complaints, sizeof complaints - 1U, 0);
    complaints[(length > 0) ? length : 0] = '\0';
    (void)close(file);
    (void)unlink(path);
    TEST_ASSERT_EQUAL_INT(0, code);
}

static unsigned logged(const char *words) {
    return count_in(complaints, words);
}

/// A client that connects at this step receives this text.
static void assert_reported_at(unsigned at, const char *words) {
    if (step == at) {
        client_connects();
    }
    if (step == at + 20U) {
        memset(received, 0, sizeof received);
        (void)recv(client_fd, received, sizeof received - 1U, MSG_DONTWAIT);
        (void)close(client_fd);
        client_fd = -1;
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(received, words), received);
    }
}

static void device_sends(const char *bytes) {
    to_relay_length += (size_t)snprintf(&to_relay[to_relay_length], sizeof to_relay - to_relay_length, "%s", bytes);
}

/// Nothing arrives for 3 s. Then a device with another rate sends, then one with another protocol and fewer bytes.
static bool noise_after_nothing(void) {
    if (step >= 3000U && step < 4900U && step % 10U == 0U) {
        device_sends("\xf8\x80\xff\x81");
    }
    if (step >= 5100U && step % 100U == 0U) {
        device_sends("login: \n");
    }
    assert_reported_at(2600, "nothing comes");
    assert_reported_at(5100, "baud rate is not");
    assert_reported_at(7600, "another protocol");
    return step == 9000U;
}

static void test_relay_reason_follows_the_received_bytes(void) {
    run_logged(noise_after_nothing);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(1, logged("warning: nothing comes"), complaints);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(1, logged("warning: 760 bytes came"), complaints);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(1, logged("warning: /dev/iwheel-board uses another protocol"), complaints);
}

/// The port does not exist.
static bool port_stays_away(void) {
    assert_reported_at(4000, "plug the board in");
    return step == 4100U;
}

static void test_relay_missing_port_is_not_reported_as_no_bytes(void) {
    port_is_missing = true;
    run_logged(port_stays_away);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(1, logged("warning: port: plug the board in"), complaints);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(0, logged("warning: nothing comes"), complaints);
}

/// Long after the port was opened the clock of the board decreases, and the board sends nothing more.
static bool board_restarts_late(void) {
    if (step % 1000U == 2U && step < 5000U) {
        board_links(EARLY + step);
    }
    if (step == 5000U) {
        board_writes(1, 5, "{\"event\":\"state\"}");
    }
    assert_reported_at(7400, "has restarted");
    return step == 7600U;
}

static void test_relay_board_restarted_late_is_reported_as_no_bytes(void) {
    run_logged(board_restarts_late);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(1, logged("warning: nothing comes"), complaints);
}

static bool board_goes(void) {
    if (step == 2U || step == 3500U) {
        board_links(EARLY + step);
    }
    return step == 7000U;
}

static void test_relay_board_offline_is_logged_each_time(void) {
    run_logged(board_goes);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(2, logged("warning: nothing comes"), complaints);
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_relay_client_disconnected_before_open_leaves_none_open);
    RUN_TEST(test_relay_closes_a_channel_before_it_opens_the_next);
    RUN_TEST(test_relay_command_quotes_the_stamp_before_its_wake_up);
    RUN_TEST(test_relay_arm_during_a_stall_is_not_sent);
    RUN_TEST(test_relay_watcher_may_stop_and_not_arm);
    RUN_TEST(test_relay_event_before_hello_is_dropped);
    RUN_TEST(test_relay_hello_before_open_is_dropped);
    RUN_TEST(test_relay_client_is_closed_by_a_restart_of_the_board);
    RUN_TEST(test_relay_log_without_a_reader_does_not_end_the_relay);
    RUN_TEST(test_stop_never_refused_by_a_relay_without_a_place);
    RUN_TEST(test_relay_reason_follows_the_received_bytes);
    RUN_TEST(test_relay_missing_port_is_not_reported_as_no_bytes);
    RUN_TEST(test_relay_board_restarted_late_is_reported_as_no_bytes);
    RUN_TEST(test_relay_board_offline_is_logged_each_time);
    return UNITY_END();
}
