// SPDX-License-Identifier: MIT
// Which requests the web bridge accepts, and which values it reads from them.
#include "driver.h"
#include "web_judge.h"

#include "unit.h"

#include <string.h>

static web_rules_t rules;
static web_asked_t asked;

void setUp(void) {
    rules = (web_rules_t){"walker.lan other", false, false};
    asked = (web_asked_t){.method = "GET", .path = "/api/status", .host = "127.0.0.1:8470", .proof = WEB_PROOF_FULL};
}

static unsigned status(void) {
    const web_verdict_t verdict = web_judge(&rules, &asked);
    TEST_ASSERT_EQUAL(verdict.status == 200, verdict.route != NULL);
    TEST_ASSERT_TRUE(verdict.status == 200 || (verdict.error[0] != '\0' && verdict.message[0] != '\0'));
    return verdict.status;
}

static void assert_status_of(const char *path, unsigned expected) {
    asked.path = path;
    TEST_ASSERT_EQUAL_UINT_MESSAGE(expected, status(), path);
}

TEST(test_request_with_token_to_an_address_is_accepted) {
    TEST_ASSERT_EQUAL_UINT(200, status());
    TEST_ASSERT_EQUAL(WEB_STATUS, web_judge(&rules, &asked).route->verb);
}

TEST(test_host_of_another_name_is_refused) {
    static const char *const ours[] = {"localhost",        "LOCALHOST:1", "walker.lan", "other:8470",
                                       "192.168.1.7:8470", "[::1]:8470",  "[fe80::1]"};
    static const char *const others[] = {"evil.example",
                                         "walker.lan.evil.example",
                                         "walker",
                                         "localhost.evil",
                                         "",
                                         "127.0.0.1.evil.example",
                                         "[::1",
                                         "127.0.0.1:",
                                         "127.0.0.1:0",
                                         "127.0.0.1:99999",
                                         "127.0.0.1:80x",
                                         "other walker.lan",
                                         "[]"};
    for (size_t i = 0; i < sizeof ours / sizeof ours[0]; i++) {
        asked.host = ours[i];
        TEST_ASSERT_EQUAL_UINT_MESSAGE(200, status(), ours[i]);
    }
    for (size_t i = 0; i < sizeof others / sizeof others[0]; i++) {
        asked.host = others[i];
        TEST_ASSERT_EQUAL_UINT_MESSAGE(421, status(), others[i]);
    }
    asked.host = NULL;
    TEST_ASSERT_EQUAL_UINT(421, status());
}

TEST(test_origin_of_another_site_is_refused) {
    static const char *const others[] = {"http://evil.example",   "null",
                                         "http://127.0.0.1:8471", "127.0.0.1:8470",
                                         "file://127.0.0.1:8470", "http://127.0.0.1:8470/"};
    asked.origin = "http://127.0.0.1:8470";
    TEST_ASSERT_EQUAL_UINT(200, status());
    asked.origin = "https://127.0.0.1:8470";
    TEST_ASSERT_EQUAL_UINT(200, status());
    for (size_t i = 0; i < sizeof others / sizeof others[0]; i++) {
        asked.origin = others[i];
        TEST_ASSERT_EQUAL_UINT_MESSAGE(403, status(), others[i]);
    }
}

TEST(test_request_cross_site_is_refused_except_the_page_itself) {
    asked.site = "cross-site";
    TEST_ASSERT_EQUAL_UINT(403, status());
    asked.site = "same-site";
    TEST_ASSERT_EQUAL_UINT(403, status());
    asked.site = "same-origin";
    TEST_ASSERT_EQUAL_UINT(200, status());
    asked.site = "cross-site";
    assert_status_of("/", 200);
    asked.origin = "http://evil.example";
    TEST_ASSERT_EQUAL_UINT(403, status());
}

TEST(test_request_without_proof_is_refused) {
    static const web_proof_t wrong[] = {WEB_PROOF_NONE, WEB_PROOF_WRONG, WEB_PROOF_OVER};
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        asked.proof = wrong[i];
        asked.method = "GET";
        assert_status_of("/api/status", 401);
        TEST_ASSERT_EQUAL_STRING((wrong[i] == WEB_PROOF_OVER) ? "bad_session" : "bad_token",
                                 web_judge(&rules, &asked).error);
        assert_status_of("/nowhere", 401);
        assert_status_of("/page.js", 200);
        assert_status_of("/api/challenge", 200);
        asked.method = "POST";
        assert_status_of("/api/estop", 401);
    }
}

TEST(test_secret_for_reading_grants_only_reading) {
    static const char *const commands[] = {"/api/estop", "/api/arm", "/api/drive", "/api/reset"};
    rules.may_drive = true;
    rules.may_reset = true;
    asked.proof = WEB_PROOF_READ;
    TEST_ASSERT_EQUAL_UINT(200, status());
    asked.method = "POST";
    for (size_t i = 0; i < sizeof commands / sizeof commands[0]; i++) {
        assert_status_of(commands[i], 401);
    }
}

