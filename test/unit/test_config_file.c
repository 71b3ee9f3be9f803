// SPDX-License-Identifier: MIT
// Configuration file of the gateway: which texts are accepted or refused, and the messages of a refusal.
#include "test_config_rig.h"

#include "folder.h"
#include "unit.h"

#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static unsigned lines_in(const char *text) {
    unsigned lines = 0;
    for (; *text != '\0'; text++) {
        lines += (*text == '\n') ? 1U : 0U;
    }
    return lines;
}

/// print -> load -> print must not change a byte.
static void assert_fixed_point(const gateway_config_t *from) {
    char *first = printed(from);
    accepted(first);
    char *second = printed(&config);
    TEST_ASSERT_EQUAL_STRING(first, second);
    free(first);
    free(second);
}

TEST(test_parse_empty_file_sets_documented_defaults) {
    accepted("");
    TEST_ASSERT_EQUAL_STRING("can0", config.bus.interface);
    TEST_ASSERT_EQUAL_UINT32(1000000, config.bus.bitrate);
    TEST_ASSERT_EQUAL_UINT16(625, config.bus.sample_point_permille);
    TEST_ASSERT_EQUAL(GATEWAY_MISMATCH_REFUSE, config.bus.on_mismatch);
    TEST_ASSERT_EQUAL_STRING("ESTOP", config.estop.line);
    TEST_ASSERT_TRUE(config.estop.active_high);
    TEST_ASSERT_EQUAL_UINT16(5, config.estop.debounce_ms);
    TEST_ASSERT_EQUAL_STRING("none", config.estop.line2);
    TEST_ASSERT_TRUE(config.estop.active2_high);
    TEST_ASSERT_EQUAL_UINT16(200, config.estop.discrepancy_ms);
    TEST_ASSERT_EQUAL_STRING("/run/iwheel/gateway.sock", config.northbound.socket);
    TEST_ASSERT_EQUAL_HEX16(0660, config.northbound.mode);
    TEST_ASSERT_EQUAL_STRING("iwheel", config.northbound.group);
    TEST_ASSERT_EQUAL_UINT16(16, config.northbound.max_clients);
    TEST_ASSERT_EQUAL_UINT16(30, config.record.blackbox_s);
    TEST_ASSERT_EQUAL_UINT16(200, config.record.keep_stops);
    TEST_ASSERT_EQUAL_STRING("/var/lib/iwheel", config.record.directory);
    TEST_ASSERT_EQUAL(IW_CONFIG_OK, iw_config_check(&config.core));
}

TEST(test_parse_empty_file_leaves_type_role_and_track_unset) {
    accepted("");
    TEST_ASSERT_EQUAL_UINT16(0, config.core.track_mm);
    TEST_ASSERT_FALSE(config.core.setpoint_type_set);
    TEST_ASSERT_EQUAL(IW_ROLE_UNSET, config.core.current_role);
    TEST_ASSERT_FALSE(config.core.listen_only);
}

