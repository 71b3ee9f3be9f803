// SPDX-License-Identifier: MIT
// The Linux port against a fake hub and a fake button: frames, echoes, losses, edges. Time is an argument; nothing
// sleeps.
#include "iwheel_linux/linux_hal.h"

#include "folder.h"
#include "unit.h"

#include <errno.h>
#include <linux/can.h>
#include <linux/can/error.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

static char bus_name[64];
static char estop_name[64];
static iwl_hal_t hal;
static int bus_listener;
static int estop_listener;
static int hub;
static int button;
static iw_time_us_t now_us;

static int listen_at(const char *name, int type) {
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    (void)snprintf(address.sun_path, sizeof address.sun_path, "%s", name + 5);
    (void)unlink(address.sun_path);
    const int fd = socket(AF_UNIX, type | SOCK_NONBLOCK, 0);
    TEST_ASSERT_EQUAL_INT(0, bind(fd, (const struct sockaddr *)&address, sizeof address));
    TEST_ASSERT_EQUAL_INT(0, listen(fd, 4));
    return fd;
}

static void press(const char *levels) {
    TEST_ASSERT_EQUAL_INT((int)strlen(levels), (int)send(button, levels, strlen(levels), MSG_NOSIGNAL));
}

static int estop(void) {
    return iwl_hal_pressed(&hal);
}

static iw_bus_state_t bus(void) {
    return iwl_bus_state(&hal.bus);
}

static iw_can_frame_t received; ///< Result of the last receive.

static int receive(void) {
    return iwl_bus_receive(&hal.bus, &received);
}

static void accept_hub(void) {
    hub = accept(bus_listener, NULL, NULL);
    TEST_ASSERT_TRUE(hub >= 0);
}

static void send_frame(uint32_t id, uint8_t dlc, uint8_t mark, uint8_t fill) {
    struct can_frame raw = {.can_id = id, .len = dlc};
    raw.__res0 = mark;
    memset(raw.data, fill, sizeof raw.data);
    TEST_ASSERT_EQUAL_INT((int)sizeof raw, (int)send(hub, &raw, sizeof raw, MSG_NOSIGNAL));
}

static bool wakes(int fd) {
    struct pollfd wait = {.fd = fd, .events = POLLIN};
    return poll(&wait, 1, 0) == 1;
}

void setUp(void) {
    const char *cause = NULL;
    folder_make();
    (void)snprintf(bus_name, sizeof bus_name, "unix:%s/bus", folder);
    (void)snprintf(estop_name, sizeof estop_name, "unix:%s/estop", folder);
    bus_listener = listen_at(bus_name, SOCK_SEQPACKET);
    now_us = 1000000;
    TEST_ASSERT_EQUAL_INT(0, iwl_hal_open(&hal, bus_name, &(iwl_estop_config_t){.name = estop_name}, &cause));
    accept_hub();
    TEST_ASSERT_EQUAL_INT(-1, estop());
    // Listen only now: otherwise the port would wait for the first byte of the button at start.
    estop_listener = listen_at(estop_name, SOCK_STREAM);
    iwl_hal_poll(&hal, now_us);
    button = accept(estop_listener, NULL, NULL);
    TEST_ASSERT_TRUE(button >= 0);
}

void tearDown(void) {
    iwl_hal_close(&hal);
    (void)close(hub);
    (void)close(button);
    (void)close(bus_listener);
    (void)close(estop_listener);
    folder_remove();
}

TEST(test_local_frame_is_sent_unchanged_and_its_echo_has_the_mark) {
    const iw_can_frame_t frame = {.id = 266, .dlc = 5, .data = {1, 2, 3, 4, 5}};
    struct can_frame raw;
    TEST_ASSERT_TRUE(iwl_bus_send(&hal.bus, &frame, 1) > 0);
    TEST_ASSERT_EQUAL_INT((int)sizeof raw, (int)recv(hub, &raw, sizeof raw, 0));
    TEST_ASSERT_EQUAL_HEX32(266, raw.can_id);
    TEST_ASSERT_EQUAL_UINT8(5, raw.len);
    TEST_ASSERT_EQUAL_UINT8(0, raw.__res0);
    TEST_ASSERT_EQUAL_MEMORY(frame.data, raw.data, 8);
    TEST_ASSERT_EQUAL_INT(0, receive());
    send_frame(266, 5, 1, 9);
    send_frame(266, 5, 0, 9);
    TEST_ASSERT_TRUE(wakes(iwl_hal_bus_fd(&hal)));
    TEST_ASSERT_EQUAL_INT(1, receive());
    TEST_ASSERT_EQUAL_UINT8(IW_CAN_ECHO, received.kind);
    TEST_ASSERT_EQUAL_INT(1, receive());
    TEST_ASSERT_EQUAL_UINT8(IW_CAN_RECEIVED, received.kind);
    TEST_ASSERT_EQUAL_INT(0, receive());
    TEST_ASSERT_FALSE(wakes(iwl_hal_bus_fd(&hal)));
}

