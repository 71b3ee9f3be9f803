// SPDX-License-Identifier: MIT
// A stop is never refused, waits for no other request, and is not lost when its client disconnects: the loop of the
// relay with a simulated board.
#include "relay_rig.h"

#include "unit.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>

static const char *last_line; ///< Line of the client directly before it closes.
static bool line_is_busy;
static bool refused_before; ///< Its arm was refused before.

#define STOP      "{\"cmd\":\"stop\",\"id\":9}\n"
#define ESTOP     "{\"cmd\":\"estop\",\"id\":9}\n"
#define BAD_ESTOP "{\"cmd\":\"estop\",\"id\":9,\"reason\":\"\\ud83d\"}\n"
#define FOUR                                                                                                           \
    "{\"cmd\":\"status\",\"id\":1}\n{\"cmd\":\"status\",\"id\":2}\n{\"cmd\":\"status\",\"id\":3}\n"                    \
    "{\"cmd\":\"status\",\"id\":4}\n"

static bool stop_and_close(void) {
    begin_with_a_client();
    if (step == 30U && refused_before) {
        client_writes("{\"cmd\":\"arm\",\"id\":1}\n");
    }
    if (step == 40U && refused_before) {
        board_answers(1, "\"arm\"", "false,\"error\":\"busy\",\"message\":\"other\"");
    }
    if (step == 99U && line_is_busy) {
        client_writes("{\"cmd\":\"status\",\"id\":2}\n");
        relay.free_us = now_us + 20000U; // 230 bytes at 115200 bit/s.
    }
    if (step == 100U) {
        client_writes(last_line);
        client_closes();
    }
    if (step == 150U) {
        TEST_ASSERT_EQUAL_UINT_MESSAGE(1, written(":\"stop\"") + written(":\"estop\""), to_board);
    }
    return step == 200U;
}

/// The client sends this line and closes: the stop in it is sent before the channel is closed.
static void assert_stop_before_close(const char *line, const char *words) {
    last_line = line;
    run(stop_and_close);
    const char *stop = strstr(to_board, words);
    TEST_ASSERT_NOT_NULL_MESSAGE(stop, to_board);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(stop, "\"cmd\":\"close\",\"channel\":1"), to_board);
}

TEST(test_relay_stop_directly_before_closing_is_sent) {
    assert_stop_before_close(STOP, "\"stop\"");
}

/// Noise or another program has left a part of a line in the board's receiver, or the board has lost bytes of it.
TEST(test_relay_stop_after_an_incomplete_line_is_received) {
    last_line = ESTOP;
    run(stop_and_close);
    const char *at = strstr(to_board, "\"estop\"");
    TEST_ASSERT_NOT_NULL_MESSAGE(at, to_board);
    const char *const stop = at;
    while (at > to_board && strncmp(at, "}*", 2) != 0) { // To the end of the line before it.
        at--;
    }
    at = strchr(at, '\n');
    TEST_ASSERT_NOT_NULL_MESSAGE(at, to_board);
    for (unsigned lost = 0; lost < 2U; lost++) {
        char data[IWN_LINE_BOARD_MAX];
        iwn_receiver_t board;
        iwn_line_t line;
        iwn_receiver_init(&board, data, sizeof data, false);
        TEST_ASSERT_EQUAL_INT(IWN_LINE_NOTHING, iwn_receiver_put(&board, '1', &line));
        if (lost > 0U) {
            iwn_receiver_spoil(&board);
        }
        iwn_line_verdict_t verdict = IWN_LINE_NOTHING;
        const char *next = at + 1;
        do {
            verdict = iwn_receiver_put(&board, *next, &line);
        } while (*next++ != '\n' || next <= stop);
        TEST_ASSERT_EQUAL_INT_MESSAGE(IWN_LINE_GOOD, verdict, at);
    }
}

TEST(test_relay_stop_before_closing_is_sent_after_a_refused_arm) {
    refused_before = true;
    assert_stop_before_close(ESTOP, "\"estop\"");
    refused_before = false;
}

TEST(test_relay_stop_before_closing_is_sent_over_a_busy_line) {
    line_is_busy = true;
    assert_stop_before_close(STOP, "\"stop\"");
    line_is_busy = false;
}

/// The client closes in the same moment, behind four questions without a reply.
TEST(test_relay_stop_before_closing_is_sent_behind_questions) {
    assert_stop_before_close(FOUR FOUR STOP, "\"stop\"");
}

