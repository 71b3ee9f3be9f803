// SPDX-License-Identifier: MIT
// The stream of the web bridge to its readers; metrics, settings and token.
#include "feed.h"
#include "metrics.h"
#include "token.h"
#include "web_settings.h"

#include "folder.h"
#include "unit.h"

#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <utime.h>

static web_feed_t feed;
static web_reader_t reader;
static char out[4096];

void setUp(void) {
    memset(&feed, 0, sizeof feed);
    web_reader_begin(&reader, &feed);
}

void tearDown(void) {
    web_reader_end(&reader);
    web_feed_free(&feed);
}

static const char *read_out(size_t size) {
    out[web_reader_take(&reader, &feed, out, size)] = '\0';
    return out;
}

static void add(const char *name, const char *json) {
    TEST_ASSERT_TRUE(web_feed_add(&feed, name, json, strlen(json), strcmp(name, "state") == 0));
}

TEST(test_reader_gets_events_in_order_and_then_the_state) {
    add("state", "{\"a\":1}");
    add("stop", "{\"b\":2}");
    add("fault", "{\"c\":3}");
    TEST_ASSERT_TRUE(web_reader_waits(&reader, &feed));
    TEST_ASSERT_EQUAL_STRING("event: stop\ndata: {\"b\":2}\n\n", read_out(1000));
    TEST_ASSERT_EQUAL_STRING("event: fault\ndata: {\"c\":3}\n\n", read_out(1000));
    TEST_ASSERT_EQUAL_STRING("event: state\ndata: {\"a\":1}\n\n", read_out(1000));
    TEST_ASSERT_EQUAL_STRING("", read_out(1000));
    TEST_ASSERT_FALSE(web_reader_waits(&reader, &feed));
}

TEST(test_reader_slow_gets_the_newest_state_only) {
    for (char i = '0'; i <= '9'; i++) {
        const char json[] = {'{', '"', i, '"', ':', i, '}', '\0'};
        add("state", json);
    }
    TEST_ASSERT_EQUAL_STRING("event: state\ndata: {\"9\":9}\n\n", read_out(1000));
    TEST_ASSERT_EQUAL_STRING("", read_out(1000));
}

TEST(test_reader_within_a_state_gets_its_end_then_the_newest) {
    add("state", "{\"a\":1}");
    TEST_ASSERT_EQUAL_STRING("event", read_out(5));
    add("state", "{\"a\":2}");
    add("state", "{\"a\":3}");
    TEST_ASSERT_EQUAL_STRING(": state\ndata: {\"a\":1}\n\n", read_out(1000));
    TEST_ASSERT_EQUAL_STRING("event: state\ndata: {\"a\":3}\n\n", read_out(1000));
}

TEST(test_reader_too_slow_gets_the_count_of_lost_events) {
    for (unsigned i = 0; i < WEB_FEED_STORED + 7U; i++) {
        add("bus", "{}");
    }
    TEST_ASSERT_EQUAL_STRING("event: lost\ndata: {\"event\":\"lost\",\"count\":7}\n\n", read_out(1000));
    for (unsigned i = 0; i < WEB_FEED_STORED; i++) {
        TEST_ASSERT_EQUAL_STRING("event: bus\ndata: {}\n\n", read_out(1000));
    }
    TEST_ASSERT_EQUAL_STRING("", read_out(1000));
}

TEST(test_reader_new_gets_the_newest_state_and_no_old_event) {
    add("stop", "{}");
    add("state", "{\"a\":1}");
    web_reader_begin(&reader, &feed);
    TEST_ASSERT_EQUAL_STRING("event: state\ndata: {\"a\":1}\n\n", read_out(1000));
    TEST_ASSERT_EQUAL_STRING("", read_out(1000));
}

TEST(test_reader_gets_no_state_that_was_cleared) {
    add("state", "{\"a\":1}");
    web_feed_forget(&feed);
    TEST_ASSERT_FALSE(web_reader_waits(&reader, &feed));
    TEST_ASSERT_EQUAL_STRING("", read_out(1000));
}

