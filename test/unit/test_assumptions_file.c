// SPDX-License-Identifier: MIT
// File of the assumption store: writing, reading, and refusal of invalid texts.
#include "assumptions/assumptions_file.h"

#include "iwheel_northbound/words.h"

#include "unit.h"

#include <stdio.h>
#include <string.h>

#define BUS "unix:/tmp/\"a\" b/bus"

static gw_stored_t known;
static gw_stored_t got;
static char text[GW_ASSUMPTIONS_FILE_SIZE];
static char reason[GW_ASSUMPTIONS_REASON_SIZE];
static size_t length;

/// Values of each item at the limit of what the bus can show. State ASSUMED: only the operator can confirm the item.
static const struct {
    iw_assumption_state_t state;
    int32_t figure;
    const char *value;
} shown[IW_ASSUMPTION_ITEMS] = {
    [IW_ASSUMPTION_SETPOINT_TYPE] = {IW_CONFIRMED, 850, "255"},
    [IW_ASSUMPTION_FORCE_UNIT_LEFT] = {IW_CONFIRMED, 11500, "cN"},
    [IW_ASSUMPTION_FORCE_UNIT_RIGHT] = {IW_CONTRADICTED, 8500, "dN"},
    [IW_ASSUMPTION_OFFSET_INCLUDED] = {IW_CONTRADICTED, -300, "yes"},
    [IW_ASSUMPTION_FEEDBACK_SIGN_LEFT] = {IW_CONFIRMED, 101, "yes"},
    [IW_ASSUMPTION_FEEDBACK_SIGN_RIGHT] = {IW_CONTRADICTED, -101, "yes"},
    [IW_ASSUMPTION_GEAR_RATIO] = {IW_CONTRADICTED, 1251, "1000/999, rpm of the rotor"},
    [IW_ASSUMPTION_POSE_BYTE_ORDER] = {IW_CONFIRMED, 8000, "yes"},
    [IW_ASSUMPTION_DLC] = {IW_CONFIRMED, 7, "yes"},
    [IW_ASSUMPTION_CURRENT_ROLE] = {IW_ASSUMED, 0, "setpoint"},
    [IW_ASSUMPTION_MOUNT_SIGN_LEFT] = {IW_ASSUMED, 0, "yes"},
    [IW_ASSUMPTION_MOUNT_SIGN_RIGHT] = {IW_ASSUMED, 0, "no"},
    [IW_ASSUMPTION_WHEEL_RADIUS] = {IW_ASSUMED, 0, "500"},
    [IW_ASSUMPTION_TRACK] = {IW_ASSUMED, 0, "540"},
};

static void fill_item(unsigned item) {
    gw_stored_item_t *entry = &known.item[item];
    const bool by_bus = shown[item].state != IW_ASSUMED;
    *entry = (gw_stored_item_t){
        .entry = {.state = by_bus ? shown[item].state : IW_CONTRADICTED,
                  .source = by_bus ? IW_SOURCE_BUS : IW_SOURCE_OPERATOR,
                  .figure = shown[item].figure},
        .since_wall_us = (item % 2U == 0U) ? 0 : INT64_C(253402300799000000),
    };
    (void)snprintf(entry->value, IWN_VALUE_SIZE, "%s", shown[item].value);
    (void)snprintf(entry->word.found, IWN_VALUE_SIZE, "%s", by_bus ? "" : shown[item].value);
}

static void fill(void) {
    memset(&known, 0, sizeof known);
    for (unsigned item = 0; item < IW_ASSUMPTION_ITEMS; item += 2) {
        fill_item(item);
    }
    known.offset[IW_LEFT] = (gw_stored_offset_t){.from = IW_OFFSET_OPERATOR,
                                                 .unit = IW_FORCE_DN,
                                                 .offset_mN = -327660,
                                                 .drift_mN = -1000,
                                                 .deviation_mN = 1000,
                                                 .samples = IW_FORCE_WINDOW_SAMPLES,
                                                 .wall_us = 0};
}

void setUp(void) {
    fill();
    memset(&got, 0xA5, sizeof got);
    length = gw_assumptions_file_write(&known, BUS, text, sizeof text);
}

static void refused(const char *why) {
    const gw_stored_t before = got;
    TEST_ASSERT_FALSE(gw_assumptions_file_read(text, length, BUS, &got, reason));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(reason, why), reason);
    TEST_ASSERT_EQUAL_MEMORY(&before, &got, sizeof got);
}

