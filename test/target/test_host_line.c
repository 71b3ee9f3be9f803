// SPDX-License-Identifier: MIT
// The image's own host code against a line that damages, cuts, doubles, delays and invents: a million lines, judged by what the
// wheels are told. The clock is virtual, the serial driver is replaced by this file.
#include "gateway_rig.h"
#include "unity.h"

#include "host.h"
#include "serial.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define FAST_MM_S 777 // What every hostile line asks for.
#define SLOW_MM_S 100 // What the good ones do.
#define BOOT      0x0123456789abcdefU

static gateway_rig_t rig;
static iw_host_t host;
static char wire[65536]; // To the board.
static size_t wire_length, wire_taken;
static uint64_t t_us, seq; // The newest stamp heard, and the newest number that was used.
static bool has_used;      // ... since the channel was opened.
static uint32_t errors, refused, accepted, written;
static uint32_t chance = 1;
static char answer[IW_HOST_LINE_BYTES + 1U]; // The last line with an id.
static char heard[IW_HOST_LINE_BYTES + 1U];  // The last line at all.
static uint32_t states;                      // Events `state`.
static char all[1U << 16];                   // The lines since `forget`, as many as fit.
static size_t all_length;
static bool estop_high;
static iw_learnt_t flash; // What is kept of the wheels,
static bool has_flash, flash_fails;
static uint32_t flash_writes;

size_t iw_serial_read(char *out, size_t size) {
    const size_t count = (size < wire_length - wire_taken) ? size : wire_length - wire_taken;
    memcpy(out, &wire[wire_taken], count);
    wire_taken += count;
    return count;
}

bool iw_serial_had_error(void) {
    return false;
}

size_t iw_serial_room(void) {
    return IW_SERIAL_SEND_BYTES;
}

/// Every line that the board writes is right.
bool iw_serial_write(const char *bytes, size_t length) {
    iwn_line_t line;
    TEST_ASSERT_EQUAL_CHAR('\n', bytes[length - 1U]);
    TEST_ASSERT_EQUAL_INT(IWN_LINE_GOOD, iwn_line_read(bytes, length - 1U, true, &line));
    t_us = line.t_us;
    written++;
    char text[IW_HOST_LINE_BYTES + 1U];
    memcpy(text, line.json, line.length);
    text[line.length] = '\0';
    memcpy(heard, text, line.length + 1U);
    if (all_length + line.length < sizeof all) {
        memcpy(&all[all_length], text, line.length + 1U);
        all_length += line.length;
    }
    if (strstr(text, "\"id\":") != NULL) {
        memcpy(answer, text, line.length + 1U);
    }
    states += (strstr(text, "\"event\":\"state\"") != NULL) ? 1U : 0U;
    errors += (strstr(text, "line_error") != NULL) ? 1U : 0U;
    refused += (strstr(text, "stale_command") != NULL) ? 1U : 0U;
    accepted += (strstr(text, "\"limited\"") != NULL) ? 1U : 0U;
    return true;
}

bool iw_serial_lend(const char *bytes, size_t length) {
    return iw_serial_write(bytes, length);
}

bool iw_serial_lends(void) {
    return false;
}

bool iw_serial_is_idle(void) {
    return true;
}

bool iw_host_keep(const iw_settings_t *settings) {
    (void)settings;
    return true;
}

bool iw_host_recall(iw_learnt_t *out_learnt) {
    *out_learnt = has_flash ? flash : *out_learnt;
    return has_flash;
}

bool iw_host_remember(const iw_learnt_t *learnt) {
    flash_writes++;
    flash = flash_fails ? flash : *learnt;
    has_flash = has_flash || !flash_fails;
    return !flash_fails;
}

static uint32_t random_below(uint32_t limit) {
    chance = chance * 1664525U + 1013904223U;
    return (uint32_t)((uint64_t)(chance >> 8) * limit >> 24);
}

static void put(const void *bytes, size_t length) {
    TEST_ASSERT_TRUE(wire_length + length <= sizeof wire);
    memcpy(&wire[wire_length], bytes, length);
    wire_length += length;
}

static size_t framed(uint8_t channel, const char *json, char out[IWN_LINE_BOARD_MAX]) {
    const iwn_line_t line = {.json = json, .length = strlen(json), .channel = channel};
    return iwn_line_write(&line, out, IWN_LINE_BOARD_MAX);
}

