// SPDX-License-Identifier: MIT
/// What outlives power: one record, written anew as a whole, in two pages of flash that take turns.
///
/// A page has slots; a record goes into the next blank one and counts when its CRC is right, which is written last.
/// So a power cut at any instant leaves the record of before or the new one. A slot that is neither blank nor right
/// is passed over. When the blank ones run short the other page is erased, at a start only: while the image runs
/// nothing is ever erased, and a record stalls the CPU for 16 ms at the most (F103; F4: 6 ms), which is less than a
/// step may be late.
///
/// Wear: with a record at each power-on, an F103's pages are erased once in four of them: 40 000 power-ons at the 10
/// 000 erasures that its maker promises.
#ifndef BRD_STORE_H
#define BRD_STORE_H

#include "iwheel/types.h"

/// Of the payload of a record.
#define BRD_STORE_WORDS 60U

/// All zero before `brd_store_open`.
typedef struct {
    uint32_t sequence; ///< Of the newest record; 0: there is none.
    uint8_t page;      ///< Where it is ...
    uint8_t slot;
    bool failed; ///< The flash did not take a record.
} brd_store_t;

/// Finds the newest record.
void brd_store_open(brd_store_t *self);

/// Its payload. False if there is none: `out_payload` is left alone.
bool brd_store_read(const brd_store_t *self, uint32_t out_payload[BRD_STORE_WORDS]);

/// Writes a record. `may_erase`: before the watchdog runs and with nothing being sent, so that it may take seconds;
/// else false when no slot is blank. False, too, if the flash fails.
bool brd_store_write(brd_store_t *self, const uint32_t payload[BRD_STORE_WORDS], bool may_erase);

/// Slots that are blank now.
unsigned brd_store_blank(const brd_store_t *self);

#endif
