// SPDX-License-Identifier: MIT
// Opening and ending of the channels of the serial line, the age limit of commands, and writes to flash.
#include "host_rig.inc"

/// Lets time pass with a relay that sends only `noise`, every 50 ms.
static void run_with_noise(unsigned span_ms, const char *noise) {
    for (unsigned ms = 0; ms < span_ms; ms += 50U) {
        put(noise, strlen(noise));
        run_ms(50);
    }
}

static void assert_channel_ends_with(const char *noise) {
    run_with_noise(IWN_LINE_SILENT_MS + 50U, noise);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(IW_CLIENT_NONE, host.client[0].served.id, noise);
}

TEST(test_channel_opened_again_has_no_lease) {
    const iw_client_t before = host.client[0].served.id;
    say(0, "{\"cmd\":\"open\",\"channel\":1,\"watch\":false}");
    run_ms(20);
    TEST_ASSERT_NOT_EQUAL_UINT(before, host.client[0].served.id);
    TEST_ASSERT_EQUAL_UINT(IW_CLIENT_NONE, gateway_rig_snapshot(&rig).holder);
    TEST_ASSERT_NOT_EQUAL_INT(IW_STATE_ARMED, iw_gateway_state(&rig.gateway));
    assert_answer("{\"cmd\":\"hello\",\"id\":3}", "\"name\":\"iwheel-gateway\"");
}

TEST(test_channel_of_a_relay_that_sends_noise_ends) {
    assert_channel_ends_with("7f3a\n");
}

TEST(test_channel_of_a_relay_with_wrong_checksums_ends) {
    assert_channel_ends_with("0 {\"cmd\":\"alive\"}*00000000\n");
}

TEST(test_channel_of_a_relay_that_sends_alive_stays_open) {
    char line[IWN_LINE_BOARD_MAX];
    line[framed(0, "{\"cmd\":\"alive\"}", line)] = '\0';
    run_with_noise(2U * IWN_LINE_SILENT_MS, line);
    TEST_ASSERT_NOT_EQUAL_UINT(IW_CLIENT_NONE, host.client[0].served.id);
}

/// Starts the host with another lease than the gateway and connects its relay.
static void start_with_lease(uint16_t lease_ms) {
    memset(&host, 0, sizeof host);
    rig.gateway.config.lease_ms = lease_ms;
    brd_host_init(&host, &place, rig.now_us);
    rig.gateway.config.lease_ms = rig.config.lease_ms;
    TEST_ASSERT_EQUAL_UINT32(lease_ms * 1000U, host.lease_us);
    say(0, "{\"cmd\":\"link\"}");
    say(0, "{\"cmd\":\"open\",\"channel\":1,\"watch\":false}");
    run_ms(20);
}

/// Sends a command with a stamp of this age.
static void drive_with_age(uint32_t age_ms) {
    char line[IWN_LINE_BOARD_MAX];
    const uint64_t stamp_us = t_us;
    refused = 0;
    run_ms(age_ms);
    put(line, drive_line(SLOW_MM_S, BOOT, ++seq, stamp_us, line));
    run_ms(10);
}

TEST(test_command_older_than_a_short_lease_is_stale) {
    start_with_lease(100);
    drive_with_age(150);
    TEST_ASSERT_EQUAL_UINT32(1, refused);
}

TEST(test_command_within_a_long_lease_is_not_stale) {
    start_with_lease(450);
    drive_with_age(300);
    TEST_ASSERT_EQUAL_UINT32(0, refused);
}

static void disarm_silently(void) {
    disarm();
    TEST_ASSERT_TRUE(brd_host_is_silent(&host));
}

TEST(test_flash_is_not_written_while_an_arm_waits) {
    disarm_silently();
    say(0, "{\"cmd\":\"alive\"}");
    gateway_judge_renew(&rig.judge);
    say(1, "{\"cmd\":\"arm\"}"); // Both lines are in one batch: the gateway does not step between them.
    say(1, "{\"cmd\":\"config\",\"commit\":true,\"id\":5}");
    forget();
    run_ms(20);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(all, "\"error\":\"denied\""), all);
    TEST_ASSERT_EQUAL_UINT64(0, host.restart_us);
}

TEST(test_channel_with_two_lines_executes_one_per_call) {
    say(1, "{\"cmd\":\"hello\",\"id\":1}");
    say(1, "{\"cmd\":\"hello\",\"id\":2}");
    answer[0] = '\0';
    TEST_ASSERT_TRUE(brd_host_receive(&host, rig.now_us));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(answer, "\"id\":1"), answer);
    TEST_ASSERT_TRUE(brd_host_receive(&host, rig.now_us));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(answer, "\"id\":2"), answer);
    TEST_ASSERT_FALSE(brd_host_receive(&host, rig.now_us));
}

TEST(test_channel_that_only_watches_may_not_arm) {
    disarm_silently();
    say(0, "{\"cmd\":\"open\",\"channel\":2,\"watch\":true}");
    say(2, "{\"cmd\":\"arm\",\"id\":9}");
    forget();
    run_ms(60);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(all, "\"id\":9,\"ok\":false,\"error\":\"denied\""), all);
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, iw_gateway_state(&rig.gateway));
}

TEST(test_channel_closed_does_not_affect_other_channels) {
    say(0, "{\"cmd\":\"open\",\"channel\":2,\"watch\":false}");
    say(0, "{\"cmd\":\"close\",\"channel\":2}");
    run_ms(20);
    TEST_ASSERT_NOT_EQUAL_UINT(IW_CLIENT_NONE, host.client[0].served.id);
    TEST_ASSERT_EQUAL_UINT(IW_CLIENT_NONE, host.client[1].served.id);
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, iw_gateway_state(&rig.gateway));
}

