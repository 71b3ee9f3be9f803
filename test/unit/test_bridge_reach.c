// SPDX-License-Identifier: MIT
// Sockets that other machines can reach, as the kernel lists them. The test opens and binds real sockets.
#include "common/reach.h"

#include "unit.h"

#include <arpa/inet.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#define SOCKETS_MAX 8U

static int fds[SOCKETS_MAX];
static unsigned fd_count;
static char text[BRIDGE_REACH_TEXT];

void setUp(void) {
    fd_count = 0;
    memset(text, 0xA5, sizeof text);
}

void tearDown(void) {
    while (fd_count > 0U) {
        (void)close(fds[--fd_count]);
    }
}

/// Opens a socket of this kind at this address with a port that the kernel selects. Returns -1 if the machine has no
/// such address.
static int open_at(int kind, const char *host) {
    union {
        struct sockaddr any;
        struct sockaddr_in v4;
        struct sockaddr_in6 v6;
    } address;
    memset(&address, 0, sizeof address);
    const bool v6 = strchr(host, ':') != NULL;
    address.any.sa_family = v6 ? AF_INET6 : AF_INET;
    const int fd = socket(address.any.sa_family, kind, 0);
    if (fd < 0) {
        return -1;
    }
    fds[fd_count++] = fd;
    if (v6) {
        (void)inet_pton(AF_INET6, host, &address.v6.sin6_addr);
    } else {
        (void)inet_pton(AF_INET, host, &address.v4.sin_addr);
    }
    const socklen_t size = v6 ? sizeof address.v6 : sizeof address.v4;
    return (bind(fd, &address.any, size) == 0) ? fd : -1;
}

static int listen_at(const char *host) {
    const int fd = open_at(SOCK_STREAM, host);
    return (fd >= 0 && listen(fd, 1) == 0) ? fd : -1;
}

static unsigned count(void) {
    return bridge_reach_count(NULL, 0, text);
}

// ---- sockets that count ---------------------------------------------------------------------------------------------

TEST(test_reach_process_without_sockets_has_none) {
    TEST_ASSERT_EQUAL_UINT(0, count());
    TEST_ASSERT_EQUAL_STRING("", text);
}

TEST(test_reach_udp_at_any_address_counts_and_is_named) {
    TEST_ASSERT_TRUE(open_at(SOCK_DGRAM, "0.0.0.0") >= 0);
    TEST_ASSERT_EQUAL_UINT(1, count());
    TEST_ASSERT_EQUAL_STRING_LEN("UDP 0.0.0.0 port ", text, 17);
    TEST_ASSERT_FALSE(bridge_reach_is_local("test", NULL, 0));
}

TEST(test_reach_tcp_counts_after_listen) {
    const int fd = open_at(SOCK_STREAM, "0.0.0.0");
    TEST_ASSERT_EQUAL_UINT(0, count());
    TEST_ASSERT_EQUAL_INT(0, listen(fd, 1));
    TEST_ASSERT_EQUAL_UINT(1, count());
    TEST_ASSERT_EQUAL_STRING_LEN("TCP 0.0.0.0 port ", text, 17);
}

TEST(test_reach_loopback_addresses_do_not_count) {
    TEST_ASSERT_TRUE(open_at(SOCK_DGRAM, "127.0.0.1") >= 0);
    TEST_ASSERT_TRUE(open_at(SOCK_DGRAM, "127.3.2.1") >= 0);
    TEST_ASSERT_TRUE(listen_at("127.0.0.1") >= 0);
    TEST_ASSERT_EQUAL_UINT(0, count());
    TEST_ASSERT_TRUE(bridge_reach_is_local("test", NULL, 0));
}

TEST(test_reach_ipv6_counts_by_its_address) {
    if (open_at(SOCK_DGRAM, "::1") < 0) {
        TEST_IGNORE_MESSAGE("this machine has no IPv6");
    }
    TEST_ASSERT_TRUE(open_at(SOCK_DGRAM, "::ffff:127.0.0.1") >= 0);
    TEST_ASSERT_EQUAL_UINT(0, count());
    TEST_ASSERT_TRUE(open_at(SOCK_DGRAM, "::") >= 0);
    TEST_ASSERT_TRUE(open_at(SOCK_DGRAM, "::ffff:0.0.0.0") >= 0);
    TEST_ASSERT_EQUAL_UINT(2, count());
}

TEST(test_reach_udp_connected_or_unbound_does_not_count) {
    const struct sockaddr_in peer = {.sin_family = AF_INET, .sin_port = 9, .sin_addr = {htonl(INADDR_LOOPBACK)}};
    fds[fd_count++] = socket(AF_INET, SOCK_DGRAM, 0);
    TEST_ASSERT_EQUAL_UINT(0, count());
    TEST_ASSERT_EQUAL_INT(0, connect(open_at(SOCK_DGRAM, "0.0.0.0"), (const struct sockaddr *)&peer, sizeof peer));
    TEST_ASSERT_EQUAL_UINT(0, count());
}

TEST(test_reach_only_the_excepted_socket_does_not_count) {
    const int pair[2] = {-1, listen_at("0.0.0.0")};
    TEST_ASSERT_EQUAL_UINT(0, bridge_reach_count(pair, 2, text));
    TEST_ASSERT_TRUE(bridge_reach_is_local("test", pair, 2));
    TEST_ASSERT_TRUE(listen_at("0.0.0.0") >= 0);
    TEST_ASSERT_EQUAL_UINT(1, bridge_reach_count(pair, 2, text));
    TEST_ASSERT_FALSE(bridge_reach_is_local("test", pair, 2));
}

// ---- bound to lo ----------------------------------------------------------------------------------------------------

TEST(test_reach_sockets_bound_to_lo_still_receive_locally) {
    struct sockaddr_in address;
    socklen_t size = sizeof address;
    char byte = 'a';
    const int fd = open_at(SOCK_DGRAM, "0.0.0.0");
    TEST_ASSERT_TRUE(listen_at("0.0.0.0") >= 0);
    TEST_ASSERT_EQUAL_UINT(2, count());
    TEST_ASSERT_TRUE(bridge_reach_bind_lo());
    TEST_ASSERT_EQUAL_UINT(0, count());
    TEST_ASSERT_EQUAL_INT(0, getsockname(fd, (struct sockaddr *)&address, &size));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    TEST_ASSERT_EQUAL_INT(
        1, sendto(open_at(SOCK_DGRAM, "127.0.0.1"), &byte, 1, 0, (const struct sockaddr *)&address, size));
    TEST_ASSERT_EQUAL_INT(1, recv(fd, &byte, 1, MSG_DONTWAIT));
}

TEST(test_reach_bind_lo_with_unread_datagram_fails) {
    struct sockaddr_in address;
    socklen_t size = sizeof address;
    const int fd = open_at(SOCK_DGRAM, "0.0.0.0");
    TEST_ASSERT_EQUAL_INT(0, getsockname(fd, (struct sockaddr *)&address, &size));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    TEST_ASSERT_EQUAL_INT(1,
                          sendto(open_at(SOCK_DGRAM, "127.0.0.1"), "a", 1, 0, (const struct sockaddr *)&address, size));
    TEST_ASSERT_FALSE(bridge_reach_bind_lo()); // The unread datagram may have come from any machine.
}
