// SPDX-License-Identifier: MIT
// Bit timing: the solver against a search through every setting, and clocks with known results.
#include <string.h>

#include "iwheel/bit_timing.h"
#include "unit.h"

#define POISON 0xA5
#define MHZ    1000000U

static const iw_bit_timing_achieved_t bus = {1000000, 625};
static iw_bit_timing_limits_t limits;

void setUp(void) {
    limits = IW_BIT_TIMING_BXCAN;
}

/// Distance of the sample point of a setting from the wanted one, as the fraction numerator / quanta.
typedef struct {
    uint64_t numerator;
    uint64_t quanta;
} distance_t;

static distance_t distance_of(uint32_t tseg1, uint32_t tseg2, uint32_t wanted_permille) {
    const uint64_t quanta = 1U + tseg1 + tseg2;
    const uint64_t is = 1000U * (1U + (uint64_t)tseg1);
    const uint64_t wanted = wanted_permille * quanta;
    const distance_t distance = {(is > wanted) ? is - wanted : wanted - is, quanta};
    return distance;
}

/// Returns true if `a` is nearer, or equally near with more quanta.
static bool is_better(distance_t a, distance_t b) {
    const uint64_t left = a.numerator * b.quanta;
    const uint64_t right = b.numerator * a.quanta;
    return left < right || (left == right && a.quanta > b.quanta);
}

/// Finds the best setting by a search through all. Returns false if no setting has the bit rate.
static bool best_of_all(uint32_t clock_hz, const iw_bit_timing_achieved_t *wanted, distance_t *out_best) {
    bool found = false;
    for (uint64_t prescaler = 1; prescaler <= limits.prescaler_max; prescaler++) {
        for (uint32_t tseg1 = limits.tseg1_min; tseg1 <= limits.tseg1_max; tseg1++) {
            for (uint32_t tseg2 = limits.tseg2_min; tseg2 <= limits.tseg2_max; tseg2++) {
                const distance_t distance = distance_of(tseg1, tseg2, wanted->sample_point_permille);
                const bool exact = prescaler * distance.quanta * wanted->bitrate_hz == clock_hz;
                if (exact && (!found || is_better(distance, *out_best))) {
                    *out_best = distance;
                    found = true;
                }
            }
        }
    }
    return found;
}

static bool is_within_limits(const iw_bit_timing_t *timing) {
    return timing->prescaler >= 1 && timing->prescaler <= limits.prescaler_max && timing->tseg1 >= limits.tseg1_min &&
           timing->tseg1 <= limits.tseg1_max && timing->tseg2 >= limits.tseg2_min && timing->tseg2 <= limits.tseg2_max;
}

static void compare_with_search(uint32_t clock_hz, const iw_bit_timing_achieved_t *wanted) {
    distance_t best = {0, 0};
    iw_bit_timing_t timing;
    iw_bit_timing_t poison;
    memset(&poison, POISON, sizeof poison);
    memset(&timing, POISON, sizeof timing);
    const iw_status_t status = iw_bit_timing_solve(&limits, clock_hz, wanted, &timing);
    if (!best_of_all(clock_hz, wanted, &best)) {
        TEST_ASSERT_EQUAL_INT(IW_ERR_RANGE, status);
        TEST_ASSERT_EQUAL_HEX8_ARRAY(&poison, &timing, sizeof timing);
        return;
    }
    TEST_ASSERT_EQUAL_INT(IW_OK, status);
    TEST_ASSERT_TRUE(is_within_limits(&timing));
    const distance_t distance = distance_of(timing.tseg1, timing.tseg2, wanted->sample_point_permille);
    TEST_ASSERT_EQUAL_UINT32(clock_hz, timing.prescaler * distance.quanta * wanted->bitrate_hz);
    TEST_ASSERT_TRUE_MESSAGE(best.numerator * distance.quanta == distance.numerator * best.quanta, "not the nearest");
    TEST_ASSERT_EQUAL_UINT32_MESSAGE(best.quanta, distance.quanta, "not the most quanta");
}

