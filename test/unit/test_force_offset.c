// SPDX-License-Identifier: MIT
// Force offset: which offset is in force, its provenance, and the validity of the net force.
#include "force_rig.h"
#include "unit.h"

static void assert_offset(iw_offset_provenance_t provenance, int32_t offset_mN) {
    TEST_ASSERT_EQUAL_INT(provenance, rig.force.provenance);
    TEST_ASSERT_EQUAL_INT32(offset_mN, rig.force.offset_mN);
}

TEST(test_force_late_join_uses_the_offset_of_the_wheel) {
    force_rig_hear(&rig, 1000, true);
    force_rig_offset(&rig, 100);
    assert_offset(IW_OFFSET_WHEEL, 10000);
    TEST_ASSERT_EQUAL_UINT64(rig.now_us, rig.force.offset_us);
    TEST_ASSERT_EQUAL_INT(IW_FORCE_VALID, force_rig_validity(&rig));
}

TEST(test_force_late_join_without_offset_frames_uses_an_estimate) {
    force_rig_quiet(&rig, 400, 500);
    assert_offset(IW_OFFSET_ESTIMATED, 5000);
    TEST_ASSERT_EQUAL_INT(IW_FORCE_VALID, force_rig_validity(&rig));
}

TEST(test_force_offset_of_the_wheel_replaces_the_estimate) {
    force_rig_quiet(&rig, 40, 1010);
    assert_offset(IW_OFFSET_ESTIMATED, 10100);
    force_rig_offset(&rig, 100);
    assert_offset(IW_OFFSET_WHEEL, 10000);
    force_rig_offset(&rig, 101);
    assert_offset(IW_OFFSET_WHEEL, 10100);
}

TEST(test_force_estimate_does_not_replace_offset_of_the_wheel) {
    force_rig_offset(&rig, 100);
    force_rig_quiet(&rig, 40, 1010);
    assert_offset(IW_OFFSET_WHEEL, 10000);
    TEST_ASSERT_EQUAL_INT32(10100, rig.force.quality.mean_mN);
}

TEST(test_force_offset_of_a_loaded_start_is_never_used) {
    force_rig_begin(&rig, IW_LEFT, true);
    force_rig_quiet(&rig, 20, 100);
    force_rig_offset(&rig, 100);
    assert_offset(IW_OFFSET_NONE, 0);
    force_rig_quiet(&rig, 20, 9000);
    assert_offset(IW_OFFSET_NONE, 0);
    for (uint32_t n = 0; n < 60; n++) {
        force_rig_quiet(&rig, 20, 100);
        force_rig_offset(&rig, 100);
        assert_offset(IW_OFFSET_NONE, 0);
    }
    TEST_ASSERT_EQUAL_INT(IW_FORCE_NO_OFFSET, force_rig_validity(&rig));
}

TEST(test_force_offset_of_a_good_start_is_used_after_the_window) {
    force_rig_begin(&rig, IW_LEFT, true);
    force_rig_quiet(&rig, 39, 1000);
    force_rig_offset(&rig, 100);
    assert_offset(IW_OFFSET_NONE, 0);
    force_rig_quiet(&rig, 1, 1000);
    assert_offset(IW_OFFSET_WHEEL, 10000);
}

TEST(test_force_restore_does_not_replace_an_offset_of_this_run) {
    iw_force_restore(&rig.force, IW_OFFSET_STORED, -1234);
    assert_offset(IW_OFFSET_STORED, -1234);
    TEST_ASSERT_EQUAL_UINT64(IW_NEVER, rig.force.offset_us);
    iw_force_restore(&rig.force, IW_OFFSET_STORED, 77);
    assert_offset(IW_OFFSET_STORED, 77);
    force_rig_hear(&rig, 0, true);
    TEST_ASSERT_EQUAL_INT(IW_FORCE_VALID, force_rig_validity(&rig));
    force_rig_offset(&rig, 1);
    iw_force_restore(&rig.force, IW_OFFSET_STORED, 5);
    assert_offset(IW_OFFSET_WHEEL, 100);
    setUp();
    force_rig_quiet(&rig, 40, 10);
    iw_force_restore(&rig.force, IW_OFFSET_STORED, 5);
    assert_offset(IW_OFFSET_ESTIMATED, 100);
    TEST_ASSERT_EQUAL_INT(IW_TARE_OK, force_rig_tare(&rig));
    iw_force_restore(&rig.force, IW_OFFSET_STORED, 5);
    assert_offset(IW_OFFSET_OPERATOR, 100);
}

