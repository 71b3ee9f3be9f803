// SPDX-License-Identifier: MIT
// Window of two seconds for the estimate of the offset: what contaminates it, and what it shows about the unit.
#include "force_rig.h"
#include "unit.h"

static void assert_window(iw_window_t expected) {
    TEST_ASSERT_EQUAL_INT(expected, rig.force.quality.window);
    TEST_ASSERT_EQUAL_INT((expected == IW_WINDOW_GOOD) ? IW_OFFSET_ESTIMATED : IW_OFFSET_NONE, rig.force.provenance);
}

TEST(test_force_init_has_an_open_window_and_no_offset) {
    assert_window(IW_WINDOW_OPEN);
    TEST_ASSERT_EQUAL_INT(IW_FORCE_NO_TELEMETRY, force_rig_validity(&rig));
    TEST_ASSERT_EQUAL_INT32(0, rig.force.offset_mN);
    TEST_ASSERT_EQUAL_UINT64(IW_NEVER, rig.force.offset_us);
    TEST_ASSERT_EQUAL_INT(IW_UNIT_UNKNOWN, rig.force.observation);
}

TEST(test_force_quiet_window_estimates_offset_at_its_last_sample) {
    force_rig_quiet(&rig, 39, 1234);
    assert_window(IW_WINDOW_OPEN);
    TEST_ASSERT_EQUAL_INT(IW_FORCE_NO_OFFSET, force_rig_validity(&rig));
    force_rig_quiet(&rig, 1, 1234);
    assert_window(IW_WINDOW_GOOD);
    TEST_ASSERT_EQUAL_INT32(12340, rig.force.offset_mN);
    TEST_ASSERT_EQUAL_UINT64(rig.now_us, rig.force.offset_us);
    TEST_ASSERT_EQUAL_UINT8(40, rig.force.quality.samples);
    TEST_ASSERT_EQUAL_INT32(12340, rig.force.quality.mean_mN);
    TEST_ASSERT_EQUAL_UINT32(0, rig.force.quality.deviation_mN);
    TEST_ASSERT_EQUAL_INT32(0, rig.force.quality.drift_mN);
    TEST_ASSERT_EQUAL_INT(IW_FORCE_VALID, force_rig_validity(&rig));
    TEST_ASSERT_EQUAL_INT32(0, iw_force_net_mN(&rig.force));
}

TEST(test_force_measure_uses_the_requested_wheel) {
    force_rig_t other;
    force_rig_init(&other);
    force_rig_quiet(&other, 40, -77);
    force_rig_quiet(&rig, 40, 1234);
    for (unsigned i = 0; i < 2U; i++) {
        const iw_force_quality_t of_other = iw_force_measure(&other.force);
        const iw_force_quality_t of_this = iw_force_measure(&rig.force);
        TEST_ASSERT_EQUAL_INT32(-770, of_other.mean_mN);
        TEST_ASSERT_EQUAL_INT32(12340, of_this.mean_mN);
        TEST_ASSERT_EQUAL_UINT8(IW_FORCE_WINDOW_SAMPLES, of_this.samples);
        TEST_ASSERT_EQUAL_INT(IW_WINDOW_GOOD, of_this.window);
    }
}

TEST(test_force_units_are_per_side_as_documented_or_configured) {
    force_rig_begin(&rig, IW_RIGHT, false);
    force_rig_quiet(&rig, 40, -77);
    TEST_ASSERT_EQUAL_INT32(-7700, rig.force.offset_mN);
    force_rig_hear(&rig, 100, true);
    TEST_ASSERT_EQUAL_INT32(10000, iw_force_raw_mN(&rig.force));
    TEST_ASSERT_EQUAL_INT32(17700, iw_force_net_mN(&rig.force));
    rig.config.force_unit[IW_LEFT] = IW_FORCE_DN;
    rig.config.force_unit[IW_RIGHT] = IW_FORCE_CN;
    force_rig_begin(&rig, IW_RIGHT, false);
    force_rig_hear(&rig, 100, true);
    TEST_ASSERT_EQUAL_INT32(1000, iw_force_raw_mN(&rig.force));
    force_rig_begin(&rig, IW_LEFT, false);
    force_rig_hear(&rig, 100, true);
    TEST_ASSERT_EQUAL_INT32(10000, iw_force_raw_mN(&rig.force));
}

