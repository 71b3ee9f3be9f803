// SPDX-License-Identifier: MIT
// The host code of the image with a line that damages, cuts, doubles, delays and invents: a million lines, judged by
// the commands that the wheels receive.
#include "host_rig.inc"

static uint32_t random_below(uint32_t limit) {
    chance = chance * 1664525U + 1013904223U;
    return (uint32_t)((uint64_t)(chance >> 8) * limit >> 24);
}

/// The judge receives no requests: the test reports them to it.
static void note_drive(void) {
    gateway_judge_asked(&rig.judge, true);
    gateway_judge_drive(&rig.judge, true);
}

static void drive_slowly(uint64_t stamp_us) {
    char line[IWN_LINE_BOARD_MAX];
    note_drive();
    put(line, drive_line(SLOW_MM_S, BOOT, ++seq, stamp_us, line));
    has_used = true;
}

/// Ends with a byte that no line contains. Otherwise the common part of two lines could repair the next line when its
/// beginning is missing.
static size_t end_short(char *line, size_t at) {
    line[at] = '?';
    return at + 1U;
}

/// Damages the line in one of several ways.
static size_t damage(char *line, size_t length) {
    const uint32_t at =
        1U + random_below((uint32_t)length - 2U); // A newline before the first byte would not change the line.
    const uint32_t count = 1U + random_below(12);
    switch (random_below(6)) {
    case 0:
        line[at] = (char)(line[at] ^ 1 << random_below(8));
        return length;
    case 1: // Bytes are cut out.
        memmove(&line[at], &line[at + count], (at + count < length) ? length - at - count : 0U);
        return (at + count < length) ? length - count : end_short(line, at);
    case 2: // Random bytes are inserted.
        memmove(&line[at + count], &line[at], length - at);
        for (uint32_t i = 0; i < count; i++) {
            line[at + i] = (char)random_below(256);
        }
        return length + count;
    case 3: // The end is missing, and the next line follows.
        return end_short(line, at);
    case 4: // The beginning is missing.
        memmove(line, &line[at], length - at);
        return length - at;
    default: // One digit is changed.
        line[at] = (char)((line[at] >= '0' && line[at] <= '9') ? '0' + (line[at] - '0' + 1) % 10 : line[at] ^ 0x20);
        return length;
    }
}

/// Sends a hostile line: damaged, or complete and old, doubled, of another start, or without a quote.
static void put_hostile(void) {
    static char captured[64][IWN_LINE_BOARD_MAX];
    static size_t stored_length[64];
    char line[IWN_LINE_BOARD_MAX + 16U];
    char good[IWN_LINE_BOARD_MAX];
    const uint32_t slot = random_below(64);
    size_t length = drive_line(FAST_MM_S, BOOT, seq + 1U + random_below(50), t_us, good);
    switch (random_below(8)) {
    case 0: // Delayed for longer than the lease.
        length = drive_line(FAST_MM_S, BOOT, seq + 1U, t_us - 205000U - random_below(1000000), line);
        break;
    case 1: // Doubled: the number was used before.
        length = drive_line(FAST_MM_S, has_used ? BOOT : ~BOOT, (seq > 50U) ? seq - random_below(50) : seq, t_us, line);
        break;
    case 2: // For another start of the board.
        length = drive_line(FAST_MM_S, BOOT ^ 1ULL << random_below(64), seq + 1U, t_us, line);
        break;
    case 3: // One of the stored lines, later.
        length = stored_length[slot];
        memcpy(line, captured[slot], length);
        break;
    default:
        memcpy(line, good, length);
        length = damage(line, length);
        if (length > 0U && iwn_line_read(line, length - 1U, false, &(iwn_line_t){0}) == IWN_LINE_GOOD) {
            length = 0; // Two equal digits were exchanged: the line is not damaged.
        }
        break;
    }
    stored_length[slot] = (length <= IWN_LINE_BOARD_MAX) ? length : 0U;
    memcpy(captured[slot], line, stored_length[slot]);
    put(line, length);
    put("\n", random_below(2)); // Some lines continue into the next line.
}

