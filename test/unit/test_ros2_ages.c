// SPDX-License-Identifier: MIT
// The age of a command or request from ROS: by the clock for writers of this machine, by earlier samples for other
// writers.
#include "ages.h"

#include "unit.h"

#include <string.h>

#define SECOND 1000000LL
#define WALL   (1700000000LL * SECOND)
#define EVERY  (SECOND / 20)
#define OTHER  (3600LL * SECOND) // The clock of the other machine is ahead by this time.

static ros_ages_t ages;
static int64_t mono_us;
static int64_t wall_us;
static int64_t age_us;

static ros_moment_t now(void) {
    return (ros_moment_t){mono_us, wall_us};
}

static void pass(int64_t for_us) {
    mono_us += for_us;
    wall_us += for_us;
}

static void begin(bool local, bool synchronised) {
    memset(&ages, 0xA5, sizeof ages);
    mono_us = 5 * SECOND;
    wall_us = WALL;
    ros_ages_init(&ages, local, synchronised, now());
}

void setUp(void) {
    begin(true, false);
}

/// A command of this writer that was sent `ago_us` ago by its clock.
static ros_age_t command_of(uint64_t source, int64_t ago_us) {
    return ros_ages_command(&ages, source, wall_us - ago_us, now(), &age_us);
}

static ros_age_t other(int64_t ago_us) {
    return command_of(9, ago_us - OTHER);
}

/// The writer of another machine sends for this time without delay; returns the verdict on the last sample.
static ros_age_t other_sends(int64_t for_us) {
    ros_age_t age = ROS_AGE_UNKNOWN;
    for (int64_t t = 0; t < for_us; t += EVERY) {
        pass(EVERY);
        age = other(1000);
    }
    return age;
}

// ---- this machine ---------------------------------------------------------------------------------------------------

TEST(test_ages_first_sample_of_a_minute_ago_is_late) {
    TEST_ASSERT_EQUAL_INT(ROS_AGE_LATE, command_of(7, 60 * SECOND));
    TEST_ASSERT_EQUAL_INT(ROS_AGE_LATE, ros_ages_request(&ages, wall_us - 60 * SECOND, now(), &age_us));
}

TEST(test_ages_first_sample_is_judged_to_the_microsecond) {
    TEST_ASSERT_EQUAL_INT(ROS_AGE_FRESH, command_of(1, ROS_OLD_US));
    TEST_ASSERT_EQUAL_INT64(ROS_OLD_US, age_us);
    TEST_ASSERT_EQUAL_INT(ROS_AGE_LATE, command_of(2, ROS_OLD_US + 1));
    TEST_ASSERT_EQUAL_INT(ROS_AGE_FRESH, command_of(3, -ROS_AHEAD_US));
    TEST_ASSERT_EQUAL_INT(ROS_AGE_AHEAD, command_of(4, -ROS_AHEAD_US - 1));
    TEST_ASSERT_EQUAL_INT(ROS_AGE_FRESH, ros_ages_request(&ages, wall_us - ROS_OLD_US, now(), &age_us));
    TEST_ASSERT_EQUAL_INT64(ROS_OLD_US, age_us);
    TEST_ASSERT_EQUAL_INT(ROS_AGE_LATE, ros_ages_request(&ages, wall_us - ROS_OLD_US - 1, now(), &age_us));
    TEST_ASSERT_EQUAL_INT(ROS_AGE_AHEAD, ros_ages_request(&ages, wall_us + ROS_AHEAD_US + 1, now(), &age_us));
}

TEST(test_ages_sample_without_a_time_is_late) {
    TEST_ASSERT_EQUAL_INT(ROS_AGE_LATE, ros_ages_command(&ages, 7, 0, now(), &age_us));
    TEST_ASSERT_EQUAL_INT(ROS_AGE_LATE, ros_ages_request(&ages, 0, now(), &age_us));
}

TEST(test_ages_overtaken_sample_is_refused) {
    TEST_ASSERT_EQUAL_INT(ROS_AGE_FRESH, command_of(7, 1000));
    TEST_ASSERT_EQUAL_INT(ROS_AGE_OVERTAKEN, command_of(7, 1001));
    TEST_ASSERT_EQUAL_INT(ROS_AGE_FRESH, command_of(7, 1000));
    TEST_ASSERT_EQUAL_INT(ROS_AGE_FRESH, command_of(8, 2000));
}

TEST(test_ages_stream_with_a_constant_delay_is_late) {
    for (unsigned i = 0; i < 100U; i++) {
        pass(EVERY);
        TEST_ASSERT_EQUAL_INT(ROS_AGE_LATE, command_of(7, ROS_OLD_US + EVERY));
    }
}