// ---- metrics --------------------------------------------------------------------------------------------------------

static web_tally_t tally;

static char *metrics_of(const char *json) {
    char *text = NULL;
    size_t length = 0;
    const iwc_message_t message = {.text = json, .length = (json != NULL) ? strlen(json) : 0U};
    const web_own_t own = {3, 4, 5, 6, 7};
    FILE *file = open_memstream(&text, &length);
    web_metrics_write((json != NULL) ? &message : NULL, &own, &tally, file);
    (void)fclose(file);
    return text;
}

TEST(test_metrics_have_base_units_and_no_unknown_values) {
    char *text = metrics_of("{\"state\":\"armed\",\"left\":{\"heard\":true,\"speed_mm_s\":-1234,\"battery_dV\":251,"
                            "\"temperature_degC\":null},"
                            "\"right\":{\"heard\":false,\"speed_mm_s\":null},\"counters\":{\"pairs\":7},"
                            "\"gaps\":{\"limits_ms\":[5,20],\"count\":[1,0,2],\"worst_us\":20500}}");
    static const char *const lines[] = {"\niwheel_up 1\n",
                                        "\niwheel_state{iwheel_state=\"armed\"} 1\n",
                                        "\niwheel_state{iwheel_state=\"latched\"} 0\n",
                                        "\niwheel_wheel_speed_meters_per_second{side=\"left\"} -1.234\n",
                                        "\niwheel_wheel_battery_volts{side=\"left\"} 25.1\n",
                                        "\niwheel_wheel_heard{side=\"right\"} 0\n",
                                        "\niwheel_setpoint_pairs_total 7\n",
                                        "\niwheel_setpoint_gap_seconds_bucket{le=\"0.005\"} 1\n",
                                        "\niwheel_setpoint_gap_seconds_bucket{le=\"0.020\"} 1\n",
                                        "\niwheel_setpoint_gap_seconds_bucket{le=\"+Inf\"} 3\n",
                                        "\niwheel_setpoint_gap_worst_seconds 0.020500\n",
                                        "\niwheel_web_watchers 3\n",
                                        "\niwheel_web_dropped_commands_total 5\n",
                                        "\niwheel_web_crowded_out_total 7\n"};
    for (size_t i = 0; i < sizeof lines / sizeof lines[0]; i++) {
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, lines[i]), lines[i]);
    }
    TEST_ASSERT_NULL(strstr(text, "iwheel_wheel_speed_meters_per_second{side=\"right\"}"));
    TEST_ASSERT_NULL(strstr(text, "iwheel_wheel_temperature_celsius{"));
    TEST_ASSERT_EQUAL_STRING("# EOF\n", text + strlen(text) - 6U);
    free(text);
}

TEST(test_metrics_without_a_gateway_have_no_values_of_wheels) {
    char *text = metrics_of(NULL);
    TEST_ASSERT_NOT_NULL(strstr(text, "\niwheel_up 0\n"));
    TEST_ASSERT_NULL(strstr(text, "iwheel_wheel"));
    free(text);
}

static void stopped(const char *json, bool is_event) {
    const iwc_message_t message = {.text = json, .length = strlen(json), .is_event = is_event};
    web_tally_take(&tally, &message, is_event);
}

static void expect_line(const char *line) {
    char *text = metrics_of(NULL);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, line), line);
    free(text);
}

