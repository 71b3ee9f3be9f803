// SPDX-License-Identifier: MIT
// The socket of the bus against a fake kernel: options, errors, sent frames. This file replaces the system calls.
#include "socketcan_socket.h"

#include "unit.h"

#include <errno.h>
#include <fcntl.h>
#include <linux/can/raw.h>
#include <string.h>

#define ASKED_MAX 16U

static struct {
    int level;
    int name;
    int value;
} asked[ASKED_MAX];
static unsigned count;
static int refused;   // The option that the kernel refuses; 0: none.
static int come;      // Result of recvmmsg: number of frames, or a negative errno.
static int accepted;  // Most frames that sendmmsg accepts; negative: a negative errno.
static size_t length; // Length that sendmmsg reports for each frame.
static struct can_frame on_bus[IW_SIDES];
static int calls;    // Calls of sendmmsg.
static bool unknown; // The kernel does not support CAN.
static int before;   // The errno that an earlier call has left.
static iwl_socketcan_socket_t bus;

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

int recvmmsg(int fd, struct mmsghdr *messages, unsigned max, int flags, struct timespec *timeout) {
    (void)fd;
    (void)timeout;
    TEST_ASSERT_EQUAL_INT(MSG_DONTWAIT, flags);
    TEST_ASSERT_LESS_OR_EQUAL_INT((int)max, come);
    for (int i = 0; i < come; i++) {
        messages[i].msg_len = sizeof(struct can_frame);
        messages[i].msg_hdr.msg_flags = 0;
        messages[i].msg_hdr.msg_controllen = 0;
    }
    errno = (come < 0) ? -come : before;
    return (come < 0) ? -1 : come;
}

int sendmmsg(int fd, struct mmsghdr *messages, unsigned asked_frames, int flags) {
    TEST_ASSERT_EQUAL_INT(bus.fd, fd);
    TEST_ASSERT_EQUAL_INT(MSG_DONTWAIT | MSG_NOSIGNAL, flags);
    TEST_ASSERT_LESS_OR_EQUAL_UINT(IW_SIDES, asked_frames);
    calls++;
    const int sent = (accepted < (int)asked_frames) ? accepted : (int)asked_frames;
    for (int i = 0; i < sent; i++) {
        TEST_ASSERT_EQUAL_UINT(1, messages[i].msg_hdr.msg_iovlen);
        TEST_ASSERT_EQUAL_UINT(sizeof on_bus[i], messages[i].msg_hdr.msg_iov->iov_len);
        TEST_ASSERT_NULL(messages[i].msg_hdr.msg_name);
        TEST_ASSERT_NULL(messages[i].msg_hdr.msg_control);
        memcpy(&on_bus[i], messages[i].msg_hdr.msg_iov->iov_base, sizeof on_bus[i]);
        messages[i].msg_len = (unsigned)length;
    }
    errno = (accepted < 0) ? -accepted : before;
    return (accepted < 0) ? -1 : sent;
}

void setUp(void) {
    memset(asked, 0, sizeof asked);
    count = 0;
    refused = come = before = calls = 0;
    memset(on_bus, 0xA5, sizeof on_bus);
    accepted = IW_SIDES;
    length = sizeof(struct can_frame);
    iwl_socketcan_socket_init(&bus);
}

void tearDown(void) {
    iwl_socketcan_socket_close(&bus);
}

static const iw_can_frame_t pair[IW_SIDES] = {
    {.id = IW_ID_LEFT_SETPOINT, .dlc = 5, .data = {1, 0, 100, 7, 208}},
    {.id = IW_ID_RIGHT_SETPOINT, .dlc = 5, .data = {1, 255, 156, 7, 208}},
};

static bool was_asked(int level, int name, int value) {
    for (unsigned i = 0; i < count; i++) {
        if (asked[i].level == level && asked[i].name == name && asked[i].value == value) {
            return true;
        }
    }
    return false;
}

