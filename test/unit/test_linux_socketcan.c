// SPDX-License-Identifier: MIT
// SocketCAN over a fake interface: states, losses, old frames, forged frames. It needs no kernel, no time and no
// rights.
#include "fake_interface.h"

#include "iwheel_linux/backend.h"

#include "unit.h"

#include <errno.h>
#include <fcntl.h>
#include <linux/can/error.h>
#include <sys/socket.h>
#include <sys/types.h>
#include <unistd.h>

static const iw_can_frame_t setpoint = {.id = 266, .dlc = 5};
static iwl_backend_store_t store;
static iw_time_us_t now_us;
static bool no_can; ///< This kernel does not support CAN.

/// The port calls `socket` once, to query interfaces. The machine of the test need not support CAN.
int socket(int domain, int type, int protocol) {
    (void)domain;
    (void)type;
    (void)protocol;
    if (no_can) {
        errno = EAFNOSUPPORT;
        return -1;
    }
    return dup(STDERR_FILENO);
}

static void poll(void) {
    iwl_bus_poll(&store, now_us);
}

static void wait_ms(unsigned ms) {
    now_us += (iw_time_us_t)ms * IW_US_PER_MS;
    poll();
}

static iw_bus_state_t state(void) {
    return iwl_bus_state(&store);
}

static void assert_state_after_ms(unsigned ms, iw_bus_state_t expected) {
    wait_ms(ms);
    TEST_ASSERT_EQUAL_INT(expected, state());
}

/// The interface is set down, and the port notices it.
static void set_down(void) {
    fake_interface.ours.error = ENETDOWN;
    fake_interface.presence = IWL_LINK_DOWN;
    wait_ms(1);
}

static iw_can_frame_t frame; ///< Result of the last receive.

static int receive(void) {
    return iwl_bus_receive(&store, &frame);
}

/// Reads all frames and returns their number.
static unsigned drain(void) {
    unsigned count = 0;
    while (receive() > 0) {
        count++;
    }
    return count;
}

static void assert_received_after_ms(unsigned ms, int expected) {
    wait_ms(ms);
    TEST_ASSERT_EQUAL_INT(expected, receive());
}

static int send_setpoint(void) {
    return iwl_bus_send(&store, &setpoint, 1);
}

static const iwl_bus_link_t *link_now(void) {
    return iwl_bus_link(&store);
}

void setUp(void) {
    now_us = 5000000;
    fake_interface_init();
    TEST_ASSERT_EQUAL_INT(0, iwl_bus_open(&store, "can0"));
    poll();
    TEST_ASSERT_EQUAL_INT(IW_BUS_ACTIVE, state());
}

void tearDown(void) {
    iwl_bus_close(&store);
}

TEST(test_socketcan_bus_off_and_restart_in_one_batch_report_once) {
    fake_interface_put_error(CAN_ERR_BUSOFF, 0, 0);
    fake_interface_put_error(CAN_ERR_RESTARTED, 0, 0);
    assert_state_after_ms(1, IW_BUS_OFF);
    TEST_ASSERT_EQUAL_INT(IW_BUS_ACTIVE, state());
}

TEST(test_socketcan_bus_off_between_frames_of_a_batch_is_reported) {
    for (unsigned i = 0; i < 10U; i++) {
        fake_interface_put(&fake_interface.ours, 256, 4, 0);
    }
    fake_interface_put_error(CAN_ERR_BUSOFF, 0, 0);
    fake_interface_put_error(CAN_ERR_RESTARTED, 0, 0);
    fake_interface_put(&fake_interface.ours, 288, 4, 0);
    wait_ms(1);
    TEST_ASSERT_EQUAL_UINT(11, drain());
    TEST_ASSERT_EQUAL_INT(IW_BUS_OFF, state());
    TEST_ASSERT_EQUAL_INT(IW_BUS_ACTIVE, state());
}