static void say(uint8_t channel, const char *json) {
    char line[IWN_LINE_BOARD_MAX];
    put(line, framed(channel, json, line));
}

/// Each with an id of its own: the halves of two lines never make a whole one.
static size_t drive_line(int speed_mm_s, uint64_t boot, uint64_t number, uint64_t stamp_us,
                         char out[IWN_LINE_BOARD_MAX]) {
    static unsigned id;
    char json[256];
    (void)snprintf(json, sizeof json,
                   "{\"boot\":\"%016llx\",\"seq\":%llu,\"t_us\":%llu,\"cmd\":\"drive\",\"left_mm_s\":%d,"
                   "\"right_mm_s\":%d,\"id\":%u}",
                   (unsigned long long)boot, (unsigned long long)number, (unsigned long long)stamp_us, speed_mm_s,
                   speed_mm_s, ++id);
    return framed(1, json, out);
}

/// Carries out what came, and lets time pass in steps of 5 ms, as the image's loop does it.
static void run_ms(uint32_t span_ms) {
    for (uint32_t ms = 0; ms < span_ms; ms += 5U) {
        while (iw_host_take(&host, rig.now_us)) {
        }
        wire_length = wire_taken = 0;
        gateway_rig_step(&rig);
        const iw_snapshot_t seen = gateway_rig_look(&rig);
        (void)iw_host_tell(&host, &seen, estop_high);
        gateway_rig_run(&rig, 5000);
        for (unsigned side = 0; side < IW_SIDES; side++) {
            TEST_ASSERT_LESS_OR_EQUAL_INT_MESSAGE(SLOW_MM_S, rig.bus.told_mm_s[side], "a hostile line was obeyed");
        }
        TEST_ASSERT_NULL_MESSAGE(rig.judge.violation, rig.judge.violation);
    }
}

static void drive_slowly(void) {
    char line[IWN_LINE_BOARD_MAX];
    gateway_judge_asked(&rig.judge, true); // The judge sees no requests: it is told.
    gateway_judge_drive(&rig.judge, true);
    put(line, drive_line(SLOW_MM_S, BOOT, ++seq, t_us, line));
    has_used = true;
}

static void arm(void) {
    say(0, "{\"cmd\":\"alive\"}");
    gateway_judge_renew(&rig.judge);
    say(1, "{\"cmd\":\"arm\"}");
    run_ms(50);
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, iw_gateway_state(&rig.gateway));
}

static void start(void);

void setUp(void) {
    has_flash = flash_fails = estop_high = false;
    flash_writes = 0;
    start();
    arm();
}

static void start(void) {
    gateway_rig_init(&rig);
    memset(&host, 0, sizeof host);
    wire_length = wire_taken = 0;
    errors = refused = accepted = written = 0;
    seq = 0;
    has_used = false;
    chance = 1;
    const iw_host_place_t place = {.gateway = &rig.gateway,
                                   .version = "0.0.0",
                                   .bus = "can",
                                   .estop = "PB0",
                                   .bitrate_hz = 1000000,
                                   .sample_point_permille = 625,
                                   .settings = iw_settings_from(&rig.config, 540),
                                   .track_mm = 540,
                                   .rate_max_hz = 10,
                                   .boot = BOOT};
    iw_host_init(&host, &place, rig.now_us);
    gateway_rig_run(&rig, 600000);
    say(0, "{\"cmd\":\"link\"}");
    say(0, "{\"cmd\":\"open\",\"channel\":1,\"watch\":false}");
    run_ms(20);
}

void tearDown(void) {}

/// With a byte that no line has: else the next one, its beginning missing, could be made whole by what is alike in both.
static size_t end_short(char *line, size_t at) {
    line[at] = '?';
    return at + 1U;
}