TEST(test_parse_every_key_reaches_its_field) {
    accepted(
        "[bus]\ninterface=unix:/tmp/bus\nbitrate=500000\nsample_point_permille=750\non_mismatch=warn\n"
        "[wheels]\nsetpoint_type=0\ncurrent_role=setpoint\nrpm_of=rotor\nradius_mm=200\ngear_ratio=27/2\ntrack_mm=600\n"
        "setpoint_dlc=8\n[left]\ninvert=yes\nforce_unit=dN\n[right]\ninvert=no\nforce_unit=cN\n"
        "[drive]\nperiod_ms=10\nlease_ms=300\naccel_mm_s2=500\ndecel_mm_s2=2000\nmax_speed_mm_s=900\n"
        "max_yaw_mrad_s=900\nyaw_accel_mrad_s2=1900\nmax_current_mA=1500\nmin_current_mA=400\nasymmetric_current=yes\n"
        "zero_hold_ms=1200\nhold_max_s=61\nafter_stop=hold\n[limits]\nwheel_silent_ms="
        "60\necho_ms=70\nrest_rpm=3\nrest_ms=250\n"
        "follow_mm_s=310\nfollow_ms=510\nblocked_ms=1100\npair_mm=61\npair_leak_ms=1001\nwheel_lag_ms=62\n[estop]"
        "\nline=gpiochip0:4\nactive=low\ndebounce_ms=7\nchip=pinctrl-bcm2711\nchip_line=GPIO4\nline2=gpiochip0:"
        "5\nline2_active=low\nchip2=expander\nchip2_line=P7\n"
        "estop_discrepancy_ms=150\n"
        "[northbound]\nsocket=/tmp/s\nmode=0600\ngroup=dialout\nmax_clients=4\n[record]\nblackbox_s=0\ndirectory=/"
        "tmp\n");
    const iw_config_t *core = &config.core;
    TEST_ASSERT_EQUAL_STRING("unix:/tmp/bus", config.bus.interface);
    TEST_ASSERT_EQUAL_UINT32(500000, config.bus.bitrate);
    TEST_ASSERT_EQUAL_UINT16(750, config.bus.sample_point_permille);
    TEST_ASSERT_EQUAL(GATEWAY_MISMATCH_WARN, config.bus.on_mismatch);
    TEST_ASSERT_TRUE(core->setpoint_type_set);
    TEST_ASSERT_EQUAL_UINT8(0, core->setpoint_type);
    TEST_ASSERT_EQUAL(IW_ROLE_SETPOINT, core->current_role);
    TEST_ASSERT_TRUE(core->rpm_of_rotor);
    TEST_ASSERT_EQUAL_UINT16(200, core->radius_mm);
    TEST_ASSERT_EQUAL_UINT16(27, core->gear_turns);
    TEST_ASSERT_EQUAL_UINT16(2, core->gear_per);
    TEST_ASSERT_EQUAL_UINT16(600, config.core.track_mm);
    TEST_ASSERT_EQUAL_UINT16(8, core->setpoint_dlc);
    TEST_ASSERT_TRUE(core->invert[IW_LEFT]);
    TEST_ASSERT_FALSE(core->invert[IW_RIGHT]);
    TEST_ASSERT_EQUAL(IW_FORCE_DN, core->force_unit[IW_LEFT]);
    TEST_ASSERT_EQUAL(IW_FORCE_CN, core->force_unit[IW_RIGHT]);
    const uint16_t numbers[] = {
        core->period_ms,      core->lease_ms,     core->accel_mm_s2,     core->decel_mm_s2,       core->max_speed_mm_s,
        core->max_current_mA, core->zero_hold_ms, core->wheel_silent_ms, core->echo_ms,           core->rest_rpm,
        core->rest_ms,        core->follow_mm_s,  core->follow_ms,       core->blocked_ms,        core->pair_mm,
        core->pair_leak_ms,   core->wheel_lag_ms, core->max_yaw_mrad_s,  core->yaw_accel_mrad_s2, core->min_current_mA,
        core->hold_max_s};
    const uint16_t wanted[] = {10,  300, 500,  2000, 900,  1500, 1200, 60,   70,  3, 250,
                               310, 510, 1100, 61,   1001, 62,   900,  1900, 400, 61};
    TEST_ASSERT_EQUAL_UINT16_ARRAY(wanted, numbers, sizeof wanted / sizeof wanted[0]);
    TEST_ASSERT_TRUE(core->asymmetric_current);
    TEST_ASSERT_TRUE(core->hold);
    TEST_ASSERT_EQUAL_STRING("gpiochip0:4", config.estop.line);
    TEST_ASSERT_EQUAL_STRING("pinctrl-bcm2711", config.estop.chip);
    TEST_ASSERT_EQUAL_STRING("GPIO4", config.estop.chip_line);
    TEST_ASSERT_FALSE(config.estop.active_high);
    TEST_ASSERT_EQUAL_STRING("gpiochip0:5", config.estop.line2);
    TEST_ASSERT_FALSE(config.estop.active2_high);
    TEST_ASSERT_EQUAL_STRING("expander", config.estop.chip2);
    TEST_ASSERT_EQUAL_STRING("P7", config.estop.chip2_line);
    TEST_ASSERT_EQUAL_UINT16(150, config.estop.discrepancy_ms);
    TEST_ASSERT_EQUAL_UINT16(7, config.estop.debounce_ms);
    TEST_ASSERT_EQUAL_STRING("/tmp/s", config.northbound.socket);
    TEST_ASSERT_EQUAL_HEX16(0600, config.northbound.mode);
    TEST_ASSERT_EQUAL_STRING("dialout", config.northbound.group);
    TEST_ASSERT_EQUAL_UINT16(4, config.northbound.max_clients);
    TEST_ASSERT_EQUAL_UINT16(0, config.record.blackbox_s);
    TEST_ASSERT_EQUAL_STRING("/tmp", config.record.directory);
    before = config;
    assert_fixed_point(&before);
}

