// SPDX-License-Identifier: MIT
// A connection of the northbound socket: bytes in, lines out.
#include "sockets/log.h"
#include "sockets/sock_client.h"

#include "unit.h"

#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

static sock_client_t client;
static int peer;
static char big[SOCK_REPLY_MAX];

void setUp(void) {
    int pair[2];
    TEST_ASSERT_EQUAL_INT(0, socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0, pair));
    memset(&client, 0, sizeof client);
    client.id = 7;
    client.pid = 42;
    client.fd = pair[0];
    peer = pair[1];
    memset(big, 'x', sizeof big);
}

void tearDown(void) {
    (void)close(client.fd);
    (void)close(peer);
}

static void send_text(const char *text) {
    TEST_ASSERT_EQUAL_INT((int)strlen(text), (int)send(peer, text, strlen(text), MSG_NOSIGNAL));
    sock_client_read(&client);
}

static void expect_line(const char *text) {
    size_t length = 0;
    const char *line = sock_client_line(&client, &length);
    TEST_ASSERT_NOT_NULL(line);
    TEST_ASSERT_EQUAL_UINT(strlen(text), length);
    TEST_ASSERT_EQUAL_INT(0, memcmp(text, line, length));
    sock_client_drop_line(&client, client.in, length);
}

static void expect_no_line(void) {
    size_t length = 0;
    TEST_ASSERT_NULL(sock_client_line(&client, &length));
}

/// Reads all bytes that the other side can read now.
static size_t drain(char *text, size_t size) {
    size_t total = 0;
    ssize_t count = 1;
    while (count > 0) {
        sock_client_flush(&client);
        count = recv(peer, (text == NULL) ? big : &text[total], (text == NULL) ? sizeof big : size - total, 0);
        total += (count > 0) ? (size_t)count : 0U;
    }
    return total;
}

TEST(test_client_bytes_become_a_line_only_at_the_newline) {
    const char *text = "{\"cmd\":\"stop\"}";
    for (const char *c = text; *c != '\0'; c++) {
        const char byte[2] = {*c, '\0'};
        send_text(byte);
        expect_no_line();
    }
    send_text("\n");
    expect_line(text);
    expect_no_line();
}

TEST(test_client_lines_of_one_read_are_in_order_and_a_part_waits) {
    send_text("one\n\ntwo\nhal");
    expect_line("one");
    expect_line("");
    expect_line("two");
    expect_no_line();
    send_text("f\n");
    expect_line("half");
}

TEST(test_client_part_of_a_line_at_the_end_is_no_line) {
    send_text("stop");
    (void)shutdown(peer, SHUT_WR);
    sock_client_read(&client);
    TEST_ASSERT_EQUAL_INT(SOCK_ENDED, client.phase);
    expect_no_line();
}

TEST(test_client_line_of_4096_bytes_fits_and_4097_are_too_long) {
    TEST_ASSERT_EQUAL_INT(IWN_LINE_MAX, (int)send(peer, big, IWN_LINE_MAX, 0));
    sock_client_read(&client);
    TEST_ASSERT_FALSE(sock_client_line_too_long(&client));
    send_text("\n");
    TEST_ASSERT_FALSE(sock_client_line_too_long(&client));
    sock_client_drop_line(&client, client.in, IWN_LINE_MAX);
    TEST_ASSERT_EQUAL_UINT(0, client.in_length);
    TEST_ASSERT_EQUAL_INT(IWN_LINE_MAX + 1, (int)send(peer, big, IWN_LINE_MAX + 1U, 0));
    sock_client_read(&client);
    TEST_ASSERT_TRUE(sock_client_line_too_long(&client));
}

TEST(test_client_reply_is_sent_completely) {
    char text[64] = "";
    sock_client_reply(&client, "hello\n", 6);
    TEST_ASSERT_FALSE(sock_client_flushed(&client));
    TEST_ASSERT_EQUAL_UINT(6, drain(text, sizeof text));
    TEST_ASSERT_EQUAL_STRING("hello\n", text);
    TEST_ASSERT_TRUE(sock_client_flushed(&client));
}

TEST(test_client_that_does_not_read_gets_the_count_of_lost_events) {
    unsigned sent = 0;
    while (client.lost < 5U) { // First the socket is full, then half of the buffer.
        sock_client_event(&client, big, 1000);
        sock_client_flush(&client);
        TEST_ASSERT_LESS_THAN_UINT(10000, sent++);
    }
    TEST_ASSERT_FALSE(sock_client_is_broken(&client));
    (void)drain(NULL, 0);
    sock_client_event(&client, "after\n", 6);
    char text[128] = "";
    (void)drain(text, sizeof text);
    TEST_ASSERT_EQUAL_STRING("{\"event\":\"lost\",\"count\":5}\nafter\n", text);
    TEST_ASSERT_EQUAL_UINT32(0, client.lost);
}

TEST(test_client_space_for_the_longest_reply_is_reserved) {
    while (client.lost == 0U) {
        sock_client_event(&client, big, 1000);
    }
    sock_client_reply(&client, big, SOCK_REPLY_MAX);
    TEST_ASSERT_FALSE(sock_client_is_broken(&client));
    sock_client_reply(&client, big, SOCK_REPLY_MAX);
    TEST_ASSERT_TRUE(sock_client_is_broken(&client));
}

