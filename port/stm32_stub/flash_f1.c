// SPDX-License-Identifier: MIT
// Section numbers refer to PM0075: 2.3.3 programming, 2.3.4 erase, 3 registers.
#include "flash.h"

#include "board.h"

typedef struct {
    volatile uint32_t ACR, KEYR, OPTKEYR, SR, CR, AR;
} flash_t;

#define FLASH  ((flash_t *)0x40022000U)
#define KEY1   0x45670123U
#define KEY2   0xCDEF89ABU
#define PG     (1U << 0)
#define PER    (1U << 1)
#define STRT   (1U << 6)
#define LOCK   (1U << 7)
#define BSY    (1U << 0)
#define FAULTS ((1U << 2) | (1U << 4))
#define EOP    (1U << 5)

#define PAGE_BYTES 1024U

// The CPU stalls while it fetches from a busy flash, so the loop makes few polls. The limit is for a defective chip.
#define POLLS_MAX (BRD_CORE_HZ / 8U / 20U)

static uint32_t address_of(unsigned page, unsigned word) {
    return BRD_STORE_ADDRESS + page * PAGE_BYTES + 4U * word;
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

static bool end(void) {
    uint32_t polls = 0;
    while ((FLASH->SR & BSY) != 0U && polls < POLLS_MAX) {
        polls++;
    }
    const bool good = (FLASH->SR & (BSY | FAULTS)) == 0U;
    FLASH->CR = LOCK;
    return good;
}

bool brd_flash_erase(unsigned page) {
    if (!begin(PER)) {
        return false;
    }
    FLASH->AR = address_of(page, 0);
    FLASH->CR = PER | STRT;
    return end();
}

/// This family can write only half a word at a time.
static bool write_half(uint32_t address, uint16_t value) {
    if (!begin(PG)) {
        return false;
    }
    *(volatile uint16_t *)address = value;
    return end() && *(volatile uint16_t *)address == value;
}

bool brd_flash_write(unsigned page, unsigned word, uint32_t value) {
    const uint32_t address = address_of(page, word);
    return write_half(address, (uint16_t)value) && write_half(address + 2U, (uint16_t)(value >> 16));
}