#define STATUS(id) "{\"cmd\":\"status\",\"id\":" id "}\n"

/// A stop behind questions without a reply. An arm before it is in the queue, another one not yet.
static bool questions_then_stop(void) {
    begin_with_a_client();
    if (step == 30U) {
        client_writes(STATUS("1") STATUS("2") "{\"cmd\":\"arm\",\"id\":3}\n" STATUS("4"));
        client_writes("{\"cmd\":\"arm\",\"id\":5}\n" STATUS("6") STATUS("7") STATUS("8") STATUS("9"));
    }
    if (step == 50U) {
        client_writes("{\"cmd\":\"stop\",\"id\":10}\n" STATUS("11"));
    }
    if (step == 51U) {
        TEST_ASSERT_EQUAL_UINT_MESSAGE(1, written("\"stop\""), to_board);
        board_answers(1, "\"stop\"", "true,\"state\":\"stopping\"");
    }
    if (step >= 60U && step % 10U == 0U && step <= 130U) {
        board_answers(1, "\"status\"", "true");
    }
    return step == 350U;
}

TEST(test_relay_stop_behind_questions_is_sent_at_once) {
    run(questions_then_stop);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(1, written("\"stop\""), to_board);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(0, written("\"arm\""), to_board);
    client_receives();
    const char *at = received;
    for (unsigned id = 1; id <= 11U; id++) {
        char reply[64];
        (void)snprintf(reply, sizeof reply, "\n{\"id\":%u,\"ok\":%s", id, (id == 3U || id == 5U) ? "false" : "true");
        at = strstr(at, reply);
        TEST_ASSERT_NOT_NULL_MESSAGE(at, received);
    }
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(received, "{\"id\":10,\"ok\":true,\"state\":\"stopping\"}"), received);
}

/// A stop beyond the maximum, while the only channel has four questions without a reply.
static bool questions_then_guest(void) {
    begin_with_a_client();
    if (step == 30U) {
        client_writes(FOUR);
    }
    if (step == 50U) {
        guest_sends(STOP);
    }
    if (step == 52U) {
        board_answers(1, "\"stop\"", "true,\"state\":\"stopping\"");
    }
    if (step == 60U) {
        guest_reads();
    }
    return step == 100U;
}

TEST(test_relay_stop_beyond_the_places_passes_questions) {
    settings.northbound.max_clients = 1;
    run(questions_then_guest);
    TEST_ASSERT_TRUE(guest_is_closed);
    TEST_ASSERT_EQUAL_STRING("{\"id\":9,\"ok\":true,\"state\":\"stopping\"}\n", guest_got);
}

// Stops in lines that are refused ------------------------------------------------------------------------------------

#define BAD_JSON                                                                                                       \
    "{\"id\":null,\"ok\":false,\"error\":\"bad_json\",\"message\":\"not one JSON object on one line; its stop is "     \
    "executed\"}\n"

static unsigned answered_at;

/// The board answers the stop at step `answered_at`.
static bool refused_line(void) {
    begin_with_a_client();
    if (step == 30U) {
        client_writes(BAD_ESTOP STATUS("2"));
    }
    if (step == 32U) {
        TEST_ASSERT_EQUAL_UINT_MESSAGE(1, written("\"cmd\":\"estop\"}"), to_board);
        client_receives();
        TEST_ASSERT_NULL_MESSAGE(strstr(received, "bad_json"), received);
    }
    if (step == answered_at) {
        board_answers(1, "\"estop\"", "true,\"state\":\"latched\"");
    }
    return step == 100U;
}

TEST(test_stop_never_refused_by_a_relay_in_a_bad_line) {
    answered_at = 33U;
    run(refused_line);
    client_receives();
    TEST_ASSERT_EQUAL_STRING(BAD_JSON, received);
}

/// The refusal reports that the stop is executed, so it waits for the answer of the board.
TEST(test_relay_stop_in_a_bad_line_is_confirmed_by_the_board) {
    answered_at = 1000U;
    run(refused_line);
    client_receives();
    TEST_ASSERT_EQUAL_STRING("", received);
}

