// SPDX-License-Identifier: MIT
/// Two pages of the chip's flash, for what must outlive power. One file per family implements it.
///
/// | chip       | pages                    | erase, at most | one word, at most | while it lasts             |
/// |------------|--------------------------|----------------|-------------------|----------------------------|
/// | STM32F103  | 62 and 63, 1 KiB each    | 40 ms          | 140 us            | the CPU stands still       |
/// | STM32F4xx  | sectors 4 (64 KiB) and 5 | 2 s            | 100 us            | the CPU stands still       |
///
/// Figures: the data sheets' memory characteristics (5.3.9 of an F103, 5.3.12 of an F4). An erase is longer than the
/// watchdog waits on an F4: it is for the time before the watchdog is started.
#ifndef BRD_FLASH_H
#define BRD_FLASH_H

#include "iwheel/types.h"

#define BRD_FLASH_PAGES 2U

/// Words that are used of a page: all of an F103's; of an F4's as many as are looked through in a moment.
#ifndef BRD_FLASH_PAGE_WORDS
#define BRD_FLASH_PAGE_WORDS 256U
#endif

/// The words of a page, as they are now.
const volatile uint32_t *brd_flash_page(unsigned page);

/// All bits of the page become 1. False if the chip refuses or does not end within its time.
bool brd_flash_erase(unsigned page);

/// Bits of one word become 0. False as above, and if the word was not erased before.
bool brd_flash_write(unsigned page, unsigned word, uint32_t value);

#endif