TEST(test_socketcan_sends_nothing_before_a_bus_off_is_reported) {
    for (unsigned i = 0; i < IWL_SOCKETCAN_BATCH; i++) {
        fake_interface_put(&fake_interface.ours, 256, 4, 0);
    }
    fake_interface_put_error(CAN_ERR_BUSOFF, 0, 0);
    fake_interface_put_error(CAN_ERR_RESTARTED, 0, 0);
    assert_state_after_ms(1, IW_BUS_ACTIVE); // Both error frames are in the second batch.
    (void)drain();
    TEST_ASSERT_EQUAL_INT(0, send_setpoint());
    TEST_ASSERT_EQUAL_INT(IW_BUS_OFF, state());
    TEST_ASSERT_EQUAL_INT(1, send_setpoint());
}

TEST(test_socketcan_restart_reports_a_missed_bus_off) {
    fake_interface_put_error(CAN_ERR_RESTARTED, 0, 0);
    assert_state_after_ms(1, IW_BUS_OFF);
    TEST_ASSERT_EQUAL_INT(IW_BUS_ACTIVE, state());
}

TEST(test_socketcan_bus_off_is_reported_until_the_carrier_returns) {
    fake_interface_put_error(CAN_ERR_BUSOFF, 0, 0);
    fake_interface.carrier = 0;
    wait_ms(20);
    TEST_ASSERT_EQUAL_UINT64_MESSAGE(now_us + 200000U, iwl_bus_next_us(&store), "received");
    wait_ms(200);
    TEST_ASSERT_EQUAL_UINT64_MESSAGE(now_us + 200000U, iwl_bus_next_us(&store), "seen");
    for (unsigned i = 0; i < 100U; i++) {
        assert_state_after_ms(20, IW_BUS_OFF);
    }
    fake_interface.carrier = 1; // The error frame of the restart was lost.
    wait_ms(200);
    (void)state();
    TEST_ASSERT_EQUAL_INT(IW_BUS_ACTIVE, state());
    TEST_ASSERT_EQUAL_UINT64(IW_NEVER, iwl_bus_next_us(&store));
}

TEST(test_socketcan_forged_bus_off_is_reported_once_and_checked) {
    fake_interface_put_error(CAN_ERR_BUSOFF, 0, MSG_DONTROUTE);
    wait_ms(1);
    TEST_ASSERT_EQUAL_UINT(1, fake_interface.polls);
    TEST_ASSERT_EQUAL_INT(IW_BUS_OFF, state());
    TEST_ASSERT_EQUAL_INT(IW_BUS_ACTIVE, state());
}

TEST(test_socketcan_forged_recovery_is_ignored) {
    fake_interface.carrier = 0;
    fake_interface_put_error(CAN_ERR_BUSOFF, 0, 0);
    fake_interface_put_error(CAN_ERR_RESTARTED, 0, MSG_DONTROUTE);
    fake_interface_put_error(CAN_ERR_CRTL, CAN_ERR_CRTL_ACTIVE, MSG_DONTROUTE);
    assert_state_after_ms(1, IW_BUS_OFF);
    TEST_ASSERT_EQUAL_INT(IW_BUS_OFF, state());
}

TEST(test_socketcan_active_frame_ends_passive_but_not_bus_off) {
    fake_interface_put_error(CAN_ERR_CRTL, CAN_ERR_CRTL_TX_PASSIVE, 0);
    assert_state_after_ms(1, IW_BUS_PASSIVE);
    TEST_ASSERT_EQUAL_INT(IW_BUS_PASSIVE, state());
    (void)drain();
    fake_interface_put_error(CAN_ERR_CRTL, CAN_ERR_CRTL_ACTIVE, 0);
    assert_state_after_ms(1, IW_BUS_ACTIVE);
    (void)drain();
    fake_interface.carrier = 0;
    fake_interface_put_error(CAN_ERR_BUSOFF, 0, 0);
    fake_interface_put_error(CAN_ERR_CRTL, CAN_ERR_CRTL_ACTIVE, 0);
    assert_state_after_ms(1, IW_BUS_OFF);
    TEST_ASSERT_EQUAL_INT(IW_BUS_OFF, state());
}