TEST(test_metrics_count_each_stop_since_the_connection_once) {
    memset(&tally, 0, sizeof tally);
    expect_line("\niwheel_stops_total{cause=\"lease_lost\"} 0\n");
    stopped("{\"number\":4,\"cause\":\"overspeed\",\"at_us\":9,\"wall_us\":1760000000000007}", false);
    expect_line("\niwheel_stops_total{cause=\"overspeed\"} 0\n"); // The stop was before the connection.
    expect_line("\niwheel_last_stop_number 4\n");
    expect_line("\niwheel_last_stop_timestamp_seconds 1760000000.000007\n");
    stopped("{\"number\":5,\"cause\":\"lease_lost\",\"at_us\":20}", true);
    stopped("{\"number\":5,\"cause\":\"lease_lost\",\"at_us\":20}", false); // The same stop, from the reply to `why`.
    expect_line("\niwheel_stops_total{cause=\"lease_lost\"} 1\n");
    expect_line("\niwheel_stops_total{cause=\"unknown\"} 0\n");
    stopped("{\"number\":8,\"cause\":\"lease_lost\",\"at_us\":30}", false); // Two stops were missed.
    expect_line("\niwheel_stops_total{cause=\"lease_lost\"} 2\n");
    expect_line("\niwheel_stops_total{cause=\"unknown\"} 2\n");
}

TEST(test_metrics_counts_continue_after_a_gateway_restart) {
    memset(&tally, 0, sizeof tally);
    stopped("{\"number\":0,\"cause\":null,\"at_us\":null}", false);
    expect_line("\niwheel_last_stop_number 0\n");
    stopped("{\"number\":1,\"cause\":\"client_stop\",\"at_us\":5}", true);
    stopped("{\"number\":1,\"cause\":\"client_stop\",\"at_us\":7}", true); // A stop of the next run of the gateway.
    stopped("{\"number\":0,\"cause\":null,\"at_us\":null}", false);
    stopped("{\"number\":2,\"cause\":\"of the future\",\"at_us\":8}", true);
    expect_line("\niwheel_stops_total{cause=\"client_stop\"} 2\n");
    expect_line("\niwheel_stops_total{cause=\"unknown\"} 2\n");
    expect_line("\niwheel_last_stop_number 2\n");
}

TEST(test_metrics_have_the_version) {
    expect_line("\niwheel_build_info{version=\"" IWHEEL_VERSION "\"} 1\n");
}

// ---- settings -------------------------------------------------------------------------------------------------------

static char complaint[1024];

static int read_settings(const char *text, web_settings_t *settings) {
    memset(complaint, 0, sizeof complaint);
    FILE *err = fmemopen(complaint, sizeof complaint - 1U, "w");
    settings_report_t report = {.name = "f", .err = err};
    *settings = web_settings_standard;
    const int result = settings_parse(&web_settings_form, &report, text, strlen(text), settings);
    (void)fclose(err);
    return result;
}

