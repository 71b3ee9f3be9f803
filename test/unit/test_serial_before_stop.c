// SPDX-License-Identifier: MIT
// No request from before a stop, of any client or of the board's e-stop line, permits motion after it: the loop of the
// relay with a simulated board.
#include "relay_rig.h"

#include "unit.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define STOP      "{\"cmd\":\"stop\",\"id\":9}\n"
#define ESTOP     "{\"cmd\":\"estop\",\"id\":9}\n"
#define BAD_ESTOP "{\"cmd\":\"estop\",\"id\":9,\"reason\":\"\\ud83d\"}\n"
#define FOUR                                                                                                           \
    "{\"cmd\":\"status\",\"id\":1}\n{\"cmd\":\"status\",\"id\":2}\n{\"cmd\":\"status\",\"id\":3}\n"                    \
    "{\"cmd\":\"status\",\"id\":4}\n"
#define STATUS(id) "{\"cmd\":\"status\",\"id\":" id "}\n"

static const char *last_line; ///< Stop of the other client.
static const char *granting;  ///< Request of the first client that waits behind its question.

/// Another client stops the wheels by `last_line` while a request of the first one waits for its turn on the line.
static bool grant_then_stop_of_another(void) {
    begin_with_a_client();
    if (step == 30U) {
        client_writes(STATUS("1"));
        client_writes(granting);
    }
    if (step == 40U) {
        guest_sends(last_line);
    }
    if (step == 45U) {
        board_answers(1, "stop\"", "true");
    }
    if (step == 50U) {
        TEST_ASSERT_EQUAL_UINT_MESSAGE(1, written("stop\""), to_board);
        board_answers(1, "\"status\"", "true");
    }
    if (step == 90U) {
        guest_closes();
        client_receives();
        client_writes("{\"cmd\":\"arm\",\"id\":3,\"name\":\"after\"}\n");
    }
    return step == 100U;
}

/// The request is refused, and a later one is sent.
static void assert_not_sent_after(const char *stop, const char *grant, const char *words) {
    last_line = stop;
    granting = grant;
    run(grant_then_stop_of_another);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(0, written(words), to_board);
    const char *const first = strstr(received, "{\"id\":1,\"ok\":true}");
    TEST_ASSERT_NOT_NULL_MESSAGE(first, received);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(first, "{\"id\":2,\"ok\":false,\"error\":\"stale_command\""), received);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(1, written("\"after\""), to_board);
}

TEST(test_relay_release_from_before_an_estop_of_another_is_refused) {
    assert_not_sent_after(ESTOP, "{\"cmd\":\"release\",\"id\":2}\n", "\"release\"");
}

TEST(test_relay_arm_from_before_a_stop_of_another_is_refused) {
    assert_not_sent_after(STOP, "{\"cmd\":\"arm\",\"id\":2,\"name\":\"before\"}\n", "\"before\"");
}

TEST(test_relay_release_from_before_a_stop_beyond_the_places_is_refused) {
    settings.northbound.max_clients = 1;
    assert_not_sent_after(BAD_ESTOP, "{\"cmd\":\"release\",\"id\":2}\n", "\"release\"");
}

static int questioner; ///< A second client with a queue of its own.