TEST(test_parse_accepts_comments_indentation_crlf_and_bom) {
    accepted("\xEF\xBB\xBF; comment\r\n# another\r\n[drive] ; here too\r\n\tlease_ms = 300\t; three periods\r\n"
             "  period_ms=10\r\n\r\n[bus]\r\n[drive]\r\n  zero_hold_ms = 1600");
    TEST_ASSERT_EQUAL_UINT16(300, config.core.lease_ms);
    TEST_ASSERT_EQUAL_UINT16(10, config.core.period_ms);
    TEST_ASSERT_EQUAL_UINT16(1600, config.core.zero_hold_ms);
}

TEST(test_parse_range_ends_are_accepted_and_beyond_refused) {
    static const struct {
        const char *section, *key;
        long min, max;
    } rows[] = {
        {"bus", "bitrate", 10000, 1000000},
        {"bus", "sample_point_permille", 500, 900},
        {"wheels", "setpoint_type", 0, 255},
        {"wheels", "radius_mm", 60, 400},
        {"wheels", "track_mm", 200, 1500},
        {"wheels", "setpoint_dlc", 5, 8},
        {"drive", "period_ms", 5, 50},
        {"drive", "accel_mm_s2", 50, 20000},
        {"drive", "max_current_mA", 300, 2000},
        {"drive", "zero_hold_ms", 1100, 5000},
        {"limits", "wheel_silent_ms", 20, 200},
        {"limits", "echo_ms", 20, 200},
        {"limits", "rest_ms", 50, 2000},
        {"limits", "follow_mm_s", 50, 500},
        {"limits", "follow_ms", 100, 1000},
        {"limits", "blocked_ms", 200, 2000},
        {"limits", "pair_mm", 20, 150},
        {"limits", "pair_leak_ms", 500, 3000},
        {"limits", "wheel_lag_ms", 10, 300},
        {"limits", "battery_low_dV", 10, 254},
        {"limits", "temperature_high_degC", 20, 200},
        {"estop", "debounce_ms", 0, 1000},
        {"estop", "estop_discrepancy_ms", 50, 1000},
        {"northbound", "max_clients", 1, 64},
        {"record", "blackbox_s", 0, 600},
        {"record", "keep_stops", 8, 256},
        {"drive", "min_current_mA", 300, 2000},
        {"drive", "max_yaw_mrad_s", 50, 10000},
        {"drive", "yaw_accel_mrad_s2", 100, 10000},
        {"drive", "hold_max_s", 10, 600},
    };
    char text[128];
    char range[64];
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        const long inside[] = {rows[i].min, rows[i].max};
        const long outside[] = {rows[i].min - 1, rows[i].max + 1, rows[i].max + 65536, 4294967296L + rows[i].min};
        for (size_t j = 0; j < 2; j++) {
            snprintf(text, sizeof text, "[%s]\n%s = %ld\n", rows[i].section, rows[i].key, inside[j]);
            accepted(text);
        }
        snprintf(range, sizeof range, "%ld..%ld", rows[i].min, rows[i].max);
        for (size_t j = 0; j < 4; j++) {
            snprintf(text, sizeof text, "[%s]\n%s = %ld\n", rows[i].section, rows[i].key, outside[j]);
            refused(text, "iw.conf:2: ", range);
        }
    }
}