static void assert_same(void) {
    for (unsigned item = 0; item < IW_ASSUMPTION_ITEMS; item++) {
        TEST_ASSERT_EQUAL_INT(known.item[item].entry.state, got.item[item].entry.state);
        TEST_ASSERT_EQUAL_INT(known.item[item].entry.source, got.item[item].entry.source);
        TEST_ASSERT_EQUAL_INT32(known.item[item].entry.figure, got.item[item].entry.figure);
        TEST_ASSERT_EQUAL_INT64(known.item[item].since_wall_us, got.item[item].since_wall_us);
        TEST_ASSERT_EQUAL_STRING(known.item[item].value, got.item[item].value);
        TEST_ASSERT_EQUAL_STRING(known.item[item].word.found, got.item[item].word.found);
        TEST_ASSERT_EQUAL_STRING(known.item[item].word.how, got.item[item].word.how);
    }
    for (unsigned side = 0; side < IW_SIDES; side++) {
        TEST_ASSERT_EQUAL_INT(known.offset[side].from, got.offset[side].from);
        TEST_ASSERT_EQUAL_INT(known.offset[side].unit, got.offset[side].unit);
        TEST_ASSERT_EQUAL_INT32(known.offset[side].offset_mN, got.offset[side].offset_mN);
        TEST_ASSERT_EQUAL_INT32(known.offset[side].drift_mN, got.offset[side].drift_mN);
        TEST_ASSERT_EQUAL_UINT32(known.offset[side].deviation_mN, got.offset[side].deviation_mN);
        TEST_ASSERT_EQUAL_UINT32(known.offset[side].samples, got.offset[side].samples);
        TEST_ASSERT_EQUAL_INT64(known.offset[side].wall_us, got.offset[side].wall_us);
    }
}

TEST(test_assumptions_file_limit_values_are_read_back) {
    TEST_ASSERT_GREATER_THAN_UINT(0, length);
    TEST_ASSERT_TRUE_MESSAGE(gw_assumptions_file_read(text, length, BUS, &got, reason), reason);
    assert_same();
}

TEST(test_assumptions_file_all_items_at_longest_fit) {
    for (unsigned item = 0; item < IW_ASSUMPTION_ITEMS; item++) {
        fill_item(item);
    }
    known.offset[IW_RIGHT] = known.offset[IW_LEFT];
    length = gw_assumptions_file_write(&known, BUS, text, sizeof text);
    TEST_ASSERT_TRUE_MESSAGE(gw_assumptions_file_read(text, length, BUS, &got, reason), reason);
    assert_same();
}

TEST(test_assumptions_file_empty_store_is_read_back) {
    memset(&known, 0, sizeof known);
    length = gw_assumptions_file_write(&known, BUS, text, sizeof text);
    TEST_ASSERT_TRUE_MESSAGE(gw_assumptions_file_read(text, length, BUS, &got, reason), reason);
    assert_same();
}

TEST(test_assumptions_file_small_buffer_writes_zero_bytes) {
    char guarded[200];
    memset(guarded, 0x5A, sizeof guarded);
    TEST_ASSERT_EQUAL_UINT(0, gw_assumptions_file_write(&known, BUS, guarded, 100));
    TEST_ASSERT_EQUAL_HEX8(0x5A, guarded[100]);
}

TEST(test_assumptions_file_any_flipped_bit_is_refused) {
    for (size_t bit = 0; bit < length * 8U; bit++) {
        text[bit / 8U] = (char)(text[bit / 8U] ^ (1 << (bit % 8U)));
        TEST_ASSERT_FALSE(gw_assumptions_file_read(text, length, BUS, &got, reason));
        text[bit / 8U] = (char)(text[bit / 8U] ^ (1 << (bit % 8U)));
    }
    TEST_ASSERT_TRUE(gw_assumptions_file_read(text, length, BUS, &got, reason));
}

TEST(test_assumptions_file_shorter_or_longer_text_is_refused) {
    const size_t whole = length;
    for (length = 0; length < whole; length++) {
        refused("damaged");
    }
    length = whole + 1U;
    text[whole] = '\n';
    refused("damaged");
}