/// One of the ways in which a line comes that was not sent like that.
static size_t damage(char *line, size_t length) {
    const uint32_t at =
        1U + random_below((uint32_t)length - 2U); // Before its first byte a newline would leave it whole.
    const uint32_t count = 1U + random_below(12);
    switch (random_below(6)) {
    case 0:
        line[at] = (char)(line[at] ^ 1 << random_below(8));
        return length;
    case 1: // Cut out.
        memmove(&line[at], &line[at + count], (at + count < length) ? length - at - count : 0U);
        return (at + count < length) ? length - count : end_short(line, at);
    case 2: // Bytes from nowhere.
        memmove(&line[at + count], &line[at], length - at);
        for (uint32_t i = 0; i < count; i++) {
            line[at + i] = (char)random_below(256);
        }
        return length + count;
    case 3: // Its end is missing, and the next line follows.
        return end_short(line, at);
    case 4: // Its beginning is missing.
        memmove(line, &line[at], length - at);
        return length - at;
    default: // A digit becomes another.
        line[at] = (char)((line[at] >= '0' && line[at] <= '9') ? '0' + (line[at] - '0' + 1) % 10 : line[at] ^ 0x20);
        return length;
    }
}

/// A hostile line: damaged, or whole and old, doubled, of another start, or without a quote.
static void put_hostile(void) {
    static char kept[64][IWN_LINE_BOARD_MAX];
    static size_t kept_length[64];
    char line[IWN_LINE_BOARD_MAX + 16U];
    char good[IWN_LINE_BOARD_MAX];
    const uint32_t slot = random_below(64);
    size_t length = drive_line(FAST_MM_S, BOOT, seq + 1U + random_below(50), t_us, good);
    switch (random_below(8)) {
    case 0: // Held up for longer than the lease.
        length = drive_line(FAST_MM_S, BOOT, seq + 1U, t_us - 205000U - random_below(1000000), line);
        break;
    case 1: // Doubled: its number has been used.
        length = drive_line(FAST_MM_S, has_used ? BOOT : ~BOOT, (seq > 50U) ? seq - random_below(50) : seq, t_us, line);
        break;
    case 2: // Meant for another start.
        length = drive_line(FAST_MM_S, BOOT ^ 1ULL << random_below(64), seq + 1U, t_us, line);
        break;
    case 3: // One of those, later.
        length = kept_length[slot];
        memcpy(line, kept[slot], length);
        break;
    default:
        memcpy(line, good, length);
        length = damage(line, length);
        if (length > 0U && iwn_line_read(line, length - 1U, false, &(iwn_line_t){0}) == IWN_LINE_GOOD) {
            length = 0; // It was damaged into itself, by two digits that were the same.
        }
        break;
    }
    kept_length[slot] = (length <= IWN_LINE_BOARD_MAX) ? length : 0U;
    memcpy(kept[slot], line, kept_length[slot]);
    put(line, length);
    put("\n", random_below(2)); // Some run into the next line.
}

