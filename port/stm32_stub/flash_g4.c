// SPDX-License-Identifier: MIT
// Section numbers refer to RM0440: 3 flash of category 3, registers 3.7.
//
// This flash writes 64 bits at a time, with 8 bits of an error-correcting code, and each 64 bits once. So a word of the
// store is 64 bits: the value and its inverse. The option DBANK (two banks with pages of 2 KiB, as delivered, or one
// bank with pages of 4 KiB) may have either value: a page of the store begins at a multiple of 4 KiB and uses the first
// 2 KiB.
#include "flash.h"

#include "board.h"
#include "fault.h"

typedef struct {
    volatile uint32_t ACR, PDKEYR, KEYR, OPTKEYR, SR, CR, ECCR, reserved, OPTR;
} flash_t;

#define FLASH  ((flash_t *)0x40022000U)
#define KEY1   0x45670123U
#define KEY2   0xCDEF89ABU
#define PG     (1U << 0)
#define PER    (1U << 1)
#define PNB(n) ((n) << 3)
#define BKER   (1U << 11)
#define STRT   (1U << 16)
#define LOCK   (1U << 31)
#define BSY    (1U << 16)
#define EOP    (1U << 0)
#define FAULTS (0xC3FAU)  // SR: every error of a write or an erase.
#define DCEN   (1U << 10) // ACR
#define DCRST  (1U << 12)
#define DBANK  (1U << 22)   // OPTR
#define ECCD   (0xAU << 28) // ECCR: two wrong bits in the lower or upper half of what was read.

#define RCC_CIFR (*(volatile uint32_t *)(BRD_RCC_ADDRESS + 0x1CU)) // 7.4
#define CSSF     (1U << 8)                                         // The crystal failed.

#define PAGE_BYTES     0x1000U
#define PAGE_TWO_BANKS 124U // Of bank 2, whose pages have 2 KiB.
#define PAGE_SINGLE    126U
#define BROKEN         0U

// Erasing takes at most 25 ms, and a poll at least 8 cycles.
#define POLLS_MAX (BRD_CORE_HZ / 8U / 20U)

static volatile bool is_reading; // Only while the store is read, a bad word is no fault.
static volatile bool is_broken;  // The NMI sets it.

void brd_nmi_handler(void);

/// A word whose write was interrupted can have two wrong bits, and reading it raises the NMI (3.3). Without this
/// handler each start would end in a reset while it searches the store. ECCR does not decide, because the interruption
/// can have damaged its contents too (ES0430 2.2.3). Every other NMI is a bad word of the program, or a failure of the
/// crystal.
void brd_nmi_handler(void) {
    if (!is_reading || (RCC_CIFR & CSSF) != 0U) {
        brd_fault_store(NULL);
    }
    FLASH->ECCR |= ECCD; // Writing 1 clears a flag.
    is_broken = true;
    __asm volatile("dsb" ::: "memory");
}

static volatile uint32_t *words_of(unsigned page, unsigned word) {
    return (volatile uint32_t *)(BRD_STORE_ADDRESS + page * PAGE_BYTES + 8U * word);
}

/// The flash raises the NMI independently of the read. The read of its status register takes longer than the NMI needs.
uint32_t brd_flash_read(unsigned page, unsigned word) {
    const volatile uint32_t *const at = words_of(page, word);
    is_broken = false;
    is_reading = true;
    const uint32_t value = at[0];
    const uint32_t inverse = at[1];
    __asm volatile("dsb" ::: "memory");
    (void)FLASH->SR;
    __asm volatile("dsb\n isb" ::: "memory");
    is_reading = false;
    const bool blank = value == UINT32_MAX && inverse == UINT32_MAX;
    return (!is_broken && (blank || inverse == ~value)) ? value : BROKEN;
}

/// Switches the data cache off until `end`: reading one bank while the other one is written can corrupt its contents
/// (ES0430 2.2.2).
static bool begin(uint32_t what) {
    if ((FLASH->CR & LOCK) != 0U) {
        FLASH->KEYR = KEY1;
        FLASH->KEYR = KEY2;
    }
    if ((FLASH->CR & LOCK) != 0U) {
        return false;
    }
    FLASH->ACR &= ~DCEN;
    FLASH->SR = FAULTS | EOP;
    FLASH->CR = what;
    return true;
}

/// Clears the data cache, which still contains the words from before the write (3.3), and switches it on.
static void empty_cache(void) {
    const uint32_t acr = FLASH->ACR & ~DCEN;
    FLASH->ACR = acr | DCRST;
    FLASH->ACR = acr | DCEN;
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
    const bool two_banks = (FLASH->OPTR & DBANK) != 0U;
    const uint32_t what = PER | (two_banks ? BKER | PNB(PAGE_TWO_BANKS + 2U * page) : PNB(PAGE_SINGLE + page));
    if (!begin(what)) {
        return false;
    }
    FLASH->CR = what | STRT;
    return end();
}

/// 3.3: the write begins with the second half.
bool brd_flash_write(unsigned page, unsigned word, uint32_t value) {
    volatile uint32_t *const at = words_of(page, word);
    if (!begin(PG)) {
        return false;
    }
    at[0] = value;
    at[1] = ~value;
    return end() && brd_flash_read(page, word) == value;
}