TEST(test_force_unseen_wheel_offset_is_doubted_beyond_5_N) {
    for (int order = 0; order < 2; order++) { // The stored offset comes first or last.
        for (int32_t stored_mN = -1; stored_mN <= 0; stored_mN++) {
            setUp();
            force_rig_hear(&rig, 0, true);
            if (order == 1) {
                force_rig_offset(&rig, 50);
                assert_offset(IW_OFFSET_WHEEL, 5000);
            }
            iw_force_restore(&rig.force, IW_OFFSET_STORED, stored_mN);
            TEST_ASSERT_EQUAL_UINT64(IW_NEVER, rig.force.offset_us);
            if (order == 0) {
                force_rig_offset(&rig, 50);
            }
            const bool near = stored_mN == 0;
            assert_offset(near ? IW_OFFSET_WHEEL : IW_OFFSET_STORED, near ? 5000 : stored_mN);
            TEST_ASSERT_EQUAL_INT(near ? IW_FORCE_VALID : IW_FORCE_OFFSET_DOUBTED, force_rig_validity(&rig));
        }
    }
}

/// The wrong unit explains the difference.
TEST(test_force_doubted_offset_does_not_hide_a_contradicted_unit) {
    iw_force_restore(&rig.force, IW_OFFSET_STORED, 1000);
    force_rig_quiet(&rig, 40, 100);
    force_rig_offset(&rig, 100);
    assert_offset(IW_OFFSET_WHEEL, 10000);
    TEST_ASSERT_EQUAL_INT(IW_FORCE_UNIT_CONTRADICTED, force_rig_validity(&rig));
}

TEST(test_force_seen_wheel_offset_is_not_replaced_by_a_stored_one) {
    force_rig_quiet(&rig, 40, 510);
    iw_force_reopen(&rig.force, true);
    force_rig_quiet(&rig, 40, 510);
    force_rig_offset(&rig, 51);
    assert_offset(IW_OFFSET_WHEEL, 5100);
    iw_force_restore(&rig.force, IW_OFFSET_STORED, 90000);
    assert_offset(IW_OFFSET_WHEEL, 5100);
}

TEST(test_force_restored_tare_is_replaced_by_the_next_tare_only) {
    iw_force_restore(&rig.force, IW_OFFSET_OPERATOR, 5000);
    assert_offset(IW_OFFSET_OPERATOR, 5000);
    TEST_ASSERT_EQUAL_UINT64(IW_NEVER, rig.force.offset_us);
    force_rig_quiet(&rig, 40, 600);
    force_rig_offset(&rig, 60);
    iw_force_reopen(&rig.force, true);
    force_rig_quiet(&rig, 40, 600);
    assert_offset(IW_OFFSET_OPERATOR, 5000);
    TEST_ASSERT_EQUAL_INT(IW_TARE_OK, force_rig_tare(&rig));
    assert_offset(IW_OFFSET_OPERATOR, 6000);
    iw_force_restore(&rig.force, IW_OFFSET_OPERATOR, 5000);
    assert_offset(IW_OFFSET_OPERATOR, 6000);
}

TEST(test_force_restored_tare_replaces_the_offset_of_the_wheel) {
    force_rig_offset(&rig, 60);
    iw_force_restore(&rig.force, IW_OFFSET_OPERATOR, 5000);
    assert_offset(IW_OFFSET_OPERATOR, 5000);
}