static void test_host_line_million_hostile_lines_none_is_obeyed(void) {
    const char *const wish = getenv("IWHEEL_HOSTILE_LINES");
    const uint32_t wanted = (wish != NULL) ? (uint32_t)strtoul(wish, NULL, 10) : 1000000U;
    uint32_t lines = 0;
    for (uint32_t turn = 0; lines < wanted; turn++) {
        for (uint32_t i = 0; i < 60U; i++, lines++) {
            put_hostile();
        }
        put("\n", 1);
        say(0, "{\"cmd\":\"alive\"}");
        if (turn % 64U < 32U) {
            drive_slowly();
        }
        run_ms(20);
        if (turn % 64U == 63U) {
            TEST_ASSERT_EQUAL_INT_MESSAGE(0, rig.bus.told_mm_s[IW_LEFT], "hostile lines kept the lease");
            run_ms(2500);
            say(0, "{\"cmd\":\"link\"}"); // So long without a relay: its channels are gone.
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

static void test_host_line_errors_are_told_at_most_five_times_a_second(void) {
    for (uint32_t turn = 0; turn < 200U; turn++) {
        put("rubbish*00000000\n", 17);
        say(0, "{\"cmd\":\"alive\"}");
        run_ms(5);
    }
    TEST_ASSERT_LESS_OR_EQUAL_UINT32(6, errors);
    TEST_ASSERT_GREATER_OR_EQUAL_UINT32(4, errors);
}

/// The lease runs from the stamp that a command quotes, not from when it came.
static void test_host_line_delayed_commands_lease_ends_from_their_stamp(void) {
    char line[IWN_LINE_BOARD_MAX];
    const uint64_t stamp_us = t_us;
    run_ms(150);
    say(0, "{\"cmd\":\"alive\"}");
    gateway_judge_asked(&rig.judge, true);
    gateway_judge_drive(&rig.judge, true);
    put(line, drive_line(SLOW_MM_S, BOOT, ++seq, stamp_us, line));
    run_ms(40);
    TEST_ASSERT_EQUAL_UINT32(1, accepted);
    run_ms(35);
    TEST_ASSERT_EQUAL_INT(IW_STATE_STOPPING, iw_gateway_state(&rig.gateway));
}

/// Asks, and looks at the answer.
static void assert_answer(const char *json, const char *part) {
    answer[0] = '\0';
    say(1, json);
    run_ms(60);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(answer, part), (answer[0] != '\0') ? answer : json);
    TEST_ASSERT_EQUAL_CHAR('}', answer[strlen(answer) - 1U]);
}

static void test_host_answers_tell_what_was_asked_and_what_became_of_it(void) {
    gateway_judge_renew(&rig.judge);
    say(0, "{\"cmd\":\"alive\"}");
    assert_answer("{\"cmd\":\"hello\",\"id\":1}", "\"name\":\"iwheel-gateway\"");
    say(0, "{\"cmd\":\"alive\"}");
    assert_answer("{\"cmd\":\"arm\",\"id\":2}", "\"id\":2,\"ok\":true");
    assert_answer("{\"cmd\":\"config\",\"id\":3,\"key\":\"no.such\",\"value\":\"1\"}", "\"id\":3,\"ok\":false");
    say(0, "{\"cmd\":\"alive\"}");
    assert_answer("{\"cmd\":\"recordings\",\"id\":4}", "\"error\":\"denied\"");
    say(0, "{\"cmd\":\"link\"}");
    run_ms(10);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(heard, "\"event\":\"link\",\"boot\":\"0123456789abcdef\","), heard);
}

static void test_host_answer_to_arm_comes_when_it_is_armed(void) {
    say(0, "{\"cmd\":\"open\",\"channel\":2,\"watch\":false}");
    say(1, "{\"cmd\":\"stop\"}");
    for (unsigned i = 0; i < 10U; i++) {
        say(0, "{\"cmd\":\"alive\"}");
        run_ms(200);
    }
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, iw_gateway_state(&rig.gateway));
    gateway_judge_renew(&rig.judge);
    answer[0] = '\0';
    say(1, "{\"cmd\":\"arm\",\"id\":7}");
    run_ms(60);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(answer, "\"id\":7,\"ok\":true"), answer);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(answer, "\"state\":\"armed\""), answer);
}

static void test_host_twist_turns_the_right_wheel_faster(void) {
    char line[IWN_LINE_BOARD_MAX];
    char json[256];
    gateway_judge_asked(&rig.judge, true);
    gateway_judge_drive(&rig.judge, true);
    (void)snprintf(json, sizeof json,
                   "{\"boot\":\"%016llx\",\"seq\":%llu,\"t_us\":%llu,\"cmd\":\"twist\",\"v_mm_s\":50,"
                   "\"yaw_mrad_s\":100}",
                   (unsigned long long)BOOT, (unsigned long long)++seq, (unsigned long long)t_us);
    put(line, framed(1, json, line));
    run_ms(200);
    TEST_ASSERT_GREATER_THAN_INT(0, rig.bus.told_mm_s[IW_LEFT]);
    TEST_ASSERT_GREATER_THAN_INT(rig.bus.told_mm_s[IW_LEFT] + 20, rig.bus.told_mm_s[IW_RIGHT]);
}

static void test_host_state_comes_at_its_rate_and_in_no_burst_after_a_stall(void) {
    say(1, "{\"cmd\":\"watch\",\"topics\":[\"state\"],\"rate_hz\":10}");
    states = 0;
    for (unsigned i = 0; i < 10U; i++) {
        say(0, "{\"cmd\":\"alive\"}");
        run_ms(100);
    }
    TEST_ASSERT_UINT_WITHIN(3, 10, states);
}

/// The relay is there all the time.
static void pass(uint32_t span_ms) {
    for (uint32_t ms = 0; ms < span_ms; ms += 100U) {
        say(0, "{\"cmd\":\"alive\"}");
        run_ms(100);
    }
}

static void forget(void) {
    all[0] = '\0';
    all_length = 0;
}

static unsigned count_of(const char *words) {
    unsigned count = 0;
    for (const char *at = strstr(all, words); at != NULL; at = strstr(at + 1, words)) {
        count++;
    }
    return count;
}