TEST(test_solve_clocks_from_8_to_80_MHz_equals_search) {
    for (uint32_t clock_hz = 8 * MHZ; clock_hz <= 80 * MHZ; clock_hz += MHZ / 2) {
        compare_with_search(clock_hz, &bus);
    }
}

TEST(test_solve_other_rates_and_sample_points_equals_search) {
    static const uint32_t rates[] = {125000, 500000, 800000};
    static const uint16_t points[] = {1, 500, 750, 800, 875, 1000};
    for (size_t i = 0; i < 18; i++) {
        const iw_bit_timing_achieved_t wanted = {rates[i / 6], points[i % 6]};
        for (uint32_t clock_hz = 8 * MHZ; clock_hz <= 80 * MHZ; clock_hz += 4 * MHZ) {
            compare_with_search(clock_hz, &wanted);
        }
    }
}

/// Sample points are in permille: a setting up to one permille further than the nearest counts as equally near.
static void assert_nearest_to_the_permille(uint32_t clock_hz, const iw_bit_timing_achieved_t *wanted) {
    distance_t best = {0, 0};
    iw_bit_timing_t timing = {0, 0, 0};
    TEST_ASSERT_TRUE(best_of_all(clock_hz, wanted, &best));
    TEST_ASSERT_EQUAL_INT(IW_OK, iw_bit_timing_solve(&limits, clock_hz, wanted, &timing));
    const distance_t distance = distance_of(timing.tseg1, timing.tseg2, wanted->sample_point_permille);
    TEST_ASSERT_TRUE(distance.numerator * best.quanta <= (best.numerator + best.quanta) * distance.quanta);
}

TEST(test_solve_every_sample_point_finds_the_nearest) {
    static const uint32_t clocks[] = {8, 10, 12, 16, 36, 42};
    for (size_t i = 0; i < sizeof clocks / sizeof clocks[0]; i++) {
        for (uint16_t permille = 1; permille <= 1000; permille++) {
            const iw_bit_timing_achieved_t wanted = {1000000, permille};
            limits.prescaler_max = 16;
            assert_nearest_to_the_permille(clocks[i] * MHZ, &wanted);
        }
    }
}

TEST(test_solve_eight_quanta_selects_the_nearest_eighth) {
    for (uint16_t permille = 1; permille <= 1000; permille++) {
        const iw_bit_timing_achieved_t wanted = {1000000, permille};
        limits.prescaler_max = 1;
        compare_with_search(8 * MHZ, &wanted);
    }
}

TEST(test_solve_narrow_limits_are_observed) {
    limits = (iw_bit_timing_limits_t){4, 3, 5, 2, 3};
    for (uint32_t clock_hz = 4 * MHZ; clock_hz <= 40 * MHZ; clock_hz += MHZ) {
        compare_with_search(clock_hz, &bus);
    }
}

TEST(test_solve_one_possible_setting_is_found) {
    limits = (iw_bit_timing_limits_t){1, 4, 4, 3, 3};
    compare_with_search(8 * MHZ, &bus);
    compare_with_search(16 * MHZ, &bus);
    compare_with_search(7 * MHZ, &bus);
}

static iw_bit_timing_achieved_t solved(uint32_t clock_hz) {
    iw_bit_timing_t timing;
    TEST_ASSERT_EQUAL_INT(IW_OK, iw_bit_timing_solve(&limits, clock_hz, &bus, &timing));
    return iw_bit_timing_achieved(clock_hz, &timing);
}

TEST(test_solve_multiples_of_8_MHz_reach_the_bus_exactly) {
    static const uint32_t clocks[] = {8, 16, 32, 40, 48, 56, 64, 72, 80};
    for (size_t i = 0; i < sizeof clocks / sizeof clocks[0]; i++) {
        const iw_bit_timing_achieved_t achieved = solved(clocks[i] * MHZ);
        TEST_ASSERT_EQUAL_UINT32(1000000, achieved.bitrate_hz);
        TEST_ASSERT_EQUAL_UINT16(625, achieved.sample_point_permille);
    }
}