TEST(test_ages_clock_set_back_makes_no_old_sample_fresh) {
    TEST_ASSERT_EQUAL_INT(ROS_AGE_FRESH, command_of(7, 1000));
    const int64_t held_us = wall_us;
    pass(60 * SECOND);
    wall_us -= 60 * SECOND; // A sample that was sent a minute ago has the present time.
    TEST_ASSERT_EQUAL_INT(ROS_AGE_UNKNOWN, ros_ages_command(&ages, 8, held_us, now(), &age_us));
    TEST_ASSERT_EQUAL_INT(ROS_AGE_DOUBTED, ros_ages_request(&ages, held_us, now(), &age_us));
    pass(60 * SECOND + ROS_OLD_US - 1);
    TEST_ASSERT_EQUAL_INT(ROS_AGE_DOUBTED, ros_ages_request(&ages, wall_us, now(), &age_us));
    pass(1);
    TEST_ASSERT_EQUAL_INT(ROS_AGE_FRESH, ros_ages_request(&ages, wall_us, now(), &age_us));
    TEST_ASSERT_EQUAL_INT(ROS_AGE_FRESH, command_of(8, 0));
}

TEST(test_ages_clock_set_back_twice_is_doubted_until_the_last_end) {
    wall_us -= 60 * SECOND;
    (void)command_of(7, 0);
    wall_us -= SECOND;
    pass(60 * SECOND);
    TEST_ASSERT_EQUAL_INT(ROS_AGE_DOUBTED, ros_ages_request(&ages, wall_us, now(), &age_us));
    pass(SECOND + ROS_OLD_US);
    TEST_ASSERT_EQUAL_INT(ROS_AGE_FRESH, ros_ages_request(&ages, wall_us, now(), &age_us));
}

TEST(test_ages_after_a_clock_set_back_a_stream_is_known_again) {
    wall_us -= 60 * SECOND;
    ros_age_t age = ROS_AGE_FRESH;
    for (int64_t t = 0; t <= ROS_LEARN_US; t += EVERY) {
        TEST_ASSERT_EQUAL_INT((t < ROS_LEARN_US) ? ROS_AGE_UNKNOWN : ROS_AGE_FRESH, age = command_of(7, 1000));
        pass(EVERY);
    }
}

TEST(test_ages_clock_set_forward_makes_earlier_samples_late) {
    TEST_ASSERT_EQUAL_INT(ROS_AGE_FRESH, command_of(7, 0));
    const int64_t sent_us = wall_us;
    wall_us += 60 * SECOND;
    TEST_ASSERT_EQUAL_INT(ROS_AGE_LATE, ros_ages_command(&ages, 7, sent_us, now(), &age_us));
    TEST_ASSERT_EQUAL_INT(ROS_AGE_FRESH, command_of(7, 0));
}

TEST(test_ages_clock_that_is_slewed_is_not_doubted) {
    for (unsigned i = 0; i < 2000U; i++) {
        pass(EVERY);
        wall_us -= EVERY / 2000; // 500 ppm.
        TEST_ASSERT_EQUAL_INT(ROS_AGE_FRESH, command_of(7, 1000));
    }
}

// ---- other machines -------------------------------------------------------------------------------------------------

TEST(test_ages_other_writer_is_known_after_a_second) {
    begin(false, false);
    for (int64_t t = 0; t <= 3 * SECOND; t += EVERY) {
        TEST_ASSERT_EQUAL_INT((t < ROS_LEARN_US) ? ROS_AGE_UNKNOWN : ROS_AGE_FRESH, other(1000));
        pass(EVERY);
    }
}

TEST(test_ages_delayed_burst_does_not_make_a_writer_known) {
    for (unsigned count = 2; count <= 100U; count++) {
        begin(false, false);
        for (unsigned i = 0; i < count; i++) {
            TEST_ASSERT_EQUAL_INT(ROS_AGE_UNKNOWN, other(60 * SECOND - (int64_t)i * EVERY));
            pass(1000);
        }
        for (int64_t t = 0; t < ROS_LEARN_US; t += EVERY) { // The stream continues with the same delay.
            TEST_ASSERT_EQUAL_INT(ROS_AGE_UNKNOWN, other(60 * SECOND - (int64_t)count * EVERY));
            pass(EVERY);
        }
    }
}

TEST(test_ages_burst_after_a_gap_is_late_then_the_stream_is_fresh) {
    for (unsigned count = 2; count <= 100U; count++) {
        begin(false, false);
        TEST_ASSERT_EQUAL_INT(ROS_AGE_FRESH, other_sends(2 * SECOND));
        pass((int64_t)count * EVERY);
        for (unsigned i = 1; i <= count; i++) { // The last sample is as old as fresh ones are.
            const ros_age_t age = other((int64_t)(count - i) * EVERY + 1000);
            TEST_ASSERT_TRUE(age != ROS_AGE_FRESH || (age_us <= ROS_LATE_US && count <= 20U));
        }
        TEST_ASSERT_EQUAL_INT(ROS_AGE_FRESH, other_sends(ROS_LEARN_US + 4 * EVERY));
    }
}

TEST(test_ages_known_writer_passes_up_to_the_limit) {
    begin(false, false);
    TEST_ASSERT_EQUAL_INT(ROS_AGE_FRESH, other_sends(2 * SECOND));
    pass(300000);
    const int64_t least_us = ages.sources[0].least_us + 300000 / (1000000 / ROS_DRIFT_PPM);
    const int64_t sent_us = mono_us - least_us - ROS_LATE_US;
    ros_ages_t copy = ages;
    TEST_ASSERT_EQUAL_INT(ROS_AGE_FRESH, ros_ages_command(&copy, 9, sent_us, now(), &age_us));
    TEST_ASSERT_EQUAL_INT64(ROS_LATE_US, age_us);
    TEST_ASSERT_EQUAL_INT(ROS_AGE_LATE, ros_ages_command(&ages, 9, sent_us - 1, now(), &age_us));
}