TEST(test_force_noise_up_to_1_N_is_quiet_and_more_is_noisy) {
    force_rig_alternate(&rig, 500, 700);
    assert_window(IW_WINDOW_GOOD);
    TEST_ASSERT_EQUAL_UINT32(1000, rig.force.quality.deviation_mN);
    TEST_ASSERT_EQUAL_INT32(6000, rig.force.offset_mN);
    force_rig_begin(&rig, IW_LEFT, false);
    force_rig_alternate(&rig, 500, 702);
    assert_window(IW_WINDOW_NOISY);
    TEST_ASSERT_EQUAL_UINT32(1010, rig.force.quality.deviation_mN);
    force_rig_begin(&rig, IW_RIGHT, false);
    force_rig_alternate(&rig, -10, 10);
    assert_window(IW_WINDOW_GOOD);
    TEST_ASSERT_EQUAL_UINT32(1000, rig.force.quality.deviation_mN);
    force_rig_begin(&rig, IW_RIGHT, false);
    force_rig_alternate(&rig, -11, 11);
    assert_window(IW_WINDOW_NOISY);
}

TEST(test_force_without_telemetry_is_invalid_at_time_zero) {
    TEST_ASSERT_EQUAL_INT(IW_FORCE_NO_TELEMETRY, iw_force_validity(&rig.force, 0));
    TEST_ASSERT_EQUAL_INT(IW_FORCE_NO_TELEMETRY, iw_force_validity(&rig.force, 1000));
}

/// 30 of 40 samples differ by 2 cN from the mean: the root of 3 cN2 is 17.3 mN.
TEST(test_force_deviation_has_a_resolution_of_1_mN) {
    for (uint32_t n = 0; n < 40; n++) {
        force_rig_hear(&rig, (int16_t)((n % 4U == 3U) ? 100 : ((n % 8U < 4U) == (n % 2U == 0U)) ? 102 : 98), true);
    }
    TEST_ASSERT_EQUAL_INT32(1000, rig.force.quality.mean_mN);
    TEST_ASSERT_EQUAL_UINT32(17, rig.force.quality.deviation_mN);
}

/// Adds pairs of samples this far above and below zero.
static void receive_pairs(uint32_t pairs, int16_t by) {
    for (uint32_t pair = 0; pair < pairs; pair++) {
        force_rig_hear(&rig, by, true);
        force_rig_hear(&rig, (int16_t)-by, true);
    }
}

TEST(test_force_large_deviation_is_exact) {
    force_rig_begin(&rig, IW_RIGHT, false);
    force_rig_alternate(&rig, 0, 800);
    TEST_ASSERT_EQUAL_UINT32(40000, rig.force.quality.deviation_mN);
}

TEST(test_force_deviation_is_finer_up_to_a_variance_of_400000) {
    receive_pairs(2, 2000);
    receive_pairs(18, 0);
    TEST_ASSERT_EQUAL_UINT32(6324, rig.force.quality.deviation_mN); // The root of 400 000 is 632.4.
    force_rig_begin(&rig, IW_LEFT, false);
    receive_pairs(2, 2000);
    receive_pairs(1, 2);
    receive_pairs(17, 1);
    TEST_ASSERT_EQUAL_UINT32(6320, rig.force.quality.deviation_mN); // 400 001
}

TEST(test_force_deviation_is_rounded_down) {
    force_rig_quiet(&rig, 39, 1);
    force_rig_quiet(&rig, 1, 0);
    TEST_ASSERT_EQUAL_UINT32(0, rig.force.quality.deviation_mN);
}

TEST(test_force_noise_1_mN_beyond_1_N_is_noisy) {
    receive_pairs(2, 102);
    receive_pairs(18, 100);
    TEST_ASSERT_EQUAL_UINT32(1001, rig.force.quality.deviation_mN);
    assert_window(IW_WINDOW_NOISY);
}

TEST(test_force_extreme_noise_does_not_overflow) {
    for (int side = 0; side < IW_SIDES; side++) {
        force_rig_begin(&rig, (iw_side_t)side, false);
        force_rig_alternate(&rig, 32766, -32767);
        assert_window(IW_WINDOW_NOISY);
        TEST_ASSERT_EQUAL_UINT32((side == IW_LEFT) ? 81910 : 819100, rig.force.quality.deviation_mN); // Limited
        force_rig_begin(&rig, (iw_side_t)side, false);
        force_rig_alternate(&rig, 0, 1400);
        assert_window(IW_WINDOW_NOISY);
        TEST_ASSERT_UINT32_WITHIN(100, (side == IW_LEFT) ? 7000 : 70000, rig.force.quality.deviation_mN);
    }
}

/// One value in the first second, another in the next one.
static void step_at_half(int16_t first, int16_t second) {
    force_rig_quiet(&rig, 20, first);
    force_rig_quiet(&rig, 20, second);
}

