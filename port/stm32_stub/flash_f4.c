// SPDX-License-Identifier: MIT
// Section numbers refer to RM0090: 3.6 erase and program, 3.9 registers.
#include "flash.h"

#include "board.h"
#include "watchdog.h"

typedef struct {
    volatile uint32_t ACR, KEYR, OPTKEYR, SR, CR, OPTCR;
} flash_t;

#define FLASH  ((flash_t *)0x40023C00U)
#define KEY1   0x45670123U
#define KEY2   0xCDEF89ABU
#define PG     (1U << 0)
#define SER    (1U << 1)
#define SNB(n) ((n) << 3)
#define BY_32  (2U << 8) // For a supply of 2.7 to 3.6 V.
#define STRT   (1U << 16)
#define LOCK   (1U << 31)
#define BSY    (1U << 16)
#define EOP    (1U << 0)
#define FAULTS (0xFU << 4)
#define WDG_SW (1U << 5)  // OPTCR: an option byte; 0: the hardware starts the watchdog at each reset.
#define DCEN   (1U << 10) // FLASH_ACR
#define DCRST  (1U << 12)

#define FIRST_SECTOR 4U

// The CPU stalls while it fetches from a busy flash, so the loop makes few polls. The limit is for a defective chip.
#define POLLS_MAX (BRD_CORE_HZ / 8U * 2U)

static uint32_t address_of(unsigned page, unsigned word) {
    static const uint32_t sectors[BRD_FLASH_PAGES] = {0x08010000U, 0x08020000U}; // 3.3; memory.ld excludes them.
    return sectors[page] + 4U * word;
}

uint32_t brd_flash_read(unsigned page, unsigned word) {
    return *(const volatile uint32_t *)address_of(page, word);
}

static bool begin(uint32_t what) {
    if ((FLASH->CR & LOCK) != 0U) {
        FLASH->KEYR = KEY1;
        FLASH->KEYR = KEY2;
    }
    FLASH->SR = FAULTS | EOP;
    FLASH->CR = what;
    return (FLASH->CR & LOCK) == 0U;
}

/// Clears the data cache, which still contains the words from before the write (3.5.2).
static void empty_cache(void) {
    const uint32_t acr = FLASH->ACR;
    FLASH->ACR = acr & ~DCEN;
    FLASH->ACR = (acr & ~DCEN) | DCRST;
    FLASH->ACR = acr;
}

static bool end(void) {
    uint32_t polls = 0;
    while ((FLASH->SR & BSY) != 0U && polls < POLLS_MAX) {
        polls++;
    }
    const bool good = (FLASH->SR & (BSY | FAULTS)) == 0U;
    FLASH->CR = LOCK;
    empty_cache();
    return good;
}

bool brd_flash_erase(unsigned page) {
    const uint32_t what = SER | SNB(FIRST_SECTOR + page) | BY_32;
    if (!begin(what)) {
        return false;
    }
    if ((FLASH->OPTCR & WDG_SW) == 0U) {
        brd_watchdog_extend(); // It bites after 0.35 s at the earliest, and an erase lasts up to 2 s.
    }
    FLASH->CR = what | STRT;
    return end();
}

bool brd_flash_write(unsigned page, unsigned word, uint32_t value) {
    volatile uint32_t *const at = (volatile uint32_t *)address_of(page, word);
    if (!begin(PG | BY_32)) {
        return false;
    }
    *at = value;
    return end() && *at == value;
}