TEST(test_local_frames_of_several_batches_arrive_in_order) {
    unsigned expected = 0;
    for (unsigned i = 0; i < 100; i++) {
        send_frame(i, 8, 0, (uint8_t)i);
    }
    for (unsigned tries = 0; tries < 300 && expected < 100; tries++) {
        if (receive() > 0) {
            TEST_ASSERT_EQUAL_HEX32(expected, received.id);
            expected++;
        }
    }
    TEST_ASSERT_EQUAL_UINT(100, expected);
}

TEST(test_local_frame_formats_differ) {
    send_frame(256U | CAN_RTR_FLAG, 4, 0, 0);
    send_frame(256U | CAN_EFF_FLAG, 4, 0, 0);
    send_frame(0x1ABCDEFU | CAN_EFF_FLAG | CAN_RTR_FLAG, 4, 0, 0);
    TEST_ASSERT_EQUAL_INT(1, receive());
    TEST_ASSERT_EQUAL_HEX32(256U | IW_CAN_REMOTE, received.id);
    TEST_ASSERT_EQUAL_INT(1, receive());
    TEST_ASSERT_EQUAL_HEX32(256U | IW_CAN_EXTENDED, received.id);
    TEST_ASSERT_EQUAL_INT(1, receive());
    TEST_ASSERT_EQUAL_HEX32(0x1ABCDEFU | IW_CAN_EXTENDED | IW_CAN_REMOTE, received.id);
}

TEST(test_local_messages_of_another_size_are_ignored) {
    char junk[40] = {0};
    TEST_ASSERT_EQUAL_INT(15, (int)send(hub, junk, 15, 0));
    TEST_ASSERT_EQUAL_INT(17, (int)send(hub, junk, 17, 0));
    TEST_ASSERT_EQUAL_INT(40, (int)send(hub, junk, 40, 0));
    send_frame(257, 7, 0, 0);
    TEST_ASSERT_EQUAL_INT(1, receive());
    TEST_ASSERT_EQUAL_HEX32(257, received.id);
    TEST_ASSERT_EQUAL_INT(0, receive());
}

TEST(test_local_hub_lost_and_back_between_reads_is_reported_once) {
    TEST_ASSERT_EQUAL_INT(IW_BUS_ACTIVE, bus());
    send_frame(256, 4, 0, 0);
    (void)close(hub);
    TEST_ASSERT_EQUAL_INT(1, receive()); // A frame received before the end still counts.
    TEST_ASSERT_TRUE(receive() < 0);
    iwl_hal_poll(&hal, now_us); // The port reconnects immediately.
    accept_hub();
    TEST_ASSERT_EQUAL_INT(IW_BUS_DOWN, bus());
    TEST_ASSERT_EQUAL_INT(IW_BUS_ACTIVE, bus());
}

TEST(test_local_half_read_batch_is_dropped_when_the_hub_is_lost) {
    const iw_can_frame_t frame = {.id = 266, .dlc = 5};
    for (unsigned i = 0; i < 10; i++) {
        send_frame(256, 4, 0, 0);
    }
    TEST_ASSERT_EQUAL_INT(1, receive());
    (void)close(hub);
    TEST_ASSERT_TRUE(iwl_bus_send(&hal.bus, &frame, 1) < 0);
    iwl_hal_poll(&hal, now_us); // The port reconnects immediately.
    accept_hub();
    TEST_ASSERT_EQUAL_INT(0, receive());
    TEST_ASSERT_EQUAL_INT(IW_BUS_DOWN, bus());
}

