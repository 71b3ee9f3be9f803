// SPDX-License-Identifier: MIT
/// Data that must survive power-off: one record, always written as a whole, in two pages of flash that alternate.
///
/// A page has slots. A record goes into the next blank slot and is valid if its CRC, which is written last, is right.
/// So after a power cut at any time the store has the previous record or the new one. A slot that is neither blank nor
/// valid is skipped. Only a write with `may_erase` erases a page; the image requests that at its start, never while it
/// runs. A record stalls the CPU for at most 16 ms (F103; F4: 6 ms), which is less than a step may be late.
///
/// Wear: with a record at each power-on, the pages of an F103 are erased once in four power-ons. 10 000 erasures, the
/// number that the manufacturer specifies, last for 40 000 power-ons.
#ifndef BRD_STORE_H
#define BRD_STORE_H

#include "iwheel/types.h"

/// Number of words in the payload of a record.
#define BRD_STORE_WORDS 60U

/// Must be all zero before `brd_store_open`.
typedef struct {
    uint32_t sequence; ///< Sequence number of the newest record; 0: there is none.
    uint8_t page;      ///< Page and slot of the newest record.
    uint8_t slot;
    bool failed; ///< The last record could not be written.
} brd_store_t;

/// Finds the newest record.
void brd_store_open(brd_store_t *self);

/// Reads the payload of the newest record. Returns false and leaves `out_payload` unchanged if there is none.
bool brd_store_read(const brd_store_t *self, uint32_t out_payload[BRD_STORE_WORDS]);

/// Writes a record. Returns false if the flash fails or no slot is blank. With `may_erase` the call erases a
/// page if necessary, which may take seconds: set it only before the watchdog runs and while nothing is being sent.
bool brd_store_write(brd_store_t *self, const uint32_t payload[BRD_STORE_WORDS], bool may_erase);

/// Returns the number of blank slots in the page of the newest record.
unsigned brd_store_blank(const brd_store_t *self);

#endif
