// SPDX-License-Identifier: MIT
// What the kernel's description of an interface is read as.
#include "netlink.h"

#include "unity.h"

#include <libmnl/libmnl.h>
#include <linux/can/netlink.h>
#include <linux/if.h>
#include <linux/if_arp.h>
#include <linux/if_link.h>
#include <linux/rtnetlink.h>
#include <string.h>

static _Alignas(struct nlmsghdr) uint8_t buffer[4096];
static struct nlmsghdr *message;
static struct ifinfomsg *interface;
static iw_netlink_reading_t reading;

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
    memset(&reading, 0xA5, sizeof reading);
}

void tearDown(void) {}

static void parse_state(uint32_t state, iw_bus_state_t expected) {
    begin(IFF_UP | IFF_ECHO);
    add_controller(&(controller_t){.state = state});
    TEST_ASSERT_TRUE(iw_netlink_parse(message, &reading));
    TEST_ASSERT_EQUAL(expected, reading.state);
}

static void test_controller_tells_all_it_is_asked_for(void) {
    begin(IFF_UP | IFF_ECHO);
    add_controller(&(controller_t){.bitrate = 1000000, .sample_point = 625, .restart_ms = 100});
    TEST_ASSERT_TRUE(iw_netlink_parse(message, &reading));
    TEST_ASSERT_EQUAL_INT(7, reading.index);
    TEST_ASSERT_EQUAL(IW_LINK_UP, reading.link.presence);
    TEST_ASSERT_FALSE(reading.link.is_virtual);
    TEST_ASSERT_TRUE(reading.link.echo_proven);
    TEST_ASSERT_FALSE(reading.link.is_mute);
    TEST_ASSERT_EQUAL_UINT32(1000000, reading.link.bitrate_hz);
    TEST_ASSERT_EQUAL_UINT32(625, reading.link.sample_point_permille);
    TEST_ASSERT_EQUAL_UINT32(100, reading.link.restart_ms);
    TEST_ASSERT_EQUAL_UINT32(10, reading.link.queue_length);
}

static void test_controller_states(void) {
    parse_state(CAN_STATE_ERROR_ACTIVE, IW_BUS_ACTIVE);
    parse_state(CAN_STATE_ERROR_WARNING, IW_BUS_ACTIVE);
    parse_state(CAN_STATE_ERROR_PASSIVE, IW_BUS_PASSIVE);
    parse_state(CAN_STATE_BUS_OFF, IW_BUS_OFF);
    parse_state(CAN_STATE_STOPPED, IW_BUS_DOWN);
    parse_state(CAN_STATE_SLEEPING, IW_BUS_DOWN);
    parse_state(99, IW_BUS_DOWN);
}

static void test_controller_modes_that_make_the_echo_a_lie_or_sending_impossible(void) {
    begin(IFF_UP | IFF_ECHO);
    add_controller(&(controller_t){.mode = CAN_CTRLMODE_LOOPBACK});
    TEST_ASSERT_TRUE(iw_netlink_parse(message, &reading));
    TEST_ASSERT_FALSE(reading.link.echo_proven);
    begin(IFF_UP | IFF_ECHO);
    add_controller(&(controller_t){.mode = CAN_CTRLMODE_PRESUME_ACK});
    TEST_ASSERT_TRUE(iw_netlink_parse(message, &reading));
    TEST_ASSERT_FALSE(reading.link.echo_proven);
    begin(IFF_UP | IFF_ECHO);
    add_controller(&(controller_t){.mode = CAN_CTRLMODE_LISTENONLY | CAN_CTRLMODE_BERR_REPORTING});
    TEST_ASSERT_TRUE(iw_netlink_parse(message, &reading));
    TEST_ASSERT_TRUE(reading.link.echo_proven);
    TEST_ASSERT_TRUE(reading.link.is_mute);
}

static void test_controller_without_the_echo_flag_proves_nothing(void) {
    begin(IFF_UP);
    add_controller(&(controller_t){.bitrate = 1000000});
    TEST_ASSERT_TRUE(iw_netlink_parse(message, &reading));
    TEST_ASSERT_FALSE(reading.link.echo_proven);
}

static void test_interface_that_is_down_has_no_state_of_its_own(void) {
    begin(IFF_ECHO);
    add_controller(&(controller_t){.state = CAN_STATE_ERROR_ACTIVE});
    TEST_ASSERT_TRUE(iw_netlink_parse(message, &reading));
    TEST_ASSERT_EQUAL(IW_LINK_DOWN, reading.link.presence);
    TEST_ASSERT_EQUAL(IW_BUS_DOWN, reading.state);
}

