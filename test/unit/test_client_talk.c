// SPDX-License-Identifier: MIT
// libiwheel-client against a gateway that the test plays at the other end of a socket pair.
#include "iwheel_client/client.h"

#include "unit.h"

#include <errno.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#define HELLO "{\"event\":\"hello\",\"name\":\"iwheel-gateway\",\"api\":1,\"state\":\"listening\",\"client\":7}\n"
#define BRIEF 20   ///< ms; nothing is expected.
#define SOON  2000 ///< ms; the expected bytes are already there, but the machine may be busy.

static iwc_t *gateway;
static int server;
static char received[1 << 20]; ///< Bytes that the gateway of the test has read, terminated.
static iwc_message_t message;

static void send_text(const char *text) {
    size_t left = strlen(text);
    while (left > 0) {
        const ssize_t now = send(server, text, left, MSG_NOSIGNAL);
        TEST_ASSERT_GREATER_THAN(0, now);
        text += now;
        left -= (size_t)now;
    }
}

/// Returns the bytes that were received since the last call.
static const char *receive(void) {
    size_t used = 0;
    for (ssize_t now = 1; now > 0; used += (now > 0) ? (size_t)now : 0U) {
        now = recv(server, received + used, sizeof received - 1U - used, MSG_DONTWAIT);
    }
    received[used] = '\0';
    return received;
}

static bool server_sees_the_end(void) {
    char byte;
    (void)receive();
    return recv(server, &byte, 1, MSG_DONTWAIT) == 0;
}

static iwc_result_t adopt_with(const char *first) {
    int pair[2];
    const int buffer_size = 4 << 20; // Buffer of the fake gateway, which may send much before the client reads.
    TEST_ASSERT_EQUAL_INT(0, socketpair(AF_UNIX, SOCK_STREAM, 0, pair));
    if (server >= 0) {
        (void)close(server);
    }
    server = pair[1];
    (void)setsockopt(server, SOL_SOCKET, SO_SNDBUF, &buffer_size, sizeof buffer_size);
    send_text(first);
    return iwc_adopt(gateway, pair[0], SOON);
}

void setUp(void) {
    server = -1;
    gateway = iwc_new();
    TEST_ASSERT_EQUAL(IWC_OK, adopt_with(HELLO));
}

void tearDown(void) {
    iwc_free(gateway);
    (void)close(server);
}

static void expect_event(const char *text) {
    TEST_ASSERT_EQUAL(IWC_OK, iwc_next(gateway, 0, &message));
    TEST_ASSERT_TRUE(message.is_event);
    TEST_ASSERT_EQUAL_STRING(text, message.text);
    TEST_ASSERT_EQUAL_size_t(strlen(text), message.length);
}

// ---- connection -----------------------------------------------------------------------------------------------------

TEST(test_connect_greeting_sets_the_number_and_sends_nothing) {
    TEST_ASSERT_EQUAL_INT64(7, iwc_number(gateway));
    TEST_ASSERT_EQUAL_STRING("", receive());
    TEST_ASSERT_EQUAL(IWC_TIMEOUT, iwc_next(gateway, 0, &message));
}

TEST(test_connect_too_many_clients_is_refused_with_reason) {
    TEST_ASSERT_EQUAL(
        IWC_REFUSED,
        adopt_with("{\"id\":null,\"ok\":false,\"error\":\"too_many_clients\",\"message\":\"16 of 16\"}\n"));
    TEST_ASSERT_EQUAL_STRING("too_many_clients", iwc_error(gateway));
    TEST_ASSERT_EQUAL_STRING("16 of 16", iwc_reason(gateway));
    TEST_ASSERT_EQUAL_INT(-1, iwc_fd(gateway));
}

TEST(test_connect_without_greeting_times_out) {
    TEST_ASSERT_EQUAL(IWC_TIMEOUT, adopt_with("{\"event\":\"hel"));
    TEST_ASSERT_EQUAL_INT(-1, iwc_fd(gateway));
    TEST_ASSERT_TRUE(server_sees_the_end());
}

TEST(test_connect_another_service_is_garbled) {
    static const char *const first[] = {"ok iwheel-sim\n",
                                        "[1]\n",
                                        "{\"event\":\"hi\"}\n",
                                        "{\"id\":1,\"ok\":true}\n",
                                        "{}\n",
                                        "{\"ok\":true,\"event\":\"hello\"}\n",
                                        "{\"event\":\"hello\",\"api\":1,\"api\":1}\n"};
    for (size_t i = 0; i < sizeof first / sizeof first[0]; i++) {
        TEST_ASSERT_EQUAL_MESSAGE(IWC_GARBLED, adopt_with(first[i]), first[i]);
        TEST_ASSERT_EQUAL_INT(-1, iwc_fd(gateway));
    }
}

