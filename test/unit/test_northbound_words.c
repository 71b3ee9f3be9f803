// SPDX-License-Identifier: MIT
// Strings of the protocol: the sentence of `why`, the names of the closed lists, and texts that are built without
// stdio.
#include "iwheel_northbound/refuse.h"
#include "iwheel_northbound/text.h"
#include "iwheel_northbound/why.h"
#include "iwheel_northbound/words.h"
#include "unit.h"

#include <string.h>

static const iwn_why_context_t context = {"\"joystick\" (client 3, pid 9)", "kerb", "unix:/e", "unix:/b"};

static const char *sentence(iw_cause_t cause, uint8_t sides, uint32_t detail) {
    static char text[IWN_SENTENCE_SIZE];
    const iw_stop_t stop = {.number = 1,
                            .cause = cause,
                            .first = cause,
                            .sides = sides,
                            .detail = detail,
                            .from = IW_STATE_ARMED,
                            .at_us = 12345678,
                            .latched = cause < IW_CAUSE_LOOP_LATE,
                            .at_once = cause <= IW_CAUSE_LOOP_LATE,
                            .applied = {.wheel = {{.speed_mm_s = 300}, {.speed_mm_s = -299}}}};
    iwn_why_sentence(&stop, &context, text, sizeof text);
    return text;
}

TEST(test_why_names_cause_numbers_time_and_fix) {
    TEST_ASSERT_EQUAL_STRING("left wheel sent no telemetry for 53 ms while driving 300/-299 mm/s; set to zero "
                             "immediately, latched at 12.345 s; "
                             "check the wheel's power and cable, then: iwheelctl reset",
                             sentence(IW_CAUSE_WHEEL_LOST, IW_SIDES_LEFT, 53));
    TEST_ASSERT_NOT_NULL(
        strstr(sentence(IW_CAUSE_WHEEL_LOST, IW_SIDES_BOTH, UINT32_MAX), "both wheels never sent telemetry"));
    TEST_ASSERT_NOT_NULL(strstr(sentence(IW_CAUSE_SECOND_MASTER, 0, 266), "id 266 (0x10A)"));
    TEST_ASSERT_NOT_NULL(strstr(sentence(IW_CAUSE_ESTOP_SOFTWARE, 0, 3), "\"joystick\" (client 3, pid 9) (\"kerb\")"));
    TEST_ASSERT_NOT_NULL(strstr(sentence(IW_CAUSE_ESTOP_LINE, 0, 1), "e-stop unix:/e pressed"));
    TEST_ASSERT_NOT_NULL(strstr(sentence(IW_CAUSE_ESTOP_LINE, 0, 2), "unreadable"));
    TEST_ASSERT_NOT_NULL(strstr(sentence(IW_CAUSE_BUS_DOWN, 0, IW_BUS_OFF), "bus unix:/b is bus-off"));
    TEST_ASSERT_NOT_NULL(strstr(sentence(IW_CAUSE_LEASE_LOST, 0, 200), "no drive command for 200 ms"));
    TEST_ASSERT_NOT_NULL(strstr(sentence(IW_CAUSE_LEASE_LOST, 0, 200), "ramped to zero at 12.345 s"));
    TEST_ASSERT_NOT_NULL(strstr(sentence(IW_CAUSE_LOOP_LATE, 0, 130), "held up for 130 ms"));
    TEST_ASSERT_NOT_NULL(
        strstr(sentence(IW_CAUSE_WHEEL_BLOCKED, IW_SIDES_RIGHT, 12), "right wheel blocked: only 12 mm/s"));
    TEST_ASSERT_NOT_NULL(strstr(sentence(IW_CAUSE_PAIR_DIVERGES, IW_SIDES_LEFT, 61),
                                "left wheel does not follow its command: the machine left its path by 61 mm"));
}

TEST(test_why_reports_for_each_stop_whether_it_ramped) {
    iw_stop_t stop = {.number = 1,
                      .cause = IW_CAUSE_WHEEL_LOST,
                      .first = IW_CAUSE_WHEEL_LOST,
                      .from = IW_STATE_ARMED,
                      .latched = true};
    char text[IWN_SENTENCE_SIZE];
    iwn_why_sentence(&stop, &context, text, sizeof text);
    TEST_ASSERT_NOT_NULL(strstr(text, "; ramped to zero, latched at"));
    stop.cause = stop.first = IW_CAUSE_PAIR_DIVERGES;
    stop.latched = false;
    iwn_why_sentence(&stop, &context, text, sizeof text);
    TEST_ASSERT_NOT_NULL(strstr(text, "; ramped to zero at"));
    stop.at_once = true;
    iwn_why_sentence(&stop, &context, text, sizeof text);
    TEST_ASSERT_NOT_NULL(strstr(text, "; set to zero immediately at"));
}

