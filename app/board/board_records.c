// SPDX-License-Identifier: MIT
#include "board_records.h"

#include <stddef.h>
#include <string.h>

/// Layout of a payload. New members go to the end: an older record has zeros there.
typedef union {
    struct {
        uint32_t power_ons;
        uint32_t flags; ///< HAS_SETTINGS, HAS_PAIR.
        brd_settings_t settings;
        uint32_t has_learned;
        brd_assumptions_t learned;
        brd_fault_t fault;
        uint32_t fault_at; ///< Value of power_ons at that fault.
    } is;
    uint32_t words[BRD_STORE_WORDS];
} record_t;

IW_STATIC_ASSERT(sizeof(record_t) == BRD_STORE_WORDS * sizeof(uint32_t), a_record_fits);

/// With fewer blank slots a start erases a page: one is for a configuration, one for learned facts.
#define ROOM_LEAST 2U

#define HAS_SETTINGS 1U ///< The record contains settings.
#define HAS_PAIR     2U ///< The record has the layout of this version; otherwise that of version 0.2.

#define BEFORE_BYTES (BRD_SETTINGS_BEFORE * sizeof(uint16_t))
/// Words in a record of version 0.2: settings, a flag for learned facts, and these facts.
#define BEFORE_AT      2U
#define BEFORE_LEARNED (BEFORE_AT + BEFORE_BYTES / sizeof(uint32_t))

static brd_settings_t from_before(const uint32_t *words) {
    uint16_t value[BRD_SETTINGS_BEFORE];
    memcpy(value, words, sizeof value);
    return brd_settings_from_before(value);
}

/// Moves the contents of a record of version 0.2 to their new places. These lie further back, so the last one moves
/// first.
static void convert(record_t *record) {
    const size_t rest = offsetof(brd_assumptions_t, zero);
    const uint8_t *const learned = (const uint8_t *)&record->words[BEFORE_LEARNED + 1U];
    memmove((uint8_t *)&record->is.learned + rest, learned + BEFORE_BYTES, sizeof(brd_assumptions_t) - rest);
    record->is.learned.settings = from_before(&record->words[BEFORE_LEARNED + 1U]);
    record->is.has_learned = record->words[BEFORE_LEARNED];
    record->is.settings = from_before(&record->words[BEFORE_AT]);
    record->is.flags |= HAS_PAIR;
}

static void read(const brd_records_t *self, record_t *out_record) {
    if (!brd_store_read(&self->store, out_record->words)) {
        *out_record = (record_t){.words = {0}}; // After the conversion it has neither settings nor learned facts.
    }
    if ((out_record->is.flags & HAS_PAIR) == 0U) {
        convert(out_record);
    }
}

/// Writes only the first fault after each power-on, so that a board that faults again and again does not wear out the
/// flash.
void brd_records_open(brd_records_t *self, bool power_on, bool is_urgent, brd_fault_t fault) {
    record_t record;
    brd_store_open(&self->store);
    read(self, &record);
    record.is.power_ons += power_on ? 1U : 0U;
    self->power_ons = record.is.power_ons;
    const bool is_short = brd_store_blank(&self->store) < ROOM_LEAST;
    const bool is_first = fault.cause != 0U && record.is.fault_at != self->power_ons;
    if (is_first) {
        record.is.fault = fault;
        record.is.fault_at = self->power_ons;
    }
    const bool is_recent = record.is.fault_at + 1U >= self->power_ons;
    self->fault = (fault.cause != 0U || !is_recent) ? fault : record.is.fault;
    const bool is_due = power_on || is_first || (is_short && !is_urgent);
    if (is_due && !brd_store_write(&self->store, record.words, !is_urgent) && power_on) {
        self->power_ons = 0;
    }
}

bool brd_records_settings(const brd_records_t *self, brd_settings_t *out_settings) {
    record_t record;
    read(self, &record);
    if ((record.is.flags & HAS_SETTINGS) == 0U) {
        return false;
    }
    *out_settings = record.is.settings;
    return true;
}

bool brd_records_assumptions(const brd_records_t *self, brd_assumptions_t *out_learned) {
    record_t record;
    read(self, &record);
    *out_learned = record.is.learned;
    return record.is.has_learned != 0U;
}

bool brd_records_commit(brd_records_t *self, const brd_settings_t *settings) {
    record_t record;
    read(self, &record);
    record.is.flags |= HAS_SETTINGS;
    record.is.settings = *settings;
    return brd_store_write(&self->store, record.words, false);
}

bool brd_records_write_assumptions(brd_records_t *self, const brd_assumptions_t *learned) {
    record_t record;
    read(self, &record);
    record.is.has_learned = 1U;
    record.is.learned = *learned;
    return brd_store_blank(&self->store) >= ROOM_LEAST && brd_store_write(&self->store, record.words, false);
}