TEST(test_connect_without_gateway_returns_errno) {
    char path[200];
    TEST_ASSERT_EQUAL(IWC_NOT_THERE, iwc_connect(gateway, "/nonexistent/x.sock", 0));
    TEST_ASSERT_EQUAL_INT(ENOENT, iwc_errno(gateway));
    TEST_ASSERT_EQUAL(IWC_CLOSED, iwc_next(gateway, 0, &message));
    memset(path, 'x', sizeof path);
    path[sizeof path - 1U] = '\0';
    TEST_ASSERT_EQUAL(IWC_INVALID, iwc_connect(gateway, path, 0));
    TEST_ASSERT_EQUAL_INT(ENAMETOOLONG, iwc_errno(gateway));
}

TEST(test_connect_newer_protocol_allows_only_status_and_stop) {
    const iwc_drive_t command = {.left_mm_s = 1};
    TEST_ASSERT_EQUAL(IWC_NEWER, adopt_with("{\"event\":\"hello\",\"api\":2,\"client\":1}\n"));
    TEST_ASSERT_EQUAL(IWC_NEWER, iwc_arm(gateway, NULL, false, 0, NULL));
    TEST_ASSERT_EQUAL(IWC_NEWER, iwc_drive(gateway, &command, 0, NULL));
    TEST_ASSERT_EQUAL(IWC_NEWER, iwc_twist(gateway, 1, 1, 0, NULL));
    TEST_ASSERT_EQUAL(IWC_NEWER, iwc_reset(gateway, 0));
    TEST_ASSERT_EQUAL_STRING("", receive());
    TEST_ASSERT_EQUAL(IWC_TIMEOUT, iwc_ask(gateway, "{\"cmd\":\"status\"}", 0, &message));
    TEST_ASSERT_NOT_NULL(strstr(receive(), "status"));
    send_text("{\"id\":12,\"ok\":true}\n");
    TEST_ASSERT_EQUAL(IWC_OK, iwc_stop(gateway, SOON));
    TEST_ASSERT_NOT_NULL(strstr(receive(), "\"cmd\":\"stop\""));
}

// ---- requests -------------------------------------------------------------------------------------------------------

TEST(test_ask_returns_the_reply_with_its_id_and_queues_events) {
    send_text("{\"event\":\"a\"}\n{\"id\":99,\"ok\":true}\n{\"id\":2,\"ok\":true,\"x\":5}\n{\"event\":\"b\"}\n");
    TEST_ASSERT_EQUAL(IWC_OK, iwc_ask(gateway, "{\"cmd\":\"status\"}", SOON, &message));
    TEST_ASSERT_EQUAL_STRING("{\"id\":2,\"cmd\":\"status\"}\n", receive());
    TEST_ASSERT_EQUAL_INT64(5, iwc_integer(&message, "x").value);
    TEST_ASSERT_FALSE(message.is_event);
    expect_event("{\"event\":\"a\"}");
    TEST_ASSERT_EQUAL(IWC_OK, iwc_next(gateway, 0, &message)); // The reply with another id is returned later.
    TEST_ASSERT_EQUAL_INT64(99, message.id);
    expect_event("{\"event\":\"b\"}");
    TEST_ASSERT_EQUAL(IWC_TIMEOUT, iwc_next(gateway, 0, &message));
}

TEST(test_ask_late_reply_is_dropped) {
    TEST_ASSERT_EQUAL(IWC_TIMEOUT, iwc_ask(gateway, "{\"cmd\":\"why\"}", 1, &message));
    send_text("{\"id\":2,\"ok\":false,\"error\":\"late\",\"message\":\"\"}\n{\"id\":4,\"ok\":true}\n");
    TEST_ASSERT_EQUAL(IWC_OK, iwc_reset(gateway, SOON));
    TEST_ASSERT_FALSE(iwc_pending(gateway));
    TEST_ASSERT_EQUAL(IWC_TIMEOUT, iwc_next(gateway, 0, &message));
}

TEST(test_ask_refusal_has_error_and_reason) {
    send_text("{\"id\":2,\"ok\":false,\"error\":\"estop_pressed\",\"message\":\"release \\\"it\\\"\"}\n");
    TEST_ASSERT_EQUAL(IWC_REFUSED, iwc_arm(gateway, "test", false, SOON, NULL));
    TEST_ASSERT_EQUAL_STRING("estop_pressed", iwc_error(gateway));
    TEST_ASSERT_EQUAL_STRING("release \"it\"", iwc_reason(gateway));
    TEST_ASSERT_GREATER_OR_EQUAL(0, iwc_fd(gateway));
}