TEST(test_parse_numbers_with_anything_around_them_are_refused) {
    static const char *const values[] = {"20ms", "20 ms", "0x14", "2e1", "20.0", "+20",
                                         "--20", "-",     "abc",  "20,", "2 0",  "20\\"};
    char text[64];
    for (size_t i = 0; i < sizeof values / sizeof values[0]; i++) {
        snprintf(text, sizeof text, "[drive]\nperiod_ms = %s\n", values[i]);
        refused(text, "iw.conf:2: period_ms = ", "write digits alone");
    }
}

/// For every key a value in quotes is refused with the fix; the quotes never become part of the value.
TEST(test_parse_value_in_quotes_is_refused_for_every_key) {
    gateway_config_t whole;
    unsigned keys = 0;
    gateway_config_default(&whole);
    whole.core.setpoint_type_set = true;
    whole.core.track_mm = 540;
    whole.core.current_role = IW_ROLE_LIMIT;
    char *const text = printed(&whole);
    char section[64] = "";
    for (char *line = strtok(text, "\n"); line != NULL; line = strtok(NULL, "\n")) {
        static const char *const before_value[] = {"\"", "'", ""};
        static const char *const behind_value[] = {"\"", "'", "\""};
        char key[64];
        char value[128];
        if (line[0] == '[') {
            (void)snprintf(section, sizeof section, "%s", line);
        }
        if (line[0] == ';' || sscanf(line, "%63[a-z_0-9A-Z] = %127[^;]", key, value) != 2) {
            continue;
        }
        for (size_t length = strlen(value); length > 0U && value[length - 1U] == ' '; length--) {
            value[length - 1U] = '\0';
        }
        for (size_t i = 0; i < sizeof before_value / sizeof before_value[0]; i++) {
            char lines[320];
            (void)snprintf(lines, sizeof lines, "%s\n%s = %s%s%s\n", section, key, before_value[i], value,
                           behind_value[i]);
            refused(lines, "iw.conf:2: ", "quotes would be part of the value; write it without them");
        }
        keys++;
    }
    free(text);
    TEST_ASSERT_GREATER_OR_EQUAL_UINT(38U, keys);
}

TEST(test_parse_lease_zero_is_refused_as_not_optional) {
    refused("[drive]\n\nlease_ms = 0\n", "iw.conf:3: ", "cannot be disabled");
    refused("[drive]\nlease_ms = 5000\n", "iw.conf:2: lease_ms = 5000 is out of range", "20..500 ms");
}

TEST(test_parse_words_outside_the_list_are_refused) {
    refused("[left]\ninvert = true\n", "iw.conf:2: ", "no or yes");
    refused("[left]\ninvert = Yes\n", "iw.conf:2: ", "no or yes");
    refused("[right]\nforce_unit = N\n", "iw.conf:2: ", "cN or dN");
    refused("[wheels]\ncurrent_role = torque\n", "iw.conf:2: ", "limit or setpoint");
    refused("[wheels]\nrpm_of = motor\n", "iw.conf:2: ", "wheel or rotor");
    refused("[bus]\non_mismatch = ignore\n", "iw.conf:2: ", "refuse or warn");
    refused("[estop]\nactive = 1\n", "iw.conf:2: ", "low or high");
}

TEST(test_parse_gear_ratio_forms) {
    accepted("[wheels]\ngear_ratio = 1000/10\n");
    accepted("[wheels]\ngear_ratio = 100\n");
    TEST_ASSERT_EQUAL_UINT16(100, config.core.gear_turns);
    TEST_ASSERT_EQUAL_UINT16(1, config.core.gear_per);
    static const char *const bad[] = {"1/", "/2",  "1/2/3",     "1.5", "1 / 2", "a/b",      "-1/2",
                                      "0",  "1/0", "1001/1000", "101", "1/2",   "999/1000", "4294967297"};
    char text[64];
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        snprintf(text, sizeof text, "[wheels]\ngear_ratio = %s\n", bad[i]);
        refused(text, "iw.conf:2: gear_ratio = ", ";");
    }
}