TEST(test_can_socket_of_ours_requests_errors_echoes_and_losses) {
    bus.lost = 7;
    bus.count = 5;
    TEST_ASSERT_EQUAL_INT(0, iwl_socketcan_socket_open(&bus, 3, IWL_SOCKETCAN_OURS));
    TEST_ASSERT_TRUE(was_asked(SOL_CAN_RAW, CAN_RAW_ERR_FILTER, (int)iwl_can_error_mask()));
    TEST_ASSERT_TRUE(was_asked(SOL_CAN_RAW, CAN_RAW_RECV_OWN_MSGS, 1));
    TEST_ASSERT_TRUE(was_asked(SOL_CAN_RAW, CAN_RAW_FD_FRAMES, 1));
    TEST_ASSERT_TRUE(was_asked(SOL_SOCKET, SO_RXQ_OVFL, 1));
    TEST_ASSERT_FALSE(was_asked(SOL_CAN_RAW, CAN_RAW_JOIN_FILTERS, 1));
    TEST_ASSERT_EQUAL_UINT32(0, bus.lost);
    TEST_ASSERT_EQUAL_UINT32(0, bus.count);
}

TEST(test_can_socket_of_others_joins_filters_without_echoes) {
    TEST_ASSERT_EQUAL_INT(0, iwl_socketcan_socket_open(&bus, 3, IWL_SOCKETCAN_OTHERS));
    TEST_ASSERT_TRUE(was_asked(SOL_CAN_RAW, CAN_RAW_JOIN_FILTERS, 1));
    TEST_ASSERT_FALSE(was_asked(SOL_CAN_RAW, CAN_RAW_RECV_OWN_MSGS, 1));
}

TEST(test_can_socket_without_a_required_option_is_not_opened) {
    static const int needed[] = {CAN_RAW_FILTER, CAN_RAW_ERR_FILTER, CAN_RAW_RECV_OWN_MSGS, SO_RXQ_OVFL};
    for (size_t i = 0; i < sizeof needed / sizeof needed[0]; i++) {
        count = 0;
        refused = needed[i];
        TEST_ASSERT_EQUAL_INT(ENOPROTOOPT, iwl_socketcan_socket_open(&bus, 3, IWL_SOCKETCAN_OURS));
        TEST_ASSERT_EQUAL_INT(-1, bus.fd);
    }
    count = 0;
    refused = CAN_RAW_JOIN_FILTERS;
    TEST_ASSERT_EQUAL_INT(ENOPROTOOPT, iwl_socketcan_socket_open(&bus, 3, IWL_SOCKETCAN_OTHERS));
}

TEST(test_can_socket_fill_separates_empty_from_interface_down) {
    TEST_ASSERT_EQUAL_INT(0, iwl_socketcan_socket_open(&bus, 3, IWL_SOCKETCAN_OURS));
    before = ENODEV;
    come = (int)IWL_SOCKETCAN_BATCH;
    TEST_ASSERT_EQUAL_INT(0, iwl_socketcan_socket_fill(&bus));
    TEST_ASSERT_EQUAL_UINT32(IWL_SOCKETCAN_BATCH, bus.count);
    TEST_ASSERT_FALSE(bus.drained);
    come = 0;
    TEST_ASSERT_EQUAL_INT(0, iwl_socketcan_socket_fill(&bus));
    TEST_ASSERT_TRUE(bus.drained);
    come = -EAGAIN;
    TEST_ASSERT_EQUAL_INT(0, iwl_socketcan_socket_fill(&bus));
    come = -ENETDOWN;
    TEST_ASSERT_EQUAL_INT(ENETDOWN, iwl_socketcan_socket_fill(&bus));
}

TEST(test_can_socket_drop_empties_it_but_does_not_set_drained) {
    TEST_ASSERT_EQUAL_INT(0, iwl_socketcan_socket_open(&bus, 3, IWL_SOCKETCAN_OURS));
    come = 3;
    TEST_ASSERT_EQUAL_INT(0, iwl_socketcan_socket_drop(&bus));
    TEST_ASSERT_TRUE(iwl_socketcan_socket_is_empty(&bus));
    TEST_ASSERT_EQUAL_UINT32(0, bus.count);
    TEST_ASSERT_FALSE(bus.drained);
    come = -ENODEV;
    TEST_ASSERT_EQUAL_INT(ENODEV, iwl_socketcan_socket_drop(&bus));
}

