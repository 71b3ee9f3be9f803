// SPDX-License-Identifier: MIT
#include "store.h"

#include "flash.h"

#include "iwheel_northbound/line.h"

#include <assert.h>

#define SLOT_WORDS 64U
#define SLOTS      (BRD_FLASH_PAGE_WORDS / SLOT_WORDS)
#define CRC_AT     (SLOT_WORDS - 1U)
#define BLANK      0xFFFFFFFFU
/// With fewer blank slots a start erases the other page: one is for a configuration, one for learned facts.
#define BLANK_LEAST 3U

static_assert(BRD_STORE_WORDS + 2U <= CRC_AT, "sequence, payload and CRC fit a slot");
static_assert(BLANK_LEAST < SLOTS, "a page that was just begun has so many");

static uint32_t read(unsigned page, unsigned slot, unsigned word) {
    return brd_flash_read(page, slot * SLOT_WORDS + word);
}

static uint32_t crc_of(unsigned page, unsigned slot) {
    uint32_t crc = 0;
    for (unsigned word = 0; word < CRC_AT; word++) {
        const uint32_t value = read(page, slot, word);
        crc = iwn_line_crc(crc, &value, sizeof value);
    }
    return crc;
}

static bool is_right(unsigned page, unsigned slot) {
    const uint32_t sequence = read(page, slot, 0);
    return sequence != 0U && sequence != BLANK && read(page, slot, CRC_AT) == crc_of(page, slot);
}

static bool is_blank(unsigned page, unsigned slot) {
    for (unsigned word = 0; word < SLOT_WORDS; word++) {
        if (read(page, slot, word) != BLANK) {
            return false;
        }
    }
    return true;
}

/// A page is filled from its first slot, so its last full slot has the newest record. The CRC of that one is computed,
/// and that of an older one only if it is wrong: after a restart in motion the wheels wait for the first zeros.
void brd_store_open(brd_store_t *self) {
    *self = (brd_store_t){.sequence = 0};
    for (unsigned page = 0; page < BRD_FLASH_PAGES; page++) {
        for (unsigned slot = SLOTS; slot-- > 0U;) {
            if (read(page, slot, 0) > self->sequence && is_right(page, slot)) {
                self->sequence = read(page, slot, 0);
                self->page = (uint8_t)page;
                self->slot = (uint8_t)slot;
            }
        }
    }
}

bool brd_store_read(const brd_store_t *self, uint32_t out_payload[BRD_STORE_WORDS]) {
    for (unsigned word = 0; word < BRD_STORE_WORDS && self->sequence != 0U; word++) {
        out_payload[word] = read(self->page, self->slot, 1U + word);
    }
    return self->sequence != 0U;
}

unsigned brd_store_blank(const brd_store_t *self) {
    unsigned blank = 0;
    for (unsigned slot = 0; slot < SLOTS; slot++) {
        blank += is_blank(self->page, slot) ? 1U : 0U;
    }
    return blank;
}

/// Writes the CRC last: without it the record is not valid.
static bool write_slot(unsigned page, unsigned slot, uint32_t sequence, const uint32_t *payload) {
    bool good = brd_flash_write(page, slot * SLOT_WORDS, sequence);
    for (unsigned word = 0; word < BRD_STORE_WORDS && good; word++) {
        good = payload[word] == BLANK || brd_flash_write(page, slot * SLOT_WORDS + 1U + word, payload[word]);
    }
    return good && brd_flash_write(page, slot * SLOT_WORDS + CRC_AT, crc_of(page, slot)) && is_right(page, slot);
}

/// Writes into the first blank slot of the page. After a failure that slot is not blank any more, and the next is
/// tried.
static bool write_in(brd_store_t *self, unsigned page, const uint32_t *payload) {
    for (unsigned slot = 0; slot < SLOTS; slot++) {
        if (is_blank(page, slot) && write_slot(page, slot, self->sequence + 1U, payload)) {
            self->sequence++;
            self->page = (uint8_t)page;
            self->slot = (uint8_t)slot;
            return true;
        }
    }
    return false;
}

bool brd_store_write(brd_store_t *self, const uint32_t payload[BRD_STORE_WORDS], bool may_erase) {
    const unsigned other = (self->page + 1U) % BRD_FLASH_PAGES;
    bool good = false;
    if (!may_erase || brd_store_blank(self) >= BLANK_LEAST) {
        good = write_in(self, self->page, payload);
    }
    if (!good && may_erase) { // The newest record is on the page that is not erased.
        good = brd_flash_erase(other) && write_in(self, other, payload);
    }
    self->failed = !good;
    return good;
}