TEST(test_force_drift_up_to_1_N_is_quiet_and_more_is_drift) {
    step_at_half(1000, 1100);
    assert_window(IW_WINDOW_GOOD);
    TEST_ASSERT_EQUAL_INT32(1000, rig.force.quality.drift_mN);
    TEST_ASSERT_EQUAL_UINT32(500, rig.force.quality.deviation_mN); // From the mean of the full window
    force_rig_begin(&rig, IW_LEFT, false);
    step_at_half(1000, 1101);
    assert_window(IW_WINDOW_DRIFT);
    force_rig_begin(&rig, IW_LEFT, false);
    step_at_half(1000, 900);
    assert_window(IW_WINDOW_GOOD);
    force_rig_begin(&rig, IW_LEFT, false);
    step_at_half(1000, 899);
    assert_window(IW_WINDOW_DRIFT);
    TEST_ASSERT_EQUAL_INT32(-1010, rig.force.quality.drift_mN);
}

TEST(test_force_drift_1_mN_beyond_1_N_is_drift) {
    force_rig_quiet(&rig, 20, 0);
    force_rig_quiet(&rig, 18, 100);
    force_rig_quiet(&rig, 2, 101);
    TEST_ASSERT_EQUAL_INT32(1001, rig.force.quality.drift_mN);
    assert_window(IW_WINDOW_DRIFT);
}

TEST(test_force_motion_at_any_sample_contaminates_the_window) {
    static const uint32_t moments[] = {0, 1, 20, 38, 39};
    for (size_t i = 0; i < 5; i++) {
        force_rig_begin(&rig, IW_LEFT, false);
        for (uint32_t n = 0; n < 40; n++) {
            force_rig_hear(&rig, 100, n != moments[i]);
        }
        assert_window(IW_WINDOW_MOVING);
        TEST_ASSERT_EQUAL_INT(IW_FORCE_NO_OFFSET, force_rig_validity(&rig));
    }
}

TEST(test_force_saturated_sample_contaminates_the_window) {
    static const int16_t limits[] = {32767, -32768};
    for (size_t i = 0; i < 2; i++) {
        force_rig_begin(&rig, IW_LEFT, false);
        force_rig_quiet(&rig, 39, limits[i]);
        TEST_ASSERT_EQUAL_INT(IW_FORCE_SATURATED, force_rig_validity(&rig));
        force_rig_quiet(&rig, 1, limits[i]);
        assert_window(IW_WINDOW_SATURATED);
    }
    force_rig_begin(&rig, IW_RIGHT, false);
    force_rig_hear(&rig, 32767, false);
    force_rig_quiet(&rig, 39, 0);
    assert_window(IW_WINDOW_SATURATED);
    TEST_ASSERT_EQUAL_INT(IW_FORCE_NO_OFFSET, force_rig_validity(&rig));
}

TEST(test_force_5_N_from_a_stored_offset_is_a_load) {
    static const int32_t stored_mN[] = {-5000, 5000, -5001, 5001};
    for (size_t i = 0; i < 4; i++) {
        force_rig_begin(&rig, IW_LEFT, true);
        iw_force_restore(&rig.force, IW_OFFSET_STORED, stored_mN[i]);
        force_rig_quiet(&rig, 40, 0);
        const bool loaded = i >= 2;
        TEST_ASSERT_EQUAL_INT(loaded ? IW_WINDOW_LOADED : IW_WINDOW_GOOD, rig.force.quality.window);
        TEST_ASSERT_EQUAL_INT(loaded ? IW_OFFSET_STORED : IW_OFFSET_ESTIMATED, rig.force.provenance);
        TEST_ASSERT_EQUAL_INT32(loaded ? stored_mN[i] : 0, rig.force.offset_mN);
    }
}

TEST(test_force_estimate_of_an_unseen_start_leaves_a_stored_offset) {
    force_rig_begin(&rig, IW_LEFT, false);
    iw_force_restore(&rig.force, IW_OFFSET_STORED, 4000);
    force_rig_quiet(&rig, 40, 0);
    TEST_ASSERT_EQUAL_INT(IW_WINDOW_GOOD, rig.force.quality.window);
    TEST_ASSERT_EQUAL_INT(IW_OFFSET_STORED, rig.force.provenance);
    TEST_ASSERT_EQUAL_INT32(4000, rig.force.offset_mN);
    TEST_ASSERT_EQUAL_INT(IW_FORCE_VALID, force_rig_validity(&rig));
}