TEST(test_force_reboot_makes_offsets_stored_except_the_operators) {
    force_rig_quiet(&rig, 40, 10);
    iw_force_reopen(&rig.force, true);
    assert_offset(IW_OFFSET_STORED, 100);
    setUp();
    force_rig_offset(&rig, 50);
    iw_force_reopen(&rig.force, true);
    assert_offset(IW_OFFSET_STORED, 5000);
    TEST_ASSERT_TRUE(rig.force.offset_us != IW_NEVER);
    iw_force_restore(&rig.force, IW_OFFSET_STORED, 5000);
    TEST_ASSERT_EQUAL_UINT64(IW_NEVER, rig.force.offset_us);
    force_rig_quiet(&rig, 40, 510);
    assert_offset(IW_OFFSET_ESTIMATED, 5100);
    TEST_ASSERT_EQUAL_INT(IW_TARE_OK, force_rig_tare(&rig));
    iw_force_reopen(&rig.force, true);
    assert_offset(IW_OFFSET_OPERATOR, 5100);
    TEST_ASSERT_EQUAL_INT(IW_WINDOW_OPEN, rig.force.quality.window);
}

TEST(test_force_reboot_under_load_is_detected_by_operators_offset) {
    force_rig_quiet(&rig, 40, 10);
    TEST_ASSERT_EQUAL_INT(IW_TARE_OK, force_rig_tare(&rig));
    iw_force_reopen(&rig.force, true);
    force_rig_quiet(&rig, 40, 2020);
    TEST_ASSERT_EQUAL_INT(IW_WINDOW_LOADED, rig.force.quality.window);
    force_rig_offset(&rig, 202);
    assert_offset(IW_OFFSET_OPERATOR, 100);
}

TEST(test_force_reboot_resets_observation_and_offset_of_the_wheel) {
    force_rig_quiet(&rig, 40, 100);
    force_rig_offset(&rig, 100);
    TEST_ASSERT_EQUAL_INT(IW_UNIT_DN, rig.force.observation);
    TEST_ASSERT_EQUAL_INT32(1000, rig.force.observed_permille);
    iw_force_reopen(&rig.force, false);
    TEST_ASSERT_EQUAL_INT(IW_UNIT_UNKNOWN, rig.force.observation);
    TEST_ASSERT_EQUAL_INT32(0, rig.force.observed_permille);
    force_rig_quiet(&rig, 40, 900);
    TEST_ASSERT_EQUAL_INT(IW_UNIT_UNKNOWN, rig.force.observation);
    assert_offset(IW_OFFSET_STORED, 10000);
}

TEST(test_force_tare_uses_the_mean_of_the_last_two_seconds) {
    force_rig_quiet(&rig, 40, 0);
    force_rig_quiet(&rig, 39, 200);
    force_rig_quiet(&rig, 1, 240);
    TEST_ASSERT_EQUAL_INT(IW_TARE_OK, force_rig_tare(&rig));
    assert_offset(IW_OFFSET_OPERATOR, 2010);
    TEST_ASSERT_EQUAL_UINT64(rig.now_us, rig.force.offset_us);
}

TEST(test_force_tare_after_long_standstill_is_accepted) {
    for (uint32_t n = 0; n < 300; n++) {
        force_rig_quiet(&rig, 1, 100);
        TEST_ASSERT_EQUAL_INT((n < 39) ? IW_TARE_NO_FORCE : IW_TARE_OK, force_rig_tare(&rig));
    }
}

TEST(test_force_tare_is_not_replaced_by_offset_of_the_wheel) {
    force_rig_quiet(&rig, 40, 200);
    (void)force_rig_tare(&rig);
    force_rig_offset(&rig, 99);
    assert_offset(IW_OFFSET_OPERATOR, 2000);
}

static void assert_tare_refused(iw_tare_t expected) {
    const iw_force_t before = rig.force;
    TEST_ASSERT_EQUAL_INT(expected, force_rig_tare(&rig));
    TEST_ASSERT_EQUAL_MEMORY(&before, &rig.force, sizeof before);
}