/// Replaces the body of the text and appends a correct checksum.
static void forge(const char *body) {
    uint32_t sum = UINT32_MAX;
    for (const char *c = body; *c != '\0'; c++) {
        sum ^= (unsigned char)*c;
        for (unsigned bit = 0; bit < 8U; bit++) {
            sum = (sum >> 1) ^ (((sum & 1U) != 0U) ? 0xEDB88320U : 0U);
        }
    }
    length = (size_t)snprintf(text, sizeof text, "%s%08x\n", body, (unsigned)~sum);
}

#define LONG "123456789012345678901234567890123456789012345678901234567890"
#define HEAD "{\"format\":\"iwheel-ledger\",\"version\":1,\"bus\":\"unix:/tmp/\\\"a\\\" b/bus\","

TEST(test_assumptions_file_other_bus_version_or_format_is_refused) {
    TEST_ASSERT_FALSE(gw_assumptions_file_read(text, length, "can0", &got, reason));
    TEST_ASSERT_NOT_NULL(strstr(reason, "another bus"));
    forge("{\"format\":\"iwheel-ledger\",\"version\":2,\"bus\":\"can0\",\"items\":{},\"offsets\":{}}\n");
    refused("another version");
    forge("{\"format\":\"something\",\"version\":1}\n");
    refused("not the assumption store");
    forge("not even JSON\n");
    refused("not the assumption store");
    forge("[1,2,3]\n");
    refused("not the assumption store");
    forge("");
    refused("damaged");
}

TEST(test_assumptions_file_one_invalid_member_refuses_the_file) {
    static const char *const bodies[] = {
        HEAD "\"offsets\":{}}\n",
        HEAD "\"items\":[],\"offsets\":{}}\n",
        HEAD "\"items\":{}}\n",
        HEAD
        "\"items\":{\"speed\":{\"state\":\"confirmed\",\"evidence\":\"bus\",\"figure\":1,\"value\":\"\",\"found\":\"\","
        "\"since_wall_us\":1}},\"offsets\":{}}\n",
        HEAD
        "\"items\":{\"dlc\":{\"state\":\"assumed\",\"evidence\":\"bus\",\"figure\":1,\"value\":\"\",\"found\":\"\","
        "\"since_wall_us\":1}},\"offsets\":{}}\n",
        HEAD "\"items\":{\"dlc\":{\"state\":\"confirmed\",\"evidence\":\"document\",\"figure\":1,\"value\":\"\","
             "\"found\":\"\",\"since_wall_us\":1}},\"offsets\":{}}\n",
        HEAD "\"items\":{\"dlc\":{\"state\":\"confirmed\",\"evidence\":\"bus\",\"figure\":2147483648,\"value\":\"\","
             "\"found\":\"\",\"since_wall_us\":1}},\"offsets\":{}}\n",
        HEAD "\"items\":{\"dlc\":{\"state\":\"confirmed\",\"evidence\":\"bus\",\"figure\":1.0,\"value\":\"\","
             "\"found\":\"\",\"since_wall_us\":1}},\"offsets\":{}}\n",
        HEAD "\"items\":{\"dlc\":{\"state\":\"confirmed\",\"evidence\":\"bus\",\"figure\":1,\"value\":\""
             "1234567890123456789012345678901234567890\",\"found\":\"\",\"since_wall_us\":1}},\"offsets\":{}}\n",
        HEAD
        "\"items\":{\"dlc\":{\"state\":\"confirmed\",\"evidence\":\"bus\",\"figure\":1,\"value\":\"\",\"found\":\"\","
        "\"since_wall_us\":1,\"more\":1}},\"offsets\":{}}\n",
        HEAD
        "\"items\":{\"dlc\":{\"state\":\"confirmed\",\"evidence\":\"bus\",\"figure\":1,\"value\":\"\",\"found\":\"\","
        "\"since_wall_us\":1,\"how\":1}},\"offsets\":{}}\n",
        HEAD
        "\"items\":{\"dlc\":{\"state\":\"confirmed\",\"evidence\":\"bus\",\"figure\":1,\"value\":\"\",\"found\":\"\","
        "\"since_wall_us\":1,\"how\":\"" LONG LONG "12345678\"}},\"offsets\":{}}\n",
        HEAD "\"items\":{},\"offsets\":{\"middle\":{}}}\n",
        HEAD "\"items\":{},\"offsets\":{\"left\":{\"from\":\"stored\",\"unit\":\"cN\",\"offset_mN\":1,\"drift_mN\":1,"
             "\"deviation_mN\":1,\"samples\":1,\"wall_us\":1}}}\n",
        HEAD "\"items\":{},\"offsets\":{\"left\":{\"from\":\"wheel\",\"unit\":\"N\",\"offset_mN\":1,\"drift_mN\":1,"
             "\"deviation_mN\":1,\"samples\":1,\"wall_us\":1}}}\n",
        HEAD
        "\"items\":{},\"offsets\":{\"left\":{\"from\":\"wheel\",\"unit\":\"cN\",\"offset_mN\":3276801,\"drift_mN\":1,"
        "\"deviation_mN\":1,\"samples\":1,\"wall_us\":1}}}\n",
        HEAD "\"items\":{},\"offsets\":{\"left\":{\"from\":\"wheel\",\"unit\":\"cN\",\"offset_mN\":1,\"drift_mN\":1,"
             "\"deviation_mN\":-1,\"samples\":1,\"wall_us\":1}}}\n",
    };
    for (size_t i = 0; i < sizeof bodies / sizeof bodies[0]; i++) {
        forge(bodies[i]);
        refused("no gateway can have measured");
    }
    forge(HEAD
          "\"items\":{},\"offsets\":{\"left\":{\"from\":\"wheel\",\"unit\":\"cN\",\"offset_mN\":100,\"drift_mN\":0,"
          "\"deviation_mN\":0,\"samples\":0,\"wall_us\":1}}}\n");
    TEST_ASSERT_TRUE_MESSAGE(gw_assumptions_file_read(text, length, BUS, &got, reason), reason);
}