static void test_virtual_interface_has_no_timing_and_is_active_while_up(void) {
    begin(IFF_UP);
    struct nlattr *info = mnl_attr_nest_start(message, IFLA_LINKINFO);
    mnl_attr_put_strz(message, IFLA_INFO_KIND, "vcan");
    mnl_attr_nest_end(message, info);
    TEST_ASSERT_TRUE(iw_netlink_parse(message, &reading));
    TEST_ASSERT_TRUE(reading.link.is_virtual);
    TEST_ASSERT_FALSE(reading.link.echo_proven);
    TEST_ASSERT_EQUAL(IW_BUS_ACTIVE, reading.state);
    TEST_ASSERT_EQUAL_UINT32(0, reading.link.bitrate_hz);
}

static void test_interface_of_another_type_is_no_can_interface_whatever_it_tells(void) {
    begin(IFF_UP | IFF_ECHO);
    interface->ifi_type = ARPHRD_ETHER;
    add_controller(&(controller_t){.state = CAN_STATE_ERROR_ACTIVE});
    TEST_ASSERT_TRUE(iw_netlink_parse(message, &reading));
    TEST_ASSERT_EQUAL(IW_LINK_NOT_CAN, reading.link.presence);
    TEST_ASSERT_EQUAL(IW_BUS_DOWN, reading.state);
    TEST_ASSERT_FALSE(reading.link.echo_proven);
}

static void test_values_that_are_too_short_are_not_reported(void) {
    begin(IFF_UP | IFF_ECHO);
    struct nlattr *info = mnl_attr_nest_start(message, IFLA_LINKINFO);
    mnl_attr_put_strz(message, IFLA_INFO_KIND, "can");
    struct nlattr *data = mnl_attr_nest_start(message, IFLA_INFO_DATA);
    mnl_attr_put_u16(message, IFLA_CAN_STATE, CAN_STATE_BUS_OFF);
    mnl_attr_put_u32(message, IFLA_CAN_BITTIMING, 500000);
    mnl_attr_nest_end(message, data);
    mnl_attr_nest_end(message, info);
    TEST_ASSERT_TRUE(iw_netlink_parse(message, &reading));
    TEST_ASSERT_EQUAL_UINT32(0, reading.link.bitrate_hz);
    TEST_ASSERT_EQUAL(IW_BUS_ACTIVE, reading.state);
}

static void test_a_kind_that_only_begins_like_a_controller_is_none(void) {
    begin(IFF_UP);
    struct nlattr *info = mnl_attr_nest_start(message, IFLA_LINKINFO);
    mnl_attr_put_strz(message, IFLA_INFO_KIND, "canary");
    mnl_attr_nest_end(message, info);
    TEST_ASSERT_TRUE(iw_netlink_parse(message, &reading));
    TEST_ASSERT_TRUE(reading.link.is_virtual);
}

static void test_messages_that_are_none_are_refused(void) {
    begin(IFF_UP);
    message->nlmsg_type = RTM_NEWADDR;
    TEST_ASSERT_FALSE(iw_netlink_parse(message, &reading));
    begin(IFF_UP);
    message->nlmsg_len = (uint32_t)NLMSG_HDRLEN + 4U;
    TEST_ASSERT_FALSE(iw_netlink_parse(message, &reading));
}

static void test_attributes_cut_short_anywhere_are_survived(void) {
    begin(IFF_UP | IFF_ECHO);
    add_controller(&(controller_t){.bitrate = 1000000, .sample_point = 625});
    const uint32_t whole = message->nlmsg_len;
    for (uint32_t length = (uint32_t)NLMSG_HDRLEN + (uint32_t)sizeof *interface; length < whole; length++) {
        message->nlmsg_len = length;
        TEST_ASSERT_TRUE(iw_netlink_parse(message, &reading));
        TEST_ASSERT_EQUAL_INT(7, reading.index);
    }
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_controller_tells_all_it_is_asked_for);
    RUN_TEST(test_controller_states);
    RUN_TEST(test_controller_modes_that_make_the_echo_a_lie_or_sending_impossible);
    RUN_TEST(test_controller_without_the_echo_flag_proves_nothing);
    RUN_TEST(test_interface_that_is_down_has_no_state_of_its_own);
    RUN_TEST(test_virtual_interface_has_no_timing_and_is_active_while_up);
    RUN_TEST(test_interface_of_another_type_is_no_can_interface_whatever_it_tells);
    RUN_TEST(test_values_that_are_too_short_are_not_reported);
    RUN_TEST(test_a_kind_that_only_begins_like_a_controller_is_none);
    RUN_TEST(test_messages_that_are_none_are_refused);
    RUN_TEST(test_attributes_cut_short_anywhere_are_survived);
    return UNITY_END();
}
