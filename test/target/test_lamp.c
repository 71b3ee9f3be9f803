// SPDX-License-Identifier: MIT
#include "lamp.h"
#include "unit.h"

#include <string.h>

static iw_snapshot_t seen;

void setUp(void) {
    memset(&seen, 0, sizeof seen);
    seen.bus = IW_BUS_ACTIVE;
}

static uint16_t pattern_in(iw_state_t state) {
    seen.state = state;
    return brd_lamp_pattern(&seen, false);
}

TEST(test_lamp_each_state_has_its_own_pattern) {
    const uint16_t patterns[] = {pattern_in(IW_STATE_LISTENING),
                                 pattern_in(IW_STATE_ARMED),
                                 pattern_in(IW_STATE_STOPPING),
                                 pattern_in(IW_STATE_LATCHED),
                                 brd_lamp_pattern(&seen, true),
                                 BRD_LAMP_NO_BUS,
                                 BRD_LAMP_NO_CRYSTAL};
    for (size_t a = 0; a < 7; a++) {
        TEST_ASSERT_NOT_EQUAL(0, patterns[a]);
        for (size_t b = 0; b < a; b++) {
            TEST_ASSERT_NOT_EQUAL(patterns[a], patterns[b]);
        }
    }
}

TEST(test_lamp_pressed_contact_has_priority_over_any_state) {
    for (int state = IW_STATE_LISTENING; state <= IW_STATE_LATCHED; state++) {
        (void)pattern_in((iw_state_t)state);
        TEST_ASSERT_EQUAL_HEX16(BRD_LAMP_ESTOP, brd_lamp_pattern(&seen, true));
    }
}

TEST(test_lamp_listening_shows_whether_the_bus_works) {
    for (int bus = IW_BUS_DOWN; bus <= IW_BUS_ACTIVE; bus++) {
        seen.bus = (iw_bus_state_t)bus;
        TEST_ASSERT_EQUAL_HEX16((bus < IW_BUS_PASSIVE) ? BRD_LAMP_NO_BUS : BRD_LAMP_LISTENING,
                                pattern_in(IW_STATE_LISTENING));
    }
}

TEST(test_lamp_pattern_starts_at_its_lowest_bit_every_second) {
    for (uint32_t slot = 0; slot < 16; slot++) {
        for (uint32_t second = 0; second < 3; second++) {
            const iw_time_us_t at_us = second * 1000000U + slot * BRD_LAMP_SLOT_US;
            TEST_ASSERT_EQUAL((0x1234U >> slot) & 1U, brd_lamp_is_lit(0x1234U, at_us));
            TEST_ASSERT_EQUAL((0x1234U >> slot) & 1U, brd_lamp_is_lit(0x1234U, at_us + BRD_LAMP_SLOT_US - 1U));
        }
    }
}
