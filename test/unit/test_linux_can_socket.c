// SPDX-License-Identifier: MIT
// The socket of the bus against what the kernel promises: what is asked for, what an error means, what is sent. The calls are this file's own.
#include "socketcan_socket.h"

#include "unity.h"

#include <errno.h>
#include <fcntl.h>
#include <linux/can/raw.h>
#include <string.h>
#include <unistd.h>

#define ASKED_MAX 16U

static struct {
    int level;
    int name;
    int value;
} asked[ASKED_MAX];
static unsigned count;
static int refused;   // The option that the kernel does not take; 0: it takes all.
static int come;      // What recvmmsg says: frames, or minus an errno.
static ssize_t taken; // What send says; negative: minus an errno.
static bool unknown;  // CAN, to this kernel.
static int before;    // The errno that a call of before has left.
static iw_socketcan_socket_t bus;

int socket(int domain, int type, int protocol) {
    TEST_ASSERT_EQUAL_INT(PF_CAN, domain);
    TEST_ASSERT_EQUAL_INT(CAN_RAW, protocol);
    TEST_ASSERT_EQUAL_INT(SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, type);
    if (unknown) {
        errno = EAFNOSUPPORT;
        return -1;
    }
    return open("/dev/null", O_RDWR | O_CLOEXEC);
}

int setsockopt(int fd, int level, int name, const void *value, socklen_t size) {
    TEST_ASSERT_GREATER_OR_EQUAL_INT(0, fd);
    TEST_ASSERT_LESS_THAN_UINT(ASKED_MAX, count);
    asked[count].level = level;
    asked[count].name = name;
    if (size == sizeof asked[count].value) {
        memcpy(&asked[count].value, value, sizeof asked[count].value);
    }
    count++;
    errno = ENOPROTOOPT;
    return (refused != 0 && name == refused) ? -1 : 0;
}

int bind(int fd, __CONST_SOCKADDR_ARG address, socklen_t size) {
    (void)fd;
    (void)address;
    TEST_ASSERT_EQUAL_UINT(sizeof(struct sockaddr_can), size);
    return 0;
}

int recvmmsg(int fd, struct mmsghdr *messages, unsigned room, int flags, struct timespec *timeout) {
    (void)fd;
    (void)timeout;
    TEST_ASSERT_EQUAL_INT(MSG_DONTWAIT, flags);
    TEST_ASSERT_LESS_OR_EQUAL_INT((int)room, come);
    for (int i = 0; i < come; i++) {
        messages[i].msg_len = sizeof(struct can_frame);
        messages[i].msg_hdr.msg_flags = 0;
        messages[i].msg_hdr.msg_controllen = 0;
    }
    errno = (come < 0) ? -come : before;
    return (come < 0) ? -1 : come;
}

ssize_t send(int fd, const void *bytes, size_t size, int flags) {
    (void)fd;
    (void)bytes;
    TEST_ASSERT_EQUAL_UINT(sizeof(struct can_frame), size);
    TEST_ASSERT_EQUAL_INT(MSG_DONTWAIT | MSG_NOSIGNAL, flags);
    errno = (taken < 0) ? (int)-taken : before;
    return (taken < 0) ? -1 : taken;
}

void setUp(void) {
    memset(asked, 0, sizeof asked);
    count = 0;
    refused = come = before = 0;
    taken = (ssize_t)sizeof(struct can_frame);
    iw_socketcan_socket_init(&bus);
}

void tearDown(void) {
    iw_socketcan_socket_close(&bus);
}

static bool was_asked(int level, int name, int value) {
    for (unsigned i = 0; i < count; i++) {
        if (asked[i].level == level && asked[i].name == name && asked[i].value == value) {
            return true;
        }
    }
    return false;
}

static void test_can_socket_of_ours_asks_for_errors_echoes_and_what_was_lost(void) {
    bus.lost = 7;
    bus.count = 5;
    TEST_ASSERT_EQUAL_INT(0, iw_socketcan_socket_open(&bus, 3, IW_SOCKETCAN_OURS));
    TEST_ASSERT_TRUE(was_asked(SOL_CAN_RAW, CAN_RAW_ERR_FILTER, (int)iw_can_error_mask()));
    TEST_ASSERT_TRUE(was_asked(SOL_CAN_RAW, CAN_RAW_RECV_OWN_MSGS, 1));
    TEST_ASSERT_TRUE(was_asked(SOL_CAN_RAW, CAN_RAW_FD_FRAMES, 1));
    TEST_ASSERT_TRUE(was_asked(SOL_SOCKET, SO_RXQ_OVFL, 1));
    TEST_ASSERT_FALSE(was_asked(SOL_CAN_RAW, CAN_RAW_JOIN_FILTERS, 1));
    TEST_ASSERT_EQUAL_UINT32(0, bus.lost);
    TEST_ASSERT_EQUAL_UINT32(0, bus.count);
}

static void test_can_socket_of_others_joins_its_filters_and_wants_no_errors(void) {
    TEST_ASSERT_EQUAL_INT(0, iw_socketcan_socket_open(&bus, 3, IW_SOCKETCAN_OTHERS));
    TEST_ASSERT_TRUE(was_asked(SOL_CAN_RAW, CAN_RAW_JOIN_FILTERS, 1));
    TEST_ASSERT_FALSE(was_asked(SOL_CAN_RAW, CAN_RAW_RECV_OWN_MSGS, 1));
}