TEST(test_socketcan_frames_from_before_link_down_are_dropped) {
    set_down();
    TEST_ASSERT_EQUAL_INT(IW_BUS_DOWN, state());
    fake_interface_put(&fake_interface.ours, 256, 4, 0);
    fake_interface_put(&fake_interface.others, 0x700, 4, 0);
    TEST_ASSERT_TRUE(receive() < 0);
    fake_interface.presence = IWL_LINK_UP;
    fake_interface.news = true;
    fake_interface_put(&fake_interface.ours, 288, 4, MSG_CONFIRM);
    wait_ms(1);
    TEST_ASSERT_EQUAL_UINT(0, drain());
    TEST_ASSERT_EQUAL_UINT(1, fake_interface.opened); // The socket is the same.
}

TEST(test_socketcan_frames_during_the_link_check_are_dropped) {
    set_down();
    fake_interface.presence = IWL_LINK_UP;
    fake_interface.news = true;
    fake_interface.late = 40;
    poll();
    TEST_ASSERT_EQUAL_UINT(0, drain());
    fake_interface_put(&fake_interface.ours, 256, 4, 0);
    TEST_ASSERT_EQUAL_UINT(1, drain());
}

TEST(test_socketcan_frames_while_the_link_is_down_are_drained) {
    set_down();
    fake_interface_put(&fake_interface.ours, 256, 4, 0);
    fake_interface_put(&fake_interface.others, 0x700, 4, 0);
    wait_ms(1);
    TEST_ASSERT_EQUAL_UINT(0, fake_interface.ours.count);
    TEST_ASSERT_EQUAL_UINT(0, fake_interface.others.count);
}

TEST(test_socketcan_half_read_batch_is_dropped_at_link_down) {
    for (unsigned i = 0; i < 20U; i++) {
        fake_interface_put(&fake_interface.ours, 256, 4, 0);
    }
    assert_received_after_ms(1, 1);
    fake_interface.send_result = -1;
    TEST_ASSERT_EQUAL_INT(-1, send_setpoint());
    TEST_ASSERT_TRUE(receive() < 0);
    fake_interface.send_result = 1;
    wait_ms(200);
    TEST_ASSERT_EQUAL_UINT(0, drain());
}

TEST(test_socketcan_link_down_and_up_between_polls_reports_once) {
    fake_interface.ours.error = ENETDOWN;
    wait_ms(1);
    wait_ms(200); // As far as the port can see, the link was up all the time.
    TEST_ASSERT_EQUAL_INT(IW_BUS_DOWN, state());
    TEST_ASSERT_EQUAL_INT(IW_BUS_ACTIVE, state());
    TEST_ASSERT_EQUAL_INT(1, send_setpoint());
}

TEST(test_socketcan_recreated_interface_gets_new_sockets) {
    fake_interface.ours.error = ENODEV;
    fake_interface.presence = IWL_LINK_ABSENT;
    assert_state_after_ms(1, IW_BUS_DOWN);
    TEST_ASSERT_EQUAL_INT(-1, send_setpoint());
    fake_interface.presence = IWL_LINK_UP;
    fake_interface.index = 4;
    wait_ms(200);
    TEST_ASSERT_EQUAL_UINT(2, fake_interface.opened);
    (void)state();
    TEST_ASSERT_EQUAL_INT(IW_BUS_ACTIVE, state());
    TEST_ASSERT_EQUAL_INT(1, send_setpoint());
}

TEST(test_socketcan_recreated_same_index_gets_new_sockets) {
    fake_interface.ours.error = ENODEV;
    wait_ms(1);
    wait_ms(200);
    TEST_ASSERT_EQUAL_UINT(2, fake_interface.opened);
}