TEST(test_force_noise_far_from_a_stored_offset_is_noise) {
    iw_force_restore(&rig.force, IW_OFFSET_STORED, 90000);
    force_rig_alternate(&rig, 0, 2000);
    TEST_ASSERT_EQUAL_INT(IW_WINDOW_NOISY, rig.force.quality.window);
}

TEST(test_force_ring_counts_at_most_its_samples) {
    force_rig_quiet(&rig, 3U * IW_FORCE_WINDOW_SAMPLES, 100);
    TEST_ASSERT_EQUAL_UINT8(IW_FORCE_WINDOW_SAMPLES, rig.force.count);
    TEST_ASSERT_EQUAL_UINT8(IW_FORCE_WINDOW_SAMPLES, rig.force.still);
}

TEST(test_force_gap_restarts_the_window) {
    force_rig_quiet(&rig, 39, 100);
    rig.now_us += MS(200) - 1U;
    force_rig_hear(&rig, 100, true);
    assert_window(IW_WINDOW_GOOD);
    force_rig_begin(&rig, IW_LEFT, false);
    force_rig_quiet(&rig, 39, 30000);
    rig.now_us += MS(200);
    force_rig_hear(&rig, 100, true);
    assert_window(IW_WINDOW_OPEN);
    force_rig_quiet(&rig, 38, 100);
    assert_window(IW_WINDOW_OPEN);
    force_rig_quiet(&rig, 1, 100);
    assert_window(IW_WINDOW_GOOD);
    TEST_ASSERT_EQUAL_INT32(1000, rig.force.offset_mN);
}

TEST(test_force_contaminated_window_stays_until_a_reboot) {
    force_rig_alternate(&rig, 0, 30000);
    force_rig_quiet(&rig, 200, 100);
    assert_window(IW_WINDOW_NOISY);
    iw_force_reopen(&rig.force, true);
    assert_window(IW_WINDOW_OPEN);
    force_rig_quiet(&rig, 40, 100);
    assert_window(IW_WINDOW_GOOD);
}

TEST(test_force_estimate_is_made_once) {
    force_rig_quiet(&rig, 40, 100);
    const iw_time_us_t offset_us = rig.force.offset_us;
    force_rig_quiet(&rig, 100, 5000);
    TEST_ASSERT_EQUAL_INT32(1000, rig.force.offset_mN);
    TEST_ASSERT_EQUAL_UINT64(offset_us, rig.force.offset_us);
    TEST_ASSERT_EQUAL_INT32(49000, iw_force_net_mN(&rig.force));
}

static iw_unit_observation_t unit_of(iw_side_t side, int16_t raw, int16_t offset_dN) {
    force_rig_begin(&rig, side, false);
    force_rig_quiet(&rig, 40, raw);
    force_rig_offset(&rig, offset_dN);
    return rig.force.observation;
}

TEST(test_force_unit_follows_from_raw_over_offset) {
    static const int16_t offsets_dN[] = {20, 100, 1000, -20, -100, -1000};
    for (int side = 0; side < IW_SIDES; side++) {
        for (size_t i = 0; i < 6; i++) {
            const int16_t offset = offsets_dN[i];
            TEST_ASSERT_EQUAL_INT(IW_UNIT_CN, unit_of((iw_side_t)side, (int16_t)(10 * offset), offset));
            TEST_ASSERT_EQUAL_INT32(10000, rig.force.observed_permille);
            TEST_ASSERT_EQUAL_INT(IW_UNIT_CN, unit_of((iw_side_t)side, (int16_t)(9 * offset), offset));
            TEST_ASSERT_EQUAL_INT(IW_UNIT_CN, unit_of((iw_side_t)side, (int16_t)(11 * offset), offset));
            TEST_ASSERT_EQUAL_INT(IW_UNIT_DN, unit_of((iw_side_t)side, offset, offset));
            TEST_ASSERT_EQUAL_INT32(1000, rig.force.observed_permille);
            TEST_ASSERT_EQUAL_INT(IW_UNIT_OFFSET_REMOVED, unit_of((iw_side_t)side, 0, offset));
            TEST_ASSERT_EQUAL_INT(IW_UNIT_UNCLEAR, unit_of((iw_side_t)side, (int16_t)(4 * offset), offset));
            TEST_ASSERT_EQUAL_INT(IW_UNIT_UNCLEAR, unit_of((iw_side_t)side, (int16_t)(offset / 2), offset));
            TEST_ASSERT_EQUAL_INT(IW_UNIT_UNCLEAR, unit_of((iw_side_t)side, (int16_t)(-offset), offset));
            TEST_ASSERT_EQUAL_INT(IW_UNIT_UNCLEAR, unit_of((iw_side_t)side, (int16_t)(-10 * offset), offset));
            TEST_ASSERT_EQUAL_INT(IW_UNIT_UNCLEAR, unit_of((iw_side_t)side, (int16_t)(14 * offset), offset));
        }
    }
}

