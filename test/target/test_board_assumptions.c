// SPDX-License-Identifier: MIT
// Stored observations of the wheels: values that are restored or dropped, and the state after a power cut.
#include "gateway_rig.h"
#include "unit.h"

#include "board_records.h"
#include "flash.h"

#include <stddef.h>
#include <string.h>

static uint32_t flash[BRD_FLASH_PAGES][BRD_FLASH_PAGE_WORDS];
static unsigned operations, cut_after, erasures;
static gateway_rig_t rig;

uint32_t brd_flash_read(unsigned page, unsigned word) {
    return flash[page][word];
}

bool brd_flash_erase(unsigned page) {
    if (operations++ >= cut_after) {
        return false;
    }
    erasures++;
    memset(flash[page], 0xFF, sizeof flash[page]);
    return true;
}

bool brd_flash_write(unsigned page, unsigned word, uint32_t value) {
    if (operations++ >= cut_after) {
        return false;
    }
    flash[page][word] = value;
    return true;
}

void setUp(void) {
    memset(flash, 0xFF, sizeof flash);
    operations = erasures = 0;
    cut_after = UINT32_MAX;
    gateway_rig_init(&rig);
}

static brd_settings_t settings_of(const char *key, const char *value) {
    char why[200];
    iwn_text_t text = iwn_text_begin(why, sizeof why);
    brd_settings_t settings = brd_settings_from(&rig.config);
    TEST_ASSERT_TRUE_MESSAGE(key == NULL || brd_settings_set(&settings, key, value, &text), why);
    return settings;
}

/// A confirmation by the operator, an observation of the bus, a tare on the left, and the zero of the right wheel
/// itself.
static brd_assumptions_t something(void) {
    static const iw_assumption_entry_t said = {IW_CONFIRMED, IW_SOURCE_OPERATOR, 0};
    static const iw_assumption_entry_t seen = {IW_CONTRADICTED, IW_SOURCE_BUS, 10012};
    static const brd_assumptions_zero_t zero[IW_SIDES] = {{12300, 3, 110, IW_OFFSET_OPERATOR},
                                                          {-4500, 0, 0, IW_OFFSET_WHEEL}};
    brd_assumptions_t learned;
    const brd_settings_t settings = settings_of(NULL, NULL);
    iw_gateway_set_assumption(&rig.gateway, IW_ASSUMPTION_TRACK, &said);
    iw_gateway_set_assumption(&rig.gateway, IW_ASSUMPTION_GEAR_RATIO, &said);
    iw_gateway_set_assumption(&rig.gateway, IW_ASSUMPTION_DLC, &said);
    iw_gateway_set_assumption(&rig.gateway, IW_ASSUMPTION_FORCE_UNIT_RIGHT, &seen);
    const iw_snapshot_t now = gateway_rig_snapshot(&rig);
    brd_assumptions_note(&learned, &now, &settings, zero);
    return learned;
}

/// Runs the gateway again with these settings and the stored values, and returns its snapshot.
static iw_snapshot_t run_again(const brd_assumptions_t *learned, const brd_settings_t *settings,
                               brd_assumptions_zero_t zero[IW_SIDES]) {
    gateway_rig_begin(&rig, false);
    brd_assumptions_restore(learned, settings, &rig.gateway, zero);
    return gateway_rig_snapshot(&rig);
}