/// The board receives equal stops that wait together as one.
static bool equal_stops(void) {
    begin_with_a_client();
    if (step == 30U) {
        client_writes("{\"cmd\":\"estop\",\"id\":1}\n" BAD_ESTOP "{\"cmd\":\"estop\",\"id\":3}\n");
    }
    if (step == 33U) {
        board_answers(1, "\"estop\"", "true");
    }
    return step == 100U;
}

TEST(test_relay_refuses_only_the_bad_line_of_equal_stops) {
    run(equal_stops);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(1, written("\"cmd\":\"estop\"}"), to_board);
    client_receives();
    TEST_ASSERT_EQUAL_STRING("{\"event\":\"hello\"}\n{\"id\":1,\"ok\":true}\n" BAD_JSON "{\"id\":3,\"ok\":true}\n",
                             received);
}

static bool questions_then_refused_line(void) {
    begin_with_a_client();
    if (step == 30U) {
        client_writes(FOUR "{\"cmd\":\"arm\",\"id\":5}\n" BAD_ESTOP);
    }
    if (step == 33U) {
        board_answers(1, "\"estop\"", "true,\"state\":\"latched\"");
    }
    if (step >= 60U && step % 10U == 0U && step <= 90U) {
        board_answers(1, "\"status\"", "true");
    }
    return step == 200U;
}

TEST(test_stop_never_waits_for_questions_in_a_bad_line) {
    run(questions_then_refused_line);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(1, written("\"cmd\":\"estop\"}"), to_board);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(0, written("\"arm\""), to_board);
    client_receives();
    const char *const fifth = strstr(received, "{\"id\":5,\"ok\":false");
    TEST_ASSERT_NOT_NULL_MESSAGE(fifth, received);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(fifth, BAD_JSON), received);
}

static bool questions_then_bad_guest(void) {
    begin_with_a_client();
    if (step == 30U) {
        client_writes(FOUR);
    }
    if (step == 50U) {
        guest_sends(BAD_ESTOP);
    }
    if (step == 52U) {
        board_answers(1, "\"estop\"", "true,\"state\":\"latched\"");
    }
    if (step == 60U) {
        guest_reads();
    }
    return step == 100U;
}

TEST(test_stop_never_needs_a_place_of_the_relay_in_a_bad_line) {
    settings.northbound.max_clients = 1;
    run(questions_then_bad_guest);
    TEST_ASSERT_TRUE(guest_is_closed);
    TEST_ASSERT_EQUAL_STRING(BAD_JSON, guest_got);
}

static bool long_line(void) {
    static char line[IWN_LINE_MAX + 2U];
    begin_with_a_client();
    if (step == 30U) {
        memset(line, ' ', IWN_LINE_MAX + 1U);
        memcpy(line, "{\"cmd\":\"stop\"", strlen("{\"cmd\":\"stop\""));
        client_writes(line);
    }
    if (step == 33U) {
        board_answers(1, "\"stop\"", "true");
    }
    return step == 100U;
}

TEST(test_stop_never_refused_by_a_relay_in_an_endless_line) {
    char byte;
    run(long_line);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(1, written("\"cmd\":\"stop\"}"), to_board);
    client_receives();
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(received, "\"error\":\"line_too_long\""), received);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(received, "sent to the board, which has not confirmed it yet"), received);
    TEST_ASSERT_NULL_MESSAGE(strstr(received, "is executed"), received);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(1, count_in(received, "\"ok\":"), received);
    TEST_ASSERT_EQUAL_INT(0, recv(client_fd, &byte, 1U, MSG_DONTWAIT));
}

/// The board has not welcomed the sender yet, but another client.
static bool stop_before_the_welcome(void) {
    begin_with_a_client();
    if (step == 30U) {
        guest_sends(STOP);
    }
    if (step == 35U) {
        board_answers(1, "\"stop\"", "true,\"state\":\"stopping\"");
    }
    if (step == 40U) {
        guest_reads();
    }
    return step == 100U;
}

TEST(test_relay_stop_before_the_welcome_uses_another_channel) {
    run(stop_before_the_welcome);
    TEST_ASSERT_EQUAL_STRING("{\"id\":9,\"ok\":true,\"state\":\"stopping\"}\n", guest_got);
    client_receives();
    TEST_ASSERT_NULL_MESSAGE(strstr(received, "\"ok\""), received);
}