TEST(test_settings_errors_have_line_and_fix) {
    static const char *const cases[][2] = {
        {"[web]\nport = 0", "f:2: "},
        {"[web]\nlisten = walker\n", "f:2: listen = walker is not an address"},
        {"[web]\nlisten = 0.0.0.0\n", "f:2: listen = 0.0.0.0 can be reached from other machines"},
        {"[web]\nlisten = ::\n", "f:2: listen = :: can be reached from other machines"},
        {"[web]\nkey = /a\n", "f:2: key is set without certificate"},
        {"[web]\ncertificate = /a\n", "f:2: certificate is set without key"},
        {"[drive]\nallow_reset = yes\n", "f:2: allow_reset = yes needs the right to drive"},
        {"[drive]\nenabled = true\n", "f:2: "},
        {"[drive]\nport = 1\n", "f:2: port is not a key of [drive]; move it to [web]"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        web_settings_t settings;
        TEST_ASSERT_EQUAL_INT_MESSAGE(SETTINGS_ERROR, read_settings(cases[i][0], &settings), cases[i][0]);
        TEST_ASSERT_EQUAL_PTR_MESSAGE(complaint, strstr(complaint, cases[i][1]), complaint);
    }
}

TEST(test_settings_for_other_machines_are_accepted_with_tls) {
    web_settings_t settings;
    TEST_ASSERT_EQUAL_INT(
        0, read_settings("[web]\nlisten = 0.0.0.0\ncertificate = /a\nkey = /b\nhosts = a b\n", &settings));
    TEST_ASSERT_TRUE(web_settings_has_tls(&settings));
    TEST_ASSERT_EQUAL_STRING("a b", web_settings_hosts(&settings));
    TEST_ASSERT_EQUAL_INT(0, read_settings("[web]\nlisten = unix:/run/a.sock\n", &settings));
    TEST_ASSERT_TRUE(web_settings_is_unix(&settings));
    TEST_ASSERT_FALSE(web_settings_has_tls(&settings));
    TEST_ASSERT_EQUAL_STRING("", web_settings_hosts(&settings));
    TEST_ASSERT_FALSE(settings.drive.enabled);
}

// ---- token ----------------------------------------------------------------------------------------------------------

static char path[64];
static FILE *null;

static void begin_token(web_token_t *token, uint32_t hours) {
    folder_make();
    (void)snprintf(path, sizeof path, "%s/token", folder);
    null = fopen("/dev/null", "w");
    *token = (web_token_t){.path = path, .hours = hours};
}

static void end_token(void) {
    folder_remove();
    (void)fclose(null);
}

TEST(test_token_is_created_for_the_bridge_alone_and_stays) {
    web_token_t token;
    web_token_t other;
    struct stat status;
    bool changed = false;
    begin_token(&token, 0);
    TEST_ASSERT_TRUE(web_token_refresh(&token, &changed, null));
    TEST_ASSERT_TRUE(changed);
    TEST_ASSERT_EQUAL_size_t(WEB_TOKEN_SIZE - 1U, strlen(token.text));
    TEST_ASSERT_EQUAL_INT(0, stat(path, &status));
    TEST_ASSERT_EQUAL_HEX(0600, status.st_mode & 07777U);
    other = (web_token_t){.path = path};
    TEST_ASSERT_TRUE(web_token_refresh(&other, &changed, null));
    TEST_ASSERT_EQUAL_STRING(token.text, other.text);
    TEST_ASSERT_TRUE(web_token_refresh(&token, &changed, null));
    TEST_ASSERT_FALSE(changed);
    end_token();
}

TEST(test_token_that_is_deleted_or_expired_is_replaced) {
    web_token_t token;
    char before[WEB_TOKEN_SIZE];
    bool changed = false;
    begin_token(&token, 1);
    TEST_ASSERT_TRUE(web_token_refresh(&token, &changed, null));
    memcpy(before, token.text, sizeof before);
    TEST_ASSERT_EQUAL_INT(0, unlink(path));
    TEST_ASSERT_TRUE(web_token_refresh(&token, &changed, null));
    TEST_ASSERT_TRUE(changed && strcmp(before, token.text) != 0);
    memcpy(before, token.text, sizeof before);
    const struct utimbuf old = {time(NULL) - 3601, time(NULL) - 3601};
    TEST_ASSERT_EQUAL_INT(0, utime(path, &old));
    TEST_ASSERT_TRUE(web_token_refresh(&token, &changed, null));
    TEST_ASSERT_TRUE(changed && strcmp(before, token.text) != 0);
    end_token();
}

TEST(test_token_that_others_can_read_is_refused) {
    web_token_t token;
    bool changed = false;
    begin_token(&token, 0);
    TEST_ASSERT_TRUE(web_token_refresh(&token, &changed, null));
    TEST_ASSERT_EQUAL_INT(0, chmod(path, 0640));
    TEST_ASSERT_FALSE(web_token_refresh(&token, &changed, null));
    end_token();
}

TEST(test_token_that_is_only_read_is_never_created) {
    web_token_t token;
    bool changed = false;
    begin_token(&token, 1);
    token.only_reads = true;
    TEST_ASSERT_FALSE(web_token_refresh(&token, &changed, null));
    TEST_ASSERT_NOT_EQUAL(0, access(path, F_OK));
    token.only_reads = false;
    TEST_ASSERT_TRUE(web_token_refresh(&token, &changed, null));
    const struct utimbuf old = {time(NULL) - 3601, time(NULL) - 3601};
    TEST_ASSERT_EQUAL_INT(0, utime(path, &old));
    token.only_reads = true;
    TEST_ASSERT_TRUE(web_token_refresh(&token, &changed, null));
    TEST_ASSERT_FALSE(changed);
    end_token();
}