TEST(test_learned_with_same_settings_is_restored_with_its_source) {
    const brd_assumptions_t learned = something();
    const brd_settings_t settings = settings_of(NULL, NULL);
    brd_assumptions_zero_t zero[IW_SIDES];
    const iw_snapshot_t seen = run_again(&learned, &settings, zero);
    TEST_ASSERT_EQUAL_INT(IW_CONFIRMED, seen.assumed[IW_ASSUMPTION_TRACK].state);
    TEST_ASSERT_EQUAL_INT(IW_SOURCE_OPERATOR, seen.assumed[IW_ASSUMPTION_TRACK].source);
    TEST_ASSERT_EQUAL_INT(IW_CONTRADICTED, seen.assumed[IW_ASSUMPTION_FORCE_UNIT_RIGHT].state);
    TEST_ASSERT_EQUAL_INT(10012, seen.assumed[IW_ASSUMPTION_FORCE_UNIT_RIGHT].figure);
    TEST_ASSERT_EQUAL_INT(IW_ASSUMED, seen.assumed[IW_ASSUMPTION_WHEEL_RADIUS].state);
    TEST_ASSERT_EQUAL_INT(IW_OFFSET_OPERATOR, seen.wheel[IW_LEFT].force->provenance);
    TEST_ASSERT_EQUAL_INT(12300, seen.wheel[IW_LEFT].force->offset_mN);
    TEST_ASSERT_TRUE(seen.wheel[IW_LEFT].force->offset_us == IW_NEVER);
    TEST_ASSERT_EQUAL_INT(IW_OFFSET_STORED, seen.wheel[IW_RIGHT].force->provenance);
    TEST_ASSERT_EQUAL_INT(-4500, seen.wheel[IW_RIGHT].force->offset_mN);
    TEST_ASSERT_EQUAL_INT(IW_OFFSET_WHEEL, zero[IW_RIGHT].from);
    brd_assumptions_t again;
    brd_assumptions_note(&again, &seen, &settings, zero);
    TEST_ASSERT_FALSE_MESSAGE(brd_assumptions_differs(&again, &learned), "each start would write the same once more");
}

TEST(test_learned_with_another_setting_drops_only_its_item) {
    static const struct {
        const char *key;
        const char *value;
        iw_assumption_item_t item;
    } cases[] = {{"wheels.track_mm", "600", IW_ASSUMPTION_TRACK},
                 {"wheels.gear_ratio", "2", IW_ASSUMPTION_GEAR_RATIO},
                 {"wheels.rpm_of", "rotor", IW_ASSUMPTION_GEAR_RATIO},
                 {"right.force_unit", "cN", IW_ASSUMPTION_FORCE_UNIT_RIGHT}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        setUp();
        const brd_assumptions_t learned = something();
        const brd_settings_t settings = settings_of(cases[i].key, cases[i].value);
        brd_assumptions_zero_t zero[IW_SIDES];
        const iw_snapshot_t seen = run_again(&learned, &settings, zero);
        unsigned known = 0;
        for (unsigned item = 0; item < IW_ASSUMPTION_ITEMS; item++) {
            known += (seen.assumed[item].state != IW_ASSUMED) ? 1U : 0U;
        }
        TEST_ASSERT_EQUAL_INT_MESSAGE(IW_ASSUMED, seen.assumed[cases[i].item].state, cases[i].key);
        TEST_ASSERT_EQUAL_UINT_MESSAGE(3, known, cases[i].key);
        const bool unit = cases[i].item == IW_ASSUMPTION_FORCE_UNIT_RIGHT;
        TEST_ASSERT_EQUAL_INT(unit ? IW_OFFSET_NONE : IW_OFFSET_STORED, seen.wheel[IW_RIGHT].force->provenance);
        brd_assumptions_t again;
        brd_assumptions_note(&again, &seen, &settings, zero);
        TEST_ASSERT_TRUE(brd_assumptions_differs(&again, &learned));
    }
}

TEST(test_learned_impossible_zero_is_not_restored) {
    brd_assumptions_t learned = something();
    const brd_settings_t settings = settings_of(NULL, NULL);
    brd_assumptions_zero_t zero[IW_SIDES];
    learned.zero[IW_LEFT].offset_mN = 327661;
    learned.zero[IW_RIGHT].from = 200;
    const iw_snapshot_t seen = run_again(&learned, &settings, zero);
    TEST_ASSERT_EQUAL_INT(IW_OFFSET_NONE, seen.wheel[IW_LEFT].force->provenance);
    TEST_ASSERT_EQUAL_INT(IW_OFFSET_NONE, seen.wheel[IW_RIGHT].force->provenance);
    TEST_ASSERT_EQUAL_INT(IW_OFFSET_NONE, zero[IW_LEFT].from);
}