static void watch_everything(void) {
    say(1, "{\"cmd\":\"watch\",\"topics\":[\"force\",\"stop\",\"bus\",\"estop\",\"lease\"],\"rate_hz\":1}");
    pass(100);
    forget();
}

static void disarm(void) {
    say(1, "{\"cmd\":\"stop\"}");
    pass(2500);
    TEST_ASSERT_EQUAL_INT(IW_STATE_LISTENING, iw_gateway_state(&rig.gateway));
}

static void test_host_tells_of_the_estop_and_of_each_cause_by_its_name_once(void) {
    disarm();
    watch_everything();
    estop_high = true;
    pass(200);
    TEST_ASSERT_EQUAL_UINT(1, count_of("\"event\":\"estop\",\"t_us\""));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(all, "\"state\":\"pressed\"}"), all);
    iw_snapshot_t seen = gateway_rig_look(&rig);
    seen.still_moving++;
    seen.present |= 1U << IW_CAUSE_ESTOP_LINE;
    iw_observe(&host, &seen);
    iw_observe(&host, &seen);
    TEST_ASSERT_EQUAL_UINT(1, count_of("\"cause\":\"still_moving\",\"present\":true"));
    TEST_ASSERT_EQUAL_UINT(1, count_of("\"cause\":\"estop_line\",\"present\":true"));
    TEST_ASSERT_EQUAL_UINT(2, count_of("\"event\":\"fault\""));
}

static void test_host_tells_of_a_stop_with_cause_and_client_and_who_stopped_refuses_others(void) {
    char line[IWN_LINE_BOARD_MAX];
    watch_everything();
    say(0, "{\"cmd\":\"open\",\"channel\":2,\"watch\":false}");
    say(2, "{\"cmd\":\"stop\"}");
    run_ms(20);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(all, "\"cause\":\"client_stop\""), all);
    answer[0] = '\0';
    put(line, drive_line(SLOW_MM_S, BOOT, ++seq, t_us, line));
    run_ms(20);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(answer, "client 2"), answer);
    forget();
    say(2, "{\"cmd\":\"estop\",\"reason\":\"test\"}");
    run_ms(20);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(all, "\"cause\":\"estop_software\""), all);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(all, "client 2"), all);
    TEST_ASSERT_NULL_MESSAGE(strstr(all, "(gone)"), all);
}

static void test_host_zero_of_each_wheel_is_told_once_for_each_change(void) {
    disarm();
    watch_everything();
    iw_snapshot_t seen = gateway_rig_look(&rig);
    iw_force_t force = *seen.wheel[IW_RIGHT].force;
    force.provenance = IW_OFFSET_STORED;
    force.offset_mN = 1234;
    force.offset_us = 77;
    seen.wheel[IW_RIGHT].force = &force;
    iw_observe(&host, &seen);
    iw_observe(&host, &seen);
    TEST_ASSERT_EQUAL_UINT(1, count_of("\"event\":\"offset\""));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(all, "\"side\":\"right\",\"offset_mN\":1234,"), all);
    TEST_ASSERT_EQUAL_UINT8(IW_OFFSET_NONE, host.zero[IW_RIGHT].from);
    force.provenance = IW_OFFSET_OPERATOR;
    force.offset_us = 99;
    forget();
    iw_observe(&host, &seen);
    iw_observe(&host, &seen);
    TEST_ASSERT_EQUAL_UINT(1, count_of("\"event\":\"offset\""));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(all, "\"before_mN\":1234,"), all);
    force.offset_us = 100;
    force.offset_mN = 55;
    iw_observe(&host, &seen);
    TEST_ASSERT_EQUAL_UINT(2, count_of("\"event\":\"offset\""));
    force.provenance = IW_OFFSET_ESTIMATED;
    force.quality.deviation_mN = 31;
    iw_observe(&host, &seen);
    TEST_ASSERT_EQUAL_UINT8(IW_OFFSET_ESTIMATED, host.zero[IW_RIGHT].from);
    TEST_ASSERT_EQUAL_UINT16(31, host.zero[IW_RIGHT].deviation_mN);
}