TEST(test_solve_usual_stm32_clocks_cannot_reach_the_sample_point) {
    static const struct {
        uint32_t clock_MHz;
        uint16_t nearest_permille;
    } clocks[] = {{36, 611}, {42, 619}, {45, 600}, {54, 611}};
    for (size_t i = 0; i < sizeof clocks / sizeof clocks[0]; i++) {
        const iw_bit_timing_achieved_t achieved = solved(clocks[i].clock_MHz * MHZ);
        TEST_ASSERT_EQUAL_UINT32(1000000, achieved.bitrate_hz);
        TEST_ASSERT_EQUAL_UINT16(clocks[i].nearest_permille, achieved.sample_point_permille);
    }
}

TEST(test_solve_f103_with_32_MHz_selects_sixteen_quanta) {
    iw_bit_timing_t timing;
    TEST_ASSERT_EQUAL_INT(IW_OK, iw_bit_timing_solve(&limits, 32 * MHZ, &bus, &timing));
    TEST_ASSERT_EQUAL_UINT16(2, timing.prescaler);
    TEST_ASSERT_EQUAL_UINT16(9, timing.tseg1);
    TEST_ASSERT_EQUAL_UINT16(6, timing.tseg2);
}

TEST(test_solve_equally_near_sample_points_selects_the_later) {
    static const iw_bit_timing_achieved_t wanted = {1000000, 650};
    iw_bit_timing_t timing;
    limits.prescaler_max = 1;
    TEST_ASSERT_EQUAL_INT(IW_OK, iw_bit_timing_solve(&limits, 10 * MHZ, &wanted, &timing));
    TEST_ASSERT_EQUAL_UINT16(700, iw_bit_timing_achieved(10 * MHZ, &timing).sample_point_permille);
}

TEST(test_solve_never_leaves_the_first_segment_empty) {
    iw_bit_timing_t timing;
    limits.tseg1_min = 0;
    TEST_ASSERT_EQUAL_INT(IW_ERR_RANGE, iw_bit_timing_solve(&limits, 2 * MHZ, &bus, &timing));
    TEST_ASSERT_EQUAL_INT(IW_OK, iw_bit_timing_solve(&limits, 3 * MHZ, &bus, &timing));
    TEST_ASSERT_EQUAL_UINT16(1, timing.tseg1);
}

TEST(test_solve_zero_argument_is_refused_output_unchanged) {
    static const iw_bit_timing_achieved_t no_rate = {0, 625};
    static const iw_bit_timing_achieved_t no_point = {1000000, 0};
    iw_bit_timing_t timing = {11, 22, 33};
    TEST_ASSERT_EQUAL_INT(IW_ERR_RANGE, iw_bit_timing_solve(&limits, 0, &bus, &timing));
    TEST_ASSERT_EQUAL_INT(IW_ERR_RANGE, iw_bit_timing_solve(&limits, 32 * MHZ, &no_rate, &timing));
    TEST_ASSERT_EQUAL_INT(IW_ERR_RANGE, iw_bit_timing_solve(&limits, 32 * MHZ, &no_point, &timing));
    limits.prescaler_max = 0;
    TEST_ASSERT_EQUAL_INT(IW_ERR_RANGE, iw_bit_timing_solve(&limits, 32 * MHZ, &bus, &timing));
    TEST_ASSERT_EQUAL_UINT16(11, timing.prescaler);
    TEST_ASSERT_EQUAL_UINT16(22, timing.tseg1);
    TEST_ASSERT_EQUAL_UINT16(33, timing.tseg2);
}

TEST(test_solve_largest_numbers_do_not_overflow) {
    static const iw_bit_timing_achieved_t wanted = {1, 1};
    limits = (iw_bit_timing_limits_t){65535, 65535, 65535, 65533, 65535};
    iw_bit_timing_t timing = {0, 0, 0};
    TEST_ASSERT_EQUAL_INT(IW_ERR_RANGE, iw_bit_timing_solve(&limits, UINT32_MAX, &wanted, &timing));
    TEST_ASSERT_EQUAL_INT(IW_OK, iw_bit_timing_solve(&limits, 131070U * 32768U - 32768U, &wanted, &timing));
    TEST_ASSERT_EQUAL_UINT16(32768, timing.prescaler);
    TEST_ASSERT_EQUAL_UINT16(65533, timing.tseg2);
}