TEST(test_parse_mode_is_octal_and_requires_owner_bits) {
    accepted("[northbound]\nmode = 666\n");
    TEST_ASSERT_EQUAL_HEX16(0666, config.northbound.mode);
    refused("[northbound]\nmode = 0680\n", "iw.conf:2: ", "octal");
    refused("[northbound]\nmode = 4660\n", "iw.conf:2: ", "octal");
    refused("[northbound]\nmode = 0060\n", "iw.conf:2: ", "owner");
    refused("[northbound]\nmode = rw-rw----\n", "iw.conf:2: ", "octal");
}

TEST(test_parse_invalid_names_are_refused) {
    refused("[bus]\ninterface = averylonginterfacename\n", "iw.conf:2: ", "at most 15 characters");
    refused("[bus]\ninterface = /dev/can0\n", "iw.conf:2: ", "unix:PATH");
    refused("[bus]\ninterface = unix:\n", "iw.conf:2: ", "no path");
    refused("[estop]\nline = unix:\n", "iw.conf:2: ", "no path");
    refused("[northbound]\ngroup = two words\n", "iw.conf:2: ", "group name");
    refused("[northbound]\nsocket = /run/iwheel/\n", "iw.conf:2: ", "directory");
    refused("[record]\ndirectory = /var/\xC3\xA4\n", "iw.conf:2: ", "printable ASCII");
}

TEST(test_parse_socket_path_up_to_the_address_size_is_accepted) {
    char text[512];
    char path[GATEWAY_PATH_SIZE + 1U];
    memset(path, 'a', sizeof path);
    path[0] = '/';
    path[GATEWAY_PATH_SIZE - 1U] = '\0';
    snprintf(text, sizeof text, "[northbound]\nsocket = %s\n[bus]\ninterface = unix:%s\n", path, path);
    accepted(text);
    TEST_ASSERT_EQUAL_STRING(path, config.northbound.socket);
    TEST_ASSERT_EQUAL_STRING(path, config.bus.interface + 5);
    path[GATEWAY_PATH_SIZE - 1U] = 'b';
    path[GATEWAY_PATH_SIZE] = '\0';
    snprintf(text, sizeof text, "[northbound]\nsocket = %s\n", path);
    refused(text, "iw.conf:2: ", "too long");
    snprintf(text, sizeof text, "[bus]\ninterface = unix:%s\n", path);
    refused(text, "iw.conf:2: ", "too long");
}

TEST(test_parse_missing_value_is_refused) {
    refused("[drive]\nlease_ms =\n", "iw.conf:2: ", "no value");
    refused("[drive]\nlease_ms = ; none\n", "iw.conf:2: ", "no value");
    refused("[northbound]\ngroup =\n", "iw.conf:2: ", "no value");
}

TEST(test_parse_line_without_equals_sign_is_refused) {
    refused("[drive]\nlease_ms 200\nperiod_ms = 20\n", "iw.conf:2: \"lease_ms 200\"", "'='");
    refused("[drive]\nperiod_ms = 20\nlease_ms", "iw.conf:3: ", "'='");
    refused("[drive]\nlease_ms =\n   200\n", "iw.conf:3: \"200\"", "'='");
    refused("[drive]\n= 200\n", "iw.conf:2: ", "no key");
}