/// The second client's stop is behind its questions, so that it is sent ahead. The first client's release waits.
static bool grant_then_stop_sent_ahead(void) {
    begin_with_a_client();
    if (step == 30U) {
        client_writes(STATUS("1") "{\"cmd\":\"release\",\"id\":2}\n");
        const int owner = client_fd;
        client_connects();
        questioner = client_fd;
        client_fd = owner;
    }
    for (uint8_t i = 2; step == 40U && i <= IWN_LINE_CHANNELS; i++) {
        board_writes(i, EARLY + 2, "{\"event\":\"hello\"}");
    }
    if (step == 50U) {
        TEST_ASSERT_EQUAL_INT(strlen(FOUR STOP), write(questioner, FOUR STOP, strlen(FOUR STOP)));
    }
    if (step == 60U) {
        TEST_ASSERT_EQUAL_UINT_MESSAGE(1, written("\"stop\""), to_board);
        board_answers(2, "\"stop\"", "true");
    }
    if (step == 61U) {
        const char *const at = strstr(to_board, "\n1 {\"id\":");
        char text[64];
        TEST_ASSERT_NOT_NULL_MESSAGE(at, to_board);
        (void)snprintf(text, sizeof text, "{\"id\":%u,\"ok\":true}", (unsigned)strtoul(&at[9], NULL, 10));
        board_writes(1, EARLY + 70, text);
    }
    if (step == 100U) {
        client_receives();
        (void)close(questioner);
    }
    return step == 110U;
}

TEST(test_relay_release_from_before_a_stop_sent_ahead_is_refused) {
    run(grant_then_stop_sent_ahead);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(0, written("\"release\""), to_board);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(received, "{\"id\":2,\"ok\":false,\"error\":\"stale_command\""), received);
}

/// The release is the fifth request, so it waits in the socket while another client stops the wheels.
static bool grant_in_the_socket(void) {
    begin_with_a_client();
    if (step == 30U) {
        client_writes(FOUR "{\"cmd\":\"release\",\"id\":5}\n");
    }
    if (step == 40U) {
        guest_sends(ESTOP);
    }
    if (step == 45U) {
        board_answers(1, "\"estop\"", "true");
    }
    if (step >= 50U && step % 10U == 0U && step <= 80U) {
        board_answers(1, "\"status\"", "true");
    }
    if (step == 100U) {
        client_receives();
        guest_closes();
    }
    return step == 110U;
}

TEST(test_relay_release_in_the_socket_at_a_stop_of_another_is_refused) {
    run(grant_in_the_socket);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(0, written("\"release\""), to_board);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(received, "{\"id\":5,\"ok\":false,\"error\":\"stale_command\""), received);
}

static unsigned answered_late_at;

/// A release of step 30 waits behind a question, which the board answers with this stamp.
static bool grant_behind_a_question(void) {
    begin_with_a_client();
    if (step == 30U) {
        client_writes(STATUS("1"));
        client_writes(granting);
    }
    if (step == answered_late_at) {
        board_answers(1, "\"status\"", "true"); // Its stamp is EARLY + 2 + step.
    }
    return step == 150U;
}

/// The e-stop line of the board may have changed meanwhile: the board compares the time with that of its last stop.
TEST(test_relay_release_that_waited_carries_its_time) {
    char dated[64];
    answered_late_at = 90U;
    granting = "{\"cmd\":\"release\",\"id\":2}\n";
    run(grant_behind_a_question);
    (void)snprintf(dated, sizeof dated, "\n1 {\"t_us\":%u,\"id\":2,\"cmd\":\"release\"}*", EARLY + 92U - 60000U);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(1, written(dated), to_board);
}

TEST(test_relay_release_that_hardly_waited_is_sent_as_it_is) {
    answered_late_at = 70U;
    granting = "{\"cmd\":\"release\",\"id\":2}\n";
    run(grant_behind_a_question);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(1, written("\n1 {\"id\":2,\"cmd\":\"release\"}*"), to_board);
}

TEST(test_relay_request_with_a_time_retains_it) {
    answered_late_at = 90U;
    granting = "{\"cmd\":\"arm\",\"id\":2,\"t_us\":77}\n";
    run(grant_behind_a_question);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(1, written("\n1 {\"id\":2,\"cmd\":\"arm\",\"t_us\":77}*"), to_board);
}

/// Their requests have no field `t_us`.
TEST(test_relay_adds_no_time_to_other_requests) {
    answered_late_at = 90U;
    granting = "{\"cmd\":\"tare\",\"id\":2}\n";
    run(grant_behind_a_question);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(1, written("\n1 {\"id\":2,\"cmd\":\"tare\"}*"), to_board);
}