TEST(test_host_line_of_a_million_hostile_lines_none_is_executed) {
    const char *const config = getenv("IWHEEL_HOSTILE_LINES");
    const uint32_t wanted = (config != NULL) ? (uint32_t)strtoul(config, NULL, 10) : 1000000U;
    uint32_t lines = 0;
    for (uint32_t turn = 0; lines < wanted; turn++) {
        for (uint32_t i = 0; i < 60U; i++, lines++) {
            put_hostile();
        }
        put("\n", 1);
        say(0, "{\"cmd\":\"alive\"}");
        if (turn % 64U < 32U) {
            drive_slowly(t_us);
        }
        run_ms(20);
        if (turn % 64U == 63U) {
            TEST_ASSERT_EQUAL_INT_MESSAGE(0, rig.bus.commanded_mm_s[IW_LEFT], "hostile lines extended the lease");
            run_ms(2500);
            say(0, "{\"cmd\":\"link\"}"); // After this time without a relay its channels are closed.
            say(0, "{\"cmd\":\"open\",\"channel\":1,\"watch\":false}");
            run_ms(20);
            arm();
            has_used = false;
        }
    }
    TEST_ASSERT_GREATER_THAN_UINT32(wanted / 10U, refused);
    TEST_ASSERT_GREATER_THAN_UINT32(100, errors);
    TEST_ASSERT_GREATER_THAN_UINT32(wanted / 60U / 4U, accepted);
}

TEST(test_host_line_errors_are_reported_at_most_5_times_per_s) {
    for (uint32_t turn = 0; turn < 200U; turn++) {
        put("rubbish*00000000\n", 17);
        say(0, "{\"cmd\":\"alive\"}");
        run_ms(5);
    }
    TEST_ASSERT_LESS_OR_EQUAL_UINT32(6, errors);
    TEST_ASSERT_GREATER_OR_EQUAL_UINT32(4, errors);
}

/// The lease runs from the stamp that a command quotes, not from its receipt.
TEST(test_host_line_lease_of_delayed_commands_runs_from_the_stamp) {
    const uint64_t stamp_us = t_us;
    run_ms(150);
    say(0, "{\"cmd\":\"alive\"}");
    drive_slowly(stamp_us);
    run_ms(40);
    TEST_ASSERT_EQUAL_UINT32(1, accepted);
    run_ms(35);
    TEST_ASSERT_EQUAL_INT(IW_STATE_STOPPING, iw_gateway_state(&rig.gateway));
}

TEST(test_host_replies_have_the_id_and_the_result) {
    gateway_judge_renew(&rig.judge);
    ask("{\"cmd\":\"hello\",\"id\":1}", "\"name\":\"iwheel-gateway\"");
    ask("{\"cmd\":\"arm\",\"id\":2}", "\"id\":2,\"ok\":true");
    assert_answer("{\"cmd\":\"config\",\"id\":3,\"key\":\"no.such\",\"value\":\"1\"}", "\"id\":3,\"ok\":false");
    ask("{\"cmd\":\"recordings\",\"id\":4}", "\"error\":\"denied\"");
    say(0, "{\"cmd\":\"link\"}");
    run_ms(10);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(last_line, "\"event\":\"link\",\"boot\":\"0123456789abcdef\","), last_line);
}

TEST(test_host_reply_to_arm_is_sent_when_armed) {
    say(0, "{\"cmd\":\"open\",\"channel\":2,\"watch\":false}");
    disarm();
    gateway_judge_renew(&rig.judge);
    answer[0] = '\0';
    say(1, "{\"cmd\":\"arm\",\"id\":7}");
    run_ms(60);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(answer, "\"id\":7,\"ok\":true"), answer);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(answer, "\"state\":\"armed\""), answer);
}

static void assert_aged(const char *cmd, int64_t age_ms, const char *part) {
    char json[128];
    say(0, "{\"cmd\":\"alive\"}");
    (void)snprintf(json, sizeof json, "{\"cmd\":\"%s\",\"id\":5,\"t_us\":%lld%s}", cmd,
                   (long long)rig.now_us - age_ms * 1000, (strcmp(cmd, "confirm") == 0) ? ",\"item\":\"dlc\"" : "");
    assert_answer(json, part);
}