TEST(test_force_tare_without_two_fresh_seconds_is_refused) {
    assert_tare_refused(IW_TARE_NO_FORCE);
    force_rig_quiet(&rig, 39, 100);
    assert_tare_refused(IW_TARE_NO_FORCE);
    force_rig_quiet(&rig, 1, 100);
    rig.now_us += MS(250);
    assert_tare_refused(IW_TARE_NO_FORCE);
    rig.now_us -= 1;
    TEST_ASSERT_EQUAL_INT(IW_TARE_OK, force_rig_tare(&rig));
    rig.now_us += MS(300);
    force_rig_quiet(&rig, 1, 100);
    assert_tare_refused(IW_TARE_NO_FORCE);
}

TEST(test_force_tare_with_unsuitable_window_is_refused) {
    force_rig_quiet(&rig, 40, 100);
    force_rig_hear(&rig, 100, false);
    force_rig_quiet(&rig, 39, 100);
    assert_tare_refused(IW_TARE_MOVING);
    force_rig_quiet(&rig, 1, 100);
    TEST_ASSERT_EQUAL_INT(IW_TARE_OK, force_rig_tare(&rig));
    force_rig_alternate(&rig, 0, 300);
    assert_tare_refused(IW_TARE_NOISY);
    force_rig_quiet(&rig, 20, 100);
    force_rig_quiet(&rig, 20, 220);
    assert_tare_refused(IW_TARE_NOISY);
    force_rig_quiet(&rig, 39, 100);
    force_rig_hear(&rig, 32767, true);
    assert_tare_refused(IW_TARE_SATURATED);
}

TEST(test_force_tare_under_load_is_refused) {
    force_rig_quiet(&rig, 40, 100);
    force_rig_quiet(&rig, 40, 2101);
    assert_tare_refused(IW_TARE_LOADED);
    force_rig_quiet(&rig, 40, -1901);
    assert_tare_refused(IW_TARE_LOADED);
    force_rig_quiet(&rig, 40, 2100);
    TEST_ASSERT_EQUAL_INT(IW_TARE_OK, force_rig_tare(&rig));
}

TEST(test_force_tare_without_an_offset_does_not_check_the_load) {
    force_rig_alternate(&rig, 0, 3000);
    force_rig_quiet(&rig, 40, 9000);
    TEST_ASSERT_EQUAL_INT(IW_OFFSET_NONE, rig.force.provenance);
    TEST_ASSERT_EQUAL_INT(IW_TARE_OK, force_rig_tare(&rig));
    assert_offset(IW_OFFSET_OPERATOR, 90000);
}

TEST(test_force_tare_replaces_a_doubted_offset) {
    force_rig_quiet(&rig, 40, 9000);
    force_rig_offset(&rig, 100);
    TEST_ASSERT_EQUAL_INT(IW_FORCE_OFFSET_DOUBTED, force_rig_validity(&rig));
    force_rig_quiet(&rig, 40, 1000);
    TEST_ASSERT_EQUAL_INT(IW_TARE_OK, force_rig_tare(&rig));
    TEST_ASSERT_EQUAL_INT(IW_FORCE_VALID, force_rig_validity(&rig));
}

TEST(test_force_tare_with_doubted_offset_does_not_check_the_load) {
    force_rig_quiet(&rig, 40, 9000);
    force_rig_offset(&rig, 100);
    force_rig_quiet(&rig, 40, 4000);
    TEST_ASSERT_EQUAL_INT(IW_FORCE_OFFSET_DOUBTED, force_rig_validity(&rig));
    TEST_ASSERT_EQUAL_INT(IW_TARE_OK, force_rig_tare(&rig));
    assert_offset(IW_OFFSET_OPERATOR, 40000);
}

TEST(test_force_tare_with_1_mN_beyond_20_N_is_a_load) {
    iw_force_restore(&rig.force, IW_OFFSET_STORED, -1);
    force_rig_quiet(&rig, 40, 2000);
    TEST_ASSERT_EQUAL_INT(IW_TARE_LOADED, force_rig_tare(&rig));
    iw_force_restore(&rig.force, IW_OFFSET_STORED, 0);
    TEST_ASSERT_EQUAL_INT(IW_TARE_OK, force_rig_tare(&rig));
}

