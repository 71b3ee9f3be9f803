// SPDX-License-Identifier: MIT
#include "wheels/wheels.h"

#include "unit.h"
#include <string.h>

static gw_gaps_t gaps;
static iw_sent_t sent;

void setUp(void) {
    memset(&gaps, 0, sizeof gaps);
    memset(&sent, 0, sizeof sent);
}

static void pair_after(uint32_t gap_us) {
    sent.pairs++;
    sent.gap_us = gap_us;
    gw_gaps_note(&gaps, &sent);
}

TEST(test_gaps_first_pair_after_silence_is_not_counted) {
    pair_after(0U);
    TEST_ASSERT_EACH_EQUAL_UINT32(0U, gaps.count, GW_GAP_BUCKETS);
    TEST_ASSERT_EQUAL_UINT32(0U, gaps.worst_us);
}

TEST(test_gaps_step_without_a_pair_is_not_counted) {
    pair_after(20000U);
    gw_gaps_note(&gaps, &sent);
    gw_gaps_note(&gaps, &sent);
    TEST_ASSERT_EQUAL_UINT32(1U, gaps.count[3]);
}

TEST(test_gaps_are_counted_in_the_bucket_up_to_its_limit) {
    pair_after(1U);
    pair_after(5000U);
    pair_after(5001U);
    pair_after(100000U);
    pair_after(100001U);
    TEST_ASSERT_EQUAL_UINT32(2U, gaps.count[0]);
    TEST_ASSERT_EQUAL_UINT32(1U, gaps.count[1]);
    TEST_ASSERT_EQUAL_UINT32(1U, gaps.count[GW_GAP_BUCKETS - 2U]);
    TEST_ASSERT_EQUAL_UINT32(1U, gaps.count[GW_GAP_BUCKETS - 1U]);
}

TEST(test_gaps_worst_is_retained_over_silence) {
    pair_after(61000U);
    pair_after(0U);
    pair_after(20000U);
    TEST_ASSERT_EQUAL_UINT32(61000U, gaps.worst_us);
}

TEST(test_gaps_are_written_as_limits_counts_and_worst) {
    char line[256];
    iwn_out_t json;
    iwn_out_init(&json, line, sizeof line);
    iwn_out_open(&json, NULL, '{');
    pair_after(20000U);
    gw_gaps_write(&gaps, &json);
    iwn_out_close(&json, '}');
    (void)iwn_out_finish(&json);
    TEST_ASSERT_NOT_NULL(strstr(line, "\"limits_ms\":[5,10,15,20,25,30,40,50,100],\"count\":[0,0,0,1,0,0,0,0,0,0],"
                                      "\"worst_us\":20000"));
}
