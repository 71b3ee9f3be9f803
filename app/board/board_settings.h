// SPDX-License-Identifier: MIT
/// The configuration as numbers that flash can keep, and as the keys and values of the gateway's configuration file.
///
/// Keys are "section.key" as in the file: drive.lease_ms. Those that only the daemon has (interfaces, sockets,
/// recordings) are refused by name. The order of the numbers is what flash holds: new ones go to the end.
#ifndef BOARD_SETTINGS_H
#define BOARD_SETTINGS_H

#include "iwheel/config.h"
#include "iwheel_northbound/json_out.h"
#include "iwheel_northbound/text.h"

#define BRD_SETTINGS 29U
/// Version 0.2 had so many, in its own order.
#define BRD_SETTINGS_BEFORE 26U

typedef struct {
    uint16_t value[BRD_SETTINGS];
} brd_settings_t;

brd_settings_t brd_settings_from(const iw_config_t *config);

/// Those that version 0.2 kept, with the defaults of the keys that came since.
brd_settings_t brd_settings_from_before(const uint16_t value[BRD_SETTINGS_BEFORE]);

/// What the core is given; its other fields are left alone.
void brd_settings_to(const brd_settings_t *self, iw_config_t *config);

/// One key. False, with nothing changed and the reason and the cure in `why`, if there is no such key or it cannot have
/// that value.
bool brd_settings_set(brd_settings_t *self, const char *key, const char *value, iwn_text_t *why);

/// The value as the file writes it. False if there is no such key, or it is not set.
#define BRD_SETTINGS_TEXT 16U
bool brd_settings_value(const brd_settings_t *self, const char *key, char out_text[BRD_SETTINGS_TEXT]);

/// The relations between keys. False, with the reason and the cure in `why`, if one does not hold.
bool brd_settings_check(const brd_settings_t *self, iwn_text_t *why);

/// The list `keys` of the reply to `config`, with the values as the file writes them; null where nothing is set.
void brd_settings_write(const brd_settings_t *self, iwn_out_t *json);

#endif