TEST(test_force_contradicted_unit_is_invalid_and_never_rescaled) {
    for (int side = 0; side < IW_SIDES; side++) {
        const int16_t wrong = (side == IW_LEFT) ? 100 : 1000;
        const int16_t right = (side == IW_LEFT) ? 1000 : 100;
        force_rig_begin(&rig, (iw_side_t)side, false);
        force_rig_quiet(&rig, 40, wrong);
        force_rig_offset(&rig, 100);
        TEST_ASSERT_EQUAL_INT(IW_FORCE_UNIT_CONTRADICTED, force_rig_validity(&rig));
        TEST_ASSERT_EQUAL_INT32((side == IW_LEFT) ? 1000 : 100000, iw_force_raw_mN(&rig.force));
        TEST_ASSERT_EQUAL_INT(IW_FORCE_UNIT_CONTRADICTED, force_rig_validity(&rig));
        force_rig_begin(&rig, (iw_side_t)side, false);
        force_rig_quiet(&rig, 40, right);
        force_rig_offset(&rig, 100);
        TEST_ASSERT_EQUAL_INT(IW_FORCE_VALID, force_rig_validity(&rig));
    }
}

TEST(test_force_removed_offset_is_invalid) {
    force_rig_quiet(&rig, 40, 0);
    force_rig_offset(&rig, 100);
    TEST_ASSERT_EQUAL_INT(IW_FORCE_OFFSET_REMOVED, force_rig_validity(&rig));
}

TEST(test_force_removed_offset_is_valid_after_a_tare) {
    force_rig_quiet(&rig, 40, 0);
    force_rig_offset(&rig, 500);
    TEST_ASSERT_EQUAL_INT(IW_TARE_OK, iw_force_tare(&rig.force, rig.now_us));
    TEST_ASSERT_EQUAL_INT(IW_FORCE_VALID, force_rig_validity(&rig));
    TEST_ASSERT_EQUAL_INT32(0, iw_force_net_mN(&rig.force));
}

TEST(test_force_is_stale_after_five_periods) {
    force_rig_quiet(&rig, 40, 0);
    rig.now_us += MS(250) - 1U;
    TEST_ASSERT_EQUAL_INT(IW_FORCE_VALID, force_rig_validity(&rig));
    rig.now_us += 1;
    TEST_ASSERT_EQUAL_INT(IW_FORCE_NO_TELEMETRY, force_rig_validity(&rig));
}

TEST(test_force_is_invalid_only_during_saturated_samples) {
    force_rig_quiet(&rig, 40, 0);
    force_rig_hear(&rig, 32767, true);
    TEST_ASSERT_EQUAL_INT(IW_FORCE_SATURATED, force_rig_validity(&rig));
    force_rig_hear(&rig, -32768, true);
    TEST_ASSERT_EQUAL_INT(IW_FORCE_SATURATED, force_rig_validity(&rig));
    force_rig_hear(&rig, -32767, true);
    TEST_ASSERT_EQUAL_INT(IW_FORCE_VALID, force_rig_validity(&rig));
}

TEST(test_force_extremes_do_not_overflow) {
    force_rig_begin(&rig, IW_RIGHT, false);
    force_rig_offset(&rig, -32768);
    force_rig_hear(&rig, 32767, true);
    TEST_ASSERT_EQUAL_INT32(3276700, iw_force_raw_mN(&rig.force));
    TEST_ASSERT_EQUAL_INT32(6553500, iw_force_net_mN(&rig.force));
    force_rig_begin(&rig, IW_RIGHT, false);
    force_rig_offset(&rig, 32767);
    force_rig_hear(&rig, -32768, true);
    TEST_ASSERT_EQUAL_INT32(-6553500, iw_force_net_mN(&rig.force));
    force_rig_begin(&rig, IW_LEFT, false);
    force_rig_quiet(&rig, 40, -32767);
    force_rig_offset(&rig, -32768);
    TEST_ASSERT_EQUAL_INT(IW_UNIT_DN, rig.force.observation);
    force_rig_begin(&rig, IW_LEFT, false);
    force_rig_quiet(&rig, 40, 32766);
    force_rig_offset(&rig, -32768);
    TEST_ASSERT_EQUAL_INT(IW_UNIT_UNCLEAR, rig.force.observation);
}