TEST(test_achieved_rounds_to_the_nearest) {
    static const struct {
        uint32_t clock_hz;
        iw_bit_timing_t timing;
        iw_bit_timing_achieved_t achieved;
    } cases[] = {
        {32 * MHZ, {4, 4, 3}, {1000000, 625}},
        {36 * MHZ, {2, 10, 7}, {1000000, 611}},              // 611.1
        {42 * MHZ, {2, 12, 8}, {1000000, 619}},              // 619.05
        {12 * MHZ, {1, 7, 4}, {1000000, 667}},               // 666.7
        {8 * MHZ, {1, 1, 1}, {2666667, 667}},                // 2 666 666.7
        {10 * MHZ, {3, 1, 1}, {1111111, 667}},               // 1 111 111.1
        {UINT32_MAX, {1, 0, 0}, {UINT32_MAX, 1000}},         // One quantum
        {UINT32_MAX, {1, 1, 0}, {UINT32_MAX / 2 + 1, 1000}}, // 2 147 483 647.5
        {UINT32_MAX, {65535, 65535, 0}, {1, 1000}},          // 1.00002
        {UINT32_MAX, {65535, 0, 65535}, {1, 0}},             // 0.015 permille
        {UINT32_MAX, {65535, 65535, 1}, {1, 1000}},          // Longest possible bit
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        const iw_bit_timing_achieved_t achieved = iw_bit_timing_achieved(cases[i].clock_hz, &cases[i].timing);
        TEST_ASSERT_EQUAL_UINT32(cases[i].achieved.bitrate_hz, achieved.bitrate_hz);
        TEST_ASSERT_EQUAL_UINT16(cases[i].achieved.sample_point_permille, achieved.sample_point_permille);
    }
}

TEST(test_achieved_every_bxcan_setting_is_within_half_a_unit) {
    for (uint16_t prescaler = 1; prescaler <= 64; prescaler++) {
        for (uint16_t tseg1 = 1; tseg1 <= 16; tseg1++) {
            for (uint16_t tseg2 = 1; tseg2 <= 8; tseg2++) {
                const iw_bit_timing_t timing = {prescaler, tseg1, tseg2};
                const iw_bit_timing_achieved_t achieved = iw_bit_timing_achieved(45 * MHZ, &timing);
                const int64_t quanta = 1 + tseg1 + tseg2;
                const int64_t rate_error = achieved.bitrate_hz * quanta * prescaler - (int64_t)45 * MHZ;
                const int64_t point_error = achieved.sample_point_permille * quanta - 1000 * (1 + tseg1);
                TEST_ASSERT_TRUE(2 * rate_error <= quanta * prescaler && -2 * rate_error <= quanta * prescaler);
                TEST_ASSERT_TRUE(2 * point_error <= quanta && -2 * point_error <= quanta);
            }
        }
    }
}

TEST(test_achieved_slower_than_any_number_is_zeros) {
    const iw_bit_timing_t timing = {65535, 65535, 65535};
    const iw_bit_timing_achieved_t achieved = iw_bit_timing_achieved(32 * MHZ, &timing);
    TEST_ASSERT_EQUAL_UINT32(0, achieved.bitrate_hz);
    TEST_ASSERT_EQUAL_UINT16(0, achieved.sample_point_permille);
}

TEST(test_achieved_prescaler_zero_is_zeros) {
    const iw_bit_timing_t timing = {0, 4, 3};
    const iw_bit_timing_achieved_t achieved = iw_bit_timing_achieved(32 * MHZ, &timing);
    TEST_ASSERT_EQUAL_UINT32(0, achieved.bitrate_hz);
    TEST_ASSERT_EQUAL_UINT16(0, achieved.sample_point_permille);
}
