// SPDX-License-Identifier: MIT
#include "kept.h"

#include <stddef.h>
#include <string.h>

/// The layout of a payload. What grows is put to the end: an older record has zeros there.
typedef union {
    struct {
        uint32_t power_ons;
        uint32_t flags; ///< HAS_SETTINGS, HAS_PAIR.
        iw_settings_t settings;
        uint32_t has_learnt;
        iw_learnt_t learnt;
    } is;
    uint32_t words[IW_STORE_WORDS];
} record_t;

IW_STATIC_ASSERT(sizeof(record_t) == IW_STORE_WORDS * sizeof(uint32_t), a_record_fits);

/// Fewer blank slots, and a start makes room: one for a configuration, one for what is learnt.
#define ROOM_LEAST 2U

#define HAS_SETTINGS 1U ///< There are settings.
#define HAS_PAIR     2U ///< As this version writes it; else it is a record of version 0.2.

#define BEFORE_BYTES (IW_SETTINGS_BEFORE * sizeof(uint16_t))
/// Of the words of the record of version 0.2: settings, whether something is learnt, and that.
#define BEFORE_AT     2U
#define BEFORE_LEARNT (BEFORE_AT + BEFORE_BYTES / sizeof(uint32_t))

static iw_settings_t from_before(const uint32_t *words) {
    uint16_t value[IW_SETTINGS_BEFORE];
    memcpy(value, words, sizeof value);
    return iw_settings_from_before(value);
}

/// What a record of version 0.2 holds moves to its new places, which lie behind: the last first.
static void convert(record_t *record) {
    const size_t rest = offsetof(iw_learnt_t, zero);
    const uint8_t *const learnt = (const uint8_t *)&record->words[BEFORE_LEARNT + 1U];
    memmove((uint8_t *)&record->is.learnt + rest, learnt + BEFORE_BYTES, sizeof(iw_learnt_t) - rest);
    record->is.learnt.settings = from_before(&record->words[BEFORE_LEARNT + 1U]);
    record->is.has_learnt = record->words[BEFORE_LEARNT];
    record->is.settings = from_before(&record->words[BEFORE_AT]);
    record->is.flags |= HAS_PAIR;
}

static void read(const iw_kept_t *self, record_t *out_record) {
    if (!iw_store_read(&self->store, out_record->words)) {
        *out_record = (record_t){.words = {0}}; // Converted, it has neither settings nor anything learnt.
    }
    if ((out_record->is.flags & HAS_PAIR) == 0U) {
        convert(out_record);
    }
}

void iw_kept_open(iw_kept_t *self, bool power_on, bool is_urgent) {
    record_t record;
    iw_store_open(&self->store);
    read(self, &record);
    record.is.power_ons += power_on ? 1U : 0U;
    self->power_ons = record.is.power_ons;
    const bool is_short = iw_store_blank(&self->store) < ROOM_LEAST;
    if ((power_on || (is_short && !is_urgent)) && !iw_store_write(&self->store, record.words, !is_urgent)) {
        self->power_ons = power_on ? 0U : self->power_ons;
    }
}

bool iw_kept_settings(const iw_kept_t *self, iw_settings_t *out_settings) {
    record_t record;
    iwn_text_t nowhere = iwn_text_begin((char[1]){0}, 1);
    read(self, &record);
    *out_settings = record.is.settings;
    return (record.is.flags & HAS_SETTINGS) != 0U && iw_settings_check(out_settings, &nowhere);
}

bool iw_kept_learnt(const iw_kept_t *self, iw_learnt_t *out_learnt) {
    record_t record;
    read(self, &record);
    *out_learnt = record.is.learnt;
    return record.is.has_learnt != 0U;
}

bool iw_kept_commit(iw_kept_t *self, const iw_settings_t *settings) {
    record_t record;
    read(self, &record);
    record.is.flags |= HAS_SETTINGS;
    record.is.settings = *settings;
    return iw_store_write(&self->store, record.words, false);
}

bool iw_kept_learn(iw_kept_t *self, const iw_learnt_t *learnt) {
    record_t record;
    read(self, &record);
    record.is.has_learnt = 1U;
    record.is.learnt = *learnt;
    return iw_store_blank(&self->store) >= ROOM_LEAST && iw_store_write(&self->store, record.words, false);
}