TEST(test_parse_unknown_key_names_the_nearest) {
    refused("[drive]\nlease = 200\n", "iw.conf:2: unknown key lease", "did you mean lease_ms?");
    refused("[drive]\nperiode_ms = 20\n", "iw.conf:2: ", "did you mean period_ms?");
    refused("[drive]\nLease_ms = 20\n", "iw.conf:2: ", "did you mean lease_ms?");
    refused("[estop]\nzzzzzzzzzz = 1\n", "iw.conf:2: ", "known are: line, active, debounce_ms");
    refused("[bus]\nlease_ms = 200\n", "iw.conf:2: ", "move it to [drive]");
    refused("lease_ms = 200\n", "iw.conf:1: ", "put it under [drive]");
}

TEST(test_parse_ids_cannot_be_configured) {
    static const char *const keys[] = {"id", "left_id", "id_left", "can_id", "right_ids"};
    char text[64];
    for (size_t i = 0; i < sizeof keys / sizeof keys[0]; i++) {
        snprintf(text, sizeof text, "[left]\n%s = 298\n", keys[i]);
        refused(text, "iw.conf:2: ", "fixed by the wheels");
    }
}

TEST(test_parse_unknown_section_is_reported_once) {
    refused("[drives]\nlease_ms = 1\nfoo = 2\n[drive]\nperiod_ms = 1\n", "iw.conf:1: unknown section [drives]",
            "iw.conf:5: ");
    TEST_ASSERT_EQUAL_UINT(2, lines_in(messages));
    refused("[Drive]\n", "iw.conf:1: ", "bus, wheels, left, right, drive, limits, estop, northbound, record");
    refused("[]\n", "iw.conf:1: unknown section []", "known are");
    refused("[drive\nlease_ms = 300\n", "iw.conf:1: ", "no ']'");
    refused("[drive] lease_ms = 300\n", "iw.conf:1: ", "follows");
}

TEST(test_parse_duplicate_key_in_repeated_section_is_refused) {
    refused("[drive]\nlease_ms = 200\nlease_ms = 200\n", "iw.conf:3: ", "first on line 2");
    refused("[drive]\nlease_ms = 200\n[bus]\n[drive]\nlease_ms = 300\n", "iw.conf:5: ", "first on line 2");
}

TEST(test_parse_overlong_line_of_any_length_is_refused) {
    char text[512];
    for (size_t length = 190; length < 420; length++) {
        memset(text, ' ', sizeof text);
        memcpy(text, "[drive]\nlease_ms = 300", 22);
        memcpy(text + 8 + length - 4, ";abc\n", 6);
        if (length <= 197) {
            accepted(text);
            TEST_ASSERT_EQUAL_UINT16(300, config.core.lease_ms);
        } else {
            refused(text, "iw.conf:2: ", "shorten it");
            TEST_ASSERT_EQUAL_UINT(1, lines_in(messages));
        }
    }
}

TEST(test_parse_nul_and_control_characters_are_refused) {
    static const char nul[] = "[drive]\nlease_ms = 300\0 0\nperiod_ms = 20\n";
    TEST_ASSERT_EQUAL_INT(GATEWAY_CONFIG_ERROR, parse_bytes(nul, sizeof nul - 1U));
    TEST_ASSERT_NOT_NULL(strstr(messages, "iw.conf:2: holds the control character 0x00"));
    refused("[drive]\nlease_ms = 300\x1b[0m\n", "iw.conf:2: ", "0x1B");
    refused("[drive]\nlease_ms = 3\xC2\x9B"
            "2J\xE2\x80\xAE\x7F\n",
            "iw.conf:2: ", "lease_ms = 3?2J??");
}

TEST(test_parse_reports_all_errors_up_to_twenty) {
    char text[1024] = "[drive]\n";
    for (unsigned i = 0; i < 20; i++) {
        strcat(text, "nonsense = 1\n");
    }
    TEST_ASSERT_EQUAL_INT(GATEWAY_CONFIG_ERROR, parse(text));
    TEST_ASSERT_EQUAL_UINT(20, lines_in(messages));
    strcat(text, "nonsense = 1\nnonsense = 1\n");
    TEST_ASSERT_EQUAL_INT(GATEWAY_CONFIG_ERROR, parse(text));
    TEST_ASSERT_EQUAL_UINT(21, lines_in(messages));
    TEST_ASSERT_NOT_NULL(strstr(messages, "iw.conf: 2 more errors"));
}

