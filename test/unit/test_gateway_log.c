// SPDX-License-Identifier: MIT
// Log of the gateway
#include "config/gateway_config.h"
#include "sockets/log.h"
#include "start/start_report.h"

#include "unit.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

static FILE *file;
static sock_log_t people;
static gateway_config_t config;
static char text[8192];

void setUp(void) {
    file = tmpfile();
    TEST_ASSERT_NOT_NULL(file);
    sock_log_open(&people, SOCK_LOG_INFO);
    sock_log_close(&people);
    people.fd = dup(fileno(file));
    gateway_config_default(&config);
    config.core.track_mm = 540;
}

void tearDown(void) {
    sock_log_close(&people);
    (void)fclose(file);
}

static const char *written(void) {
    rewind(file);
    text[fread(text, 1, sizeof text - 1U, file)] = '\0';
    return text;
}

static void assert_line(const char *line) {
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(written(), line), line);
}

TEST(test_log_at_start_names_bus_sockets_estop_and_stop_budget) {
    (void)snprintf(config.bus.interface, sizeof config.bus.interface, "can7");
    (void)snprintf(config.estop.line, sizeof config.estop.line, "gpiochip0/17");
    (void)snprintf(config.northbound.socket, sizeof config.northbound.socket, "/run/drive.sock");
    (void)snprintf(config.northbound.watch_socket, sizeof config.northbound.watch_socket, "/run/watch.sock");
    gw_report_start(&config, false, true, &people);
    assert_line("iwheel-gateway: info: version " IWHEEL_VERSION "; bus can7; clients at /run/drive.sock\n");
    assert_line("iwheel-gateway: info: watchers at /run/watch.sock\n");
    assert_line("iwheel-gateway: info: e-stop: gpiochip0/17\n");
    const iw_stop_budget_t budget = iw_config_stop_budget(&config.core);
    char line[160];
    (void)snprintf(line, sizeof line, "stop budget, client lost: %u ms and %u mm after its last command\n",
                   (unsigned)budget.client_lost_ms, (unsigned)budget.client_lost_mm);
    assert_line(line);
    (void)snprintf(line, sizeof line, "stop budget, gateway killed: %u ms and %u mm at full command, then unknown\n",
                   (unsigned)budget.killed_ms, (unsigned)budget.killed_mm);
    assert_line(line);
    assert_line(
        "angle budget, zero without ramp: the machine turns by 16.2 degrees if a wheel is blocked, by 18.3 if it is "
        "slow (assumes 4700 mm/s2, not measured)\n");
    assert_line(
        "angle budget, ramp: the machine turns by 40.4 degrees if a wheel coasts (assumes 700 mm/s2, not measured), "
        "by 10.6 if it follows 100 ms late\n");
    assert_line("angle budget, unbounded: the machine turns by 106.1 degrees per second if only one wheel drives; up "
                "to 12.5 per second are not detected\n");
    TEST_ASSERT_NULL(strstr(written(), "track_mm"));
    assert_line("iwheel-gateway: warning: setpoint_type or current_role is not configured: arm will be refused; set "
                "both under [wheels]\n");
}

/// A narrower track turns further. A slow machine coasts instead of braking, and a quarter of its speed may not be
/// detected.
TEST(test_log_at_start_calculates_angles_from_track_and_speed) {
    config.core.track_mm = 270;
    gw_report_start(&config, false, false, &people);
    assert_line("turns by 212.2 degrees per second if only one wheel drives;");
    config.core.track_mm = 540;
    config.core.max_speed_mm_s = 90;
    gw_report_start(&config, false, false, &people);
    assert_line("turns by 3.7 degrees if a wheel is blocked, by 7.2 if it is slow");
    config.core.decel_mm_s2 = 600;
    gw_report_start(&config, false, false, &people);
    assert_line(", ramp: the machine turns by 0.0 degrees if a wheel coasts");
}

/// Without a configured track nothing is calculated.
TEST(test_log_at_start_without_a_track_warns_and_has_no_angle) {
    config.core.track_mm = 0;
    gw_report_start(&config, false, false, &people);
    assert_line("iwheel-gateway: warning: track_mm is not configured: arm will be refused; set it under [wheels] "
                "(iwheelctl bringup measures it)\n");
    TEST_ASSERT_NULL(strstr(written(), "angle"));
}

TEST(test_log_at_start_omits_absent_watchers_and_warnings) {
    config.core.setpoint_type_set = true;
    config.core.current_role = IW_ROLE_LIMIT;
    config.core.listen_only = true;
    gw_report_start(&config, true, false, &people);
    assert_line("; listens only\n");
    assert_line(" (SIMULATED)\n");
    TEST_ASSERT_NULL(strstr(written(), "watchers"));
    TEST_ASSERT_NULL(strstr(written(), "warning"));
}

TEST(test_log_accepts_a_burst_and_counts_dropped_lines) {
    for (unsigned i = 0; i < 45U; i++) {
        sock_log(&people, SOCK_LOG_WARNING, "line %u", i);
    }
    people.credit_us -= 200000U; // Time for one line
    sock_log(&people, SOCK_LOG_ERROR, "last");
    assert_line("warning: line 39\n");
    TEST_ASSERT_NULL(strstr(written(), "line 40"));
    assert_line("iwheel-gateway: error: (5 lines dropped before this one) last\n");
}

TEST(test_log_omits_lower_levels_and_control_characters) {
    sock_log(&people, SOCK_LOG_DEBUG, "below");
    sock_log(&people, SOCK_LOG_INFO, "two\nlines \033[1m");
    TEST_ASSERT_NULL(strstr(written(), "below"));
    TEST_ASSERT_NULL(strchr(written(), '\033'));
    TEST_ASSERT_EQUAL_PTR(strrchr(written(), '\n'), strchr(written(), '\n'));
    sock_log_level_t level = SOCK_LOG_ERROR;
    TEST_ASSERT_TRUE(sock_log_level_of("debug", &level));
    TEST_ASSERT_EQUAL_INT(SOCK_LOG_DEBUG, level);
    TEST_ASSERT_FALSE(sock_log_level_of("loud", &level));
}