/// The only client closes before its welcome.
static bool stop_without_a_welcome(void) {
    begin_with_the_board();
    if (step == 10U) {
        client_connects();
        client_writes(STOP);
        client_closes();
    }
    for (uint8_t i = 1; step == 40U && i <= IWN_LINE_CHANNELS; i++) {
        board_writes(i, EARLY + 1, "{\"event\":\"hello\"}");
    }
    if (step == 50U) {
        board_answers(1, "\"stop\"", "true");
    }
    return step == 600U;
}

TEST(test_relay_stop_without_a_channel_opens_one) {
    run(stop_without_a_welcome);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(1, written("\"stop\""), to_board);
    const char *stop = strstr(to_board, "\"stop\"");
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(stop, "\"close\""), to_board);
    TEST_ASSERT_NULL_MESSAGE(strstr(stop, "\"open\""), to_board);
}

/// The board does not answer the stop, as if it had closed the channel. It welcomes a later channel.
static bool stop_without_an_answer(void) {
    begin_with_a_client();
    if (step == 30U) {
        client_writes(STOP);
    }
    if (step == 170U) {
        TEST_ASSERT_EQUAL_UINT_MESSAGE(1, written("\"stop\""), to_board);
    }
    if (step == 200U) {
        TEST_ASSERT_EQUAL_UINT_MESSAGE(2, written("\n1 {\"id\":1,\"cmd\":\"stop\"}"), to_board);
    }
    if (step == 400U) {
        TEST_ASSERT_EQUAL_UINT_MESSAGE(1, written("\"open\",\"channel\":2"), to_board);
        board_writes(2, EARLY + 400, "{\"event\":\"hello\"}");
    }
    if (step == 600U) {
        TEST_ASSERT_GREATER_OR_EQUAL_UINT_MESSAGE(1, written("\n2 {\"id\":1,\"cmd\":\"stop\"}"), to_board);
        board_answers(2, "\"stop\"", "true");
    }
    return step == 1000U;
}

TEST(test_relay_stop_without_an_answer_is_repeated_on_a_new_channel) {
    run(stop_without_an_answer);
    TEST_ASSERT_LESS_OR_EQUAL_UINT_MESSAGE(5, written("\"stop\""), to_board);
    TEST_ASSERT_GREATER_OR_EQUAL_UINT_MESSAGE(1, written("\"close\",\"channel\":2"), to_board);
    client_receives();
    TEST_ASSERT_EQUAL_UINT_MESSAGE(1, count_in(received, "{\"id\":9,\"ok\":true}"), received);
}

static int followers[IWN_LINE_CHANNELS]; ///< Clients, one of which uses the channel of the first.

/// The reply comes when another client has the channel.
static bool reply_after_the_sender(void) {
    begin_with_a_client();
    if (step == 30U) {
        client_writes(STOP);
        client_closes();
    }
    for (unsigned i = 0; step == 40U && i < IWN_LINE_CHANNELS; i++) {
        client_connects();
        followers[i] = client_fd;
    }
    if (step == 50U) {
        TEST_ASSERT_EQUAL_INT(RELAY_OPENING, relay.channel[1].state);
        board_writes(1, EARLY + 50, "{\"event\":\"hello\"}");
    }
    if (step == 60U) {
        board_answers(1, "\"stop\"", "true");
    }
    return step == 100U;
}

TEST(test_relay_reply_to_a_stop_reaches_no_other_client) {
    unsigned greeted = 0;
    settings.northbound.max_clients = IWN_LINE_CHANNELS;
    run(reply_after_the_sender);
    for (unsigned i = 0; i < IWN_LINE_CHANNELS; i++) {
        client_fd = followers[i];
        client_receives();
        client_closes();
        greeted += count_in(received, "hello");
        TEST_ASSERT_NULL_MESSAGE(strstr(received, "\"ok\""), received);
    }
    TEST_ASSERT_EQUAL_UINT(1, greeted);
    TEST_ASSERT_FALSE(relay_stops_wait(&relay, now_us));
}

/// A client whose arm was refused sends two equal stops and ends, and reads its replies.
static bool stop_and_end(void) {
    begin_with_a_client();
    if (step == 30U && refused_before) {
        client_writes("{\"cmd\":\"arm\",\"id\":1}\n");
    }
    if (step == 40U && refused_before) {
        board_answers(1, "\"arm\"", "false");
    }
    if (step == 50U) {
        client_writes(last_line);
        (void)shutdown(client_fd, SHUT_WR);
    }
    if (step == 60U) {
        board_answers(1, "\"stop\"", "true");
    }
    if (step == 70U) {
        client_receives();
    }
    return step == 100U;
}