static void test_host_word_on_an_item_is_compared_with_what_is_in_force(void) {
    say(0, "{\"cmd\":\"alive\"}");
    assert_answer("{\"cmd\":\"confirm\",\"id\":1,\"item\":\"track\",\"value\":\"530\"}", "\"state\":\"confirmed\"");
    say(0, "{\"cmd\":\"alive\"}");
    assert_answer("{\"cmd\":\"confirm\",\"id\":2,\"item\":\"track\",\"value\":\"551\"}", "\"state\":\"contradicted\"");
    say(0, "{\"cmd\":\"alive\"}");
    assert_answer("{\"cmd\":\"confirm\",\"id\":3,\"item\":\"dlc\",\"value\":\"551\"}", "value must be yes or no");
}

static void test_host_line_is_stamped_every_25_ms_while_armed_and_not_more_often(void) {
    forget();
    for (unsigned i = 0; i < 10U; i++) {
        say(0, "{\"cmd\":\"alive\"}");
        gateway_judge_renew(&rig.judge);
        run_ms(25);
    }
    TEST_ASSERT_UINT_WITHIN(2, 10, count_of("\"event\":\"link\""));
}

static void test_host_keeps_what_was_learnt_in_the_silence_once_and_has_it_at_the_next_start(void) {
    iw_ledger_state_t state;
    disarm();
    assert_answer("{\"cmd\":\"confirm\",\"id\":1,\"item\":\"track\",\"value\":\"540\"}", "\"confirmed\"");
    pass(2500);
    const uint32_t writes = flash_writes;
    TEST_ASSERT_GREATER_THAN_UINT32(0, writes);
    TEST_ASSERT_EQUAL_INT(IW_MEMORY_KEPT, host.memory);
    pass(5000);
    TEST_ASSERT_EQUAL_UINT32_MESSAGE(writes, flash_writes, "the flash wears");
    start();
    state = iw_host_look(&host)->assumed[IW_LEDGER_TRACK].state;
    TEST_ASSERT_EQUAL_INT(IW_LEDGER_CONFIRMED, state);
    TEST_ASSERT_EQUAL_INT(IW_MEMORY_KEPT, host.memory);
    has_flash = false;
    start();
    state = iw_host_look(&host)->assumed[IW_LEDGER_TRACK].state;
    TEST_ASSERT_EQUAL_INT(IW_LEDGER_ASSUMED, state);
    TEST_ASSERT_EQUAL_INT(IW_MEMORY_NEW, host.memory);
    flash_fails = true;
    assert_answer("{\"cmd\":\"confirm\",\"id\":1,\"item\":\"track\",\"value\":\"540\"}", "\"confirmed\"");
    pass(5000);
    TEST_ASSERT_EQUAL_INT(IW_MEMORY_FAILED, host.memory);
}

static void test_host_command_older_than_its_channel_is_stale(void) {
    char json[256];
    (void)snprintf(json, sizeof json,
                   "{\"boot\":\"%016llx\",\"seq\":1,\"t_us\":%llu,\"cmd\":\"drive\",\"left_mm_s\":100,"
                   "\"right_mm_s\":100}",
                   (unsigned long long)BOOT, (unsigned long long)t_us);
    run_ms(5);
    say(0, "{\"cmd\":\"open\",\"channel\":2,\"watch\":false}");
    run_ms(5);
    refused = 0;
    say(2, json);
    run_ms(5);
    TEST_ASSERT_EQUAL_UINT32(1, refused);
}

static void test_host_state_after_a_stall_comes_in_no_burst(void) {
    disarm();
    say(1, "{\"cmd\":\"watch\",\"topics\":[\"state\"],\"rate_hz\":10}");
    pass(300);
    forget();
    gateway_rig_run(&rig, 300000); // The image's loop stands still.
    states = 0;
    say(0, "{\"cmd\":\"alive\"}");
    run_ms(50);
    TEST_ASSERT_EQUAL_UINT32(1, states);
    TEST_ASSERT_EQUAL_UINT(0, count_of("\"event\":\"lost\""));
}