TEST(test_stop_never_needs_a_proof) {
    asked.method = "POST";
    asked.path = "/api/stop";
    for (int proof = WEB_PROOF_NONE; proof <= WEB_PROOF_FULL; proof++) {
        asked.proof = (web_proof_t)proof;
        TEST_ASSERT_EQUAL_UINT(200, status());
    }
    asked.origin = "http://evil.example";
    TEST_ASSERT_EQUAL_UINT(403, status());
    asked.origin = NULL;
    asked.host = "evil.example";
    TEST_ASSERT_EQUAL_UINT(421, status());
}

TEST(test_header_sent_twice_is_refused) {
    asked.is_doubled = true;
    TEST_ASSERT_EQUAL_UINT(400, status());
    asked.body = 1;
    TEST_ASSERT_EQUAL_UINT(400, status());
}

TEST(test_request_to_unknown_path_or_method_is_refused) {
    static const char *const nowhere[] = {"/api", "/api/status/", "/../etc/passwd",   "/%2e%2e/token", "//",
                                          "",     "/index.html",  "/uPlot.LICENSE/.."};
    for (size_t i = 0; i < sizeof nowhere / sizeof nowhere[0]; i++) {
        assert_status_of(nowhere[i], 404);
    }
    assert_status_of("/api/stop", 405);
    asked.method = "POST";
    TEST_ASSERT_EQUAL_UINT(200, status());
}

TEST(test_request_with_a_body_is_refused) {
    asked.body = 1;
    TEST_ASSERT_EQUAL_UINT(413, status());
    asked.body = -1;
    TEST_ASSERT_EQUAL_UINT(413, status());
    asked.method = "POST";
    TEST_ASSERT_EQUAL_UINT(413, status());
    assert_status_of("/api/stop", 413);
    asked.body = 4097;
    TEST_ASSERT_EQUAL_UINT(413, status());
}

TEST(test_stop_is_never_refused_for_a_short_body) {
    asked.method = "POST";
    asked.path = "/api/stop";
    asked.body = 2;
    TEST_ASSERT_EQUAL_UINT(200, status());
    asked.path = "/api/estop";
    asked.body = 4096;
    TEST_ASSERT_EQUAL_UINT(200, status());
    assert_status_of("/api/record", 413);
}

TEST(test_driving_and_reset_are_refused_unless_configured) {
    asked.method = "POST";
    assert_status_of("/api/arm", 403);
    assert_status_of("/api/drive", 403);
    rules.may_drive = true;
    TEST_ASSERT_EQUAL_UINT(200, status());
    assert_status_of("/api/reset", 403);
    rules.may_reset = true;
    TEST_ASSERT_EQUAL_UINT(200, status());
}

TEST(test_stop_and_estop_are_always_accepted) {
    asked.method = "POST";
    assert_status_of("/api/stop", 200);
    assert_status_of("/api/estop", 200);
}

TEST(test_number_with_other_characters_or_out_of_range_is_refused) {
    static const char *const wrong[] = {NULL,   "",   "-", "+1", " 1", "1 ", "1.0", "0x1", "1e2", "9223372036854775808",
                                        "-101", "101"};
    int64_t value = 7;
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        TEST_ASSERT_FALSE(web_number(wrong[i], -100, 100, &value));
    }
    TEST_ASSERT_EQUAL_INT64(7, value);
    TEST_ASSERT_TRUE(web_number("-100", -100, 100, &value));
    TEST_ASSERT_EQUAL_INT64(-100, value);
}

TEST(test_recording_name_with_a_path_is_refused) {
    static const char *const wrong[] = {
        NULL,      "",
        ".log",    "a",
        "a.txt",   "../a.log",
        "a/b.log", "a.log.log",
        "a\".log", "a b.log",
        "a\\.log", "a%2f.log",
        "a.log/",  "0123456789012345678901234567890123456789012345678901234567890123.log"};
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        TEST_ASSERT_FALSE(web_recording_name(wrong[i]));
    }
    TEST_ASSERT_TRUE(web_recording_name("stop-000017-wheel_lost.jsonl"));
    TEST_ASSERT_TRUE(web_recording_name("a.log"));
    TEST_ASSERT_TRUE(web_recording_name("a.conf"));
}

// ---- the driver -----------------------------------------------------------------------------------------------------

#define NOW 5000000U

static web_driver_t driver;
static const web_limits_t limits = {300, 300000, 0};
static web_command_t command;

static const char *next_command(uint64_t now_us) {
    web_twist_t twist = {-1, -1};
    const char *why = web_driver_take(&driver, &command, &limits, now_us, &twist);
    TEST_ASSERT_EQUAL_INT32((why == NULL) ? 200 : -1, twist.v_mm_s);
    return why;
}