TEST(test_force_unit_observation_tolerates_15_percent) {
    TEST_ASSERT_EQUAL_INT(IW_UNIT_CN, unit_of(IW_LEFT, 8500, 1000));
    TEST_ASSERT_EQUAL_INT(IW_UNIT_UNCLEAR, unit_of(IW_LEFT, 8499, 1000));
    TEST_ASSERT_EQUAL_INT(IW_UNIT_CN, unit_of(IW_LEFT, 11500, 1000));
    TEST_ASSERT_EQUAL_INT(IW_UNIT_UNCLEAR, unit_of(IW_LEFT, 11501, 1000));
    TEST_ASSERT_EQUAL_INT(IW_UNIT_DN, unit_of(IW_LEFT, 850, 1000));
    TEST_ASSERT_EQUAL_INT(IW_UNIT_UNCLEAR, unit_of(IW_LEFT, 849, 1000));
    TEST_ASSERT_EQUAL_INT(IW_UNIT_DN, unit_of(IW_LEFT, 1150, 1000));
    TEST_ASSERT_EQUAL_INT(IW_UNIT_UNCLEAR, unit_of(IW_LEFT, 1151, 1000));
    TEST_ASSERT_EQUAL_INT(IW_UNIT_OFFSET_REMOVED, unit_of(IW_LEFT, 300, 1000));
    TEST_ASSERT_EQUAL_INT(IW_UNIT_OFFSET_REMOVED, unit_of(IW_LEFT, -300, 1000));
    TEST_ASSERT_EQUAL_INT(IW_UNIT_UNCLEAR, unit_of(IW_LEFT, 301, 1000));
    TEST_ASSERT_EQUAL_INT(IW_UNIT_UNCLEAR, unit_of(IW_LEFT, -301, 1000));
}

TEST(test_force_small_offset_is_unknown_unless_far_off) {
    TEST_ASSERT_EQUAL_INT(IW_UNIT_UNKNOWN, unit_of(IW_LEFT, 190, 19));
    TEST_ASSERT_EQUAL_INT(IW_UNIT_UNKNOWN, unit_of(IW_LEFT, 0, -19));
    TEST_ASSERT_EQUAL_INT(IW_UNIT_UNKNOWN, unit_of(IW_LEFT, 2000, 0));
    TEST_ASSERT_EQUAL_INT(IW_UNIT_UNKNOWN, unit_of(IW_LEFT, 2100, 10));
    TEST_ASSERT_EQUAL_INT(IW_UNIT_UNCLEAR, unit_of(IW_LEFT, 2101, 10));
    TEST_ASSERT_EQUAL_INT(IW_UNIT_UNCLEAR, unit_of(IW_LEFT, 2001, 0));
    TEST_ASSERT_EQUAL_INT(IW_UNIT_UNCLEAR, unit_of(IW_LEFT, -2001, 0));
    TEST_ASSERT_EQUAL_INT(IW_FORCE_OFFSET_DOUBTED, force_rig_validity(&rig));
}

TEST(test_force_small_offset_is_far_off_beyond_20_N) {
    force_rig_quiet(&rig, 36, 2000);
    force_rig_quiet(&rig, 4, 2001);
    TEST_ASSERT_EQUAL_INT32(20001, rig.force.quality.mean_mN);
    force_rig_offset(&rig, 0);
    TEST_ASSERT_EQUAL_INT(IW_UNIT_UNCLEAR, rig.force.observation);
}

TEST(test_force_unit_observation_requires_window_and_offset) {
    force_rig_offset(&rig, 100);
    TEST_ASSERT_EQUAL_INT(IW_UNIT_UNKNOWN, rig.force.observation);
    force_rig_quiet(&rig, 39, 1000);
    TEST_ASSERT_EQUAL_INT(IW_UNIT_UNKNOWN, rig.force.observation);
    force_rig_quiet(&rig, 1, 1000);
    TEST_ASSERT_EQUAL_INT(IW_UNIT_CN, rig.force.observation);
}

TEST(test_force_contaminated_window_has_no_unit_observation) {
    force_rig_alternate(&rig, 0, 2000);
    force_rig_offset(&rig, 100);
    TEST_ASSERT_EQUAL_INT(IW_UNIT_UNKNOWN, rig.force.observation);
}