TEST(test_ask_refusal_without_message_has_a_reason) {
    send_text("{\"id\":2,\"ok\":false,\"error\":\"denied\",\"message\":\"\"}\n");
    TEST_ASSERT_EQUAL(IWC_REFUSED, iwc_reset(gateway, SOON));
    TEST_ASSERT_EQUAL_STRING("the gateway refused without a message: denied; see its log", iwc_reason(gateway));
    send_text("{\"id\":4,\"ok\":false}\n");
    TEST_ASSERT_EQUAL(IWC_REFUSED, iwc_reset(gateway, SOON));
    TEST_ASSERT_EQUAL_STRING("the gateway refused without a message: no name of an error; see its log",
                             iwc_reason(gateway));
}

TEST(test_reason_is_that_of_the_last_failed_call) {
    char path[200];
    memset(path, 'x', sizeof path);
    path[sizeof path - 1U] = '\0';
    TEST_ASSERT_EQUAL_STRING(iwc_words(IWC_OK), iwc_reason(gateway)); // Connected, and no call has failed.
    TEST_ASSERT_EQUAL(IWC_TIMEOUT, iwc_next(gateway, 0, &message));   // This is no failure.
    TEST_ASSERT_EQUAL_STRING(iwc_words(IWC_OK), iwc_reason(gateway));
    TEST_ASSERT_EQUAL(IWC_TIMEOUT, iwc_reset(gateway, 1));
    TEST_ASSERT_EQUAL_STRING(iwc_words(IWC_TIMEOUT), iwc_reason(gateway));
    TEST_ASSERT_EQUAL(IWC_INVALID, iwc_watch(gateway, 0, 0, SOON));
    TEST_ASSERT_EQUAL_STRING(iwc_words(IWC_INVALID), iwc_reason(gateway));
    send_text("{\"id\":4,\"ok\":false,\"error\":\"busy\",\"message\":\"wait\"}\n");
    TEST_ASSERT_EQUAL(IWC_REFUSED, iwc_reset(gateway, SOON));
    send_text("{\"id\":6,\"ok\":true}\n");
    TEST_ASSERT_EQUAL(IWC_OK, iwc_reset(gateway, SOON)); // A call that succeeds changes nothing.
    TEST_ASSERT_EQUAL_STRING("wait", iwc_reason(gateway));
    (void)close(server);
    server = -1;
    TEST_ASSERT_EQUAL(IWC_CLOSED, iwc_next(gateway, SOON, &message));
    TEST_ASSERT_EQUAL_STRING(iwc_words(IWC_CLOSED), iwc_reason(gateway));
    TEST_ASSERT_EQUAL(IWC_NOT_THERE, iwc_connect(gateway, "/nonexistent/x.sock", 0));
    TEST_ASSERT_EQUAL_STRING(iwc_words(IWC_NOT_THERE), iwc_reason(gateway));
    TEST_ASSERT_EQUAL(IWC_INVALID, iwc_stop_at(gateway, path, 0));
    TEST_ASSERT_EQUAL_STRING(iwc_words(IWC_INVALID), iwc_reason(gateway));
}

TEST(test_ask_refusal_without_id_ends_the_pending_request) {
    send_text("{\"id\":null,\"ok\":false,\"error\":\"bad_json\",\"message\":\"\"}\n");
    TEST_ASSERT_EQUAL(IWC_REFUSED, iwc_reset(gateway, SOON));
    TEST_ASSERT_EQUAL_STRING("bad_json", iwc_error(gateway));
}

TEST(test_ask_flood_of_events_does_not_extend_the_timeout) {
    const pid_t flood = fork();
    if (flood == 0) {
        for (;;) {
            (void)send(server, "{\"event\":\"frame\",\"id\":1}\n", 25, 0);
        }
    }
    const iwc_result_t result = iwc_reset(gateway, SOON);
    const iwc_result_t latest = iwc_latest(gateway);
    (void)kill(flood, SIGKILL);
    (void)waitpid(flood, NULL, 0);
    TEST_ASSERT_EQUAL(IWC_TIMEOUT, result);
    TEST_ASSERT_EQUAL(IWC_OK, latest);
}