TEST(test_local_lost_hub_is_down_and_retried_at_the_back_off) {
    const iw_can_frame_t frame = {.id = 266, .dlc = 5};
    (void)close(bus_listener);
    (void)close(hub);
    TEST_ASSERT_TRUE(receive() < 0);
    unsigned attempts = 0;
    for (unsigned i = 0; i < 1000; i++) { // One second, with a poll every millisecond.
        const iw_time_us_t before_us = iwl_hal_next_us(&hal);
        iwl_hal_poll(&hal, now_us);
        attempts += (iwl_hal_next_us(&hal) != before_us) ? 1U : 0U;
        TEST_ASSERT_TRUE(iwl_hal_next_us(&hal) > now_us);
        TEST_ASSERT_TRUE(iwl_hal_next_us(&hal) <= now_us + 200000U);
        TEST_ASSERT_EQUAL_INT(IW_BUS_DOWN, bus());
        TEST_ASSERT_TRUE(iwl_bus_send(&hal.bus, &frame, 1) < 0);
        TEST_ASSERT_TRUE(receive() < 0);
        now_us += 1000;
    }
    TEST_ASSERT_TRUE(attempts >= 5 && attempts <= 10);
    TEST_ASSERT_FALSE(wakes(iwl_hal_bus_fd(&hal)));
    bus_listener = listen_at(bus_name, SOCK_SEQPACKET);
    now_us += 200000;
    iwl_hal_poll(&hal, now_us);
    accept_hub();
    TEST_ASSERT_EQUAL_INT(IW_BUS_ACTIVE, bus());
}

TEST(test_local_error_frames_change_only_the_state) {
    struct can_frame passive = {.can_id = CAN_ERR_FLAG | CAN_ERR_CRTL, .len = 8};
    passive.data[1] = CAN_ERR_CRTL_TX_PASSIVE;
    TEST_ASSERT_EQUAL_INT(16, (int)send(hub, &passive, sizeof passive, 0));
    TEST_ASSERT_EQUAL_INT(0, receive());
    TEST_ASSERT_EQUAL_INT(IW_BUS_PASSIVE, bus());
    send_frame(CAN_ERR_FLAG | CAN_ERR_BUSOFF, 8, 0, 0);
    send_frame(CAN_ERR_FLAG | CAN_ERR_RESTARTED, 8, 0, 0);
    TEST_ASSERT_EQUAL_INT(0, receive());
    TEST_ASSERT_EQUAL_INT(IW_BUS_OFF, bus()); // A short bus-off is reported, too.
    TEST_ASSERT_EQUAL_INT(IW_BUS_ACTIVE, bus());
    send_frame(CAN_ERR_FLAG | CAN_ERR_BUSOFF, 8, 0, 0);
    TEST_ASSERT_EQUAL_INT(0, receive());
    TEST_ASSERT_EQUAL_INT(IW_BUS_OFF, bus());
    TEST_ASSERT_EQUAL_INT(IW_BUS_OFF, bus());
}

TEST(test_local_state_frames_of_clients_cannot_end_bus_off) {
    static const uint32_t good[] = {CAN_ERR_FLAG | CAN_ERR_RESTARTED, CAN_ERR_FLAG | CAN_ERR_CRTL};
    send_frame(CAN_ERR_FLAG | CAN_ERR_BUSOFF, 8, 2, 0);
    TEST_ASSERT_EQUAL_INT(0, receive());
    TEST_ASSERT_EQUAL_INT(IW_BUS_OFF, bus());
    TEST_ASSERT_EQUAL_INT(IW_BUS_ACTIVE, bus());
    send_frame(CAN_ERR_FLAG | CAN_ERR_BUSOFF, 8, 0, 0);
    TEST_ASSERT_EQUAL_INT(0, receive());
    for (size_t i = 0; i < 2; i++) {
        send_frame(good[i], 8, 2, CAN_ERR_CRTL_ACTIVE);
        send_frame(good[i], 8, 2, CAN_ERR_CRTL_TX_PASSIVE);
        TEST_ASSERT_EQUAL_INT(0, receive());
        TEST_ASSERT_EQUAL_INT(IW_BUS_OFF, bus());
    }
    send_frame(CAN_ERR_FLAG | CAN_ERR_CRTL, 8, 0,
               CAN_ERR_CRTL_ACTIVE); // The frame of the controller does not end bus-off either.
    send_frame(CAN_ERR_FLAG | CAN_ERR_CRTL, 8, 0, CAN_ERR_CRTL_TX_PASSIVE);
    TEST_ASSERT_EQUAL_INT(0, receive());
    TEST_ASSERT_EQUAL_INT(IW_BUS_OFF, bus());
}