/// Requests `count` snapshots on as many channels, from `first` on, in one batch: no event is sent between them.
static void ask_for_status(unsigned first, unsigned count) {
    char json[64];
    for (unsigned channel = first; channel < first + count; channel++) {
        (void)snprintf(json, sizeof json, "{\"cmd\":\"open\",\"channel\":%u,\"watch\":true}", channel);
        say(0, json);
        (void)snprintf(json, sizeof json, "{\"cmd\":\"status\",\"id\":%u}", 100U + channel);
        say((uint8_t)channel, json);
    }
}

static void assert_reported(const char *part) {
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(all, part), part);
}

TEST(test_pending_replies_leave_a_place_for_an_arm) {
    char part[64];
    disarm_silently();
    say(0, "{\"cmd\":\"alive\"}");
    gateway_judge_renew(&rig.judge);
    forget();
    say(1, "{\"cmd\":\"status\",\"id\":101}");
    ask_for_status(2, IWN_LINE_CHANNELS - 1U);
    say(1, "{\"cmd\":\"arm\",\"id\":99}");
    run_ms(120);
    for (unsigned channel = 1; channel <= IWN_LINE_CHANNELS; channel++) {
        (void)snprintf(part, sizeof part, "\"id\":%u,\"ok\":true", 100U + channel);
        assert_reported(part);
    }
    assert_reported("\"id\":99,\"ok\":true");
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, iw_gateway_state(&rig.gateway));
}

TEST(test_pending_reply_of_a_closed_channel_frees_its_place) {
    forget();
    ask_for_status(2, 3);
    say(0, "{\"cmd\":\"close\",\"channel\":3}");
    say(1, "{\"cmd\":\"status\",\"id\":7}");
    run_ms(60);
    assert_reported("\"id\":102,\"ok\":true");
    assert_reported("\"id\":104,\"ok\":true");
    assert_reported("\"id\":7,\"ok\":true");
    TEST_ASSERT_NULL(strstr(all, "\"id\":103"));
}

TEST(test_pending_place_belongs_to_one_client_and_request) {
    static brd_pending_t pool;
    const iwn_id_t one = {.kind = IWN_ID_NUMBER, .number = 1};
    const iwn_id_t two = {.kind = IWN_ID_NUMBER, .number = 2};
    memset(&pool, 0, sizeof pool);
    TEST_ASSERT_EQUAL_INT(IWN_ID_NONE, brd_pending_take(&pool, 5, IWN_CMD_ARM)->kind);
    brd_pending_put(&pool, 5, IWN_CMD_ARM, &one);
    brd_pending_put(&pool, 5, IWN_CMD_STATUS, &two);
    TEST_ASSERT_EQUAL_INT(IWN_ID_NONE, brd_pending_take(&pool, 6, IWN_CMD_ARM)->kind);
    brd_pending_put(&pool, 5, IWN_CMD_ARM, &two);
    TEST_ASSERT_EQUAL_INT64(2, brd_pending_take(&pool, 5, IWN_CMD_ARM)->number);
    TEST_ASSERT_EQUAL_INT(IWN_ID_NONE, brd_pending_take(&pool, 5, IWN_CMD_ARM)->kind);
    TEST_ASSERT_EQUAL_INT64(2, brd_pending_take(&pool, 5, IWN_CMD_STATUS)->number);
}

TEST(test_pending_pool_full_accepts_only_clients_that_wait_in_it) {
    static brd_pending_t pool;
    const iwn_id_t id = {.kind = IWN_ID_NUMBER, .number = 1};
    memset(&pool, 0, sizeof pool);
    for (iw_client_t client = 1; client <= IWN_LINE_CHANNELS; client++) {
        TEST_ASSERT_TRUE(brd_pending_has_room(&pool, client, IWN_CMD_STATUS));
        brd_pending_put(&pool, client, IWN_CMD_STATUS, &id);
    }
    TEST_ASSERT_FALSE(brd_pending_has_room(&pool, 99, IWN_CMD_STATUS));
    TEST_ASSERT_TRUE(brd_pending_has_room(&pool, 1, IWN_CMD_STATUS));
    brd_pending_put(&pool, 99, IWN_CMD_STATUS, &id); // No entry is replaced.
    TEST_ASSERT_EQUAL_INT(IWN_ID_NONE, brd_pending_take(&pool, 99, IWN_CMD_STATUS)->kind);
    for (iw_client_t client = 1; client <= BRD_PENDING_ARMS; client++) {
        TEST_ASSERT_TRUE(brd_pending_has_room(&pool, client, IWN_CMD_ARM));
        brd_pending_put(&pool, client, IWN_CMD_ARM, &id);
    }
    TEST_ASSERT_FALSE(brd_pending_has_room(&pool, 8, IWN_CMD_ARM));
    brd_pending_forget(&pool, 2);
    TEST_ASSERT_TRUE(brd_pending_has_room(&pool, 8, IWN_CMD_ARM));
    TEST_ASSERT_TRUE(brd_pending_has_room(&pool, 99, IWN_CMD_STATUS));
    TEST_ASSERT_EQUAL_INT64(1, brd_pending_take(&pool, 1, IWN_CMD_STATUS)->number);
    TEST_ASSERT_EQUAL_INT64(1, brd_pending_take(&pool, 1, IWN_CMD_ARM)->number);
    TEST_ASSERT_EQUAL_INT64(1, brd_pending_take(&pool, IWN_LINE_CHANNELS, IWN_CMD_STATUS)->number);
}
