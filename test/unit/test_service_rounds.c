// SPDX-License-Identifier: MIT
// Many clients at the same time: each gets its turn, the holder of the lease is first, and no client uses all the time.
#include "daemon.h"
#include "sockets/sock_clients.h"

#include "iwheel_linux/clock.h"

#include "unit.h"

#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <unistd.h>

#define CROWD 60U
/// Lines of each client; a turn reads four.
#define LINES 4U

static gw_daemon_t *daemon_;
static int peer[CROWD];
static char drained[1U << 20];

static void begin_core(void) {
    const iwl_estop_config_t estop = {.name = "none"};
    const char *cause = "";
    gateway_config_default(&daemon_->config);
    gw_daemon_compose(daemon_);
    TEST_ASSERT_EQUAL_INT(0, gw_box_open(&daemon_->box, &(gw_box_config_t){.blackbox_s = 0}));
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, iwl_hal_open(&daemon_->wheels.hal, "unix:/nonexistent/iwheel-bus", &estop, &cause),
                                  cause);
    daemon_->wheels.now_us = iwl_clock_now_us();
    TEST_ASSERT_EQUAL_INT(IW_CONFIG_OK,
                          gw_wheels_begin(&daemon_->wheels, &daemon_->config.core, daemon_->box.ring, false));
}

static void connect_crowd(void) {
    for (unsigned i = 0; i < CROWD; i++) {
        int pair[2];
        sock_client_t *client = &daemon_->clients.client[i];
        TEST_ASSERT_EQUAL_INT(0, socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0, pair));
        client->id = i + 1U;
        client->fd = pair[0];
        peer[i] = pair[1];
        daemon_->clients.count[SOCK_DRIVE]++;
        daemon_->clients.open[SOCK_DRIVE] |= UINT64_C(1) << i;
    }
}

static void all_ask(void) {
    static const char line[] = "{\"cmd\":\"status\"}\n";
    for (unsigned i = 0; i < CROWD; i++) {
        for (unsigned n = 0; n < LINES; n++) {
            TEST_ASSERT_EQUAL_INT(sizeof line - 1U, send(peer[i], line, sizeof line - 1U, MSG_NOSIGNAL));
        }
        daemon_->clients.client[i].readable = true;
    }
}

void setUp(void) {
    daemon_ = (gw_daemon_t *)calloc(1, sizeof *daemon_);
    daemon_->clients.epoll_fd = epoll_create1(EPOLL_CLOEXEC);
    sock_log_open(&daemon_->log, SOCK_LOG_ERROR);
    begin_core();
    connect_crowd();
    all_ask();
}

void tearDown(void) {
    for (unsigned i = 0; i < CROWD; i++) {
        (void)close(daemon_->clients.client[i].fd);
        (void)close(peer[i]);
    }
    gw_box_close(&daemon_->box);
    iwl_hal_close(&daemon_->wheels.hal);
    (void)close(daemon_->clients.epoll_fd);
    sock_log_close(&daemon_->log);
    free(daemon_);
}

static bool is_served(unsigned i) {
    return !daemon_->clients.client[i].readable && daemon_->clients.client[i].in_length == 0U;
}

static unsigned served(void) {
    unsigned count = 0;
    for (unsigned i = 0; i < CROWD; i++) {
        count += is_served(i) ? 1U : 0U;
    }
    return count;
}

TEST(test_round_serves_a_part_of_the_clients_and_is_busy) {
    sock_service_clients(&daemon_->clients, IW_CLIENT_NONE);
    TEST_ASSERT_GREATER_THAN_UINT(0, served());
    TEST_ASSERT_LESS_THAN_UINT(CROWD, served());
    TEST_ASSERT_TRUE(sock_service_is_busy(&daemon_->clients));
}

TEST(test_round_continues_after_the_last_served_client) {
    unsigned before = 0;
    for (unsigned rounds = 0; served() < CROWD; rounds++) {
        sock_service_clients(&daemon_->clients, IW_CLIENT_NONE);
        TEST_ASSERT_GREATER_THAN_UINT(before, served());
        TEST_ASSERT_LESS_THAN_UINT(CROWD, rounds);
        for (unsigned i = 0; i < served(); i++) {
            TEST_ASSERT_TRUE_MESSAGE(is_served(i), "in order, no client twice before each client once");
        }
        before = served();
    }
    sock_service_clients(&daemon_->clients, IW_CLIENT_NONE);
    TEST_ASSERT_FALSE(daemon_->clients.some_wait);
}

TEST(test_round_begins_with_the_holder_of_the_lease) {
    sock_service_clients(&daemon_->clients, CROWD);
    TEST_ASSERT_TRUE(is_served(CROWD - 1U));
    TEST_ASSERT_LESS_THAN_UINT(CROWD, served());
}

TEST(test_round_client_not_served_is_not_caught_up) {
    daemon_->clients.now_us = iwl_clock_now_us();
    sock_service_clients(&daemon_->clients, IW_CLIENT_NONE);
    TEST_ASSERT_FALSE(is_served(CROWD - 1U));
    TEST_ASSERT_EQUAL_UINT64(0, daemon_->clients.client[CROWD - 1U].caught_up_us);
    TEST_ASSERT_EQUAL_UINT64(daemon_->clients.now_us, daemon_->clients.client[0].caught_up_us);
}

TEST(test_round_of_sending_reaches_every_client) {
    while (served() < CROWD) {
        sock_service_clients(&daemon_->clients, IW_CLIENT_NONE);
    }
    for (unsigned rounds = 0; rounds == 0U || daemon_->clients.lines_wait; rounds++) {
        sock_service_flush(&daemon_->clients, IW_CLIENT_NONE);
        TEST_ASSERT_LESS_THAN_UINT(CROWD, rounds);
    }
    for (unsigned i = 0; i < CROWD; i++) {
        TEST_ASSERT_GREATER_THAN_INT(1000, recv(peer[i], drained, sizeof drained, MSG_DONTWAIT));
    }
}

/// Waiting bytes are moved to the front many times.
TEST(test_lines_are_complete_and_in_order_for_a_slow_reader) {
    sock_client_t *client = &daemon_->clients.client[0];
    char line[64];
    char expected[sizeof line];
    size_t length = 0;
    unsigned total = 0;
    unsigned read_back = 0;
    while (read_back < 20000U) {
        while (client->out_end - client->out_start < SOCK_OUT_SIZE - sizeof line) {
            (void)snprintf(line, sizeof line, "{\"line\":%u,\"and\":\"something to fill it\"}\n", total++);
            sock_client_reply(client, line, strlen(line));
        }
        TEST_ASSERT_FALSE(sock_client_is_broken(client));
        sock_client_flush(client);
        const ssize_t count = recv(peer[0], &drained[length], 4999U, MSG_DONTWAIT);
        TEST_ASSERT_GREATER_THAN_INT(0, (int)count);
        length += (size_t)count;
        for (char *end = (char *)memchr(drained, '\n', length); end != NULL;
             end = (char *)memchr(drained, '\n', length)) {
            const size_t whole = (size_t)(end - drained) + 1U;
            (void)snprintf(expected, sizeof expected, "{\"line\":%u,\"and\":\"something to fill it\"}\n", read_back++);
            TEST_ASSERT_EQUAL_size_t(strlen(expected), whole);
            TEST_ASSERT_EQUAL_MEMORY(expected, drained, whole);
            length -= whole;
            memmove(drained, &drained[whole], length);
        }
    }
}