static void test_host_setting_out_of_its_range_is_refused(void) {
    iw_settings_t settings = iw_settings_from(&rig.config, 540);
    iw_config_t config = rig.config;
    char text[256];
    iwn_text_t why = iwn_text_begin(text, sizeof text);
    TEST_ASSERT_TRUE(iw_settings_check(&settings, &why));
    config.gear_turns = 1000;
    config.gear_per = 1;
    settings = iw_settings_from(&config, 540);
    TEST_ASSERT_FALSE(iw_settings_check(&settings, &why));
    config = rig.config;
    config.lease_ms = 900;
    settings = iw_settings_from(&config, 540);
    TEST_ASSERT_FALSE(iw_settings_check(&settings, &why));
    config = rig.config;
    config.radius_mm = 0;
    settings = iw_settings_from(&config, 540);
    TEST_ASSERT_FALSE(iw_settings_check(&settings, &why));
}

static void test_host_obeys_the_relay_and_counts_what_is_none_of_its_words_as_an_error(void) {
    static const char *const good[] = {"{\"cmd\":\"alive\"}",
                                       "{\"cmd\":\"open\",\"channel\":2,\"watch\":true}",
                                       "{\"cmd\":\"close\",\"channel\":2}",
                                       "{\"cmd\":\"link\"}",
                                       "{\"ok\":true}",
                                       "{\"event\":\"x\"}"};
    static const char *const bad[] = {"{\"cmd\":\"dance\"}",
                                      "{\"cmd\":\"close\"}",
                                      "{\"cmd\":\"close\",\"channel\":99}",
                                      "{\"x\":1}",
                                      "[]",
                                      "{\"cmd\":\"open\",\"channel\":2}"};
    for (size_t i = 0; i < sizeof good / sizeof good[0]; i++) {
        say(0, good[i]);
        run_ms(5);
        TEST_ASSERT_EQUAL_UINT32_MESSAGE(0, host.errors, good[i]);
    }
    say(1, "{\"cmd\":\"hello\"}"); // With the relay begun anew nobody is there.
    run_ms(5);
    TEST_ASSERT_EQUAL_UINT32(1, host.errors);
    for (uint32_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        say(0, bad[i]);
        run_ms(5);
        TEST_ASSERT_EQUAL_UINT32_MESSAGE(2U + i, host.errors, bad[i]);
    }
    say(0, "{\"cmd\":\"open\",\"channel\":1,\"watch\":false}");
    forget();
    say(1, "{\"ok\":true}");
    say(1, "{\"cmd\":\"hello\",\"id\":1}");
    run_ms(5);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(0, count_of("\"ok\":false"), all);
    TEST_ASSERT_EQUAL_UINT32(2U + sizeof bad / sizeof bad[0] - 1U, host.errors);
}

static void test_host_client_that_is_closed_or_not_heard_for_half_a_second_is_gone_and_told_as_who_it_was(void) {
    watch_everything();
    say(0, "{\"cmd\":\"open\",\"channel\":2,\"watch\":true}");
    say(2, "{\"cmd\":\"watch\",\"topics\":[\"stop\"]}");
    run_ms(10);
    gateway_judge_renew(&rig.judge);
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, iw_gateway_state(&rig.gateway));
    forget();
    say(0, "{\"cmd\":\"close\",\"channel\":1}");
    run_ms(10);
    TEST_ASSERT_TRUE(iw_gateway_state(&rig.gateway) != IW_STATE_ARMED);
    TEST_ASSERT_EQUAL_UINT32(IW_CLIENT_NONE, host.client[0].id);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(all, "\"event\":\"stop\""), all);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(all, "client 1 "), all);
    run_ms(480);
    TEST_ASSERT_TRUE(host.client[1].id != IW_CLIENT_NONE);
    run_ms(30);
    TEST_ASSERT_EQUAL_UINT32(IW_CLIENT_NONE, host.client[1].id);
}

static void test_host_status_has_the_estop_and_of_each_wheel_its_own_zero(void) {
    host.zero[IW_LEFT] = (iw_learnt_zero_t){.from = IW_OFFSET_OPERATOR, .deviation_mN = 11};
    host.zero[IW_RIGHT] = (iw_learnt_zero_t){.from = IW_OFFSET_ESTIMATED, .deviation_mN = 22};
    const iwn_surroundings_t around = iw_host_around(&host, iw_host_look(&host));
    TEST_ASSERT_TRUE(around.estop.present);
    TEST_ASSERT_EQUAL_UINT32(11, around.zero[IW_LEFT].deviation_mN);
    TEST_ASSERT_EQUAL_UINT32(22, around.zero[IW_RIGHT].deviation_mN);
}