TEST(test_learned_small_changes_need_no_record) {
    const brd_assumptions_t stored = something();
    brd_assumptions_t now = stored;
    now.figure[IW_ASSUMPTION_FORCE_UNIT_RIGHT]++;
    now.zero[IW_RIGHT].offset_mN += BRD_ASSUMPTIONS_MOVED_mN;
    now.zero[IW_RIGHT].from = IW_OFFSET_ESTIMATED;
    TEST_ASSERT_FALSE(brd_assumptions_differs(&now, &stored));
    now.zero[IW_RIGHT].offset_mN++;
    TEST_ASSERT_TRUE(brd_assumptions_differs(&now, &stored));
    now = stored;
    now.zero[IW_LEFT].offset_mN++; // A tare is stored even if it changes by a millinewton.
    TEST_ASSERT_TRUE(brd_assumptions_differs(&now, &stored));
}

static const brd_fault_t no_fault = {0, 0};

static brd_records_t power_on(void) {
    brd_records_t stored = {.power_ons = 0};
    cut_after = UINT32_MAX;
    brd_records_open(&stored, true, false, no_fault);
    return stored;
}

TEST(test_learned_cut_at_any_word_leaves_the_old_or_new_record) {
    const brd_settings_t settings = settings_of("wheels.track_mm", "540");
    brd_assumptions_t learned = something();
    brd_settings_t found;
    brd_assumptions_t read;
    brd_records_t stored = power_on();
    TEST_ASSERT_FALSE(brd_records_assumptions(&stored, &read));
    TEST_ASSERT_TRUE(brd_records_commit(&stored, &settings));
    learned.zero[IW_LEFT].offset_mN = 0;
    stored = power_on();
    TEST_ASSERT_TRUE(brd_records_write_assumptions(&stored, &learned));
    for (unsigned cut = 0; cut <= 64U; cut++) {
        stored = power_on();
        TEST_ASSERT_TRUE(brd_records_assumptions(&stored, &read));
        const int32_t before = read.zero[IW_LEFT].offset_mN;
        learned.zero[IW_LEFT].offset_mN = before + 1;
        operations = 0;
        cut_after = cut;
        const bool done = brd_records_write_assumptions(&stored, &learned);
        stored = power_on();
        TEST_ASSERT_TRUE(brd_records_settings(&stored, &found) && brd_records_assumptions(&stored, &read));
        TEST_ASSERT_EQUAL_MEMORY(&settings, &found, sizeof found);
        TEST_ASSERT_EQUAL_INT(done ? before + 1 : before, read.zero[IW_LEFT].offset_mN);
        TEST_ASSERT_TRUE_MESSAGE(done == (cut >= 62U), "sequence, payload and CRC are written, and nothing else");
    }
}

TEST(test_learned_last_blank_slot_is_reserved_for_settings) {
    const brd_settings_t settings = settings_of(NULL, NULL);
    const brd_assumptions_t learned = something();
    brd_records_t stored = power_on();
    while (brd_records_write_assumptions(&stored, &learned)) {
    }
    TEST_ASSERT_EQUAL_UINT(1, brd_store_blank(&stored.store));
    TEST_ASSERT_TRUE(brd_records_commit(&stored, &settings));
    TEST_ASSERT_EQUAL_UINT(0, erasures);
    const uint32_t power_ons = stored.power_ons;
    brd_records_open(&stored, false, true, no_fault); // Wheels may be turning: no slow operation starts.
    TEST_ASSERT_EQUAL_UINT(0, erasures);
    brd_records_open(&stored, false, false, no_fault);
    TEST_ASSERT_EQUAL_UINT(1, erasures);
    TEST_ASSERT_EQUAL_UINT(3, brd_store_blank(&stored.store));
    TEST_ASSERT_EQUAL_UINT32(power_ons, stored.power_ons);
    brd_assumptions_t read;
    brd_settings_t found;
    TEST_ASSERT_TRUE(brd_records_assumptions(&stored, &read) && brd_records_settings(&stored, &found));
    brd_records_open(&stored, false, false, no_fault);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(1, erasures, "each start would erase");
}