TEST(test_client_event_to_a_closing_client_is_dropped) {
    sock_client_finish(&client, 1000);
    sock_client_event(&client, "x\n", 2);
    TEST_ASSERT_TRUE(sock_client_flushed(&client));
    TEST_ASSERT_EQUAL_UINT64(1000U + SOCK_CLOSING_US, client.close_us);
    sock_client_finish(&client, 5000); // Only the first call sets the time.
    TEST_ASSERT_EQUAL_UINT64(1000U + SOCK_CLOSING_US, client.close_us);
}

TEST(test_client_disconnected_is_detected_at_a_write) {
    (void)close(peer);
    sock_client_reply(&client, "x\n", 2);
    sock_client_flush(&client);
    TEST_ASSERT_TRUE(sock_client_is_broken(&client));
    peer = -1;
}

TEST(test_log_line_has_no_control_characters) {
    char line[256] = "";
    int ends[2];
    sock_log_t log;
    const int before = dup(STDERR_FILENO);
    TEST_ASSERT_EQUAL_INT(0, pipe(ends));
    TEST_ASSERT_EQUAL_INT(STDERR_FILENO, dup2(ends[1], STDERR_FILENO));
    sock_log_open(&log, SOCK_LOG_INFO);
    sock_log(&log, SOCK_LOG_INFO, "from %s", "\x1b[2J\n\xC2\x9B\xE2\x80\xAE\x9B\xC3\xA9");
    sock_log_close(&log);
    (void)dup2(before, STDERR_FILENO);
    (void)close(before);
    (void)close(ends[1]);
    TEST_ASSERT_GREATER_THAN(0, read(ends[0], line, sizeof line - 1U));
    (void)close(ends[0]);
    TEST_ASSERT_EQUAL_STRING("iwheel-gateway: info: from ?[2J????\xC3\xA9\n", line);
}

TEST(test_client_request_within_25_ms_of_caught_up_was_sent_now) {
    send_text("{}\n");
    client.caught_up_us = 1000000;
    TEST_ASSERT_EQUAL_UINT64(1025000, sock_client_sent_us(&client, 1025000, 0));
    TEST_ASSERT_EQUAL_UINT64(1000000, sock_client_sent_us(&client, 1025001, 0));
    TEST_ASSERT_EQUAL_UINT64(1000000, sock_client_sent_us(&client, 1000001, 1000001));
}

TEST(test_client_with_an_unread_line_is_not_caught_up) {
    send_text("{}\n{}\n");
    sock_client_note_caught_up(&client, 5);
    expect_line("{}");
    sock_client_note_caught_up(&client, 6);
    TEST_ASSERT_EQUAL_UINT64(0, client.caught_up_us);
    expect_line("{}");
    sock_client_note_caught_up(&client, 7);
    TEST_ASSERT_EQUAL_UINT64(7, client.caught_up_us);
}

TEST(test_client_caught_up_time_never_decreases) {
    sock_client_check_caught_up(&client, 9);
    sock_client_note_caught_up(&client, 8);
    TEST_ASSERT_EQUAL_UINT64(9, client.caught_up_us);
}

TEST(test_client_with_bytes_in_its_socket_is_not_caught_up) {
    TEST_ASSERT_EQUAL_INT(3, (int)send(peer, "{}\n", 3, MSG_NOSIGNAL));
    sock_client_check_caught_up(&client, 5);
    TEST_ASSERT_EQUAL_UINT64(0, client.caught_up_us);
    sock_client_read(&client);
    expect_line("{}");
    sock_client_check_caught_up(&client, 6);
    TEST_ASSERT_EQUAL_UINT64(6, client.caught_up_us);
}

TEST(test_client_with_a_full_buffer_is_not_caught_up) {
    for (int i = 0; i < 3; i++) {
        TEST_ASSERT_EQUAL_INT(4000, (int)send(peer, big, 4000, MSG_NOSIGNAL));
    }
    sock_client_read(&client);
    sock_client_note_caught_up(&client, 5);
    TEST_ASSERT_EQUAL_UINT64(0, client.caught_up_us);
}

TEST(test_client_full_or_closing_is_not_read) {
    const size_t capacity = sizeof client.in;
    while (client.in_length < capacity) {
        const size_t part = (capacity - client.in_length < sizeof big) ? capacity - client.in_length : sizeof big;
        TEST_ASSERT_EQUAL_INT((int)part, (int)send(peer, big, part, MSG_NOSIGNAL));
        sock_client_read(&client);
    }
    TEST_ASSERT_EQUAL_INT(1, (int)send(peer, "x", 1, MSG_NOSIGNAL));
    sock_client_read(&client);
    TEST_ASSERT_NOT_EQUAL_INT(SOCK_ENDED, client.phase);
    TEST_ASSERT_TRUE(sock_client_line_too_long(&client));
    client.in_length = 0;
    client.phase = SOCK_CLOSING;
    sock_client_read(&client);
    TEST_ASSERT_EQUAL_UINT(0, client.in_length);
}
