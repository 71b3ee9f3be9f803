// SPDX-License-Identifier: MIT
#include "board_settings.h"

#include "iwheel_northbound/request.h"

#include <string.h>

/// Indices of values. Those below TYPE are numbers of the core, in the order of iw_config_t.
enum { TYPE = 26, ROLE, SWITCHES, SETTINGS_END };
IW_STATIC_ASSERT(SETTINGS_END == BRD_SETTINGS && TYPE == (int)IW_CONFIG_SETPOINT_DLC, numbers_of_the_core_come_first);
#define FIRST offsetof(iw_config_t, period_ms)
IW_STATIC_ASSERT(offsetof(iw_config_t, setpoint_dlc) == FIRST + (TYPE - 1U) * sizeof(uint16_t),
                 the_core_s_numbers_are_side_by_side);

/// Bits of SWITCHES, in the order of version 0.2, which had a number for each of the first five.
enum { RPM_OF = 0, INVERT_LEFT, INVERT_RIGHT, UNIT_LEFT, UNIT_RIGHT, ASYMMETRIC, HOLD };

#define UNSET         0xFFFFU
#define INDEX(fault)  ((uint8_t)(IW_CONFIG_##fault - 1))
#define NUMBER_DIGITS 5U

/// Form of a value.
typedef enum { NUMBER, BYTE, GEAR, WORDS, SWITCH } kind_t;

typedef enum { S_WHEELS, S_LEFT, S_RIGHT, S_DRIVE, S_LIMITS } section_t;
static const char *const sections[] = {"wheels", "left", "right", "drive", "limits"};

/// Pairs of words: for a SWITCH those of 0 and 1; for WORDS, the role, those of 1 and 2.
typedef enum { W_NONE, W_ROLE, W_TURNS, W_YES, W_UNIT, W_HOLD } words_t;
static const char *const words[][2] = {
    [W_NONE] = {NULL, NULL}, [W_ROLE] = {"limit", "setpoint"}, [W_TURNS] = {"wheel", "rotor"},
    [W_YES] = {"no", "yes"}, [W_UNIT] = {"cN", "dN"},          [W_HOLD] = {"release", "hold"},
};

/// As small as possible, because the flash of an F103 is full.
typedef struct {
    const char *key;
    uint8_t section; ///< A section_t.
    uint8_t at;
    uint8_t kind;  ///< A kind_t.
    uint8_t words; ///< A words_t.
} row_t;