TEST(test_socketcan_link_up_in_bus_off_waits_for_the_carrier) {
    fake_interface.ours.error = ENETDOWN;
    assert_state_after_ms(1, IW_BUS_DOWN);
    fake_interface.state = IW_BUS_OFF;
    fake_interface.carrier = 0;
    assert_state_after_ms(200, IW_BUS_OFF);
    assert_state_after_ms(200, IW_BUS_OFF);
    fake_interface.carrier = 1;
    wait_ms(200);
    (void)state();
    TEST_ASSERT_EQUAL_INT(IW_BUS_ACTIVE, state());
}

TEST(test_socketcan_netlink_failure_leaves_the_interface_active) {
    fake_interface.ours.error = ENETDOWN;
    wait_ms(1);
    (void)state();
    fake_interface.netlink_fails = true;
    assert_state_after_ms(200, IW_BUS_ACTIVE);
    TEST_ASSERT_FALSE(link_now()->echo_proven);
}

TEST(test_socketcan_down_interface_is_read_once_per_period) {
    set_down();
    poll();
    TEST_ASSERT_EQUAL_UINT64(now_us + 200000U, iwl_bus_next_us(&store));
    const unsigned before = fake_interface.readings;
    fake_interface.presence = IWL_LINK_UP;
    wait_ms(199);
    TEST_ASSERT_EQUAL_UINT(before, fake_interface.readings);
    wait_ms(1);
    TEST_ASSERT_EQUAL_UINT(before + 1U, fake_interface.readings);
}

TEST(test_socketcan_interface_that_stays_down_is_no_change) {
    set_down();
    wait_ms(200);
    const uint32_t changes = link_now()->changes;
    wait_ms(200);
    wait_ms(200);
    TEST_ASSERT_EQUAL_UINT32(changes, link_now()->changes);
}

static unsigned descriptors(void) {
    unsigned count = 0;
    for (int fd = 0; fd < 256; fd++) {
        count += (fcntl(fd, F_GETFD) >= 0) ? 1U : 0U;
    }
    return count;
}

static void assert_not_opened(int error) {
    TEST_ASSERT_EQUAL_INT(error, iwl_bus_open(&store, "can0"));
    no_can = false;
    fake_interface.open_error = 0;
    fake_interface.events_dead = false;
}

TEST(test_socketcan_failed_open_returns_errno_and_leaks_nothing) {
    iwl_bus_close(&store);
    const unsigned before = descriptors();
    no_can = true;
    assert_not_opened(EAFNOSUPPORT);
    fake_interface.open_error = EPROTONOSUPPORT;
    assert_not_opened(EPROTONOSUPPORT);
    fake_interface.events_dead = true;
    assert_not_opened(EBADF);
    TEST_ASSERT_EQUAL_UINT(before, descriptors());
    setUp();
    TEST_ASSERT_GREATER_THAN_UINT(before, descriptors());
    iwl_bus_close(&store);
    TEST_ASSERT_EQUAL_UINT(before, descriptors());
    setUp();
}

TEST(test_socketcan_down_at_start_is_reported_without_netlink) {
    iwl_bus_close(&store);
    fake_interface.presence = IWL_LINK_DOWN;
    fake_interface.netlink_fails = true;
    TEST_ASSERT_EQUAL_INT(0, iwl_bus_open(&store, "can0"));
    TEST_ASSERT_EQUAL_INT(IWL_LINK_DOWN, link_now()->presence);
    TEST_ASSERT_EQUAL_INT(IW_BUS_DOWN, state());
}

TEST(test_socketcan_interface_without_sockets_is_down) {
    iwl_bus_close(&store);
    fake_interface.sockets_fail = true;
    TEST_ASSERT_EQUAL_INT(0, iwl_bus_open(&store, "can0"));
    assert_state_after_ms(1, IW_BUS_DOWN);
    TEST_ASSERT_EQUAL_INT(-1, receive());
    TEST_ASSERT_EQUAL_INT(-1, send_setpoint());
    fake_interface.sockets_fail = false;
    assert_state_after_ms(200, IW_BUS_ACTIVE);
}