TEST(test_ask_invalid_request_is_not_sent) {
    char text[IWC_REQUEST_MAX + 10U];
    int64_t id = 0;
    static const char *const bad[] = {"",
                                      "{}",
                                      "[]",
                                      "{\"cmd\":\"stop\"",
                                      "{\"cmd\":\"stop\",\"id\":1}",
                                      "{\"cmd\":\n\"stop\"}",
                                      "{\"cmd\":\"stop\"}{\"cmd\":\"stop\"}",
                                      "{\"cmd\":\"a\",\"cmd\":\"b\"}",
                                      " {\"cmd\":\"stop\"}"};
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        TEST_ASSERT_EQUAL_MESSAGE(IWC_INVALID, iwc_send(gateway, bad[i], 0, &id), bad[i]);
    }
    (void)snprintf(text, sizeof text, "{\"cmd\":\"%*s\"}", (int)IWC_REQUEST_MAX - 10, "x");
    TEST_ASSERT_EQUAL(IWC_INVALID, iwc_send(gateway, text, 0, &id));
    TEST_ASSERT_EQUAL(IWC_INVALID, iwc_watch(gateway, 128, 10, 0));
    TEST_ASSERT_EQUAL(IWC_INVALID, iwc_watch(gateway, 1, 101, 0));
    TEST_ASSERT_EQUAL(IWC_INVALID, iwc_arm(gateway, "a\nb", false, 0, NULL));
    TEST_ASSERT_EQUAL_STRING("", receive());
}

TEST(test_ask_helpers_send_lines_of_the_protocol) {
    const iwc_drive_t plain = {.left_mm_s = -300, .right_mm_s = 200};
    const iwc_drive_t full = {.left_mm_s = 1, .right_mm_s = 2, .has_current = true, .left_mA = 3, .right_mA = -4};
    (void)iwc_arm(gateway, "a \"b\\", true, 0, NULL);
    (void)iwc_drive(gateway, &plain, 0, NULL);
    (void)iwc_drive(gateway, &full, 0, NULL);
    (void)iwc_twist(gateway, 5, -6, 0, NULL);
    (void)iwc_watch(gateway, IWC_WATCH_STATE | IWC_WATCH_FRAME, 20, 0);
    (void)iwc_watch(gateway, 0, 1, 0);
    (void)iwc_reset(gateway, 0);
    (void)iwc_estop(gateway, "stairs", 0);
    TEST_ASSERT_EQUAL_STRING(
        "{\"id\":2,\"cmd\":\"arm\",\"name\":\"a \\\"b\\\\\",\"takeover\":true}\n"
        "{\"id\":3,\"cmd\":\"drive\",\"left_mm_s\":-300,\"right_mm_s\":200}\n"
        "{\"id\":5,\"cmd\":\"drive\",\"left_mm_s\":1,\"right_mm_s\":2,\"left_mA\":3,\"right_mA\":-4}\n"
        "{\"id\":7,\"cmd\":\"twist\",\"v_mm_s\":5,\"yaw_mrad_s\":-6}\n"
        "{\"id\":10,\"cmd\":\"watch\",\"rate_hz\":20,\"topics\":[\"state\",\"frame\"]}\n"
        "{\"id\":12,\"cmd\":\"watch\",\"rate_hz\":1,\"topics\":[]}\n"
        "{\"id\":14,\"cmd\":\"reset\"}\n"
        "{\"id\":16,\"cmd\":\"estop\",\"reason\":\"stairs\"}\n",
        receive());
}

TEST(test_ask_terms_and_applied_values_are_returned) {
    iwc_terms_t terms;
    iwc_applied_t applied;
    const iwc_drive_t command = {.left_mm_s = 2000, .right_mm_s = 2000};
    send_text("{\"id\":2,\"ok\":true,\"lease_ms\":200,\"first_lease_ms\":1000,\"stop_budget_ms\":887,"
              "\"stop_budget_mm\":554,\"warnings\":[\"w\"]}\n");
    TEST_ASSERT_EQUAL(IWC_OK, iwc_arm(gateway, NULL, false, SOON, &terms));
    TEST_ASSERT_EQUAL_INT32(200, terms.lease_ms);
    TEST_ASSERT_EQUAL_INT32(1000, terms.first_lease_ms);
    TEST_ASSERT_EQUAL_INT32(887, terms.stop_budget_ms);
    TEST_ASSERT_EQUAL_INT32(554, terms.stop_budget_mm);
    size_t length = 0;
    TEST_ASSERT_TRUE(iwc_reply(gateway, &message));
    TEST_ASSERT_EQUAL_STRING_LEN("[\"w\"]", iwc_json(&message, "warnings", &length), 5);
    TEST_ASSERT_EQUAL_INT64(2, message.id);
    send_text("{\"id\":4,\"ok\":true,\"left_mm_s\":1000,\"right_mm_s\":-999,\"left_mA\":2000,\"right_mA\":1999,"
              "\"limited\":true}\n");
    TEST_ASSERT_EQUAL(IWC_OK, iwc_drive(gateway, &command, SOON, &applied));
    TEST_ASSERT_TRUE(iwc_reply(gateway, &message));
    TEST_ASSERT_EQUAL_INT32(1000, applied.left_mm_s);
    TEST_ASSERT_EQUAL_INT32(-999, applied.right_mm_s);
    TEST_ASSERT_EQUAL_INT32(2000, applied.left_mA);
    TEST_ASSERT_EQUAL_INT32(1999, applied.right_mA);
    TEST_ASSERT_TRUE(applied.limited);
}