TEST(test_local_restart_reports_a_missed_bus_off) {
    send_frame(CAN_ERR_FLAG | CAN_ERR_RESTARTED, 8, 0, 0);
    TEST_ASSERT_EQUAL_INT(0, receive());
    TEST_ASSERT_EQUAL_INT(IW_BUS_OFF, bus());
    TEST_ASSERT_EQUAL_INT(IW_BUS_ACTIVE, bus());
}

TEST(test_local_full_hub_refuses_the_frame_and_stays_active) {
    const iw_can_frame_t frame = {.id = 266, .dlc = 5};
    unsigned sent = 0;
    int result = 1;
    while (result > 0) {
        result = iwl_bus_send(&hal.bus, &frame, 1);
        sent += (result > 0) ? 1U : 0U;
        TEST_ASSERT_LESS_THAN_UINT(100000, sent);
    }
    TEST_ASSERT_EQUAL_INT(0, result);
    TEST_ASSERT_EQUAL_INT(IW_BUS_ACTIVE, bus());
}

TEST(test_local_purge_reconnects_to_the_hub_and_reports_a_loss) {
    const iw_can_frame_t frame = {.id = 266, .dlc = 5};
    struct can_frame raw;
    TEST_ASSERT_TRUE(iwl_bus_send(&hal.bus, &frame, 1) > 0);
    TEST_ASSERT_EQUAL_INT(IWL_LINK_PURGE_NONE, iwl_hal_link(&hal)->purge);
    TEST_ASSERT_EQUAL_INT(0, iwl_bus_purge(&hal.bus));
    TEST_ASSERT_EQUAL_INT(IWL_LINK_PURGE_DONE, iwl_hal_link(&hal)->purge);
    const uint32_t changes = iwl_hal_link(&hal)->changes;
    TEST_ASSERT_EQUAL_INT(0, iwl_bus_purge(&hal.bus)); // There is no connection to leave.
    TEST_ASSERT_EQUAL_UINT32(changes, iwl_hal_link(&hal)->changes);
    TEST_ASSERT_EQUAL_INT((int)sizeof raw, (int)recv(hub, &raw, sizeof raw, 0));
    // End of the connection: the hub drops its queued frames.
    TEST_ASSERT_EQUAL_INT(0, (int)recv(hub, &raw, sizeof raw, 0));
    (void)close(hub);
    iwl_hal_poll(&hal, now_us);
    accept_hub();
    TEST_ASSERT_EQUAL_INT(IW_BUS_DOWN, bus());
    TEST_ASSERT_EQUAL_INT(IW_BUS_ACTIVE, bus());
    TEST_ASSERT_EQUAL_INT(0, receive()); // No echo of an earlier frame arrives.
    TEST_ASSERT_TRUE(iwl_bus_send(&hal.bus, &frame, 1) > 0);
}

TEST(test_local_estop_is_unreadable_until_the_first_byte) {
    TEST_ASSERT_EQUAL_INT(-1, estop());
    press("0");
    TEST_ASSERT_TRUE(wakes(iwl_hal_estop_fd(&hal)));
    TEST_ASSERT_EQUAL_INT(0, estop());
    TEST_ASSERT_EQUAL_INT(0, estop());
}

TEST(test_local_estop_pulse_between_two_reads_is_an_edge) {
    press("0");
    TEST_ASSERT_EQUAL_INT(0, estop());
    press("10");
    TEST_ASSERT_TRUE(estop() > 0);
    TEST_ASSERT_EQUAL_INT(0, estop());
    press("1");
    TEST_ASSERT_TRUE(estop() > 0);
    TEST_ASSERT_TRUE(estop() > 0);
    press("0");
    TEST_ASSERT_TRUE(estop() > 0); // The release is an edge, too.
    TEST_ASSERT_EQUAL_INT(0, estop());
    press("100"); // The button reports "released" twice.
    TEST_ASSERT_TRUE(estop() > 0);
    TEST_ASSERT_EQUAL_INT(0, estop());
}