TEST(test_records_store_the_first_fault_of_a_power_on) {
    const brd_fault_t first = {0x0C000100U, 0x08001234U};
    const brd_fault_t second = {0x0C008200U, 0x08004321U};
    brd_records_t stored = power_on();
    TEST_ASSERT_EQUAL_HEX32(0, stored.fault.cause);
    operations = 0;
    brd_records_open(&stored, false, true, first);
    TEST_ASSERT_GREATER_THAN_UINT(0, operations);
    operations = 0;
    for (unsigned repeated = 0; repeated < 100U; repeated++) {
        brd_records_open(&stored, false, (repeated & 1U) != 0U, second);
        TEST_ASSERT_EQUAL_MEMORY(&second, &stored.fault, sizeof second);
    }
    TEST_ASSERT_EQUAL_UINT_MESSAGE(0, operations, "each fault wears the flash");
    brd_records_open(&stored, false, false, no_fault);
    TEST_ASSERT_EQUAL_MEMORY(&first, &stored.fault, sizeof first);
    stored = power_on();
    TEST_ASSERT_EQUAL_MEMORY(&first, &stored.fault, sizeof first);
    stored = power_on();
    TEST_ASSERT_EQUAL_HEX32_MESSAGE(0, stored.fault.cause, "an old fault is reported");
    brd_records_open(&stored, false, true, second);
    stored = power_on();
    TEST_ASSERT_EQUAL_MEMORY(&second, &stored.fault, sizeof second);
}

/// A record of version 0.2 has 26 values: its 18 numbers, type, role, five switches, track. Other keys were added
/// later.
static void put_as_before(uint8_t *place, const brd_settings_t *settings) {
    iw_config_t config;
    iw_config_default(&config);
    brd_settings_to(settings, &config);
    const uint16_t value[26] = {config.period_ms,
                                config.lease_ms,
                                config.accel_mm_s2,
                                config.decel_mm_s2,
                                config.max_speed_mm_s,
                                config.max_current_mA,
                                config.zero_hold_ms,
                                config.wheel_silent_ms,
                                config.echo_ms,
                                config.rest_rpm,
                                config.rest_ms,
                                config.follow_mm_s,
                                config.follow_ms,
                                config.blocked_ms,
                                config.radius_mm,
                                config.gear_turns,
                                config.gear_per,
                                config.setpoint_dlc,
                                config.setpoint_type_set ? config.setpoint_type : 0xFFFFU,
                                (uint16_t)config.current_role,
                                config.rpm_of_rotor,
                                config.invert[IW_LEFT],
                                config.invert[IW_RIGHT],
                                (uint16_t)config.force_unit[IW_LEFT],
                                (uint16_t)config.force_unit[IW_RIGHT],
                                config.track_mm};
    memcpy(place, value, sizeof value);
}

/// Writes the layout of version 0.2: settings, a flag for learned values, and these values.
static void write_as_before(brd_records_t *stored, const brd_settings_t *settings, const brd_assumptions_t *learned) {
    uint32_t words[BRD_STORE_WORDS] = {7U, (settings != NULL) ? 1U : 0U};
    uint8_t *const rest = (uint8_t *)&words[2];
    if (settings != NULL) {
        put_as_before(rest, settings);
    }
    if (learned != NULL) {
        words[15] = 1U;
        put_as_before(rest + 56U, &learned->settings);
        memcpy(rest + 108U, learned->zero, sizeof *learned - offsetof(brd_assumptions_t, zero));
    }
    TEST_ASSERT_TRUE(brd_store_write(&stored->store, words, false));
}

