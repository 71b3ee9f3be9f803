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
#ifndef IW_STM32_FLASH_H
#define IW_STM32_FLASH_H

#include "iwheel/types.h"

#define IW_FLASH_PAGES 2U

/// Words that are used of a page: all of an F103's; of an F4's as many as are looked through in a moment.
#ifndef IW_FLASH_PAGE_WORDS
#define IW_FLASH_PAGE_WORDS 256U
#endif

/// The words of a page, as they are now.
const volatile uint32_t *iw_flash_page(unsigned page);

/// All bits of the page become 1. False if the chip refuses or does not end within its time.
bool iw_flash_erase(unsigned page);

/// Bits of one word become 0. False as above, and if the word was not erased before.
bool iw_flash_write(unsigned page, unsigned word, uint32_t value);

#endif