TEST(test_local_estop_any_byte_but_zero_is_pressed) {
    press("0");
    TEST_ASSERT_EQUAL_INT(0, estop());
    press("?");
    TEST_ASSERT_TRUE(estop() > 0);
    TEST_ASSERT_TRUE(estop() > 0);
}

TEST(test_local_estop_reconnected_is_unreadable_until_first_byte) {
    press("0");
    TEST_ASSERT_EQUAL_INT(0, estop());
    (void)close(button);
    TEST_ASSERT_EQUAL_INT(-1, estop());
    iwl_hal_poll(&hal, now_us);
    button = accept(estop_listener, NULL, NULL);
    TEST_ASSERT_TRUE(button >= 0);
    TEST_ASSERT_EQUAL_INT(-1, estop());
    press("0");
    TEST_ASSERT_EQUAL_INT(0, estop());
    TEST_ASSERT_EQUAL_INT(0, hal.estop_last);
}

TEST(test_local_names_without_a_backend_leave_no_descriptor_open) {
    static iwl_hal_t other;
    const char *cause = NULL;
    const int before = dup(0);
    (void)close(before);
    const iwl_estop_config_t none = {.name = "none"};
    const iwl_estop_config_t no_line = {.name = "gpiochip0:x"};
    const iwl_estop_config_t no_path = {.name = "unix:"};
    TEST_ASSERT_EQUAL_INT(ENOTSUP, iwl_hal_open(&other, "can_of_16_letters", &none, &cause));
    TEST_ASSERT_EQUAL_STRING("can_of_16_letters", cause);
    TEST_ASSERT_NOT_EQUAL_INT(0, iwl_hal_open(&other, bus_name, &no_line, &cause));
    TEST_ASSERT_EQUAL_STRING("gpiochip0:x", cause);
    TEST_ASSERT_EQUAL_INT(ENOENT, iwl_hal_open(&other, bus_name, &no_path, &cause));
    TEST_ASSERT_EQUAL_STRING("unix:", cause);
    char longest[200] = "unix:";
    memset(&longest[5], 'x', 150);
    TEST_ASSERT_EQUAL_INT(ENAMETOOLONG, iwl_hal_open(&other, longest, &none, &cause));
    const int after = dup(0);
    (void)close(after);
    TEST_ASSERT_EQUAL_INT(before, after);
}

TEST(test_local_two_contacts_must_be_of_one_kind) {
    static iwl_hal_t other;
    static char second_name[200];
    const char *cause = NULL;
    const int before = dup(0);
    (void)close(before);
    (void)snprintf(second_name, sizeof second_name, "%s2", estop_name);
    const struct {
        const char *first;
        const char *second;
        int error;
    } rows[] = {{estop_name, estop_name, ENOTUNIQ},
                {estop_name, "gpiochip0:4", EXDEV},
                {"none", second_name, EXDEV},
                {estop_name, "unix:", ENOENT},
                {estop_name, "none", 0},
                {estop_name, NULL, 0},
                {estop_name, second_name, 0}};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        const iwl_estop_config_t config = {.name = rows[i].first, .name2 = rows[i].second, .discrepancy_ms = 200};
        TEST_ASSERT_EQUAL_INT(rows[i].error, iwl_hal_open(&other, bus_name, &config, &cause));
        if (rows[i].error != 0) {
            TEST_ASSERT_EQUAL_STRING(rows[i].second, cause);
        } else {
            TEST_ASSERT_EQUAL(rows[i].second == second_name, other.two_contacts);
            TEST_ASSERT_EQUAL_UINT32(200000U, other.pair.limit_us);
            iwl_hal_close(&other);
        }
    }
    const int after = dup(0);
    (void)close(after);
    TEST_ASSERT_EQUAL_INT(before, after);
}

TEST(test_local_without_an_estop_is_released) {
    static iwl_hal_t other;
    const char *cause = NULL;
    TEST_ASSERT_EQUAL_INT(0, iwl_hal_open(&other, bus_name, &(iwl_estop_config_t){.name = "none"}, &cause));
    TEST_ASSERT_EQUAL_INT(0, iwl_hal_pressed(&other));
    TEST_ASSERT_EQUAL_INT(-1, iwl_hal_estop_fd(&other));
    TEST_ASSERT_FALSE(other.estop_ops->present);
    iwl_hal_close(&other);
}