/// The text is as versions wrote it that had no track and no `how`.
TEST(test_assumptions_file_of_an_old_version_is_accepted) {
    forge(HEAD "\"items\":{\"wheel_radius\":{\"state\":\"confirmed\",\"evidence\":\"operator\",\"figure\":0,"
               "\"value\":\"192\",\"found\":\"192\",\"since_wall_us\":1}},\"offsets\":{}}\n");
    TEST_ASSERT_TRUE_MESSAGE(gw_assumptions_file_read(text, length, BUS, &got, reason), reason);
    TEST_ASSERT_EQUAL_INT(IW_CONFIRMED, got.item[IW_ASSUMPTION_WHEEL_RADIUS].entry.state);
    TEST_ASSERT_EQUAL_STRING("192", got.item[IW_ASSUMPTION_WHEEL_RADIUS].word.found);
    TEST_ASSERT_EQUAL_STRING("", got.item[IW_ASSUMPTION_WHEEL_RADIUS].word.how);
    TEST_ASSERT_EQUAL_INT(IW_ASSUMED, got.item[IW_ASSUMPTION_TRACK].entry.state);
}

TEST(test_assumptions_file_how_is_written_only_if_set) {
    memset(&known, 0, sizeof known);
    gw_stored_item_t *entry = &known.item[IW_ASSUMPTION_TRACK];
    entry->entry = (iw_assumption_entry_t){IW_CONFIRMED, IW_SOURCE_OPERATOR, 0};
    length = gw_assumptions_file_write(&known, BUS, text, sizeof text);
    TEST_ASSERT_NULL(strstr(text, "\"how\""));
    (void)snprintf(entry->word.how, sizeof entry->word.how, "bringup: 3 full turns by hand");
    length = gw_assumptions_file_write(&known, BUS, text, sizeof text);
    TEST_ASSERT_NOT_NULL(strstr(text, "\"how\":\"bringup: 3 full turns by hand\""));
    TEST_ASSERT_TRUE_MESSAGE(gw_assumptions_file_read(text, length, BUS, &got, reason), reason);
    assert_same();
}

/// Writes the store and reads it again. Returns true if the text is accepted.
static bool believed(void) {
    length = gw_assumptions_file_write(&known, BUS, text, sizeof text);
    TEST_ASSERT_GREATER_THAN_UINT(0, length);
    const bool accepted = gw_assumptions_file_read(text, length, BUS, &got, reason);
    if (!accepted) {
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(reason, "measured"), reason);
    }
    return accepted;
}

