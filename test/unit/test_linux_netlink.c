// SPDX-License-Identifier: MIT
// Requests to the kernel for the description of an interface, and the parser of the replies. This file replaces the
// kernel.
#include "netlink.h"

#include "unit.h"

#include <errno.h>
#include <libmnl/libmnl.h>
#include <linux/can/netlink.h>
#include <linux/if.h>
#include <linux/if_arp.h>
#include <linux/if_link.h>
#include <linux/rtnetlink.h>
#include <signal.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

static _Alignas(struct nlmsghdr) uint8_t buffer[4096];
static struct nlmsghdr *message;
static struct ifinfomsg *interface;
static iwl_netlink_reading_t reading;

/// The fake kernel behind the socket, in memory that is shared with the process that restarts a link.
typedef struct {
    unsigned opened;
    unsigned closed;
    unsigned groups;
    pid_t port;
    unsigned asked;    ///< Number of requests.
    unsigned flags[8]; ///< Flags of each request that sets an interface up or down.
    int answer[8];     ///< Reply to each of those requests: an errno.
    unsigned slept;
    uint32_t sequence; ///< Sequence number of the last request.
    bool bind_fails;
    bool stale; ///< A reply to another request arrives first.
} kernel_t;

static kernel_t *kernel;

struct mnl_socket *mnl_socket_open2(int bus, int flags) {
    TEST_ASSERT_EQUAL_INT(NETLINK_ROUTE, bus);
    TEST_ASSERT_TRUE((flags & SOCK_CLOEXEC) != 0);
    kernel->opened++;
    return (struct mnl_socket *)(void *)kernel;
}

int mnl_socket_bind(struct mnl_socket *socket, unsigned groups, pid_t port) {
    (void)socket;
    kernel->groups = groups;
    kernel->port = port;
    errno = EADDRINUSE;
    return kernel->bind_fails ? -1 : 0;
}

int mnl_socket_close(struct mnl_socket *socket) {
    TEST_ASSERT_EQUAL_PTR(kernel, socket);
    kernel->closed++;
    errno = EBADF; // Any call may set errno.
    return 0;
}

ssize_t mnl_socket_sendto(const struct mnl_socket *socket, const void *request, size_t size) {
    const struct nlmsghdr *header = (const struct nlmsghdr *)request;
    (void)socket;
    if (header->nlmsg_type == RTM_NEWLINK && kernel->asked < 8U) {
        kernel->flags[kernel->asked] = ((const struct ifinfomsg *)mnl_nlmsg_get_payload(header))->ifi_flags;
    }
    kernel->sequence = header->nlmsg_seq;
    kernel->asked++;
    return (ssize_t)size;
}

ssize_t mnl_socket_recvfrom(const struct mnl_socket *socket, void *out, size_t size) {
    struct nlmsghdr *reply = mnl_nlmsg_put_header(out);
    (void)socket;
    (void)size;
    reply->nlmsg_type = NLMSG_ERROR;
    reply->nlmsg_seq = kernel->sequence - (kernel->stale ? 1U : 0U);
    struct nlmsgerr *verdict = (struct nlmsgerr *)mnl_nlmsg_put_extra_header(reply, sizeof *verdict);
    verdict->error = kernel->stale ? -ENOSYS : -kernel->answer[(kernel->asked - 1U) % 8U];
    kernel->stale = false;
    return (ssize_t)reply->nlmsg_len;
}

unsigned sleep(unsigned seconds) {
    kernel->slept += seconds;
    return 0;
}

static void begin(unsigned flags) {
    memset(buffer, 0, sizeof buffer);
    message = mnl_nlmsg_put_header(buffer);
    message->nlmsg_type = RTM_NEWLINK;
    interface = (struct ifinfomsg *)mnl_nlmsg_put_extra_header(message, sizeof *interface);
    interface->ifi_type = ARPHRD_CAN;
    interface->ifi_index = 7;
    interface->ifi_flags = flags;
    mnl_attr_put_strz(message, IFLA_IFNAME, "can0");
    mnl_attr_put_u32(message, IFLA_TXQLEN, 10);
}

typedef struct {
    uint32_t bitrate;
    uint32_t sample_point;
    uint32_t state;
    uint32_t mode;
    uint32_t restart_ms;
} controller_t;