static void test_can_socket_without_what_it_needs_is_not_opened(void) {
    static const int needed[] = {CAN_RAW_FILTER, CAN_RAW_ERR_FILTER, CAN_RAW_RECV_OWN_MSGS, SO_RXQ_OVFL};
    for (size_t i = 0; i < sizeof needed / sizeof needed[0]; i++) {
        count = 0;
        refused = needed[i];
        TEST_ASSERT_EQUAL_INT(ENOPROTOOPT, iw_socketcan_socket_open(&bus, 3, IW_SOCKETCAN_OURS));
        TEST_ASSERT_EQUAL_INT(-1, bus.fd);
    }
    count = 0;
    refused = CAN_RAW_JOIN_FILTERS;
    TEST_ASSERT_EQUAL_INT(ENOPROTOOPT, iw_socketcan_socket_open(&bus, 3, IW_SOCKETCAN_OTHERS));
}

static void test_can_socket_tells_frames_nothing_and_an_interface_that_went(void) {
    TEST_ASSERT_EQUAL_INT(0, iw_socketcan_socket_open(&bus, 3, IW_SOCKETCAN_OURS));
    before = ENODEV;
    come = (int)IW_SOCKETCAN_BATCH;
    TEST_ASSERT_EQUAL_INT(0, iw_socketcan_socket_fill(&bus));
    TEST_ASSERT_EQUAL_UINT32(IW_SOCKETCAN_BATCH, bus.count);
    TEST_ASSERT_FALSE(bus.drained);
    come = 0;
    TEST_ASSERT_EQUAL_INT(0, iw_socketcan_socket_fill(&bus));
    TEST_ASSERT_TRUE(bus.drained);
    come = -EAGAIN;
    TEST_ASSERT_EQUAL_INT(0, iw_socketcan_socket_fill(&bus));
    come = -ENETDOWN;
    TEST_ASSERT_EQUAL_INT(ENETDOWN, iw_socketcan_socket_fill(&bus));
}

static void test_can_socket_that_is_emptied_keeps_nothing_and_is_not_known_to_be_drained(void) {
    TEST_ASSERT_EQUAL_INT(0, iw_socketcan_socket_open(&bus, 3, IW_SOCKETCAN_OURS));
    come = 3;
    TEST_ASSERT_EQUAL_INT(0, iw_socketcan_socket_drop(&bus));
    TEST_ASSERT_TRUE(iw_socketcan_socket_is_empty(&bus));
    TEST_ASSERT_EQUAL_UINT32(0, bus.count);
    TEST_ASSERT_FALSE(bus.drained);
    come = -ENODEV;
    TEST_ASSERT_EQUAL_INT(ENODEV, iw_socketcan_socket_drop(&bus));
}

static void test_can_socket_frame_is_taken_refused_for_now_or_the_bus_is_gone(void) {
    const iw_can_frame_t frame = {.id = IW_ID_LEFT_SETPOINT, .dlc = 5};
    TEST_ASSERT_EQUAL_INT(0, iw_socketcan_socket_open(&bus, 3, IW_SOCKETCAN_OURS));
    TEST_ASSERT_EQUAL_INT(1, iw_socketcan_socket_send(&bus, &frame));
    static const int for_now[] = {EAGAIN, ENOBUFS, EINTR};
    for (size_t i = 0; i < sizeof for_now / sizeof for_now[0]; i++) {
        taken = -for_now[i];
        TEST_ASSERT_EQUAL_INT(0, iw_socketcan_socket_send(&bus, &frame));
    }
    taken = -ENETDOWN;
    TEST_ASSERT_EQUAL_INT(-1, iw_socketcan_socket_send(&bus, &frame));
    taken = 0; // Less than a frame: no frame. What a call of before left says nothing.
    before = EAGAIN;
    TEST_ASSERT_EQUAL_INT(-1, iw_socketcan_socket_send(&bus, &frame));
}

static void test_can_socket_that_the_kernel_does_not_know_is_told_as_such(void) {
    unknown = true;
    memset(&bus, 0xA5, sizeof bus);
    const int error = iw_socketcan_socket_open(&bus, 3, IW_SOCKETCAN_OURS);
    unknown = false;
    TEST_ASSERT_EQUAL_INT(EAFNOSUPPORT, error);
    TEST_ASSERT_EQUAL_INT(-1, bus.fd);
    TEST_ASSERT_EQUAL_UINT(0, count);
}

static void test_can_socket_in_use_is_that_descriptor_and_a_hub_only_if_it_is_one(void) {
    iw_socketcan_socket_use(&bus, 77, true);
    TEST_ASSERT_EQUAL_INT(77, bus.fd);
    TEST_ASSERT_TRUE(bus.is_hub);
    TEST_ASSERT_EQUAL_INT(0, iw_socketcan_socket_open(&bus, 3, IW_SOCKETCAN_OURS));
    TEST_ASSERT_FALSE(bus.is_hub);
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_can_socket_of_ours_asks_for_errors_echoes_and_what_was_lost);
    RUN_TEST(test_can_socket_of_others_joins_its_filters_and_wants_no_errors);
    RUN_TEST(test_can_socket_without_what_it_needs_is_not_opened);
    RUN_TEST(test_can_socket_tells_frames_nothing_and_an_interface_that_went);
    RUN_TEST(test_can_socket_that_is_emptied_keeps_nothing_and_is_not_known_to_be_drained);
    RUN_TEST(test_can_socket_frame_is_taken_refused_for_now_or_the_bus_is_gone);
    RUN_TEST(test_can_socket_that_the_kernel_does_not_know_is_told_as_such);
    RUN_TEST(test_can_socket_in_use_is_that_descriptor_and_a_hub_only_if_it_is_one);
    return UNITY_END();
}