TEST(test_assumptions_file_bus_figure_beyond_limits_is_refused) {
    static const struct {
        iw_assumption_item_t item;
        iw_assumption_state_t state;
        const char *value;
        int32_t low; ///< Least accepted figure; `high` is the largest one.
        int32_t high;
    } rows[] = {
        {IW_ASSUMPTION_FORCE_UNIT_LEFT, IW_CONFIRMED, "cN", 8500, 11500},
        {IW_ASSUMPTION_FORCE_UNIT_LEFT, IW_CONTRADICTED, "cN", 850, 1150},
        {IW_ASSUMPTION_FORCE_UNIT_RIGHT, IW_CONFIRMED, "dN", 850, 1150},
        {IW_ASSUMPTION_FORCE_UNIT_RIGHT, IW_CONTRADICTED, "dN", 8500, 11500},
        {IW_ASSUMPTION_OFFSET_INCLUDED, IW_CONTRADICTED, "yes", -300, 300},
        {IW_ASSUMPTION_FEEDBACK_SIGN_LEFT, IW_CONFIRMED, "yes", 101, 32768 * 43},
        {IW_ASSUMPTION_FEEDBACK_SIGN_RIGHT, IW_CONTRADICTED, "yes", -32768 * 43, -101},
        {IW_ASSUMPTION_SETPOINT_TYPE, IW_CONFIRMED, "1", 564, 1436},
        {IW_ASSUMPTION_GEAR_RATIO, IW_CONFIRMED, "1, rpm of the wheel", 880, 1120},
        {IW_ASSUMPTION_POSE_BYTE_ORDER, IW_CONFIRMED, "yes", 8000, 98304000},
        {IW_ASSUMPTION_POSE_BYTE_ORDER, IW_CONTRADICTED, "yes", 0, 125},
        {IW_ASSUMPTION_DLC, IW_CONFIRMED, "yes", 7, 7},
        {IW_ASSUMPTION_DLC, IW_CONTRADICTED, "yes", 0, 8},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        const int32_t figures[] = {rows[i].low, rows[i].high, rows[i].low - 1, rows[i].high + 1, INT32_MIN, INT32_MAX};
        memset(&known, 0, sizeof known);
        gw_stored_item_t *entry = &known.item[rows[i].item];
        (void)snprintf(entry->value, IWN_VALUE_SIZE, "%s", rows[i].value);
        for (size_t j = 0; j < sizeof figures / sizeof figures[0]; j++) {
            entry->entry = (iw_assumption_entry_t){rows[i].state, IW_SOURCE_BUS, figures[j]};
            TEST_ASSERT_EQUAL_MESSAGE(j < 2, believed(), iwn_assumption_item_name(rows[i].item));
        }
        entry->entry = (iw_assumption_entry_t){rows[i].state, IW_SOURCE_BUS, rows[i].low};
        entry->since_wall_us = -1;
        TEST_ASSERT_FALSE(believed());
        entry->since_wall_us = INT64_C(253402300799000001);
        TEST_ASSERT_FALSE(believed());
    }
}

TEST(test_assumptions_file_bus_source_of_operator_item_is_refused) {
    static const iw_assumption_item_t items[] = {IW_ASSUMPTION_CURRENT_ROLE, IW_ASSUMPTION_MOUNT_SIGN_LEFT,
                                                 IW_ASSUMPTION_MOUNT_SIGN_RIGHT, IW_ASSUMPTION_WHEEL_RADIUS};
    for (size_t i = 0; i < sizeof items / sizeof items[0]; i++) {
        memset(&known, 0, sizeof known);
        fill_item(items[i]);
        TEST_ASSERT_TRUE(believed());
        known.item[items[i]].entry.figure = 1;
        TEST_ASSERT_FALSE_MESSAGE(believed(), "the operator states no figure");
        known.item[items[i]].entry.figure = 0;
        known.item[items[i]].entry.source = IW_SOURCE_BUS;
        TEST_ASSERT_FALSE(believed());
    }
}