TEST(test_one_person_board_refuses_late_requests) {
    static const int64_t late_ms[] = {1100, 10000, 60000, -200};
    assert_answer("{\"cmd\":\"estop\",\"id\":1}", "\"ok\":true");
    pass(2500);
    for (size_t i = 0; i < sizeof late_ms / sizeof late_ms[0]; i++) {
        assert_aged("reset", late_ms[i], "\"error\":\"stale_command\"");
        assert_aged("confirm", late_ms[i], "\"error\":\"stale_command\"");
        TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, iw_gateway_state(&rig.gateway));
    }
    assert_aged("reset", 500, "\"ok\":true");
    for (size_t i = 0; i < sizeof late_ms / sizeof late_ms[0]; i++) {
        assert_aged("arm", late_ms[i], "\"error\":\"stale_command\"");
        TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, iw_gateway_state(&rig.gateway));
    }
    gateway_judge_renew(&rig.judge);
    assert_aged("arm", 500, "\"ok\":true");
    TEST_ASSERT_NULL_MESSAGE(strstr(answer, "key"), "a board has no random numbers");
}

TEST(test_one_person_board_reset_of_another_stop_is_refused) {
    assert_answer("{\"cmd\":\"estop\",\"id\":1}", "\"ok\":true");
    pass(2500);
    ask("{\"cmd\":\"reset\",\"id\":2,\"stop\":2}", "\"error\":\"stale_command\"");
    assert_answer("{\"cmd\":\"reset\",\"id\":3,\"stop\":0}", "\"error\":\"stale_command\"");
    say(0, "{\"cmd\":\"alive\"}");
    TEST_ASSERT_EQUAL_INT(IW_STATE_LATCHED, iw_gateway_state(&rig.gateway));
    assert_answer("{\"cmd\":\"reset\",\"id\":4,\"stop\":1}", "\"ok\":true");
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, iw_gateway_state(&rig.gateway));
}

/// Row 7: a command that is refused for its quote or its key still shows that a client requests motion.
TEST(test_one_person_board_refused_drive_makes_arm_stale) {
    static const char *const refused_for[] = {"\"cmd\":\"drive\",\"left_mm_s\":777,\"right_mm_s\":777",
                                              "\"cmd\":\"drive\",\"left_mm_s\":777,\"right_mm_s\":777,\"key\":\"00\"",
                                              "\"cmd\":\"drive\",\"left_mm_s\":0,\"right_mm_s\":0"};
    for (size_t i = 0; i < sizeof refused_for / sizeof refused_for[0]; i++) {
        char json[128];
        (void)snprintf(json, sizeof json, "{\"id\":5,%s}", refused_for[i]); // The command has no quote.
        assert_answer(json, "\"ok\":false");
        assert_answer("{\"cmd\":\"stop\",\"id\":6}", "\"ok\":true");
        say(0, "{\"cmd\":\"alive\"}");
        const bool counts = i < 2U;
        gateway_judge_renew(&rig.judge);
        assert_answer("{\"cmd\":\"arm\",\"id\":7}", counts ? "\"error\":\"stale_command\"" : "\"ok\":true");
        pass(2500);
        gateway_judge_renew(&rig.judge);
        assert_answer("{\"cmd\":\"arm\",\"id\":8}", "\"ok\":true");
    }
}

TEST(test_host_twist_turns_the_right_wheel_faster) {
    char line[IWN_LINE_BOARD_MAX];
    char json[256];
    note_drive();
    (void)snprintf(json, sizeof json,
                   "{\"boot\":\"%016llx\",\"seq\":%llu,\"t_us\":%llu,\"cmd\":\"twist\",\"v_mm_s\":50,"
                   "\"yaw_mrad_s\":100}",
                   (unsigned long long)BOOT, (unsigned long long)++seq, (unsigned long long)t_us);
    put(line, framed(1, json, line));
    run_ms(200);
    TEST_ASSERT_GREATER_THAN_INT(0, rig.bus.commanded_mm_s[IW_LEFT]);
    TEST_ASSERT_GREATER_THAN_INT(rig.bus.commanded_mm_s[IW_LEFT] + 20, rig.bus.commanded_mm_s[IW_RIGHT]);
}

TEST(test_host_state_is_sent_at_its_rate) {
    say(1, "{\"cmd\":\"watch\",\"topics\":[\"state\"],\"rate_hz\":10}");
    states = 0;
    pass(1000);
    TEST_ASSERT_UINT_WITHIN(3, 10, states);
}