static void add_controller(const controller_t *controller) {
    const struct can_bittiming timing = {.bitrate = controller->bitrate, .sample_point = controller->sample_point};
    const struct can_ctrlmode mode = {.mask = UINT32_MAX, .flags = controller->mode};
    struct nlattr *info = mnl_attr_nest_start(message, IFLA_LINKINFO);
    mnl_attr_put_strz(message, IFLA_INFO_KIND, "can");
    struct nlattr *data = mnl_attr_nest_start(message, IFLA_INFO_DATA);
    mnl_attr_put_u32(message, IFLA_CAN_STATE, controller->state);
    mnl_attr_put(message, IFLA_CAN_CTRLMODE, sizeof mode, &mode);
    mnl_attr_put_u32(message, IFLA_CAN_RESTART_MS, controller->restart_ms);
    mnl_attr_put(message, IFLA_CAN_BITTIMING, sizeof timing, &timing);
    mnl_attr_nest_end(message, data);
    mnl_attr_nest_end(message, info);
}

void setUp(void) {
    if (kernel == NULL) {
        kernel = (kernel_t *)mmap(NULL, sizeof *kernel, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
        TEST_ASSERT_TRUE(kernel != MAP_FAILED);
    }
    memset(kernel, 0, sizeof *kernel);
    memset(&reading, 0xA5, sizeof reading);
}

static void parse_state(uint32_t state, iw_bus_state_t expected) {
    begin(IFF_UP | IFF_ECHO);
    add_controller(&(controller_t){.state = state});
    TEST_ASSERT_TRUE(iwl_netlink_parse(message, &reading));
    TEST_ASSERT_EQUAL(expected, reading.state);
}

TEST(test_netlink_controller_values_are_all_parsed) {
    begin(IFF_UP | IFF_ECHO);
    add_controller(&(controller_t){.bitrate = 1000000, .sample_point = 625, .restart_ms = 100});
    TEST_ASSERT_TRUE(iwl_netlink_parse(message, &reading));
    TEST_ASSERT_EQUAL_INT(7, reading.index);
    TEST_ASSERT_EQUAL(IWL_LINK_UP, reading.link.presence);
    TEST_ASSERT_FALSE(reading.link.is_virtual);
    TEST_ASSERT_TRUE(reading.link.echo_proven);
    TEST_ASSERT_FALSE(reading.link.is_mute);
    TEST_ASSERT_EQUAL_UINT32(1000000, reading.link.bitrate_hz);
    TEST_ASSERT_EQUAL_UINT32(625, reading.link.sample_point_permille);
    TEST_ASSERT_EQUAL_UINT32(100, reading.link.restart_ms);
    TEST_ASSERT_EQUAL_UINT32(10, reading.link.queue_length);
}

TEST(test_netlink_controller_states_map_to_bus_states) {
    parse_state(CAN_STATE_ERROR_ACTIVE, IW_BUS_ACTIVE);
    parse_state(CAN_STATE_ERROR_WARNING, IW_BUS_ACTIVE);
    parse_state(CAN_STATE_ERROR_PASSIVE, IW_BUS_PASSIVE);
    parse_state(CAN_STATE_BUS_OFF, IW_BUS_OFF);
    parse_state(CAN_STATE_STOPPED, IW_BUS_DOWN);
    parse_state(CAN_STATE_SLEEPING, IW_BUS_DOWN);
    parse_state(99, IW_BUS_DOWN);
}

TEST(test_netlink_controller_modes_set_echo_proven_and_mute) {
    begin(IFF_UP | IFF_ECHO);
    add_controller(&(controller_t){.mode = CAN_CTRLMODE_LOOPBACK});
    TEST_ASSERT_TRUE(iwl_netlink_parse(message, &reading));
    TEST_ASSERT_FALSE(reading.link.echo_proven);
    begin(IFF_UP | IFF_ECHO);
    add_controller(&(controller_t){.mode = CAN_CTRLMODE_PRESUME_ACK});
    TEST_ASSERT_TRUE(iwl_netlink_parse(message, &reading));
    TEST_ASSERT_FALSE(reading.link.echo_proven);
    begin(IFF_UP | IFF_ECHO);
    add_controller(&(controller_t){.mode = CAN_CTRLMODE_LISTENONLY | CAN_CTRLMODE_BERR_REPORTING});
    TEST_ASSERT_TRUE(iwl_netlink_parse(message, &reading));
    TEST_ASSERT_TRUE(reading.link.echo_proven);
    TEST_ASSERT_TRUE(reading.link.is_mute);
}

TEST(test_netlink_controller_without_echo_flag_is_not_proven) {
    begin(IFF_UP);
    add_controller(&(controller_t){.bitrate = 1000000});
    TEST_ASSERT_TRUE(iwl_netlink_parse(message, &reading));
    TEST_ASSERT_FALSE(reading.link.echo_proven);
}

TEST(test_netlink_interface_down_ignores_the_controller_state) {
    begin(IFF_ECHO);
    add_controller(&(controller_t){.state = CAN_STATE_ERROR_ACTIVE});
    TEST_ASSERT_TRUE(iwl_netlink_parse(message, &reading));
    TEST_ASSERT_EQUAL(IWL_LINK_DOWN, reading.link.presence);
    TEST_ASSERT_EQUAL(IW_BUS_DOWN, reading.state);
}

TEST(test_netlink_virtual_interface_is_active_without_timing) {
    begin(IFF_UP);
    struct nlattr *info = mnl_attr_nest_start(message, IFLA_LINKINFO);
    mnl_attr_put_strz(message, IFLA_INFO_KIND, "vcan");
    mnl_attr_nest_end(message, info);
    TEST_ASSERT_TRUE(iwl_netlink_parse(message, &reading));
    TEST_ASSERT_TRUE(reading.link.is_virtual);
    TEST_ASSERT_FALSE(reading.link.echo_proven);
    TEST_ASSERT_EQUAL(IW_BUS_ACTIVE, reading.state);
    TEST_ASSERT_EQUAL_UINT32(0, reading.link.bitrate_hz);
}

TEST(test_netlink_interface_of_another_type_is_not_can) {
    begin(IFF_UP | IFF_ECHO);
    interface->ifi_type = ARPHRD_ETHER;
    add_controller(&(controller_t){.state = CAN_STATE_ERROR_ACTIVE});
    TEST_ASSERT_TRUE(iwl_netlink_parse(message, &reading));
    TEST_ASSERT_EQUAL(IWL_LINK_NOT_CAN, reading.link.presence);
    TEST_ASSERT_EQUAL(IW_BUS_DOWN, reading.state);
    TEST_ASSERT_FALSE(reading.link.echo_proven);
}

TEST(test_netlink_values_that_are_too_short_are_not_reported) {
    begin(IFF_UP | IFF_ECHO);
    struct nlattr *info = mnl_attr_nest_start(message, IFLA_LINKINFO);
    mnl_attr_put_strz(message, IFLA_INFO_KIND, "can");
    struct nlattr *data = mnl_attr_nest_start(message, IFLA_INFO_DATA);
    mnl_attr_put_u16(message, IFLA_CAN_STATE, CAN_STATE_BUS_OFF);
    mnl_attr_put_u32(message, IFLA_CAN_BITTIMING, 500000);
    mnl_attr_nest_end(message, data);
    mnl_attr_nest_end(message, info);
    TEST_ASSERT_TRUE(iwl_netlink_parse(message, &reading));
    TEST_ASSERT_EQUAL_UINT32(0, reading.link.bitrate_hz);
    TEST_ASSERT_EQUAL(IW_BUS_ACTIVE, reading.state);
}

TEST(test_netlink_kind_with_the_prefix_can_is_virtual) {
    begin(IFF_UP);
    struct nlattr *info = mnl_attr_nest_start(message, IFLA_LINKINFO);
    mnl_attr_put_strz(message, IFLA_INFO_KIND, "canary");
    mnl_attr_nest_end(message, info);
    TEST_ASSERT_TRUE(iwl_netlink_parse(message, &reading));
    TEST_ASSERT_TRUE(reading.link.is_virtual);
}

TEST(test_netlink_messages_of_another_kind_are_refused) {
    begin(IFF_UP);
    message->nlmsg_type = RTM_NEWADDR;
    TEST_ASSERT_FALSE(iwl_netlink_parse(message, &reading));
    begin(IFF_UP);
    message->nlmsg_len = (uint32_t)NLMSG_HDRLEN + 4U;
    TEST_ASSERT_FALSE(iwl_netlink_parse(message, &reading));
}

TEST(test_netlink_attributes_cut_anywhere_do_not_crash) {
    begin(IFF_UP | IFF_ECHO);
    add_controller(&(controller_t){.bitrate = 1000000, .sample_point = 625});
    const uint32_t whole = message->nlmsg_len;
    for (uint32_t length = (uint32_t)NLMSG_HDRLEN + (uint32_t)sizeof *interface; length < whole; length++) {
        message->nlmsg_len = length;
        TEST_ASSERT_TRUE(iwl_netlink_parse(message, &reading));
        TEST_ASSERT_EQUAL_INT(7, reading.index);
    }
}

TEST(test_netlink_socket_has_no_group_and_is_closed_once) {
    iwl_netlink_t netlink;
    TEST_ASSERT_EQUAL_INT(0, iwl_netlink_open(&netlink));
    TEST_ASSERT_EQUAL_UINT(0, kernel->groups);
    TEST_ASSERT_EQUAL_INT(MNL_SOCKET_AUTOPID, kernel->port);
    iwl_netlink_close(&netlink);
    iwl_netlink_close(&netlink);
    TEST_ASSERT_EQUAL_UINT(1, kernel->closed);
    kernel->bind_fails = true;
    TEST_ASSERT_EQUAL_INT(EADDRINUSE, iwl_netlink_open(&netlink));
    TEST_ASSERT_EQUAL_UINT(2, kernel->opened);
    TEST_ASSERT_EQUAL_UINT(2, kernel->closed);
}

TEST(test_netlink_request_reads_the_reply_with_its_sequence) {
    iwl_netlink_t netlink;
    TEST_ASSERT_EQUAL_INT(0, iwl_netlink_open(&netlink));
    kernel->answer[0] = EPERM;
    kernel->stale = true;
    TEST_ASSERT_EQUAL_INT(EPERM, iwl_netlink_set_up(&netlink, 3, true));
    TEST_ASSERT_EQUAL_INT(0, iwl_netlink_set_up(&netlink, 3, false));
    TEST_ASSERT_EQUAL_UINT(IFF_UP, kernel->flags[0]);
    TEST_ASSERT_EQUAL_UINT(0, kernel->flags[1]);
    iwl_netlink_close(&netlink);
}

/// Waits for the process that restarts a link and returns its result.
static int restarted(void) {
    pid_t process;
    int result = IWL_NETLINK_RESTART_RUNNING;
    TEST_ASSERT_EQUAL_INT(0, iwl_netlink_restart_start(3, &process));
    siginfo_t ended;
    TEST_ASSERT_EQUAL_INT(0, waitid(P_PID, (id_t)process, &ended, WEXITED | WNOWAIT));
    result = iwl_netlink_restart_poll(process);
    return result;
}

TEST(test_netlink_restart_retries_up_until_the_link_is_up) {
    kernel->answer[1] = kernel->answer[2] = EBUSY;
    TEST_ASSERT_EQUAL_INT(0, restarted());
    TEST_ASSERT_EQUAL_UINT(4, kernel->asked);
    TEST_ASSERT_EQUAL_UINT(0, kernel->flags[0]);
    TEST_ASSERT_EQUAL_UINT(IFF_UP, kernel->flags[3]);
    TEST_ASSERT_GREATER_THAN_UINT(1, kernel->slept);
}

TEST(test_netlink_restart_refused_by_the_kernel_fails_immediately) {
    kernel->answer[0] = EPERM;
    TEST_ASSERT_EQUAL_INT(EPERM, restarted());
    TEST_ASSERT_EQUAL_UINT(1, kernel->asked);
    setUp();
    kernel->answer[1] = ENODEV;
    TEST_ASSERT_EQUAL_INT(ENODEV, restarted());
    TEST_ASSERT_EQUAL_UINT(2, kernel->asked);
}

TEST(test_netlink_restart_process_that_was_killed_has_failed) {
    const pid_t process = fork();
    siginfo_t ended;
    if (process == 0) {
        (void)raise(SIGKILL);
    }
    TEST_ASSERT_EQUAL_INT(0, waitid(P_PID, (id_t)process, &ended, WEXITED | WNOWAIT));
    TEST_ASSERT_EQUAL_INT(EIO, iwl_netlink_restart_poll(process));
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, iwl_netlink_restart_poll(process), "another process has read its status");
}