// ---- lines ----------------------------------------------------------------------------------------------------------

TEST(test_line_in_single_bytes_is_one_message) {
    static const char text[] = "{\"event\":\"a\"}\n{\"event\":\"b\"}\n";
    char byte[2] = "";
    for (size_t i = 0; text[i] != '\0'; i++) {
        if (i != 14 && i != 28) {
            TEST_ASSERT_EQUAL(IWC_TIMEOUT, iwc_next(gateway, 0, &message));
        }
        byte[0] = text[i];
        send_text(byte);
        if (text[i] == '\n') {
            expect_event((i < 20) ? "{\"event\":\"a\"}" : "{\"event\":\"b\"}");
        }
    }
}

/// Sends an event of this many bytes, without its newline.
static void send_long(size_t length) {
    static char text[IWC_LINE_MAX + 10U];
    const int n = snprintf(text, sizeof text, "{\"event\":\"");
    memset(text + n, 'e', sizeof text - (size_t)n);
    memcpy(text + length - 2U, "\"}\n", 4);
    send_text(text);
}

TEST(test_line_of_maximum_length_is_accepted_repeatedly) {
    for (int i = 0; i < 10; i++) {
        send_long(IWC_LINE_MAX);
        TEST_ASSERT_EQUAL(IWC_OK, iwc_next(gateway, SOON, &message));
        TEST_ASSERT_EQUAL_size_t(IWC_LINE_MAX, message.length);
    }
}

TEST(test_line_longer_than_the_maximum_ends_the_connection) {
    send_text("{\"event\":\"a\"}\n");
    send_long(IWC_LINE_MAX + 1U);
    expect_event("{\"event\":\"a\"}");
    TEST_ASSERT_EQUAL(IWC_GARBLED, iwc_next(gateway, SOON, &message));
    TEST_ASSERT_TRUE(server_sees_the_end());
}

TEST(test_line_without_newline_ends_the_connection) {
    for (unsigned i = 0; i <= IWC_LINE_MAX / 64U; i++) {
        send_text("{{{{{{{{{{{{{{{{{{{{{{{{{{{{{{{{{{{{{{{{{{{{{{{{{{{{{{{{{{{{{{{{");
    }
    TEST_ASSERT_EQUAL(IWC_GARBLED, iwc_next(gateway, SOON, &message));
}

TEST(test_line_of_garbage_ends_the_connection_after_good_ones) {
    static const char *const bad[] = {"x\n",
                                      "\n",
                                      "{\"ok\":true,\"event\":\"both\"}\n",
                                      "{\"ok\":true,\"ok\":true}\n",
                                      "{\"neither\":1}\n",
                                      "{\"event\":\"\xff\"}\n",
                                      "{\"event\":\"a\",\"b\":01}\n",
                                      "{\"event\":\"a\",\"b\":{\"c\":1}\n"};
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        TEST_ASSERT_EQUAL(IWC_OK, adopt_with(HELLO));
        send_text("{\"event\":\"good\"}\n");
        send_text(bad[i]);
        expect_event("{\"event\":\"good\"}");
        TEST_ASSERT_EQUAL_MESSAGE(IWC_GARBLED, iwc_next(gateway, 0, &message), bad[i]);
        TEST_ASSERT_EQUAL(IWC_GARBLED, iwc_next(gateway, 0, &message));
        TEST_ASSERT_TRUE(server_sees_the_end());
    }
}