static void lose_hub(void) {
    (void)close(hub);
    TEST_ASSERT_TRUE(receive() < 0);
}

static void assert_waits_longer_and_longer(void) {
    static const unsigned gaps_ms[] = {20, 40, 80, 160, 200, 200};
    for (size_t i = 0; i < sizeof gaps_ms / sizeof gaps_ms[0]; i++) {
        iwl_bus_poll(&hal.bus, now_us);
        TEST_ASSERT_EQUAL_UINT64(now_us + gaps_ms[i] * 1000U, iwl_bus_next_us(&hal.bus));
        now_us = iwl_bus_next_us(&hal.bus);
    }
}

static void come_back(void) {
    bus_listener = listen_at(bus_name, SOCK_SEQPACKET);
    iwl_bus_poll(&hal.bus, now_us);
    accept_hub();
}

TEST(test_local_lost_hub_is_retried_with_growing_intervals) {
    for (unsigned time = 0; time < 2U; time++) {
        (void)close(bus_listener);
        lose_hub();
        assert_waits_longer_and_longer();
        come_back();
    }
}

TEST(test_local_hub_absent_at_start_is_retried_after_20_ms) {
    static iwl_hal_t other;
    const char *cause = NULL;
    char name[96];
    (void)snprintf(name, sizeof name, "%s.nobody", bus_name);
    TEST_ASSERT_EQUAL_INT(0, iwl_hal_open(&other, name, &(iwl_estop_config_t){.name = "none"}, &cause));
    iwl_bus_poll(&other.bus, now_us);
    TEST_ASSERT_EQUAL_UINT64(now_us + 20000U, iwl_bus_next_us(&other.bus));
    iwl_hal_close(&other);
}

TEST(test_local_bus_off_lasts_until_a_new_hub) {
    send_frame(CAN_ERR_FLAG | CAN_ERR_BUSOFF, 8, 0, 0);
    TEST_ASSERT_EQUAL_INT(0, receive());
    for (unsigned ms = 0; ms < 5U; ms++) {
        iwl_bus_poll(&hal.bus, now_us += 1000U);
        TEST_ASSERT_EQUAL_INT(IW_BUS_OFF, bus());
    }
    (void)close(bus_listener);
    lose_hub();
    come_back();
    TEST_ASSERT_EQUAL_INT(IW_BUS_DOWN, bus());
    TEST_ASSERT_EQUAL_INT(IW_BUS_ACTIVE, bus());
}

TEST(test_local_without_descriptors_open_fails_and_poll_retries) {
    static iwl_hal_t other;
    const char *cause = NULL;
    struct rlimit before;
    lose_hub();
    TEST_ASSERT_EQUAL_INT(0, getrlimit(RLIMIT_NOFILE, &before));
    const struct rlimit none = {.rlim_cur = 0, .rlim_max = before.rlim_max};
    TEST_ASSERT_EQUAL_INT(0, setrlimit(RLIMIT_NOFILE, &none));
    const int error = iwl_hal_open(&other, bus_name, &(iwl_estop_config_t){.name = "none"}, &cause);
    iwl_bus_poll(&hal.bus, now_us);
    const iw_time_us_t next_us = iwl_bus_next_us(&hal.bus);
    TEST_ASSERT_EQUAL_INT(0, setrlimit(RLIMIT_NOFILE, &before));
    TEST_ASSERT_EQUAL_INT(EMFILE, error);
    TEST_ASSERT_EQUAL_UINT64(now_us + 20000U, next_us);
    now_us = next_us;
    iwl_bus_poll(&hal.bus, now_us);
    accept_hub();
}

TEST(test_local_bus_has_no_timing_and_a_proven_echo) {
    const iwl_bus_link_t *link = iwl_hal_link(&hal);
    TEST_ASSERT_EQUAL_INT(IWL_LINK_LOCAL, link->presence);
    TEST_ASSERT_TRUE(link->is_virtual);
    TEST_ASSERT_TRUE(link->echo_proven);
}
