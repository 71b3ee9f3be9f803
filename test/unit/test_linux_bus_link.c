// SPDX-License-Identifier: MIT
// The verdict on the bit timing of a link.
#include "iwheel_linux/bus_link.h"

#include "iwheel/bit_timing.h"
#include "netlink.h"

#include "unit.h"

#include <stdio.h>

static iwl_timing_t judge(uint32_t bitrate_hz, uint16_t sample_point_permille) {
    const iwl_bus_link_t link = {
        .presence = IWL_LINK_UP, .bitrate_hz = bitrate_hz, .sample_point_permille = sample_point_permille};
    return iwl_timing_judge(&link, IW_BUS_BITRATE_HZ, IW_BUS_SAMPLE_POINT_PERMILLE);
}

TEST(test_timing_verdict_depends_on_the_sample_point_distance) {
    for (uint16_t permille = 1; permille <= 1000; permille++) {
        const int off = (permille > 625) ? permille - 625 : 625 - permille;
        const iwl_timing_t expected = (off <= 5) ? IWL_TIMING_RIGHT : (off <= 25) ? IWL_TIMING_NEAR : IWL_TIMING_WRONG;
        TEST_ASSERT_EQUAL_MESSAGE(expected, judge(1000000, permille), "sample point");
    }
}

TEST(test_timing_other_bit_rate_is_wrong_at_any_sample_point) {
    TEST_ASSERT_EQUAL(IWL_TIMING_WRONG, judge(500000, 625));
    TEST_ASSERT_EQUAL(IWL_TIMING_WRONG, judge(999999, 625));
    TEST_ASSERT_EQUAL(IWL_TIMING_WRONG, judge(500000, 0));
}

TEST(test_timing_missing_value_is_unknown_unless_other_is_wrong) {
    TEST_ASSERT_EQUAL(IWL_TIMING_UNKNOWN, judge(1000000, 0));
    TEST_ASSERT_EQUAL(IWL_TIMING_UNKNOWN, judge(0, 625));
    TEST_ASSERT_EQUAL(IWL_TIMING_UNKNOWN, judge(0, 0));
    TEST_ASSERT_EQUAL(IWL_TIMING_WRONG, judge(0, 750));
}

TEST(test_timing_of_a_virtual_link_is_not_judged) {
    const iwl_bus_link_t link = {.presence = IWL_LINK_UP, .is_virtual = true, .bitrate_hz = 5};
    TEST_ASSERT_EQUAL(IWL_TIMING_VIRTUAL, iwl_timing_judge(&link, 1000000, 625));
}

TEST(test_link_is_same_compares_interface_values_only) {
    const iwl_bus_link_t link = {.presence = IWL_LINK_UP, .bitrate_hz = 1, .queue_length = 2};
    iwl_bus_link_t other = link;
    other.purge = IWL_LINK_PURGE_DONE;
    other.changes = 9;
    other.lost = 9;
    other.load_permille = 9;
    TEST_ASSERT_TRUE(iwl_bus_link_is_same(&link, &other));
#define DIFFERS(field, value)                                                                                          \
    other = link;                                                                                                      \
    other.field = (value);                                                                                             \
    TEST_ASSERT_FALSE_MESSAGE(iwl_bus_link_is_same(&link, &other), #field)
    DIFFERS(presence, IWL_LINK_DOWN);
    DIFFERS(is_virtual, true);
    DIFFERS(echo_proven, true);
    DIFFERS(is_mute, true);
    DIFFERS(bitrate_hz, 3);
    DIFFERS(sample_point_permille, 3);
    DIFFERS(restart_ms, 3);
    DIFFERS(queue_length, 3);
#undef DIFFERS
}

/// The loopback interface has a carrier unless it is down; then the kernel returns no value.
TEST(test_link_carrier_is_that_of_the_kernel_or_unknown) {
    char line[8] = "";
    FILE *file = fopen("/sys/class/net/lo/carrier", "r");
    TEST_ASSERT_NOT_NULL(file);
    const bool known = fgets(line, sizeof line, file) != NULL;
    (void)fclose(file);
    TEST_ASSERT_EQUAL_INT(known ? line[0] - '0' : -1, iwl_netdev_carrier("lo"));
    TEST_ASSERT_EQUAL_INT(-1, iwl_netdev_carrier("no-such-one"));
}