static void test_host_restarts_only_if_it_was_asked_to(void) {
    TEST_ASSERT_FALSE(iw_host_wants_restart(&host));
    host.restart_us = 1;
    TEST_ASSERT_TRUE(iw_host_wants_restart(&host));
}

static void test_host_line_is_stamped_once_a_second_at_rest_and_wakes_for_it(void) {
    disarm();
    pass(1000);
    forget();
    pass(3000);
    TEST_ASSERT_EQUAL_UINT(3, count_of("\"event\":\"link\""));
    const iw_snapshot_t seen = gateway_rig_look(&rig);
    TEST_ASSERT_EQUAL_UINT64(host.linked_us + 1000000U, iw_host_tell(&host, &seen, false));
}

static void test_host_hello_and_force_are_whole(void) {
    forget();
    say(0, "{\"cmd\":\"open\",\"channel\":2,\"watch\":true}");
    say(2, "{\"cmd\":\"watch\",\"topics\":[\"force\"],\"rate_hz\":10}");
    run_ms(20);
    const char *const hello = strstr(all, "\"event\":\"hello\"");
    TEST_ASSERT_NOT_NULL_MESSAGE(hello, all);
    TEST_ASSERT_TRUE_MESSAGE(strstr(hello, "\"t_us\":") < strchr(hello, '}'), hello);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(strstr(all, "\"event\":\"force\""), "\"left\":{"), all);
}

static void test_host_looks_for_what_it_has_learnt_after_two_seconds_of_silence_and_every_two_seconds(void) {
    disarm();
    const iw_time_us_t silent_us = host.learn_us;
    TEST_ASSERT_TRUE(silent_us > rig.now_us - 2000000U && silent_us <= rig.now_us + 2000000U);
    while (host.learn_us == silent_us) {
        pass(100);
    }
    TEST_ASSERT_UINT64_WITHIN(110000U, rig.now_us + 2000000U, host.learn_us);
    host.learn_us = 0; // As after motion.
    pass(100);
    TEST_ASSERT_UINT64_WITHIN(110000U, rig.now_us + 2000000U, host.learn_us);
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_host_line_million_hostile_lines_none_is_obeyed);
    RUN_TEST(test_host_line_errors_are_told_at_most_five_times_a_second);
    RUN_TEST(test_host_line_delayed_commands_lease_ends_from_their_stamp);
    RUN_TEST(test_host_answers_tell_what_was_asked_and_what_became_of_it);
    RUN_TEST(test_host_answer_to_arm_comes_when_it_is_armed);
    RUN_TEST(test_host_twist_turns_the_right_wheel_faster);
    RUN_TEST(test_host_state_comes_at_its_rate_and_in_no_burst_after_a_stall);
    RUN_TEST(test_host_tells_of_the_estop_and_of_each_cause_by_its_name_once);
    RUN_TEST(test_host_tells_of_a_stop_with_cause_and_client_and_who_stopped_refuses_others);
    RUN_TEST(test_host_zero_of_each_wheel_is_told_once_for_each_change);
    RUN_TEST(test_host_word_on_an_item_is_compared_with_what_is_in_force);
    RUN_TEST(test_host_line_is_stamped_every_25_ms_while_armed_and_not_more_often);
    RUN_TEST(test_host_keeps_what_was_learnt_in_the_silence_once_and_has_it_at_the_next_start);
    RUN_TEST(test_host_command_older_than_its_channel_is_stale);
    RUN_TEST(test_host_state_after_a_stall_comes_in_no_burst);
    RUN_TEST(test_host_setting_out_of_its_range_is_refused);
    RUN_TEST(test_host_obeys_the_relay_and_counts_what_is_none_of_its_words_as_an_error);
    RUN_TEST(test_host_client_that_is_closed_or_not_heard_for_half_a_second_is_gone_and_told_as_who_it_was);
    RUN_TEST(test_host_status_has_the_estop_and_of_each_wheel_its_own_zero);
    RUN_TEST(test_host_restarts_only_if_it_was_asked_to);
    RUN_TEST(test_host_line_is_stamped_once_a_second_at_rest_and_wakes_for_it);
    RUN_TEST(test_host_hello_and_force_are_whole);
    RUN_TEST(test_host_looks_for_what_it_has_learnt_after_two_seconds_of_silence_and_every_two_seconds);
    return UNITY_END();
}