TEST(test_why_of_an_estop_while_latched_names_the_first_cause) {
    const iw_stop_t stop = {.number = 2,
                            .cause = IW_CAUSE_ESTOP_LINE,
                            .first = IW_CAUSE_FEEDBACK_SIGN,
                            .first_sides = IW_SIDES_LEFT,
                            .first_detail = 312,
                            .from = IW_STATE_LATCHED,
                            .detail = 1,
                            .at_us = 12345678,
                            .latched = true,
                            .at_once = true};
    char text[IWN_SENTENCE_SIZE];
    iwn_why_sentence(&stop, &context, text, sizeof text);
    TEST_ASSERT_EQUAL_STRING("e-stop unix:/e pressed while latched: left wheel turns against its command at 312 mm/s; "
                             "still latched at 12.345 s; release the button, check invert in the configuration, then: "
                             "iwheelctl reset",
                             text);
}

/// The same cause stops, or latches the third time.
TEST(test_why_requires_a_reset_only_after_a_latch) {
    iw_stop_t stop = {
        .number = 3, .cause = IW_CAUSE_PAIR_DIVERGES, .first = IW_CAUSE_PAIR_DIVERGES, .from = IW_STATE_ARMED};
    char text[IWN_SENTENCE_SIZE];
    iwn_why_sentence(&stop, &context, text, sizeof text);
    TEST_ASSERT_NOT_NULL(strstr(text, "turns freely and drives, then arm again"));
    stop.latched = true;
    iwn_why_sentence(&stop, &context, text, sizeof text);
    TEST_ASSERT_NOT_NULL(strstr(text, "turns freely and drives, then: iwheelctl reset"));
}

TEST(test_why_after_a_crash_has_no_unknown_values) {
    const iw_stop_t stop = {.number = 1, .cause = IW_CAUSE_RESTART, .first = IW_CAUSE_RESTART, .at_once = true};
    char text[IWN_SENTENCE_SIZE];
    iwn_why_sentence(&stop, &context, text, sizeof text);
    TEST_ASSERT_EQUAL_STRING(
        "the gateway before this one died while the wheels were armed; set to zero immediately at 0.000 s; "
        "find the crash in the log, then arm again",
        text);
}

TEST(test_why_has_a_sentence_and_a_name_for_every_cause) {
    for (unsigned cause = IW_CAUSE_ESTOP_LINE; cause < IW_CAUSES; cause++) {
        const char *text = sentence((iw_cause_t)cause, IW_SIDES_LEFT, 1);
        TEST_ASSERT_TRUE(strlen(text) > 60U);
        TEST_ASSERT_NOT_NULL(strstr(text, "12.345 s"));
        TEST_ASSERT_TRUE(strcmp("unknown", iwn_cause_name((iw_cause_t)cause)) != 0);
        for (unsigned other = 0; other < cause; other++) {
            TEST_ASSERT_TRUE(strcmp(iwn_cause_name((iw_cause_t)other), iwn_cause_name((iw_cause_t)cause)) != 0);
        }
    }
    TEST_ASSERT_EQUAL_STRING("unknown", iwn_cause_name((iw_cause_t)IW_CAUSES));
}

TEST(test_why_without_a_stop_reports_no_stop) {
    const iw_stop_t stop = {.number = 0};
    char text[IWN_SENTENCE_SIZE];
    iwn_why_sentence(&stop, &context, text, sizeof text);
    TEST_ASSERT_EQUAL_STRING("no stop since the gateway started", text);
}

TEST(test_names_of_all_refusals_are_errors_of_the_closed_list) {
    for (unsigned refusal = IW_REFUSE_OUT_OF_RANGE; refusal < IW_REFUSALS; refusal++) {
        const iwn_error_t error = iwn_error_of((iw_refusal_t)refusal);
        TEST_ASSERT_TRUE(error > IWN_OK && error < IWN_INTERNAL);
    }
    TEST_ASSERT_EQUAL_INT(IWN_OK, iwn_error_of(IW_REFUSE_NONE));
    TEST_ASSERT_EQUAL_INT(IWN_INTERNAL, iwn_error_of((iw_refusal_t)999));
    for (unsigned error = 0; error < IWN_ERRORS; error++) {
        TEST_ASSERT_TRUE(strcmp("unknown", iwn_error_name((iwn_error_t)error)) != 0);
    }
    for (unsigned item = 0; item < IW_ASSUMPTION_ITEMS; item++) {
        TEST_ASSERT_TRUE(strcmp("unknown", iwn_assumption_item_name((iw_assumption_item_t)item)) != 0);
    }
    TEST_ASSERT_EQUAL_STRING("offset_doubted", iwn_force_validity_name(IW_FORCE_OFFSET_DOUBTED));
    TEST_ASSERT_EQUAL_STRING("unreadable", iwn_estop_name(-1, true));
    TEST_ASSERT_EQUAL_STRING("disagrees", iwn_estop_name(IW_ESTOP_DISAGREES, true));
    TEST_ASSERT_EQUAL_STRING("none", iwn_estop_name(0, false));
}