TEST(test_line_cut_by_end_of_gateway_is_no_message) {
    const iwc_drive_t command = {.left_mm_s = 100};
    send_text("{\"event\":\"a\"}\n{\"event\":\"b\"}");
    (void)shutdown(server, SHUT_RDWR);
    expect_event("{\"event\":\"a\"}");
    for (int i = 0; i < 3; i++) {
        TEST_ASSERT_EQUAL(IWC_CLOSED, iwc_next(gateway, IWC_FOREVER, &message));
        TEST_ASSERT_EQUAL(IWC_CLOSED, iwc_drive(gateway, &command, SOON, NULL));
    }
    TEST_ASSERT_EQUAL_INT(-1, iwc_fd(gateway));
    TEST_ASSERT_EQUAL(IWC_OK, adopt_with(HELLO));
    TEST_ASSERT_EQUAL_STRING("", receive()); // After the new connection nothing is armed or driven automatically.
    TEST_ASSERT_EQUAL(IWC_TIMEOUT, iwc_next(gateway, 0, &message));
}

// ---- more messages than the client reads ----------------------------------------------------------------------------

TEST(test_flood_of_unread_events_retains_newest_and_count) {
    char text[300];
    uint64_t total = 0;
    int64_t last = -1;
    for (int i = 0; i < 5000; i++) {
        (void)snprintf(text, sizeof text, "{\"event\":\"%s\",\"number\":%d,\"pad\":\"%200s\"}\n",
                       (i % 10 == 0) ? "stop" : "state", i, "");
        send_text(text);
        if (i % 500 == 499) {
            TEST_ASSERT_EQUAL(IWC_TIMEOUT, iwc_ask(gateway, "{\"cmd\":\"status\"}", 0, NULL));
        }
    }
    while (iwc_next(gateway, 0, &message) == IWC_OK) {
        total += message.skipped + 1U;
        TEST_ASSERT_GREATER_THAN(last, iwc_integer(&message, "number").value);
        last = iwc_integer(&message, "number").value;
    }
    TEST_ASSERT_EQUAL_INT64(4999, last);
    TEST_ASSERT_EQUAL_UINT64(5000, total);
}

TEST(test_flood_of_different_events_drops_the_oldest) {
    char text[100];
    uint64_t total = 0;
    int64_t last = -1;
    for (int i = 0; i < 300; i++) {
        (void)snprintf(text, sizeof text, "{\"event\":\"frame\",\"id\":%d,\"kind\":\"received\"}\n", i);
        send_text(text);
    }
    TEST_ASSERT_EQUAL(IWC_OK, iwc_latest(gateway));
    while (iwc_next(gateway, 0, &message) == IWC_OK) {
        total += message.skipped + 1U;
        last = iwc_integer(&message, "id").value;
    }
    TEST_ASSERT_EQUAL_INT64(299, last);
    TEST_ASSERT_EQUAL_UINT64(300, total);
}

TEST(test_latest_retains_one_message_of_each_kind_in_order) {
    send_text(
        "{\"event\":\"fault\",\"cause\":\"overspeed\"}\n{\"event\":\"state\",\"n\":1}\n{\"id\":1,\"ok\":true}\n"
        "{\"event\":\"fault\",\"cause\":\"bus_down\"}\n{\"event\":\"lost\",\"count\":10}\n{\"event\":\"state\",\"n\":2}"
        "\n"
        "{\"event\":\"frame\",\"id\":256,\"kind\":\"echo\"}\n{\"event\":\"frame\",\"id\":256,\"kind\":\"received\"}\n"
        "{\"event\":\"state\",\"n\":3}\n");
    TEST_ASSERT_EQUAL(IWC_OK, iwc_latest(gateway));
    TEST_ASSERT_TRUE(iwc_pending(gateway));
    TEST_ASSERT_EQUAL(IWC_OK, iwc_next(gateway, 0, &message));
    TEST_ASSERT_EQUAL_STRING("{\"event\":\"fault\",\"cause\":\"overspeed\"}", message.text);
    TEST_ASSERT_EQUAL_UINT64(12, message.skipped);
    TEST_ASSERT_EQUAL(IWC_OK, iwc_next(gateway, 0, &message));
    TEST_ASSERT_EQUAL_INT64(1, message.id);
    TEST_ASSERT_EQUAL_UINT64(0, message.skipped);
    expect_event("{\"event\":\"fault\",\"cause\":\"bus_down\"}");
    expect_event("{\"event\":\"frame\",\"id\":256,\"kind\":\"echo\"}");
    expect_event("{\"event\":\"frame\",\"id\":256,\"kind\":\"received\"}");
    expect_event("{\"event\":\"state\",\"n\":3}");
    TEST_ASSERT_FALSE(iwc_pending(gateway));
}