TEST(test_ages_gap_by_either_clock_restarts_the_measurement) {
    begin(false, false);
    TEST_ASSERT_EQUAL_INT(ROS_AGE_FRESH, other_sends(2 * SECOND));
    pass(ROS_GAP_US);
    TEST_ASSERT_EQUAL_INT(ROS_AGE_FRESH, other(1000));
    pass(ROS_GAP_US + 1);
    TEST_ASSERT_EQUAL_INT(ROS_AGE_UNKNOWN, other(1000));
    TEST_ASSERT_EQUAL_INT(ROS_AGE_FRESH, other_sends(2 * SECOND));
    TEST_ASSERT_EQUAL_INT(ROS_AGE_UNKNOWN, other(1000 - ROS_GAP_US - 1));
    begin(false, false);
    TEST_ASSERT_EQUAL_INT(ROS_AGE_FRESH, other_sends(2 * SECOND));
    TEST_ASSERT_EQUAL_INT(ROS_AGE_UNKNOWN, other(2 * SECOND)); // The clock of the writer was set back.
}

TEST(test_ages_clock_off_by_12_percent_is_never_known) {
    static const int per_cent[] = {88, 112};
    for (unsigned i = 0; i < 2U; i++) {
        begin(false, false);
        for (int64_t t = 0; t < 60 * SECOND; t += EVERY) {
            TEST_ASSERT_EQUAL_INT(ROS_AGE_UNKNOWN, ros_ages_command(&ages, 9, t * per_cent[i] / 100, now(), &age_us));
            pass(EVERY);
        }
    }
}

TEST(test_ages_clock_drift_of_50_ppm_for_a_day_passes) {
    begin(false, false);
    for (int64_t t = 0; t < 86400 * SECOND; t += SECOND) {
        const ros_age_t age = ros_ages_command(&ages, 9, t - t / 20000, now(), &age_us); // 50 ppm slow.
        TEST_ASSERT_EQUAL_INT((t < 2 * SECOND) ? ROS_AGE_UNKNOWN : ROS_AGE_FRESH, age);
        pass(SECOND);
    }
}

TEST(test_ages_shorter_delay_becomes_the_reference) {
    begin(false, false);
    for (int64_t t = 0; t < 2 * SECOND; t += EVERY) {
        (void)other(90000);
        pass(EVERY);
    }
    TEST_ASSERT_EQUAL_INT(ROS_AGE_FRESH, other(1000));
    pass(300000);
    TEST_ASSERT_EQUAL_INT(ROS_AGE_LATE, other(1000 + ROS_LATE_US + 100));
}

TEST(test_ages_request_of_another_machine_needs_synchronised_time) {
    begin(false, false);
    TEST_ASSERT_EQUAL_INT(ROS_AGE_UNKNOWN, ros_ages_request(&ages, wall_us, now(), &age_us));
    begin(false, true);
    TEST_ASSERT_EQUAL_INT(ROS_AGE_FRESH, ros_ages_request(&ages, wall_us, now(), &age_us));
    TEST_ASSERT_EQUAL_INT(ROS_AGE_LATE, ros_ages_request(&ages, wall_us - ROS_OLD_US - 1, now(), &age_us));
}

TEST(test_ages_command_with_synchronised_clocks_needs_both) {
    begin(false, true);
    for (int64_t t = 0; t <= ROS_LEARN_US; t += EVERY) {
        TEST_ASSERT_EQUAL_INT((t < ROS_LEARN_US) ? ROS_AGE_UNKNOWN : ROS_AGE_FRESH, command_of(9, 1000));
        pass(EVERY);
    }
    begin(false, true);
    for (int64_t t = 0; t <= 2LL * ROS_LEARN_US; t += EVERY) {
        TEST_ASSERT_EQUAL_INT(ROS_AGE_LATE, command_of(9, SECOND));
        pass(EVERY);
    }
}

TEST(test_ages_new_writer_replaces_the_longest_idle_one) {
    begin(false, false);
    for (uint64_t source = 1; source <= ROS_SOURCES; source++) {
        for (int64_t t = 0; t <= ROS_LEARN_US; t += ROS_LEARN_US) {
            (void)command_of(source, 0);
            pass(((t == 0) ? ROS_LEARN_US : 0) + 1);
        }
    }
    pass(1000);
    TEST_ASSERT_EQUAL_UINT64(ROS_SOURCES, ages.sources[ROS_SOURCES - 1U].source);
    (void)command_of(1, 0);
    (void)command_of(ROS_SOURCES + 1U, 0); // The new source replaces source 2.
    TEST_ASSERT_EQUAL_UINT64(1, ages.sources[0].source);
    TEST_ASSERT_EQUAL_UINT64(ROS_SOURCES + 1U, ages.sources[1].source);
}
