// SPDX-License-Identifier: MIT
#include "kept.h"

#include <string.h>

/// The layout of a payload. What grows is put to the end.
typedef struct {
    uint32_t power_ons;
    uint32_t has_settings;
    iw_settings_t settings;
} record_t;

IW_STATIC_ASSERT(sizeof(record_t) <= IW_STORE_WORDS * 4U, a_record_fits);

static bool write(iw_kept_t *self, const iw_settings_t *settings, bool may_erase) {
    const record_t record = {
        .power_ons = self->power_ons,
        .has_settings = (settings != NULL) ? 1U : 0U,
        .settings = (settings != NULL) ? *settings : (iw_settings_t){{0}},
    };
    uint32_t payload[IW_STORE_WORDS] = {0};
    memcpy(payload, &record, sizeof record);
    return iw_store_write(&self->store, payload, may_erase);
}

void iw_kept_open(iw_kept_t *self, bool power_on) {
    uint32_t payload[IW_STORE_WORDS];
    record_t record = {.power_ons = 0};
    iwn_text_t nowhere = iwn_text_begin((char[1]){0}, 1);
    if (iw_store_open(&self->store, payload)) {
        memcpy(&record, payload, sizeof record);
    }
    self->power_ons = record.power_ons;
    self->settings = record.settings;
    self->has_settings = record.has_settings != 0U && iw_settings_check(&record.settings, &nowhere);
    if (power_on) {
        self->power_ons++;
        if (!write(self, self->has_settings ? &self->settings : NULL, true)) {
            self->power_ons = 0;
        }
    }
}

bool iw_kept_commit(iw_kept_t *self, const iw_settings_t *settings) {
    if (!write(self, settings, false)) {
        return false;
    }
    self->settings = *settings;
    self->has_settings = true;
    return true;
}