static const row_t rows[] = {
    [BRD_KEY_SETPOINT_TYPE] = {"setpoint_type", S_WHEELS, TYPE, BYTE, W_NONE},
    [BRD_KEY_CURRENT_ROLE] = {"current_role", S_WHEELS, ROLE, WORDS, W_ROLE},
    [BRD_KEY_RPM_OF] = {"rpm_of", S_WHEELS, RPM_OF, SWITCH, W_TURNS},
    [BRD_KEY_RADIUS] = {"radius_mm", S_WHEELS, INDEX(RADIUS), NUMBER, W_NONE},
    [BRD_KEY_GEAR_RATIO] = {"gear_ratio", S_WHEELS, INDEX(GEAR_TURNS), GEAR, W_NONE},
    [BRD_KEY_TRACK] = {"track_mm", S_WHEELS, INDEX(TRACK), NUMBER, W_NONE},
    [BRD_KEY_SETPOINT_DLC] = {"setpoint_dlc", S_WHEELS, INDEX(SETPOINT_DLC), NUMBER, W_NONE},
    [BRD_KEY_INVERT_LEFT] = {"invert", S_LEFT, INVERT_LEFT, SWITCH, W_YES},
    [BRD_KEY_UNIT_LEFT] = {"force_unit", S_LEFT, UNIT_LEFT, SWITCH, W_UNIT},
    [BRD_KEY_INVERT_RIGHT] = {"invert", S_RIGHT, INVERT_RIGHT, SWITCH, W_YES},
    [BRD_KEY_UNIT_RIGHT] = {"force_unit", S_RIGHT, UNIT_RIGHT, SWITCH, W_UNIT},
    {"period_ms", S_DRIVE, INDEX(PERIOD), NUMBER, W_NONE},
    {"lease_ms", S_DRIVE, INDEX(LEASE), NUMBER, W_NONE},
    {"accel_mm_s2", S_DRIVE, INDEX(ACCEL), NUMBER, W_NONE},
    {"decel_mm_s2", S_DRIVE, INDEX(DECEL), NUMBER, W_NONE},
    {"max_speed_mm_s", S_DRIVE, INDEX(MAX_SPEED), NUMBER, W_NONE},
    {"max_yaw_mrad_s", S_DRIVE, INDEX(MAX_YAW), NUMBER, W_NONE},
    {"yaw_accel_mrad_s2", S_DRIVE, INDEX(YAW_ACCEL), NUMBER, W_NONE},
    {"max_current_mA", S_DRIVE, INDEX(MAX_CURRENT), NUMBER, W_NONE},
    {"min_current_mA", S_DRIVE, INDEX(MIN_CURRENT), NUMBER, W_NONE},
    {"asymmetric_current", S_DRIVE, ASYMMETRIC, SWITCH, W_YES},
    {"zero_hold_ms", S_DRIVE, INDEX(ZERO_HOLD), NUMBER, W_NONE},
    {"hold_max_s", S_DRIVE, INDEX(HOLD_MAX), NUMBER, W_NONE},
    {"after_stop", S_DRIVE, HOLD, SWITCH, W_HOLD},
    {"wheel_silent_ms", S_LIMITS, INDEX(WHEEL_SILENT), NUMBER, W_NONE},
    {"echo_ms", S_LIMITS, INDEX(ECHO), NUMBER, W_NONE},
    {"rest_rpm", S_LIMITS, INDEX(REST_RPM), NUMBER, W_NONE},
    {"rest_ms", S_LIMITS, INDEX(REST), NUMBER, W_NONE},
    {"follow_mm_s", S_LIMITS, INDEX(FOLLOW_SPEED), NUMBER, W_NONE},
    {"follow_ms", S_LIMITS, INDEX(FOLLOW), NUMBER, W_NONE},
    {"blocked_ms", S_LIMITS, INDEX(BLOCKED), NUMBER, W_NONE},
    {"pair_mm", S_LIMITS, INDEX(PAIR), NUMBER, W_NONE},
    {"pair_leak_ms", S_LIMITS, INDEX(PAIR_LEAK), NUMBER, W_NONE},
    {"wheel_lag_ms", S_LIMITS, INDEX(WHEEL_LAG), NUMBER, W_NONE},
};
#define ROWS (sizeof rows / sizeof rows[0])

static const char *section_of(const row_t *row) {
    return sections[row->section];
}

static void turn(brd_settings_t *self, unsigned bit, bool on) {
    const uint16_t mask = (uint16_t)(1U << bit);
    self->value[SWITCHES] = (uint16_t)(on ? self->value[SWITCHES] | mask : self->value[SWITCHES] & ~mask);
}

static bool is_on(const brd_settings_t *self, unsigned bit) {
    return (self->value[SWITCHES] & (1U << bit)) != 0U;
}

brd_settings_t brd_settings_from(const iw_config_t *config) {
    brd_settings_t self;
    memcpy(self.value, (const uint8_t *)config + FIRST, TYPE * sizeof self.value[0]);
    self.value[TYPE] = config->setpoint_type_set ? config->setpoint_type : UNSET;
    self.value[ROLE] = (uint16_t)config->current_role;
    self.value[SWITCHES] = 0;
    turn(&self, RPM_OF, config->rpm_of_rotor);
    turn(&self, ASYMMETRIC, config->asymmetric_current);
    turn(&self, HOLD, config->hold);
    for (unsigned side = 0; side < IW_SIDES; side++) {
        turn(&self, INVERT_LEFT + side, config->invert[side]);
        turn(&self, UNIT_LEFT + side, config->force_unit[side] != IW_FORCE_CN);
    }
    return self;
}

brd_settings_t brd_settings_from_before(const uint16_t value[BRD_SETTINGS_BEFORE]) {
    static const uint8_t numbers[] = {
        INDEX(PERIOD),      INDEX(LEASE),        INDEX(ACCEL),        INDEX(DECEL),   INDEX(MAX_SPEED),
        INDEX(MAX_CURRENT), INDEX(ZERO_HOLD),    INDEX(WHEEL_SILENT), INDEX(ECHO),    INDEX(REST_RPM),
        INDEX(REST),        INDEX(FOLLOW_SPEED), INDEX(FOLLOW),       INDEX(BLOCKED), INDEX(RADIUS),
        INDEX(GEAR_TURNS),  INDEX(GEAR_PER),     INDEX(SETPOINT_DLC), TYPE,           ROLE};
    iw_config_t standard;
    iw_config_default(&standard);
    brd_settings_t self = brd_settings_from(&standard);
    for (size_t i = 0; i < sizeof numbers; i++) {
        self.value[numbers[i]] = value[i];
    }
    self.value[INDEX(TRACK)] = value[BRD_SETTINGS_BEFORE - 1U];
    for (unsigned bit = RPM_OF; bit <= UNIT_RIGHT; bit++) {
        turn(&self, bit, value[sizeof numbers + bit] != 0U);
    }
    return self;
}

