// SPDX-License-Identifier: MIT
#include "watchdog.h"

#include "board.h"

#include <assert.h>
#include <stdint.h>

// Registers (RM0008 19.4, RM0090 21.4): key, prescaler, reload, status.
typedef struct {
    volatile uint32_t KR, PR, RLR, SR;
} iwdg_t;

#define IWDG   ((iwdg_t *)0x40003000U)
#define FEED   0xAAAAU
#define UNLOCK 0x5555U
#define START  0xCCCCU
#define BY_4   0U
#define BY_256 6U
#define RELOAD (BRD_LSI_MAX_HZ / 4U * BRD_WATCHDOG_MS / 1000U + 1U)

// The registers accept the values within 5 cycles of the slow oscillator. A read of SR takes at least 8 cycles of the
// core.
#define POLLS_MAX (BRD_INTERNAL_HZ / 8U / 1000U)

static_assert(RELOAD <= 0xFFFU, "12 bits");

static void wait_until_accepted(void) {
    for (uint32_t poll = 0; IWDG->SR != 0U && poll < POLLS_MAX; poll++) {
    }
    brd_watchdog_feed();
}

void brd_watchdog_start(void) {
    IWDG->KR = START;
    IWDG->KR = UNLOCK;
    IWDG->PR = BY_4;
    IWDG->RLR = RELOAD;
    wait_until_accepted();
}

/// The reload value is the highest since the reset.
void brd_watchdog_extend(void) {
    IWDG->KR = UNLOCK;
    IWDG->PR = BY_256;
    wait_until_accepted();
}

void brd_watchdog_feed(void) {
    IWDG->KR = FEED;
}
