// SPDX-License-Identifier: MIT
// The complete loop of the relay with a simulated board.
#include "relay_rig.h"

#include "unit.h"

#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#define LATE 900000

/// The client disconnects while the line is full, before its `open` could be written.
static bool client_goes_before_open(void) {
    begin_with_the_board();
    if (step == 10U) {
        port_is_full = true;
        client_connects();
    }
    if (step == 20U) {
        client_closes();
    }
    if (step == 30U) {
        port_is_full = false;
    }
    return step == 500U;
}

TEST(test_relay_client_disconnected_before_open_leaves_none_open) {
    run(client_goes_before_open);
    // A line that the port has partly accepted may still be sent. No channel may stay open.
    TEST_ASSERT_LESS_OR_EQUAL_UINT(1, written("\"cmd\":\"open\""));
    TEST_ASSERT_GREATER_OR_EQUAL_UINT(1, written("\"cmd\":\"close\",\"channel\":1"));
    const char *last_open = strstr(to_board, "\"cmd\":\"open\"");
    TEST_ASSERT_TRUE(last_open == NULL || strstr(last_open, "\"cmd\":\"close\"") != NULL);
}

/// A client disconnects, and the next one connects before the line accepts a byte.
static bool client_follows_another(void) {
    begin_with_a_client();
    if (step == 30U) {
        port_is_full = true;
        client_closes();
    }
    if (step == 40U) {
        client_connects();
    }
    if (step == 50U) {
        port_is_full = false;
    }
    return step == 150U;
}

TEST(test_relay_closes_a_channel_before_it_opens_the_next) {
    run(client_follows_another);
    TEST_ASSERT_EQUAL_UINT(2, written("\"cmd\":\"open\""));
    const char *close_at = strstr(to_board, "\"cmd\":\"close\",\"channel\":1");
    TEST_ASSERT_NOT_NULL(close_at);
    TEST_ASSERT_NOT_NULL(strstr(close_at, "\"cmd\":\"open\""));
}

/// One wake-up brings a newer stamp of the board and a command that was sent before it.
static bool stamp_and_command_together(void) {
    begin_with_a_client();
    if (step == 30U) {
        client_writes("{\"cmd\":\"arm\",\"id\":1}\n");
    }
    if (step == 40U) {
        board_writes(1, EARLY + 2, "{\"id\":1,\"ok\":true}");
    }
    if (step == 100U) {
        client_writes("{\"cmd\":\"drive\",\"left_mm_s\":1,\"right_mm_s\":1}\n");
        board_links(LATE);
    }
    return step == 150U;
}

TEST(test_relay_command_quotes_the_stamp_before_its_wake_up) {
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

TEST(test_relay_arm_during_a_stall_is_not_sent) {
    run(relay_stands_still);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(0, written("\"cmd\":\"arm\""), to_board);
}

static bool watcher_commands(void) {
    begin_with_the_board();
    if (step == 10U) {
        connect_to(settings.northbound.watch_socket);
    }
    if (step == 20U) {
        board_writes(1, EARLY + 1, "{\"event\":\"hello\"}");
    }
    if (step == 30U) {
        client_writes("{\"cmd\":\"arm\",\"id\":1}\n");
    }
    if (step == 60U) {
        client_writes("{\"cmd\":\"stop\",\"id\":2}\n");
    }
    return step == 100U;
}

TEST(test_relay_watcher_may_stop_and_not_arm) {
    settings.northbound.watch_mode = 0600;
    settings.northbound.watch_group[0] = '\0';
    (void)snprintf(settings.northbound.watch_socket, sizeof settings.northbound.watch_socket, "%s/watch", folder);
    run(watcher_commands);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(0, written("\"cmd\":\"arm\""), to_board);
    TEST_ASSERT_GREATER_OR_EQUAL_UINT_MESSAGE(1, written("\"cmd\":\"stop\""), to_board);
}

/// An event for the previous client arrives on the channel before the hello.
static bool event_before_hello(void) {
    begin_with_the_board();
    if (step == 10U) {
        client_connects();
    }
    if (step == 20U) {
        board_writes(1, EARLY + 1, "{\"event\":\"lease\",\"holder\":7}");
    }
    if (step == 30U) {
        board_writes(1, EARLY + 2, "{\"event\":\"hello\"}");
    }
    if (step == 150U) {
        client_receives();
    }
    return step == 150U;
}

TEST(test_relay_event_before_hello_is_dropped) {
    run(event_before_hello);
    TEST_ASSERT_EQUAL_STRING("{\"event\":\"hello\"}\n", received);
    TEST_ASSERT_GREATER_OR_EQUAL_UINT_MESSAGE(1, written("\"cmd\":\"alive\""), to_board);
}

/// The greeting of the previous client arrives before the open of this one could be written.
static bool hello_before_open(void) {
    begin_with_the_board();
    if (step == 10U) {
        relay.free_us = now_us + 50000U;
        client_connects();
    }
    if (step == 20U) {
        board_writes(1, EARLY + 1, "{\"event\":\"hello\"}");
    }
    if (step == 30U) {
        client_receives();
    }
    return step == 40U;
}

TEST(test_relay_hello_before_open_is_dropped) {
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

TEST(test_relay_client_is_closed_by_a_restart_of_the_board) {
    run(board_restarts);
}

static bool board_comes(void) {
    begin_with_the_board();
    return step == 20U;
}

TEST(test_relay_log_without_a_reader_does_not_end_the_relay) {
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
    begin_with_a_client();
    if (step == 30U) {
        guest_sends("{\"cmd\":\"stop\",\"id\":\"guest\"}\n");
    }
    if (step == 40U) {
        TEST_ASSERT_EQUAL_UINT_MESSAGE(1, written("\"cmd\":\"stop\""), to_board);
        board_writes(1, EARLY + 2, "{\"id\":1,\"ok\":true,\"state\":\"stopping\"}");
    }
    if (step == 60U) {
        guest_reads();
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(guest_got, "{\"id\":\"guest\",\"ok\":true,\"state\":\"stopping\"}"),
                                     guest_got);
        guest_sends("{\"cmd\":\"reset\",\"id\":\"guest\"}\n");
    }
    if (step == 80U) {
        guest_reads();
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(guest_got, "too_many_clients"), guest_got);
    }
    return step == 350U;
}