TEST(test_parse_stop_budget_error_names_last_key_and_valid_values) {
    refused("[drive]\nmax_speed_mm_s = 2000\nlease_ms = 300\naccel_mm_s2 = 900\n", "iw.conf:3: ", "= 1654 ms to stop");
    TEST_ASSERT_NOT_NULL(strstr(messages, "write max_speed_mm_s = 1020 at most, or decel_mm_s2 = 2942 at least\n"));
    accepted("[drive]\nmax_speed_mm_s = 1020\nlease_ms = 300\n");
    refused("[drive]\nmax_speed_mm_s = 1021\nlease_ms = 300\n", "iw.conf:3: ", "1001 ms");
    accepted("[drive]\nmax_speed_mm_s = 2000\nlease_ms = 300\ndecel_mm_s2 = 2942\n");
    refused("[drive]\nmax_speed_mm_s = 2000\nlease_ms = 300\ndecel_mm_s2 = 2941\n", "iw.conf:4: ", "1001 ms");
}

TEST(test_parse_stop_budget_error_names_the_longest_valid_lease) {
    refused("[drive]\nmax_speed_mm_s = 1000\nlease_ms = 350\n", "iw.conf:3: ", "or lease_ms = 313 at most");
    accepted("[drive]\nmax_speed_mm_s = 1000\nlease_ms = 313\n");
    refused("[drive]\nmax_speed_mm_s = 1000\nlease_ms = 314\n", "iw.conf:3: ", "1001 ms");
}

TEST(test_print_and_load_is_a_fixed_point_for_every_word) {
    gateway_config_t wanted;
    gateway_config_default(&wanted);
    assert_fixed_point(&wanted);
    TEST_ASSERT_EQUAL_MEMORY(&wanted, &config, sizeof wanted);
    wanted.core.setpoint_type_set = true;
    wanted.core.setpoint_type = 255;
    wanted.core.current_role = IW_ROLE_LIMIT;
    wanted.core.track_mm = 200;
    wanted.core.rpm_of_rotor = true;
    wanted.core.invert[IW_RIGHT] = true;
    wanted.core.force_unit[IW_LEFT] = IW_FORCE_DN;
    wanted.bus.on_mismatch = GATEWAY_MISMATCH_WARN;
    wanted.estop.active_high = false;
    wanted.core.gear_turns = 7;
    wanted.core.gear_per = 3;
    assert_fixed_point(&wanted);
    TEST_ASSERT_EQUAL_MEMORY(&wanted, &config, sizeof wanted);
}

TEST(test_print_shows_unset_keys_as_comments) {
    gateway_config_default(&config);
    char *text = printed(&config);
    TEST_ASSERT_NOT_NULL(strstr(text, "\n;setpoint_type = ? "));
    TEST_ASSERT_NOT_NULL(strstr(text, "\n;current_role = ? "));
    TEST_ASSERT_NOT_NULL(strstr(text, "\n;track_mm = ?                      ; 200..1500 mm, no default\n"));
    TEST_ASSERT_NULL(strstr(text, "listen-only"));
    free(text);
    config.core.listen_only = true;
    text = printed(&config);
    TEST_ASSERT_NOT_NULL(strstr(text, "; In force from the command line: --listen-only"));
    free(text);
}

TEST(test_print_fits_the_line_limit_with_the_longest_texts) {
    gateway_config_default(&before);
    memset(before.bus.interface, 'a', sizeof before.bus.interface - 1U);
    memcpy(before.bus.interface, "unix:", 5);
    memcpy(before.estop.line, before.bus.interface, sizeof before.estop.line);
    memset(before.northbound.socket, 'b', sizeof before.northbound.socket - 1U);
    memset(before.record.directory, 'c', sizeof before.record.directory - 1U);
    memset(before.northbound.group, 'g', sizeof before.northbound.group - 1U);
    assert_fixed_point(&before);
}

