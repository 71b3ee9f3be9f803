// SPDX-License-Identifier: MIT
#include "boot.h"

#include "board.h"

#define UNIQUE_ID ((const volatile uint32_t *)BRD_UNIQUE_ID_ADDRESS) // 96 bits.

__attribute__((section(".noinit"))) static volatile uint32_t count, inverse;

/// Maps different values to different results, so that two counts never have the same id. The constants are those of
/// the splitmix64 mixer.
static uint64_t mix(uint64_t value) {
    value = (value ^ value >> 30) * 0xBF58476D1CE4E5B9U;
    value = (value ^ value >> 27) * 0x94D049BB133111EBU;
    return value ^ value >> 31;
}

uint64_t brd_boot_id(uint32_t power_ons) {
    static uint64_t id;
    if (id == 0U) {
        count = (count == ~inverse) ? count + 1U : 1U;
        inverse = ~count;
        const uint64_t parts[] = {((uint64_t)UNIQUE_ID[0] << 32 | UNIQUE_ID[1]) ^ UNIQUE_ID[2],
                                  ((uint64_t)power_ons << 32) + count};
        uint64_t mixed = 0;
        for (unsigned i = 0; i < 2U; i++) {
            mixed = mix(mixed + parts[i]);
        }
        id = mixed;
    }
    return id;
}