TEST(test_stop_never_refused_by_a_relay_without_a_place) {
    settings.northbound.max_clients = 1;
    run(stop_beyond_the_places);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(1, written("\"cmd\":\"open\""), to_board);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(0, written("\"cmd\":\"reset\""), to_board);
    client_receives();
    TEST_ASSERT_NULL_MESSAGE(strstr(received, "\"ok\""), received); // The guest has requested nothing.
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
        client_receives();
        client_closes();
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

TEST(test_relay_reason_follows_the_received_bytes) {
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

TEST(test_relay_missing_port_is_not_reported_as_no_bytes) {
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

TEST(test_relay_board_restarted_late_is_reported_as_no_bytes) {
    run_logged(board_restarts_late);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(1, logged("warning: nothing comes"), complaints);
}

static bool board_goes(void) {
    if (step == 2U || step == 3500U) {
        board_links(EARLY + step);
    }
    return step == 7000U;
}

TEST(test_relay_board_offline_is_logged_each_time) {
    run_logged(board_goes);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(2, logged("warning: nothing comes"), complaints);
}

// The end by a signal -------------------------------------------------------------------------------------------------

static unsigned answer_at; ///< Step at which the board answers the stop; 0: never.
static unsigned last_step;

/// The line is busy when the client sends a stop and the relay receives the signal.
static bool stop_at_the_end(void) {
    begin_with_a_client();
    if (step == 100U) {
        relay.free_us = now_us + 20000U;
        client_writes("{\"cmd\":\"estop\",\"id\":1}\n");
    }
    if (answer_at != 0U && step == answer_at) {
        board_answers(1, "\"estop\"", "true");
    }
    for (uint8_t i = 1; step == 140U && i <= IWN_LINE_CHANNELS; i++) {
        board_writes(i, EARLY + 140,
                     "{\"event\":\"hello\"}"); // Of the channel that the relay opens for the repetition.
    }
    if (step > 101U) {
        TEST_ASSERT_NOT_EQUAL(0, access(settings.northbound.socket, F_OK));
    }
    last_step = step;
    return step == 100U;
}

TEST(test_relay_stop_is_sent_and_answered_before_the_end) {
    answer_at = 150U;
    run_logged(stop_at_the_end);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(1, written("\"estop\""), to_board);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(strstr(to_board, "\"estop\""), "\"close\",\"channel\":1"), to_board);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(0, logged("no reply"), complaints);
    TEST_ASSERT_UINT_WITHIN(20, 160, last_step);
}

TEST(test_relay_stop_without_an_answer_at_the_end_is_logged) {
    answer_at = 0;
    run_logged(stop_at_the_end);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(2, written("\"estop\""), to_board);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(1, logged("1 stop has no reply of the board"), complaints);
    TEST_ASSERT_UINT_WITHIN(3, 400, last_step);
}

/// A client drives when the relay ends.
static bool drive_at_the_end(void) {
    begin_with_a_client();
    if (step == 100U) {
        client_writes("{\"cmd\":\"arm\",\"id\":1}\n");
    }
    if (step == 105U) {
        client_writes("{\"cmd\":\"status\",\"id\":2}\n{\"cmd\":\"drive\",\"left_mm_s\":1,\"right_mm_s\":1}\n");
        relay.free_us = now_us + 20000U;
    }
    last_step = step;
    return step == 105U;
}

TEST(test_relay_end_closes_the_channels_and_sends_no_command) {
    run_logged(drive_at_the_end);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(2, written("\"close\",\"channel\":1"), to_board); // The first one is at its start.
    TEST_ASSERT_EQUAL_UINT_MESSAGE(0, written("\"drive\""), to_board);
    TEST_ASSERT_UINT_WITHIN(15, 125, last_step);
}

static bool full_port_at_the_end(void) {
    begin_with_a_client();
    if (step == 99U) {
        port_is_full = true;
    }
    if (step > 101U) {
        TEST_ASSERT_LESS_OR_EQUAL_UINT64(relay.ends_us, relay.planned_us); // The wait ends in time.
    }
    last_step = step;
    return step == 100U;
}

TEST(test_relay_ends_with_a_port_that_accepts_nothing) {
    run_logged(full_port_at_the_end);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(0, logged("no reply of the board"), complaints);
    TEST_ASSERT_UINT_WITHIN(3, 400, last_step);
}

static bool silent_board_at_the_end(void) {
    last_step = step;
    return step == 100U;
}

TEST(test_relay_without_a_board_ends_immediately) {
    run_logged(silent_board_at_the_end);
    TEST_ASSERT_UINT_WITHIN(2, 100, last_step);
}
