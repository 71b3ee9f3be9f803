// SPDX-License-Identifier: MIT
#include "test_sim_rig.h"

#include "message.h"
#include "unity.h"

#include <string.h>

sim_pair_config_t config;
sim_pair_t pair;
seen_t seen[2048];
static int16_t command_mm_s[IW_SIDES];
static bool driving;

void rig_init(void) {
    memset(&pair, 0xA5, sizeof pair);
    sim_pair_default(&config);
    sim_pair_init(&pair, &config, START_US, 1U);
    rig_forget();
    rig_let_go();
}

static void note(const sim_sent_t *sent) {
    seen_t *const of = &seen[sent->frame.id];
    uint32_t const gap_us = (uint32_t)(sent->due_us - of->last_us);
    if (of->count == 0U) {
        of->first_us = sent->due_us;
        of->shortest_us = UINT32_MAX;
    } else {
        of->shortest_us = (gap_us < of->shortest_us) ? gap_us : of->shortest_us;
        of->longest_us = (gap_us > of->longest_us) ? gap_us : of->longest_us;
    }
    of->count += 1U;
    of->last_us = sent->due_us;
    of->frame = sent->frame;
}

void rig_forget(void) {
    memset(seen, 0, sizeof seen);
}

static void take_until(iw_time_us_t until_us) {
    sim_sent_t sent;
    while (sim_pair_step(&pair, until_us, &sent)) {
        note(&sent);
        sim_pair_receive(&pair, sent.due_us, &sent.frame);
    }
}

void rig_run(iw_time_us_t from_us, iw_time_us_t until_us) {
    for (iw_time_us_t now_us = from_us; driving && now_us < until_us; now_us += 20U * MS) {
        take_until(now_us);
        for (unsigned side = 0U; side < IW_SIDES; side++) {
            iw_codec_setpoint_t const setpoint = {command_mm_s[side], 2000, 1U};
            iw_can_frame_t frame;
            (void)iw_codec_encode_setpoint((iw_side_t)side, &setpoint, IW_DLC_SETPOINT, &frame);
            sim_pair_receive(&pair, now_us, &frame);
        }
    }
    take_until(until_us);
}

void rig_drive(int16_t left_mm_s, int16_t right_mm_s) {
    driving = true;
    command_mm_s[IW_LEFT] = left_mm_s;
    command_mm_s[IW_RIGHT] = right_mm_s;
}

void rig_let_go(void) {
    driving = false;
}

message_t rig_last(uint32_t id) {
    message_t message;
    TEST_ASSERT_GREATER_THAN_UINT32(0U, seen[id].count);
    TEST_ASSERT_TRUE(message_decode(&seen[id].frame, &message));
    return message;
}