void brd_settings_to(const brd_settings_t *self, iw_config_t *config) {
    memcpy((uint8_t *)config + FIRST, self->value, TYPE * sizeof self->value[0]);
    config->setpoint_type_set = self->value[TYPE] != UNSET;
    config->setpoint_type = config->setpoint_type_set ? (uint8_t)self->value[TYPE] : 0U;
    config->current_role = (iw_current_role_t)self->value[ROLE];
    config->rpm_of_rotor = is_on(self, RPM_OF);
    config->asymmetric_current = is_on(self, ASYMMETRIC);
    config->hold = is_on(self, HOLD);
    for (unsigned side = 0; side < IW_SIDES; side++) {
        config->invert[side] = is_on(self, INVERT_LEFT + side);
        config->force_unit[side] = is_on(self, UNIT_LEFT + side) ? IW_FORCE_DN : IW_FORCE_CN;
    }
}

static const row_t *find(const char *key) {
    for (size_t i = 0; i < ROWS; i++) {
        const size_t length = strlen(section_of(&rows[i]));
        if (strncmp(key, section_of(&rows[i]), length) == 0 && key[length] == '.' &&
            strcmp(&key[length + 1U], rows[i].key) == 0) {
            return &rows[i];
        }
    }
    return NULL;
}

/// Reads digits up to the end of the text or up to `end`, which it skips. Returns false if there are no digits, too
/// many, or another character follows.
static bool read_number(const char **text, char end, uint32_t *out_number) {
    unsigned digits = 0;
    *out_number = 0;
    for (; **text >= '0' && **text <= '9' && digits <= NUMBER_DIGITS; ++*text, digits++) {
        *out_number = *out_number * 10U + (uint32_t)(**text - '0');
    }
    const bool good = digits > 0U && digits <= NUMBER_DIGITS && (**text == '\0' || **text == end);
    *text += (**text != '\0') ? 1 : 0;
    return good;
}

static iw_config_range_t range_of(const row_t *row) {
    switch (row->kind) {
    case BYTE:
        return (iw_config_range_t){0U, UINT8_MAX};
    default:
        return iw_config_range((iw_config_fault_t)(row->at + 1U));
    }
}

static bool within(uint32_t number, iw_config_range_t range) {
    return number >= range.min && number <= range.max;
}

static void add_key(const row_t *row, iwn_text_t *text) {
    IWN_TEXT_JOIN(text, section_of(row), ".", row->key);
}

static bool refuse_number(const row_t *row, iwn_text_t *why) {
    const iw_config_range_t range = range_of(row);
    add_key(row, why);
    iwn_text_add(why, (row->kind == GEAR) ? " must be N or N/M, each of " : " must be ");
    iwn_text_int(why, range.min);
    iwn_text_add(why, " to ");
    iwn_text_int(why, range.max);
    return false;
}

static bool set_number(brd_settings_t *self, const row_t *row, const char *value, iwn_text_t *why) {
    const iw_config_range_t range = range_of(row);
    uint32_t number = 0;
    uint32_t per = 1;
    const bool first = read_number(&value, (row->kind == GEAR) ? '/' : '\0', &number);
    const bool divided = value[0] != '\0';
    if (!first || !within(number, range) || (divided && !read_number(&value, '\0', &per)) ||
        !within(per, (row->kind == GEAR) ? range : (iw_config_range_t){1U, 1U})) {
        return refuse_number(row, why);
    }
    self->value[row->at] = (uint16_t)number;
    if (row->kind == GEAR) {
        self->value[row->at + 1U] = (uint16_t)per;
    }
    return true;
}

static void set_word(brd_settings_t *self, const row_t *row, unsigned word) {
    if (row->kind == SWITCH) {
        turn(self, row->at, word != 0U);
    } else {
        self->value[row->at] = (uint16_t)(IW_ROLE_LIMIT + word);
    }
}

static bool set(brd_settings_t *self, const row_t *row, const char *value, iwn_text_t *why) {
    if (row->kind < WORDS) {
        return set_number(self, row, value, why);
    }
    for (unsigned i = 0; i < 2U; i++) {
        if (strcmp(value, words[row->words][i]) == 0) {
            set_word(self, row, i);
            return true;
        }
    }
    add_key(row, why);
    IWN_TEXT_JOIN(why, " must be ", words[row->words][0], " or ", words[row->words][1]);
    return false;
}