static void begin(void) {
    driver = (web_driver_t){0};
    command = (web_command_t){true, "4900000", "1", "200", "-100"};
    web_driver_begin(&driver, NOW);
}

TEST(test_drive_command_of_the_armed_page_is_accepted_once) {
    begin();
    TEST_ASSERT_NULL(next_command(NOW));
    TEST_ASSERT_NOT_NULL(next_command(NOW)); // The same command again.
    command.sequence = "3";
    TEST_ASSERT_NULL(next_command(NOW));
    command.sequence = "2"; // Overtaken by sequence 3.
    TEST_ASSERT_NOT_NULL(next_command(NOW));
    TEST_ASSERT_EQUAL_UINT64(2, driver.dropped);
}

TEST(test_drive_command_late_or_from_the_future_is_dropped) {
    begin();
    TEST_ASSERT_NOT_NULL(strstr(next_command(4900000U + 300001U), "too old"));
    TEST_ASSERT_NOT_NULL(strstr(next_command(4900000U - WEB_AHEAD_US - 1U), "future"));
    TEST_ASSERT_EQUAL_INT64(0, driver.sequence);
    TEST_ASSERT_NULL(next_command(4900000U + 300000U));
    // The clock of this command was read after that of the bridge, which found the command waiting.
    command.sequence = "2";
    TEST_ASSERT_NULL(next_command(4900000U - WEB_AHEAD_US));
}

TEST(test_drive_command_has_its_age_by_the_clock_of_the_gateway) {
    const web_limits_t board = {300, 300000, -4000000};
    web_twist_t twist;
    begin();
    command.t_us = "900000";
    TEST_ASSERT_NOT_NULL(web_driver_take(&driver, &command, &board, NOW + 200001U, &twist));
    TEST_ASSERT_NULL(web_driver_take(&driver, &command, &board, NOW + 200000U, &twist));
    TEST_ASSERT_FALSE(web_driver_silent(&driver, NOW + 200000U));
}

TEST(test_drive_command_of_another_page_is_dropped) {
    begin();
    command.is_holders = false;
    TEST_ASSERT_NOT_NULL(next_command(NOW));
    command.is_holders = true;
    web_driver_end(&driver);
    TEST_ASSERT_NOT_NULL(next_command(NOW));
}

TEST(test_drive_command_beyond_limits_counts_as_motion) {
    begin();
    command.is_holders = false;
    TEST_ASSERT_TRUE(web_command_moves(&command));
    command.v_mm_s = "0";
    TEST_ASSERT_TRUE(web_command_moves(&command));
    command.yaw_mrad_s = "0";
    TEST_ASSERT_FALSE(web_command_moves(&command));
    command.v_mm_s = "-5000";
    TEST_ASSERT_TRUE(web_command_moves(&command));
    command.v_mm_s = "1.5";
    TEST_ASSERT_FALSE(web_command_moves(&command));
    command.v_mm_s = NULL;
    TEST_ASSERT_FALSE(web_command_moves(&command));
}

TEST(test_arm_and_reset_outside_their_age_limits_are_refused) {
    static const char *const wrong[] = {NULL, "", "x", "-1", "3999999", "5100001", "0", "9223372036854775807"};
    static const char *const good[] = {"4000000", "5000000", "5100000"};
    int64_t t_us = 7;
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        TEST_ASSERT_NOT_NULL(web_age_wrong(wrong[i], NOW, &t_us));
    }
    TEST_ASSERT_EQUAL_INT64(7, t_us);
    for (size_t i = 0; i < sizeof good / sizeof good[0]; i++) {
        TEST_ASSERT_NULL(web_age_wrong(good[i], NOW, &t_us));
    }
    TEST_ASSERT_EQUAL_INT64(5100000, t_us);
}

TEST(test_drive_command_beyond_the_configured_speed_is_dropped) {
    begin();
    command.v_mm_s = "301";
    TEST_ASSERT_NOT_NULL(next_command(NOW));
    command.v_mm_s = "200";
    command.yaw_mrad_s = "1001";
    TEST_ASSERT_NOT_NULL(next_command(NOW));
    command.yaw_mrad_s = NULL;
    TEST_ASSERT_NOT_NULL(next_command(NOW));
}

TEST(test_driver_without_commands_is_silent_until_it_ends) {
    begin();
    TEST_ASSERT_FALSE(web_driver_silent(&driver, NOW + WEB_FIRST_US - 1U));
    TEST_ASSERT_TRUE(web_driver_silent(&driver, NOW + WEB_FIRST_US));
    TEST_ASSERT_NULL(next_command(NOW));
    TEST_ASSERT_FALSE(web_driver_silent(&driver, NOW + WEB_SILENT_US - 1U));
    TEST_ASSERT_TRUE(web_driver_silent(&driver, NOW + WEB_SILENT_US));
    web_driver_end(&driver);
    TEST_ASSERT_FALSE(web_driver_silent(&driver, UINT64_MAX));
}