TEST(test_latest_does_not_change_the_current_message) {
    send_text("{\"event\":\"a\"}\n");
    expect_event("{\"event\":\"a\"}");
    send_text("{\"event\":\"b\"}\n{\"event\":\"b\"}\n{\"event\":");
    TEST_ASSERT_EQUAL(IWC_OK, iwc_latest(gateway));
    TEST_ASSERT_EQUAL_STRING("{\"event\":\"a\"}", message.text);
    send_text("\"c\"}\n");
    expect_event("{\"event\":\"b\"}");
    TEST_ASSERT_EQUAL_UINT64(1, message.skipped);
    expect_event("{\"event\":\"c\"}");
}

// ---- driving --------------------------------------------------------------------------------------------------------

TEST(test_drive_is_sent_once_and_never_repeated) {
    const iwc_drive_t command = {.left_mm_s = 300, .right_mm_s = 300};
    TEST_ASSERT_EQUAL(IWC_OK, iwc_drive(gateway, &command, 0, NULL));
    TEST_ASSERT_EQUAL_STRING("{\"id\":1,\"cmd\":\"drive\",\"left_mm_s\":300,\"right_mm_s\":300}\n", receive());
    for (int i = 0; i < 20; i++) {
        (void)iwc_next(gateway, 1, &message);
        (void)iwc_latest(gateway);
    }
    TEST_ASSERT_EQUAL_STRING("", receive());
}

TEST(test_drive_without_replies_is_full_and_dropped) {
    const iwc_drive_t command = {.left_mm_s = 300, .right_mm_s = 300};
    for (unsigned i = 0; i < IWC_DRIVES_MAX; i++) {
        TEST_ASSERT_EQUAL(IWC_OK, iwc_drive(gateway, &command, 0, NULL));
    }
    TEST_ASSERT_EQUAL(IWC_FULL, iwc_drive(gateway, &command, 0, NULL));
    TEST_ASSERT_EQUAL(IWC_FULL, iwc_twist(gateway, 1, 1, 0, NULL));
    (void)receive();
    send_text("{\"id\":1,\"ok\":true}\n");
    TEST_ASSERT_EQUAL_STRING("", receive());
    TEST_ASSERT_EQUAL(IWC_OK,
                      iwc_drive(gateway, &command, 0, NULL)); // A reply has arrived; the client need not read it first.
    TEST_ASSERT_EQUAL(IWC_FULL, iwc_drive(gateway, &command, 0, NULL));
    TEST_ASSERT_EQUAL(IWC_TIMEOUT,
                      iwc_ask(gateway, "{\"cmd\":\"status\"}", 0, NULL)); // All other requests are still sent.
    TEST_ASSERT_NOT_NULL(strstr(receive(), "status"));
}

/// Fills the socket to the gateway.
static void stuff(void) {
    const int buffer_size = 1;
    int64_t id = 0;
    TEST_ASSERT_EQUAL_INT(0, setsockopt(iwc_fd(gateway), SOL_SOCKET, SO_SNDBUF, &buffer_size, sizeof buffer_size));
    for (int i = 0; i < 10000; i++) {
        const iwc_result_t result = iwc_send(gateway, "{\"cmd\":\"hello\"}", 0, &id);
        if (result == IWC_FULL) {
            return;
        }
        TEST_ASSERT_EQUAL(IWC_OK, result);
    }
    TEST_FAIL_MESSAGE("the socket never fills");
}

TEST(test_drive_on_full_socket_is_never_sent_later) {
    const iwc_drive_t command = {.left_mm_s = 300, .right_mm_s = 300};
    stuff();
    for (unsigned i = 0; i <= IWC_DRIVES_MAX; i++) {
        TEST_ASSERT_EQUAL(IWC_FULL, iwc_drive(gateway, &command, (i == 0) ? 2 : 0, NULL));
    }
    (void)receive();
    TEST_ASSERT_NULL(strstr(received, "drive"));
    TEST_ASSERT_EQUAL(IWC_TIMEOUT, iwc_next(gateway, 1, &message));
    TEST_ASSERT_EQUAL(IWC_TIMEOUT, iwc_ask(gateway, "{\"cmd\":\"status\"}", 1, NULL));
    TEST_ASSERT_NULL(strstr(receive(), "drive"));
    TEST_ASSERT_NOT_NULL(strstr(received, "status"));
    TEST_ASSERT_EQUAL(IWC_OK, iwc_drive(gateway, &command, 0, NULL)); // An unsent drive does not wait for a reply.
}

