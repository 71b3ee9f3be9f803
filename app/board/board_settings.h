// SPDX-License-Identifier: MIT
/// The configuration as numbers that the flash can store, and as keys and values of the gateway's configuration file.
///
/// Keys are "section.key" as in the file: drive.lease_ms. Keys that only the daemon has (interfaces, sockets,
/// recordings) are refused, and the refusal contains the key. The order of the numbers is the layout in flash: new ones
/// go to the end.
#ifndef BOARD_SETTINGS_H
#define BOARD_SETTINGS_H

#include "iwheel/config.h"
#include "iwheel_northbound/json_out.h"
#include "iwheel_northbound/text.h"

#define BRD_SETTINGS 29U
/// Number of values in version 0.2, which had its own order.
#define BRD_SETTINGS_BEFORE 26U

typedef struct {
    uint16_t value[BRD_SETTINGS];
} brd_settings_t;

/// Keys of the sections wheels, left and right. Assumptions are about their values.
typedef enum {
    BRD_KEY_SETPOINT_TYPE = 0,
    BRD_KEY_CURRENT_ROLE,
    BRD_KEY_RPM_OF,
    BRD_KEY_RADIUS,
    BRD_KEY_GEAR_RATIO,
    BRD_KEY_TRACK,
    BRD_KEY_SETPOINT_DLC,
    BRD_KEY_INVERT_LEFT,
    BRD_KEY_UNIT_LEFT,
    BRD_KEY_INVERT_RIGHT,
    BRD_KEY_UNIT_RIGHT,
    BRD_KEY_NONE,
} brd_key_t;

brd_settings_t brd_settings_from(const iw_config_t *config);

/// Converts the values of version 0.2. Keys that were added later get their defaults.
brd_settings_t brd_settings_from_before(const uint16_t value[BRD_SETTINGS_BEFORE]);

/// Writes the values to `config` and leaves its other fields unchanged.
void brd_settings_to(const brd_settings_t *self, iw_config_t *config);

/// Sets one key. Returns false, changes nothing and writes reason and fix to `why` if the key does not exist or cannot
/// have that value.
bool brd_settings_set(brd_settings_t *self, const char *key, const char *value, iwn_text_t *why);
bool brd_settings_set_key(brd_settings_t *self, brd_key_t key, const char *value, iwn_text_t *why);

/// Writes the value in the form of the configuration file. Returns false if the key is not set.
#define BRD_SETTINGS_TEXT 16U
bool brd_settings_value(const brd_settings_t *self, brd_key_t key, char out_text[BRD_SETTINGS_TEXT]);

/// Checks the relations between keys. Returns false, and writes reason and fix to `why`, if one does not hold.
bool brd_settings_check(const brd_settings_t *self, iwn_text_t *why);

/// Writes the values to `config` if brd_settings_check accepts them. Otherwise `config` keeps its values, but is without
/// setpoint type and role of the current, so that the gateway refuses to arm: valid values next to the invalid one
/// (invert, max_speed_mm_s) are not in force.
void brd_settings_apply(const brd_settings_t *self, iw_config_t *config);

/// Writes the list `keys` of the reply to `config`, with values in the form of the configuration file; null: not set.
void brd_settings_write(const brd_settings_t *self, iwn_out_t *json);

#endif