TEST(test_assumptions_file_invalid_value_is_refused) {
    static const struct {
        iw_assumption_item_t item;
        const char *value;
    } rows[] = {
        {IW_ASSUMPTION_WHEEL_RADIUS, "19"},       {IW_ASSUMPTION_WHEEL_RADIUS, "501"},
        {IW_ASSUMPTION_WHEEL_RADIUS, "192 mm"},   {IW_ASSUMPTION_SETPOINT_TYPE, "256"},
        {IW_ASSUMPTION_CURRENT_ROLE, "neither"},  {IW_ASSUMPTION_FORCE_UNIT_LEFT, "N"},
        {IW_ASSUMPTION_MOUNT_SIGN_LEFT, "maybe"}, {IW_ASSUMPTION_GEAR_RATIO, "1001, rpm of the wheel"},
        {IW_ASSUMPTION_GEAR_RATIO, "1/0"},        {IW_ASSUMPTION_GEAR_RATIO, "1, rpm of the moon"},
        {IW_ASSUMPTION_DLC, "\033[2J"},           {IW_ASSUMPTION_DLC, "perhaps"},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        memset(&known, 0, sizeof known);
        gw_stored_item_t *entry = &known.item[rows[i].item];
        entry->entry = (iw_assumption_entry_t){IW_CONFIRMED, IW_SOURCE_OPERATOR, 0};
        TEST_ASSERT_TRUE(believed());
        (void)snprintf(entry->value, IWN_VALUE_SIZE, "%s", rows[i].value);
        TEST_ASSERT_FALSE_MESSAGE(believed(), rows[i].value);
        entry->value[0] = '\0';
        (void)snprintf(entry->word.found, IWN_VALUE_SIZE, "%s", rows[i].value);
        TEST_ASSERT_FALSE_MESSAGE(believed(), rows[i].value);
    }
}

TEST(test_assumptions_file_impossible_offset_is_refused) {
    static const struct {
        bool good;
        gw_stored_offset_t offset;
    } rows[] = {
        {true, {IW_OFFSET_OPERATOR, IW_FORCE_CN, 327660, 0, 0, 40, 1}},
        {false, {IW_OFFSET_OPERATOR, IW_FORCE_CN, 327661, 0, 0, 40, 1}},
        {false, {IW_OFFSET_OPERATOR, IW_FORCE_CN, 912000, 0, 0, 40, 1}},
        {false, {IW_OFFSET_WHEEL, IW_FORCE_CN, -912000, 0, 0, 0, 1}},
        {false, {IW_OFFSET_ESTIMATED, IW_FORCE_DN, 912000, 0, 0, 40, 1}},
        {false, {IW_OFFSET_WHEEL, IW_FORCE_DN, 912000, 0, 0, 0, 1}},
        {true, {IW_OFFSET_ESTIMATED, IW_FORCE_DN, -327660, -1000, 1000, 40, 1}},
        {false, {IW_OFFSET_ESTIMATED, IW_FORCE_DN, 0, -1001, 0, 40, 1}},
        {false, {IW_OFFSET_ESTIMATED, IW_FORCE_DN, 0, 1001, 0, 40, 1}},
        {false, {IW_OFFSET_OPERATOR, IW_FORCE_DN, 0, 0, 1001, 40, 1}},
        {false, {IW_OFFSET_OPERATOR, IW_FORCE_DN, 0, 0, 0, 39, 1}},
        {false, {IW_OFFSET_OPERATOR, IW_FORCE_DN, 0, 0, 0, 41, 1}},
        {false, {IW_OFFSET_OPERATOR, IW_FORCE_DN, 0, 0, 0, 40, -1}},
        {true, {IW_OFFSET_WHEEL, IW_FORCE_DN, 12300, 0, 0, 0, 1}},
        {false, {IW_OFFSET_WHEEL, IW_FORCE_DN, 12301, 0, 0, 0, 1}},
        {false, {IW_OFFSET_WHEEL, IW_FORCE_DN, 12300, 1, 0, 0, 1}},
        {false, {IW_OFFSET_WHEEL, IW_FORCE_DN, 12300, 0, 1, 0, 1}},
        {false, {IW_OFFSET_WHEEL, IW_FORCE_DN, 12300, 0, 0, 40, 1}},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        char row[32];
        (void)snprintf(row, sizeof row, "row %zu", i);
        memset(&known, 0, sizeof known);
        known.offset[(i % 2U == 0U) ? IW_LEFT : IW_RIGHT] = rows[i].offset;
        TEST_ASSERT_EQUAL_MESSAGE(rows[i].good, believed(), row);
    }
}

TEST(test_assumptions_file_name_has_no_separators) {
    char name[64];
    gw_assumptions_file_name("can0", name, sizeof name);
    TEST_ASSERT_EQUAL_STRING("ledger-can0", name);
    gw_assumptions_file_name("unix:/run/a b/../bus", name, sizeof name);
    TEST_ASSERT_EQUAL_STRING("ledger-unix__run_a_b_.._bus", name);
}
