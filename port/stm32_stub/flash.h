// SPDX-License-Identifier: MIT
/// Two pages of the chip's flash for data that must survive power-off. One file per family implements these functions.
///
/// | chip       | pages                    | erase, at most | one word, at most | meanwhile      |
/// |------------|--------------------------|----------------|-------------------|----------------|
/// | STM32F103  | 62 and 63, 1 KiB each    | 40 ms          | 140 us            | the CPU stalls |
/// | STM32F4xx  | sectors 4 (64 KiB) and 5 | 2 s            | 100 us            | the CPU stalls |
/// | STM32G474  | the last 8 KiB of 512    | 25 ms          | 90 us             | the CPU waits  |
///
/// The figures are from the data sheets (memory characteristics: 5.3.9 of an F103, 5.3.12 of an F4, 5.3.10 of a G474).
/// An erase on an F4 takes longer than the period of the watchdog, so it is allowed only before the watchdog is
/// started. If an option byte starts the watchdog at the reset, the erase extends its period first.
#ifndef BRD_FLASH_H
#define BRD_FLASH_H

#include "iwheel/types.h"

#define BRD_FLASH_PAGES 2U

/// Words in use per page: on an F103 the whole page, on an F4 as many as can be searched quickly.
#ifndef BRD_FLASH_PAGE_WORDS
#define BRD_FLASH_PAGE_WORDS 256U
#endif

/// Returns the current value of one word of a page. On an STM32G4 a word whose write was interrupted by a loss of power
/// reads 0.
uint32_t brd_flash_read(unsigned page, unsigned word);

/// Sets all bits of the page to 1. Returns false if the chip refuses or does not finish in time.
bool brd_flash_erase(unsigned page);

/// Writes `value` to one word; the flash can only change bits to 0. Returns false in the same cases, and if the word
/// was not erased before.
bool brd_flash_write(unsigned page, unsigned word, uint32_t value);

#endif