TEST(test_learned_record_of_version_0_2_is_read_with_defaults) {
    const brd_settings_t settings = settings_of("wheels.track_mm", "777");
    brd_assumptions_t learned = something();
    brd_settings_t found;
    brd_assumptions_t read;
    brd_records_t stored = power_on();
    write_as_before(&stored, &settings, &learned);
    // The second start reads what the first start has written in the new layout.
    for (unsigned start = 0; start < 2U; start++) {
        stored = power_on();
        TEST_ASSERT_EQUAL_UINT32(8U + start, stored.power_ons);
        TEST_ASSERT_TRUE(brd_records_settings(&stored, &found) && brd_records_assumptions(&stored, &read));
        TEST_ASSERT_EQUAL_MEMORY(&settings, &found, sizeof found);
        TEST_ASSERT_EQUAL_MEMORY(&learned.settings, &read.settings, sizeof read.settings);
        TEST_ASSERT_EQUAL_MEMORY(learned.zero, read.zero, sizeof read - offsetof(brd_assumptions_t, zero));
    }
}

/// Version 0.2 accepted these values. The wheels of this machine turn against each other without `invert`.
TEST(test_records_of_0_2_outside_new_limits_do_not_arm) {
    static const struct {
        uint16_t radius_mm, max_current_mA, follow_mm_s;
        const char *why, *key, *value;
    } cases[] = {{300, 1000, 300, "set it to 1 first", "limits.rest_rpm", "1"},
                 {200, 200, 300, "drive.max_current_mA must be 300 to 2000", "drive.max_current_mA", "300"},
                 {200, 1000, 900, "limits.follow_mm_s must be 50 to 500", "limits.follow_mm_s", "500"}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        setUp();
        rig.config.setpoint_type_set = true;
        rig.config.current_role = IW_ROLE_LIMIT;
        rig.config.invert[IW_RIGHT] = true;
        rig.config.rest_rpm = 2;
        rig.config.radius_mm = cases[i].radius_mm;
        rig.config.max_current_mA = cases[i].max_current_mA;
        rig.config.follow_mm_s = cases[i].follow_mm_s;
        const brd_settings_t before = brd_settings_from(&rig.config);
        brd_records_t stored = power_on();
        write_as_before(&stored, &before, NULL);
        stored = power_on();
        iw_config_t config;
        iw_config_default(&config);
        config.setpoint_type_set = true;
        config.current_role = IW_ROLE_LIMIT;
        brd_settings_t found = brd_settings_from(&config);
        TEST_ASSERT_TRUE(brd_records_settings(&stored, &found));
        brd_settings_apply(&found, &config);
        TEST_ASSERT_FALSE(config.setpoint_type_set);
        TEST_ASSERT_EQUAL_INT(IW_ROLE_UNSET, config.current_role);
        TEST_ASSERT_EQUAL_INT(IW_CONFIG_OK, iw_config_check(&config));
        char text[256];
        iwn_text_t why = iwn_text_begin(text, sizeof text);
        TEST_ASSERT_FALSE(brd_settings_check(&found, &why));
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, cases[i].why), text);
        // The operator corrects this key and commits.
        TEST_ASSERT_TRUE_MESSAGE(brd_settings_set(&found, cases[i].key, cases[i].value, &why), text);
        TEST_ASSERT_TRUE(brd_records_commit(&stored, &found));
        stored = power_on();
        TEST_ASSERT_TRUE(brd_records_settings(&stored, &found));
        brd_settings_apply(&found, &config);
        TEST_ASSERT_TRUE(config.setpoint_type_set && config.invert[IW_RIGHT]);
        TEST_ASSERT_EQUAL_INT(IW_ROLE_LIMIT, config.current_role);
    }
}

TEST(test_learned_record_of_version_0_2_without_settings_is_empty) {
    brd_settings_t found;
    brd_assumptions_t read;
    brd_records_t stored = power_on();
    write_as_before(&stored, NULL, NULL);
    stored = power_on();
    TEST_ASSERT_FALSE(brd_records_settings(&stored, &found));
    TEST_ASSERT_FALSE(brd_records_assumptions(&stored, &read));
}

/// A command that was stored before a power loss quotes another number of starts.
TEST(test_learned_every_power_on_is_counted) {
    for (uint32_t starts = 1; starts < 20U; starts++) {
        TEST_ASSERT_EQUAL_UINT32(starts, power_on().power_ons);
    }
}