TEST(test_can_socket_send_separates_busy_from_bus_lost) {
    TEST_ASSERT_EQUAL_INT(0, iwl_socketcan_socket_open(&bus, 3, IWL_SOCKETCAN_OURS));
    TEST_ASSERT_EQUAL_INT(1, iwl_socketcan_socket_send(&bus, pair, 1));
    static const int for_now[] = {EAGAIN, ENOBUFS, EINTR};
    for (size_t i = 0; i < sizeof for_now / sizeof for_now[0]; i++) {
        accepted = -for_now[i];
        TEST_ASSERT_EQUAL_INT(0, iwl_socketcan_socket_send(&bus, pair, 1));
        TEST_ASSERT_EQUAL_INT(0, iwl_socketcan_socket_send(&bus, pair, IW_SIDES));
    }
    accepted = -ENETDOWN;
    TEST_ASSERT_EQUAL_INT(-1, iwl_socketcan_socket_send(&bus, pair, IW_SIDES));
    accepted = 0; // No frame. The errno of an earlier call has no meaning.
    before = EAGAIN;
    TEST_ASSERT_EQUAL_INT(-1, iwl_socketcan_socket_send(&bus, pair, IW_SIDES));
    accepted = 1; // Less than a whole frame counts as no frame.
    length = sizeof(struct can_frame) - 1U;
    TEST_ASSERT_EQUAL_INT(-1, iwl_socketcan_socket_send(&bus, pair, IW_SIDES));
}

TEST(test_can_socket_pair_is_sent_in_one_call_left_first) {
    TEST_ASSERT_EQUAL_INT(0, iwl_socketcan_socket_open(&bus, 3, IWL_SOCKETCAN_OURS));
    TEST_ASSERT_EQUAL_INT(2, iwl_socketcan_socket_send(&bus, pair, IW_SIDES));
    TEST_ASSERT_EQUAL_INT(1, calls);
    for (size_t side = 0; side < IW_SIDES; side++) {
        TEST_ASSERT_EQUAL_HEX32(pair[side].id, on_bus[side].can_id);
        TEST_ASSERT_EQUAL_UINT8(pair[side].dlc, on_bus[side].len);
        TEST_ASSERT_EQUAL_UINT8_ARRAY(pair[side].data, on_bus[side].data, sizeof on_bus[side].data);
    }
}

TEST(test_can_socket_half_sent_pair_reports_one_frame) {
    TEST_ASSERT_EQUAL_INT(0, iwl_socketcan_socket_open(&bus, 3, IWL_SOCKETCAN_OURS));
    accepted = 1;
    before = ENOBUFS;
    TEST_ASSERT_EQUAL_INT(1, iwl_socketcan_socket_send(&bus, pair, IW_SIDES));
    TEST_ASSERT_EQUAL_INT(1, calls); // The port does not retry the second frame.
}

TEST(test_can_socket_call_sends_no_more_frames_than_wheels) {
    iw_can_frame_t many[IW_SIDES + 1U] = {{.id = 1}, {.id = 2}, {.id = 3}};
    TEST_ASSERT_EQUAL_INT(0, iwl_socketcan_socket_open(&bus, 3, IWL_SOCKETCAN_OURS));
    TEST_ASSERT_EQUAL_INT(2, iwl_socketcan_socket_send(&bus, many, IW_SIDES + 1U));
}

TEST(test_can_socket_unknown_to_the_kernel_reports_eafnosupport) {
    unknown = true;
    memset(&bus, 0xA5, sizeof bus);
    const int error = iwl_socketcan_socket_open(&bus, 3, IWL_SOCKETCAN_OURS);
    unknown = false;
    TEST_ASSERT_EQUAL_INT(EAFNOSUPPORT, error);
    TEST_ASSERT_EQUAL_INT(-1, bus.fd);
    TEST_ASSERT_EQUAL_UINT(0, count);
}

TEST(test_can_socket_is_a_hub_only_when_used_as_one) {
    iwl_socketcan_socket_use(&bus, 77, true);
    TEST_ASSERT_EQUAL_INT(77, bus.fd);
    TEST_ASSERT_TRUE(bus.is_hub);
    TEST_ASSERT_EQUAL_INT(0, iwl_socketcan_socket_open(&bus, 3, IWL_SOCKETCAN_OURS));
    TEST_ASSERT_FALSE(bus.is_hub);
}