TEST(test_relay_client_that_ends_after_a_stop_receives_its_reply) {
    last_line = STOP;
    refused_before = true;
    run(stop_and_end);
    refused_before = false;
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(received, "{\"id\":9,\"ok\":true}\n"), received);
}

TEST(test_relay_equal_stops_are_sent_once_and_answered_each) {
    last_line = STOP STOP;
    run(stop_and_end);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(1, written("\"stop\""), to_board);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(2, count_in(received, "{\"id\":9,\"ok\":true}\n"), received);
}

/// The board is lost before it answers.
static bool board_is_lost_after_a_stop(void) {
    begin_with_a_client();
    if (step == 30U) {
        client_writes(STOP);
    }
    if (step == 40U) {
        board_writes(1, 5, "{\"event\":\"state\"}");
    }
    if (step == 45U) {
        client_receives();
        guest_sends(ESTOP);
    }
    if (step == 50U) {
        guest_reads();
    }
    return step == 60U;
}

TEST(test_relay_stop_without_a_board_is_reported_immediately) {
    run(board_is_lost_after_a_stop);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(received, "{\"id\":9,\"ok\":false,\"error\":\"bus_down\""), received);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(guest_got, "bus_down"), guest_got);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(0, written("\"estop\""), to_board);
}

/// The relay is delayed for longer than the board waits, and a stop was sent meanwhile.
static bool stop_during_a_stall(void) {
    begin_with_a_client();
    if (step == 60U) {
        client_writes("{\"cmd\":\"drive\",\"left_mm_s\":1,\"right_mm_s\":1}\n" STOP);
        now_us += 600000U;
    }
    for (uint8_t i = 1; step == 80U && i <= IWN_LINE_CHANNELS; i++) {
        board_writes(i, EARLY + 80, "{\"event\":\"hello\"}");
    }
    return step == 100U;
}

TEST(test_relay_stop_during_a_stall_is_sent_after_it) {
    run(stop_during_a_stall);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(0, written("\"drive\""), to_board);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(1, written("\"stop\""), to_board);
}

/// More stops than places come while the line accepts nothing, and an estop is the last one.
static bool stops_of_many(void) {
    begin_with_a_client();
    if (step == 30U) {
        port_is_full = true;
    }
    if (step >= 40U && step < 40U + RELAY_STOPS + 8U) {
        guest_sends((step == 40U + RELAY_STOPS + 7U) ? ESTOP : STOP);
        guest_closes();
    }
    if (step == 120U) {
        port_is_full = false;
    }
    return step == 140U;
}

TEST(test_relay_stop_beyond_all_places_is_sent) {
    settings.northbound.max_clients = 1;
    run(stops_of_many);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(1, written("\"estop\""), to_board);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(RELAY_STOPS, written("\"stop\""), to_board);
}

static bool one_stop(void) {
    begin_with_a_client();
    if (step == 30U) {
        client_writes(last_line);
    }
    return step == 50U;
}

TEST(test_relay_stop_longer_than_the_line_is_sent) {
    char quotes[401];
    char text[1300];
    char sent[500];
    for (unsigned i = 0; i < sizeof quotes; i++) {
        quotes[i] = (i % 2U == 0U) ? '\\' : '"';
    }
    quotes[400] = '\0';
    (void)snprintf(text, sizeof text, "{\"cmd\":%700s\"estop\",\"id\":9,\"reason\":\"%s\"}\n", "", quotes);
    (void)snprintf(sent, sizeof sent, "{\"id\":1,\"cmd\":\"estop\",\"reason\":\"%s\"}", quotes);
    last_line = text;
    run(one_stop);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(1, written(sent), to_board);
}

TEST(test_stop_never_refused_by_an_older_board_for_a_field) {
    char text[600];
    char sent[300];
    (void)snprintf(text, sizeof text, "{\"cmd\":\"estop\",\"id\":9,\"t_us\":1,\"reason\":\"a\\nb%0400d\"}\n", 0);
    (void)snprintf(sent, sizeof sent, "{\"id\":1,\"cmd\":\"estop\",\"reason\":\"a b%0197d\"}", 0);
    last_line = text;
    run(one_stop);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(1, written(sent), to_board);
}