TEST(test_socketcan_full_queue_is_no_loss) {
    fake_interface.send_result = 0;
    TEST_ASSERT_EQUAL_INT(0, send_setpoint());
    TEST_ASSERT_EQUAL_INT(IW_BUS_ACTIVE, state());
}

TEST(test_socketcan_purge_restarts_once_and_reports_the_result) {
    TEST_ASSERT_EQUAL_INT(0, iwl_bus_purge(&store));
    TEST_ASSERT_EQUAL_INT(0, iwl_bus_purge(&store));
    TEST_ASSERT_EQUAL_UINT(1, fake_interface.restarts);
    TEST_ASSERT_EQUAL_INT(3, fake_interface.restarted);
    const uint32_t changes = link_now()->changes;
    wait_ms(1);
    TEST_ASSERT_EQUAL_INT(IWL_LINK_PURGE_NONE, link_now()->purge);
    fake_interface.restart_result = 0;
    wait_ms(1);
    TEST_ASSERT_EQUAL_INT(IWL_LINK_PURGE_DONE, link_now()->purge);
    TEST_ASSERT_TRUE(link_now()->changes != changes);
    (void)iwl_bus_purge(&store);
    TEST_ASSERT_EQUAL_UINT(2, fake_interface.restarts);
}

TEST(test_socketcan_purge_result_survives_a_link_reading) {
    (void)iwl_bus_purge(&store);
    fake_interface.restart_result = 0;
    wait_ms(1);
    fake_interface.ours.error = ENETDOWN;
    wait_ms(1);
    fake_interface.link.restart_ms = 77;
    wait_ms(200);
    TEST_ASSERT_EQUAL_UINT32(77, link_now()->restart_ms);
    TEST_ASSERT_EQUAL_INT(IWL_LINK_PURGE_DONE, link_now()->purge);
}

TEST(test_socketcan_load_counts_all_frames) {
    wait_ms(1000);
    TEST_ASSERT_EQUAL_UINT32(0, link_now()->load_permille);
    for (unsigned i = 0; i < 20U; i++) {
        fake_interface_put(&fake_interface.ours, 256, 8, 0);
        wait_ms(10);
        (void)drain();
    }
    wait_ms(800);
    const uint32_t ours = link_now()->load_permille;
    TEST_ASSERT_GREATER_THAN_UINT32(1, ours);
    for (unsigned i = 0; i < 20U; i++) {
        fake_interface_put(&fake_interface.ours, 256, 8, 0);
        fake_interface_put(&fake_interface.others, 0x700, 8, 0);
        wait_ms(10);
        (void)drain();
    }
    wait_ms(800);
    TEST_ASSERT_EQUAL_UINT32(2U * ours, link_now()->load_permille);
}

TEST(test_socketcan_purge_that_was_not_permitted_is_not_retried) {
    (void)iwl_bus_purge(&store);
    fake_interface.restart_result = EPERM;
    wait_ms(1);
    TEST_ASSERT_EQUAL_INT(IWL_LINK_PURGE_NOT_ALLOWED, link_now()->purge);
    (void)iwl_bus_purge(&store);
    TEST_ASSERT_EQUAL_UINT(1, fake_interface.restarts);
}

TEST(test_socketcan_purge_without_a_proven_echo_does_not_restart) {
    iwl_bus_close(&store);
    fake_interface_init();
    fake_interface.link.echo_proven = false;
    TEST_ASSERT_EQUAL_INT(0, iwl_bus_open(&store, "vcan0"));
    (void)iwl_bus_purge(&store);
    TEST_ASSERT_EQUAL_UINT(0, fake_interface.restarts);
}