TEST(test_why_shows_three_decimals_of_any_time) {
    static const struct {
        iw_time_us_t at_us;
        const char *shown;
    } cases[] = {{0, "at 0.000 s"},
                 {7999, "at 0.007 s"},
                 {42000, "at 0.042 s"},
                 {999999, "at 0.999 s"},
                 {1234567890123, "at 1234567.890 s"}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        char text[IWN_SENTENCE_SIZE];
        const iw_stop_t stop = {.number = 1, .cause = IW_CAUSE_SHUTDOWN, .at_us = cases[i].at_us};
        iwn_why_sentence(&stop, &context, text, sizeof text);
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, cases[i].shown), text);
    }
}

TEST(test_why_that_does_not_fit_is_cut_and_terminated) {
    char text[24];
    const iw_stop_t stop = {.number = 1, .cause = IW_CAUSE_CLIENT_STOP};
    memset(text, 'x', sizeof text);
    iwn_why_sentence(&stop, &context, text, 20U);
    TEST_ASSERT_EQUAL_STRING("\"joystick\" (client ", text);
    TEST_ASSERT_EQUAL_HEX8('x', text[20]);
}

TEST(test_text_is_built_and_terminated_at_any_size) {
    char buffer[16];
    for (size_t size = 1; size < sizeof buffer; size++) {
        memset(buffer, 'x', sizeof buffer);
        iwn_text_t text = iwn_text_begin(buffer, size);
        IWN_TEXT_JOIN(&text, "ab", "", "c");
        iwn_text_int(&text, -12);
        iwn_text_hex(&text, 0x1AFU, 4U);
        const size_t fits = (size - 1U < 10U) ? size - 1U : 10U;
        TEST_ASSERT_EQUAL_UINT(fits, text.length);
        TEST_ASSERT_EQUAL_STRING_LEN("abc-1201AF", buffer, fits);
        TEST_ASSERT_EQUAL_HEX8('\0', buffer[fits]);
        TEST_ASSERT_EQUAL_HEX8('x', buffer[size]);
    }
}

TEST(test_text_of_any_code_point_is_read_back_unchanged) {
    for (uint32_t code_point = 1; code_point <= 0x10FFFFU; code_point++) {
        char bytes[5] = "";
        size_t read;
        if (code_point >= 0xD800U && code_point <= 0xDFFFU) {
            continue;
        }
        const size_t length = iwn_utf8(code_point, bytes);
        TEST_ASSERT_EQUAL_HEX32(code_point, iwn_plain_read(bytes, &read));
        TEST_ASSERT_EQUAL_UINT(length, read);
    }
}

// ---- refusals -------------------------------------------------------------------------------------------------------

static iw_codec_wheel_t telemetry[IW_SIDES];
static iw_config_t config = {.rest_rpm = 2, .rest_ms = 200};
static iw_snapshot_t seen;
static iwn_refusal_t refusal;

static const char *not_at_rest(void) {
    const iwn_refuse_context_t moment = {.seen = &seen};
    const iwn_request_t request = {.cmd = IWN_CMD_ARM};
    seen.config = &config;
    for (unsigned side = 0; side < IW_SIDES; side++) {
        seen.wheel[side].telemetry = &telemetry[side];
        seen.wheel[side].heard = true;
    }
    iwn_refuse_describe(&moment, &request, IW_REFUSE_NOT_AT_REST, &refusal);
    return refusal.message;
}

TEST(test_refusal_at_standstill_names_the_time_and_no_speeds) {
    static const char turning[] = "the wheels turn or are commanded to: left ";
    TEST_ASSERT_EQUAL_STRING("the wheels are not at standstill for 200 ms yet; wait, then try again", not_at_rest());
    for (unsigned side = 0; side < IW_SIDES; side++) {
        static const int16_t still[] = {-2, 2};
        static const int16_t moving[] = {-3, 3};
        for (size_t i = 0; i < 2U; i++) {
            telemetry[side].speed.speed_rpm = still[i];
            TEST_ASSERT_NULL(strstr(not_at_rest(), turning));
            telemetry[side].speed.speed_rpm = moving[i];
            TEST_ASSERT_NOT_NULL(strstr(not_at_rest(), turning));
        }
        telemetry[side].speed.speed_rpm = 0;
        seen.applied.wheel[side].speed_mm_s = 1;
        TEST_ASSERT_NOT_NULL(strstr(not_at_rest(), turning));
        seen.applied.wheel[side].speed_mm_s = 0;
    }
}
