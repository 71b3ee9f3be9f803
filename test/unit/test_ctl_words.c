// SPDX-License-Identifier: MIT
// Durations and suggestions for mistyped words, as all verbs parse them.
#include "config/similar.h"
#include "text/duration.h"

#include "unit.h"

#include <stdio.h>

TEST(test_duration_in_every_unit_with_decimals_is_read) {
    static const struct {
        const char *text;
        int64_t us;
    } cases[] = {
        {"500ms", 500000},     {"2s", 2000000}, {"1.5s", 1500000}, {"2min", 120000000}, {"1h", 3600000000},
        {"0.25min", 15000000}, {"0.5ms", 500},  {"0s", 0},         {"1.125s", 1125000}, {"999999h", 3599996400000000},
        {"007s", 7000000}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        int64_t us = -1;
        TEST_ASSERT_TRUE_MESSAGE(duration_parse(cases[i].text, &us), cases[i].text);
        TEST_ASSERT_EQUAL_INT64_MESSAGE(cases[i].us, us, cases[i].text);
    }
}

TEST(test_duration_invalid_is_refused_output_unchanged) {
    static const char *const cases[] = {"",        "2",    "s",        "2 s", "-1s",  "+1s", "1.s",
                                        "1.2345s", ".5s",  "1,5s",     "2m",  "2sec", "2S",  "1.5.2s",
                                        "1e3s",    "0x1s", "1234567s", "2s ", " 2s",  "infs"};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        int64_t us = 77;
        TEST_ASSERT_FALSE_MESSAGE(duration_parse(cases[i], &us), cases[i]);
        TEST_ASSERT_EQUAL_INT64(77, us);
    }
}

TEST(test_duration_option_out_of_range_prints_the_range) {
    static const duration_range_t range = {20000, 600000000};
    char why[DURATION_WHY_SIZE];
    int64_t us = 77;
    TEST_ASSERT_TRUE(duration_option("--for", "10min", range, &us, why));
    TEST_ASSERT_EQUAL_INT64(600000000, us);
    TEST_ASSERT_TRUE(duration_option("--for", "20ms", range, &us, why));
    TEST_ASSERT_FALSE(duration_option("--for", "19ms", range, &us, why));
    TEST_ASSERT_EQUAL_STRING("--for 19ms is out of range; write 20ms to 10min", why);
    TEST_ASSERT_FALSE(duration_option("--for", "600001ms", range, &us, why));
    TEST_ASSERT_FALSE(duration_option("--for", NULL, range, &us, why));
    TEST_ASSERT_EQUAL_STRING("--for needs a time with its unit, such as 500ms, 1.5s, 2min or 1h, not \"\"", why);
    TEST_ASSERT_EQUAL_INT64(20000, us);
}

TEST(test_duration_option_without_unit_prints_the_correct_form) {
    static const duration_range_t range = {20000, 600000000};
    static const struct {
        const char *text;
        const char *meant;
    } cases[] = {{"2", "; write: --for 2s"},
                 {"0.5", "; write: --for 0.5s"},
                 {"2m", "; write: --for 2min"},
                 {"700", ""},
                 {"20m", ""},
                 {"0", ""},
                 {"", ""},
                 {"2x", ""},
                 {"m", ""},
                 {"1.2345", ""},
                 {"-1", ""}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        char why[DURATION_WHY_SIZE];
        char wanted[DURATION_WHY_SIZE];
        int64_t us = 77;
        (void)snprintf(wanted, sizeof wanted,
                       "--for needs a time with its unit, such as " DURATION_FORM ", not \"%s\"%s", cases[i].text,
                       cases[i].meant);
        TEST_ASSERT_FALSE(duration_option("--for", cases[i].text, range, &us, why));
        TEST_ASSERT_EQUAL_STRING(wanted, why);
        TEST_ASSERT_EQUAL_INT64(77, us);
    }
}

TEST(test_word_distance_is_small_only_for_similar_words) {
    TEST_ASSERT_EQUAL_size_t(0, settings_word_distance("stat", "status"));
    TEST_ASSERT_EQUAL_size_t(1, settings_word_distance("staus", "status"));
    TEST_ASSERT_EQUAL_size_t(2, settings_word_distance("hlep", "help"));
    TEST_ASSERT_EQUAL_size_t(3, settings_word_distance("priod_m", "period_msx"));
    TEST_ASSERT_EQUAL_size_t(SETTINGS_WORD_STRANGE, settings_word_distance("xyz", "top"));
    TEST_ASSERT_EQUAL_size_t(SETTINGS_WORD_STRANGE, settings_word_distance("st", "status"));
    TEST_ASSERT_EQUAL_size_t(SETTINGS_WORD_STRANGE, settings_word_distance("", "top"));
    TEST_ASSERT_EQUAL_size_t(SETTINGS_WORD_STRANGE,
                             settings_word_distance("period_msperiod_msperiod_msperiod_msperiod_ms", "period_ms"));
}