bool brd_settings_set(brd_settings_t *self, const char *key, const char *value, iwn_text_t *why) {
    const row_t *const row = find(key);
    if (row == NULL) {
        IWN_TEXT_JOIN(why, key, " is no key of a board; use keys of wheels, left, right, drive, limits");
        return false;
    }
    return set(self, row, value, why);
}

bool brd_settings_set_key(brd_settings_t *self, brd_key_t key, const char *value, iwn_text_t *why) {
    return set(self, &rows[key], value, why);
}

/// Returns the row of a number that is outside its range. Role and switches are never stored with another value.
static const row_t *row_of(iw_config_fault_t fault) {
    const row_t *row = rows;
    while (row < &rows[ROWS - 1U] && (row->kind > GEAR || row->at + 1U != (unsigned)fault)) {
        row++;
    }
    return row;
}

bool brd_settings_check(const brd_settings_t *self, iwn_text_t *why) {
    iw_config_t config;
    brd_settings_to(self, &config);
    const iw_config_fault_t fault = iw_config_check(&config);
    switch (fault) {
    case IW_CONFIG_OK:
        return true;
    case IW_CONFIG_STOP_BUDGET:
        iwn_text_add(why,
                     "lease_ms + period_ms + max_speed_mm_s / decel_mm_s2 exceeds 1000 ms, after which the wheels stop "
                     "on their own: lower one of the first three, or raise decel_mm_s2");
        return false;
    case IW_CONFIG_REST_SPEED:
        iwn_text_add(why, "rest_rpm is more than 60 mm/s at a wheel of this radius and gear: set it to ");
        iwn_text_int(why, iw_config_rest(&config).standard);
        iwn_text_add(why, " first");
        return false;
    case IW_CONFIG_MIN_CURRENT:
        iwn_text_add(why, "min_current_mA must not be more than max_current_mA");
        return false;
    case IW_CONFIG_GEAR_PER:
    case IW_CONFIG_GEAR_RATIO:
        iwn_text_add(why, "gear_ratio must lie within 1 and 100");
        return false;
    default:
        return refuse_number(row_of(fault), why);
    }
}

void brd_settings_apply(const brd_settings_t *self, iw_config_t *config) {
    iwn_text_t nowhere = iwn_text_begin((char[1]){0}, 1);
    if (brd_settings_check(self, &nowhere)) {
        brd_settings_to(self, config);
    } else {
        config->setpoint_type_set = false;
        config->current_role = IW_ROLE_UNSET;
    }
}

static bool value_of(const brd_settings_t *self, const row_t *row, char out_text[BRD_SETTINGS_TEXT]) {
    iwn_text_t text = iwn_text_begin(out_text, BRD_SETTINGS_TEXT);
    if (row->kind == SWITCH) {
        iwn_text_add(&text, words[row->words][is_on(self, row->at) ? 1 : 0]);
        return true;
    }
    const uint16_t value = self->value[row->at];
    if (row->kind == WORDS) {
        const unsigned word = (unsigned)value - IW_ROLE_LIMIT;
        iwn_text_add(&text, (word < 2U) ? words[row->words][word] : "");
        return word < 2U;
    }
    iwn_text_int(&text, value);
    if (row->kind == GEAR && self->value[row->at + 1U] != 1U) {
        iwn_text_add(&text, "/");
        iwn_text_int(&text, self->value[row->at + 1U]);
    }
    return within(value, range_of(row)); // False for an unset type, and for a track of 0.
}

bool brd_settings_value(const brd_settings_t *self, brd_key_t key, char out_text[BRD_SETTINGS_TEXT]) {
    return value_of(self, &rows[key], out_text);
}

void brd_settings_write(const brd_settings_t *self, iwn_out_t *json) {
    char name[IWN_KEY_MAX + 1U];
    char value[BRD_SETTINGS_TEXT];
    iwn_out_open(json, "keys", '[');
    for (size_t i = 0; i < ROWS; i++) {
        iwn_text_t key = iwn_text_begin(name, sizeof name);
        add_key(&rows[i], &key);
        iwn_out_open(json, NULL, '{');
        iwn_out_text(json, "key", name);
        iwn_out_text(json, "value", value_of(self, &rows[i], value) ? value : NULL);
        iwn_out_close(json, '}');
    }
    iwn_out_close(json, ']');
}