TEST(test_socketcan_error_flood_is_bounded_in_a_step) {
    for (unsigned i = 0; i < 1000U; i++) {
        fake_interface_put_error(CAN_ERR_CRTL, CAN_ERR_CRTL_RX_WARNING, 0);
    }
    wait_ms(1);
    TEST_ASSERT_EQUAL_UINT(0, drain());
    TEST_ASSERT_LESS_OR_EQUAL_UINT(10, fake_interface.fills);
    TEST_ASSERT_GREATER_THAN_UINT(600, fake_interface.ours.count);
}

TEST(test_socketcan_lost_frames_are_counted_and_carrier_is_read) {
    fake_interface.ours.lost = 7;
    fake_interface.carrier = 0; // The error frame of the bus-off is among the lost frames.
    wait_ms(1);
    TEST_ASSERT_EQUAL_UINT32(7, link_now()->lost);
    TEST_ASSERT_EQUAL_INT(IW_BUS_OFF, state());
}

TEST(test_socketcan_other_ids_come_after_ours_and_setpoints) {
    fake_interface_put(&fake_interface.others, 0x700, 4, 0);
    fake_interface_put(&fake_interface.ours, 256, 4, 0);
    wait_ms(20);
    TEST_ASSERT_EQUAL_INT(1, receive());
    TEST_ASSERT_EQUAL_HEX32(256, frame.id);
    TEST_ASSERT_EQUAL_INT(1, receive());
    TEST_ASSERT_EQUAL_HEX32(0x700, frame.id);
    TEST_ASSERT_EQUAL_INT(0, receive());
    fake_interface_put(&fake_interface.others, 0x701, 4, 0);
    assert_received_after_ms(1, 0);
    TEST_ASSERT_EQUAL_INT(1, send_setpoint());
    assert_received_after_ms(2, 0);
    wait_ms(1);
    TEST_ASSERT_EQUAL_INT(1, receive());
    TEST_ASSERT_EQUAL_HEX32(0x701, frame.id);
    assert_received_after_ms(20, 0);
    fake_interface_put(&fake_interface.others, 0x702, 4, 0);
    assert_received_after_ms(9, 0);
    assert_received_after_ms(1, 1);
}

TEST(test_socketcan_echo_has_the_mark_of_the_message) {
    fake_interface_put(&fake_interface.ours, 266, 5, MSG_CONFIRM | MSG_DONTROUTE);
    fake_interface_put(&fake_interface.ours, 266, 5, MSG_DONTROUTE);
    wait_ms(1);
    TEST_ASSERT_EQUAL_INT(1, receive());
    TEST_ASSERT_EQUAL_UINT8(IW_CAN_ECHO, frame.kind);
    TEST_ASSERT_EQUAL_INT(1, receive());
    TEST_ASSERT_EQUAL_UINT8(IW_CAN_RECEIVED, frame.kind);
}

TEST(test_socketcan_buffer_size_survives_a_link_reading) {
    TEST_ASSERT_EQUAL_UINT32(FAKE_ROOM, link_now()->room_bytes);
    fake_interface.ours.error = ENETDOWN;
    fake_interface.link.restart_ms = 99;
    wait_ms(1);
    wait_ms(300);
    TEST_ASSERT_EQUAL_UINT32(99, link_now()->restart_ms);
    TEST_ASSERT_EQUAL_UINT32(FAKE_ROOM, link_now()->room_bytes);
}

TEST(test_socketcan_events_are_read_only_after_a_wake_by_the_bus) {
    fake_interface.news = true;
    iwl_bus_waited(&store, false);
    wait_ms(1);
    TEST_ASSERT_TRUE(fake_interface.news);
    iwl_bus_waited(&store, true);
    wait_ms(1);
    TEST_ASSERT_FALSE(fake_interface.news);
}

TEST(test_socketcan_interface_up_is_found_without_a_wake) {
    set_down();
    fake_interface.presence = IWL_LINK_UP;
    fake_interface.news = true;
    iwl_bus_waited(&store, false);
    assert_state_after_ms(1, IW_BUS_DOWN); // The loss is reported once.
    TEST_ASSERT_EQUAL_INT(IW_BUS_ACTIVE, state());
}