TEST(test_print_of_defaults_equals_the_shipped_file) {
    gateway_config_default(&config);
    char *text = printed(&config);
    TEST_ASSERT_EQUAL_STRING_MESSAGE(text, file_text(IWHEEL_SHARE_DIR "/gateway.conf"),
                                     "copy the output of iwheel-gateway --print-config to share/gateway.conf");
    free(text);
}

TEST(test_load_reads_a_file_and_names_it_in_errors) {
    char path[] = "/tmp/iwheel-config-XXXXXX";
    const int file = mkstemp(path);
    TEST_ASSERT_TRUE(file >= 0);
    TEST_ASSERT_TRUE(dprintf(file, "[drive]\nlease_ms = 300\n") > 0);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, load(path), messages);
    TEST_ASSERT_EQUAL_UINT16(300, config.core.lease_ms);
    TEST_ASSERT_TRUE(dprintf(file, "period=1\n") > 0);
    TEST_ASSERT_EQUAL_INT(GATEWAY_CONFIG_ERROR, load(path));
    TEST_ASSERT_EQUAL_MEMORY(&before, &config, sizeof config);
    TEST_ASSERT_EQUAL_INT(0, strncmp(messages, path, strlen(path)));
    TEST_ASSERT_NOT_NULL(strstr(messages, "did you mean period_ms?"));
    TEST_ASSERT_EQUAL_INT(0, ftruncate(file, (off_t)GATEWAY_CONFIG_FILE_MAX));
    TEST_ASSERT_EQUAL_INT(GATEWAY_CONFIG_ERROR, load(path));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(messages, "is larger than 65535 bytes"), messages);
    close(file);
    unlink(path);
}

TEST(test_load_of_missing_file_directory_or_device_is_refused) {
    TEST_ASSERT_EQUAL_INT(GATEWAY_CONFIG_ERROR, load("/nonexistent/gateway.conf"));
    TEST_ASSERT_NOT_NULL(strstr(messages, "/nonexistent/gateway.conf: cannot be opened (No such file or directory); "));
    TEST_ASSERT_EQUAL_INT(GATEWAY_CONFIG_ERROR, load("/tmp"));
    TEST_ASSERT_NOT_NULL(strstr(messages, "not a regular file"));
    TEST_ASSERT_EQUAL_INT(GATEWAY_CONFIG_ERROR, load("/dev/zero"));
    TEST_ASSERT_NOT_NULL(strstr(messages, "not a regular file"));
    TEST_ASSERT_EQUAL_MEMORY(&before, &config, sizeof config);
}

TEST(test_override_changes_one_key_by_the_same_rules) {
    accepted("");
    TEST_ASSERT_EQUAL_INT(0, override("bus.interface", "unix:/tmp/bus"));
    TEST_ASSERT_EQUAL_STRING("unix:/tmp/bus", config.bus.interface);
    TEST_ASSERT_EQUAL_INT(0, override("estop.line", "none"));
    TEST_ASSERT_EQUAL_STRING("none", config.estop.line);
    before = config;
    TEST_ASSERT_EQUAL_INT(GATEWAY_CONFIG_ERROR, override("bus.interface", "unix:/tmp/a;b"));
    TEST_ASSERT_EQUAL_INT(0, strncmp(messages, "--option: interface = unix:/tmp/a;b", 35));
    TEST_ASSERT_EQUAL_INT(GATEWAY_CONFIG_ERROR, override("bus.interface", ""));
    TEST_ASSERT_EQUAL_INT(GATEWAY_CONFIG_ERROR, override("bus.nonsense", "1"));
    TEST_ASSERT_EQUAL_INT(GATEWAY_CONFIG_ERROR, override("drive.max_speed_mm_s", "5000"));
    TEST_ASSERT_NOT_NULL(strstr(messages, "to stop, more than the 1000 ms"));
    TEST_ASSERT_EQUAL_MEMORY(&before, &config, sizeof config);
    assert_fixed_point(&before);
}