TEST(test_drive_sent_in_part_ends_the_connection) {
    char text[IWC_REQUEST_MAX - 20U];
    char line[] = "{\"id\":1,\"cmd\":\"hello\"}\n";
    int64_t id = 0;
    (void)snprintf(text, sizeof text, "{\"cmd\":\"drive\",\"x\":\"%*s\"}", (int)sizeof text - 30, "");
    stuff();
    TEST_ASSERT_EQUAL(sizeof line - 1U, recv(server, line, sizeof line - 1U, 0)); // Makes space for a part.
    TEST_ASSERT_EQUAL(IWC_CLOSED, iwc_send(gateway, text, 0, &id));
    TEST_ASSERT_NOT_NULL(strstr(receive(), "drive"));
    TEST_ASSERT_NULL(strchr(strstr(received, "drive"), '\n'));
    TEST_ASSERT_TRUE(server_sees_the_end());
}

TEST(test_stop_without_reply_ends_the_connection) {
    TEST_ASSERT_EQUAL(IWC_TIMEOUT, iwc_stop(gateway, 1));
    TEST_ASSERT_TRUE(server_sees_the_end());
    TEST_ASSERT_EQUAL(IWC_CLOSED, iwc_next(gateway, 0, &message));
    TEST_ASSERT_EQUAL(IWC_OK, adopt_with(HELLO));
    stuff();
    TEST_ASSERT_EQUAL(IWC_FULL, iwc_estop(gateway, NULL, 1));
    TEST_ASSERT_EQUAL_INT(-1, iwc_fd(gateway));
}

TEST(test_drive_to_a_closed_gateway_raises_no_signal) {
    const iwc_drive_t command = {.left_mm_s = 300};
    send_text("{\"event\":\"stop\"}\n");
    (void)shutdown(server, SHUT_RDWR);
    TEST_ASSERT_EQUAL(IWC_CLOSED, iwc_drive(gateway, &command, 0, NULL));
    expect_event("{\"event\":\"stop\"}"); // The last event of the gateway is not lost.
    TEST_ASSERT_EQUAL(IWC_CLOSED, iwc_next(gateway, 0, &message));
}

// ---- processes and signals ------------------------------------------------------------------------------------------

TEST(test_close_ends_the_connection_despite_a_duplicate) {
    const int copy = dup(iwc_fd(gateway));
    iwc_close(gateway);
    TEST_ASSERT_TRUE(server_sees_the_end());
    (void)close(copy);
}

TEST(test_fork_child_neither_drives_nor_ends_the_connection) {
    int status = -1;
    const iwc_drive_t command = {.left_mm_s = 300};
    const pid_t child = fork();
    if (child == 0) {
        const bool good = iwc_drive(gateway, &command, 0, NULL) == IWC_CLOSED;
        iwc_free(gateway);
        _exit(good ? 0 : 1);
    }
    TEST_ASSERT_EQUAL_INT(child, waitpid(child, &status, 0));
    TEST_ASSERT_EQUAL_INT(0, status);
    TEST_ASSERT_EQUAL_STRING("", receive());
    TEST_ASSERT_FALSE(server_sees_the_end());
    TEST_ASSERT_EQUAL(IWC_OK, iwc_drive(gateway, &command, 0, NULL));
}

static void note(int number) {
    (void)number;
}

TEST(test_wait_ends_with_an_unblocked_signal) {
    struct sigaction action = {.sa_handler = note};
    struct sigaction before;
    sigset_t blocked;
    sigset_t usual;
    (void)sigemptyset(&blocked);
    (void)sigaddset(&blocked, SIGUSR1);
    (void)sigaction(SIGUSR1, &action, &before);
    (void)sigprocmask(SIG_BLOCK, &blocked, &usual);
    (void)raise(SIGUSR1);
    TEST_ASSERT_EQUAL(IWC_TIMEOUT, iwc_next(gateway, 1, &message));
    iwc_let_in(gateway, &usual);
    TEST_ASSERT_EQUAL(IWC_INTERRUPTED, iwc_next(gateway, IWC_FOREVER, &message));
    TEST_ASSERT_EQUAL(IWC_TIMEOUT, iwc_next(gateway, 1, &message));
    (void)sigprocmask(SIG_SETMASK, &usual, NULL);
    (void)sigaction(SIGUSR1, &before, NULL);
}

TEST(test_words_exist_for_every_result) {
    for (int i = IWC_OK; i <= IWC_SEVERAL; i++) {
        TEST_ASSERT_GREATER_THAN(3, strlen(iwc_words((iwc_result_t)i)));
    }
    TEST_ASSERT_EQUAL_STRING("", iwc_words((iwc_result_t)99));
}
