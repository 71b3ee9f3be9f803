// SPDX-License-Identifier: MIT
#include "wheels/tape.h"

#include "unit.h"
#include <stdlib.h>

static blackbox_ring_t *ring;
static gw_tape_t tape;
static iw_hal_t hal;
static blackbox_entry_t entries[8U * BLACKBOX_BLOCK];
static size_t count;

// Port with results that the test sets.
static int send_answer, estop_answer, waiting;
static iw_bus_state_t bus_answer;

static int answer_send(void *context, const iw_can_frame_t *frames, uint32_t frame_count) {
    (void)context;
    (void)frames;
    (void)frame_count;
    return send_answer;
}

static int answer_receive(void *context, iw_can_frame_t *out_frame) {
    (void)context;
    *out_frame = (iw_can_frame_t){.id = 256, .dlc = 4, .data = {(uint8_t)waiting}};
    return (waiting > 0) ? waiting-- : 0;
}

static iw_bus_state_t answer_bus_state(void *context) {
    (void)context;
    return bus_answer;
}

static int answer_purge(void *context) {
    (void)context;
    return 1;
}

static int answer_estop(void *context) {
    (void)context;
    return estop_answer;
}

static const iw_hal_t port = {.send = answer_send,
                              .receive = answer_receive,
                              .bus_state = answer_bus_state,
                              .purge = answer_purge,
                              .estop_pressed = answer_estop};

void setUp(void) {
    ring = (blackbox_ring_t *)malloc(blackbox_ring_size(0));
    TEST_ASSERT_NOT_NULL(ring);
    blackbox_ring_init(ring, 0);
    gw_tape_init(&tape, ring);
    hal = gw_tape_hal(&tape, &port);
    send_answer = 1;
    estop_answer = 0;
    bus_answer = IW_BUS_ACTIVE;
    waiting = 0;
}

void tearDown(void) {
    free(ring);
}

static void step(iw_time_us_t now_us) {
    iw_can_frame_t frame;
    gw_tape_step_begin(&tape, now_us);
    (void)hal.estop_pressed(hal.context);
    (void)hal.bus_state(hal.context);
    while (hal.receive(hal.context, &frame) > 0) {
    }
    gw_tape_step_end(&tape);
}

static void read_ring(void) {
    (void)blackbox_ring_copy(ring, 0, UINT64_MAX, entries, &count);
}

static void expect_kinds(const uint8_t *kinds, size_t expected) {
    read_ring();
    TEST_ASSERT_EQUAL_size_t(expected, count);
    for (size_t i = 0; i < expected; i++) {
        TEST_ASSERT_EQUAL(kinds[i], entries[i].kind);
    }
}

TEST(test_tape_answers_are_recorded_first_and_on_change) {
    const uint8_t kinds[] = {BLACKBOX_ESTOP, BLACKBOX_BUS,  BLACKBOX_STEP, BLACKBOX_STEP,
                             BLACKBOX_ESTOP, BLACKBOX_STEP, BLACKBOX_BUS,  BLACKBOX_STEP};
    step(1);
    step(2);
    estop_answer = 1;
    step(3);
    bus_answer = IW_BUS_OFF;
    step(4);
    expect_kinds(kinds, sizeof kinds);
    TEST_ASSERT_EQUAL_INT64(1, entries[4].as.value);
    TEST_ASSERT_EQUAL(IW_BUS_OFF, entries[6].a);
    TEST_ASSERT_EQUAL_UINT64(4, entries[7].at_us);
}

TEST(test_tape_frame_not_accepted_is_recorded_with_the_result) {
    const iw_can_frame_t frame = {.id = 266, .dlc = 5};
    const uint8_t kinds[] = {BLACKBOX_NOT_SENT, BLACKBOX_NOT_SENT};
    gw_tape_step_begin(&tape, 5);
    (void)hal.send(hal.context, &frame, 1);
    send_answer = 0;
    (void)hal.send(hal.context, &frame, 1);
    send_answer = -1;
    (void)hal.send(hal.context, &frame, 1);
    expect_kinds(kinds, sizeof kinds);
    TEST_ASSERT_EQUAL_INT64(0, entries[0].as.value);
    TEST_ASSERT_EQUAL_INT64(-1, entries[1].as.value);
    TEST_ASSERT_EQUAL_UINT32(266, entries[1].number);
}

TEST(test_tape_frames_have_the_time_of_their_step) {
    const uint8_t kinds[] = {BLACKBOX_ESTOP, BLACKBOX_BUS, BLACKBOX_FRAME, BLACKBOX_FRAME, BLACKBOX_STEP};
    waiting = 2;
    step(7);
    step(8);
    expect_kinds(kinds, sizeof kinds);
    TEST_ASSERT_EQUAL_UINT64(7, entries[3].at_us);
    TEST_ASSERT_EQUAL_HEX32(256, entries[3].number);
    TEST_ASSERT_EQUAL(4, entries[3].a);
    TEST_ASSERT_EQUAL(2, entries[2].as.data[0]);
}

TEST(test_tape_only_a_failed_send_is_recorded) {
    const iw_can_frame_t frame = {.id = 266, .dlc = 5};
    gw_tape_step_begin(&tape, 5);
    TEST_ASSERT_EQUAL(1, hal.send(hal.context, &frame, 1));
    send_answer = -1;
    TEST_ASSERT_EQUAL(-1, hal.send(hal.context, &frame, 1));
    TEST_ASSERT_EQUAL(1, hal.purge(hal.context));
    read_ring();
    TEST_ASSERT_EQUAL_size_t(2, count);
    TEST_ASSERT_EQUAL(BLACKBOX_NOT_SENT, entries[0].kind);
    TEST_ASSERT_EQUAL(266, entries[0].number);
    TEST_ASSERT_EQUAL_INT64(-1, entries[0].as.value);
    TEST_ASSERT_EQUAL(BLACKBOX_PURGE, entries[1].kind);
}

TEST(test_tape_first_refused_frame_of_a_pair_is_recorded) {
    static const int answers[] = {2, 1, 0, -1};
    const iw_can_frame_t pair[] = {{.id = 266, .dlc = 5}, {.id = 298, .dlc = 5}};
    gw_tape_step_begin(&tape, 5);
    for (size_t i = 0; i < sizeof answers / sizeof answers[0]; i++) {
        send_answer = answers[i];
        TEST_ASSERT_EQUAL(answers[i], hal.send(hal.context, pair, 2));
    }
    read_ring();
    TEST_ASSERT_EQUAL_size_t(3, count);
    TEST_ASSERT_EQUAL_UINT32(298, entries[0].number);
    TEST_ASSERT_EQUAL_INT64(0, entries[0].as.value);
    TEST_ASSERT_EQUAL_UINT32(266, entries[1].number);
    TEST_ASSERT_EQUAL_INT64(0, entries[1].as.value);
    TEST_ASSERT_EQUAL_UINT32(266, entries[2].number);
    TEST_ASSERT_EQUAL_INT64(-1, entries[2].as.value);
}

TEST(test_tape_answers_are_recorded_again_each_second) {
    const iw_bus_facts_t facts = {.timing_contradicted = true, .echo_proven = true};
    TEST_ASSERT_FALSE(gw_tape_again(&tape, 5000000)); // No answer was requested yet.
    gw_tape_facts(&tape, 1, &facts);
    gw_tape_facts(&tape, 2, &facts);
    step(1000000);
    TEST_ASSERT_TRUE(gw_tape_again(&tape, 1000000));
    TEST_ASSERT_FALSE(gw_tape_again(&tape, 1999999));
    TEST_ASSERT_TRUE(gw_tape_again(&tape, 2000000));
    const uint8_t kinds[] = {BLACKBOX_FACTS, BLACKBOX_ESTOP, BLACKBOX_BUS,   BLACKBOX_STEP, BLACKBOX_ESTOP,
                             BLACKBOX_BUS,   BLACKBOX_FACTS, BLACKBOX_ESTOP, BLACKBOX_BUS,  BLACKBOX_FACTS};
    expect_kinds(kinds, sizeof kinds);
    TEST_ASSERT_EQUAL(1, entries[9].a);
    TEST_ASSERT_EQUAL(1, entries[9].b);
}

TEST(test_tape_drive_has_the_request_and_its_age) {
    const iw_drive_t request = {.speed_mm_s = {300, -2147483647}, .current_mA = {100000, -100000}, .has_current = true};
    const blackbox_entry_t entry = {.at_us = 1000, .number = 7, .b = IW_REFUSE_BUSY};
    gw_tape_drive(&tape, &entry, &request, 400);
    read_ring();
    TEST_ASSERT_EQUAL(BLACKBOX_DRIVE, entries[0].kind);
    TEST_ASSERT_EQUAL(7, entries[0].number);
    TEST_ASSERT_EQUAL(IW_REFUSE_BUSY, entries[0].b);
    TEST_ASSERT_EQUAL_INT32(300, entries[0].as.drive.speed_mm_s[IW_LEFT]);
    TEST_ASSERT_EQUAL_INT32(-2147483647, entries[0].as.drive.speed_mm_s[IW_RIGHT]);
    TEST_ASSERT_EQUAL_INT16(INT16_MAX, entries[0].as.drive.current_mA[IW_LEFT]);
    TEST_ASSERT_EQUAL_INT16(INT16_MIN, entries[0].as.drive.current_mA[IW_RIGHT]);
    TEST_ASSERT_EQUAL_UINT32(600, entries[0].as.drive.age_us);
}

TEST(test_tape_frames_around_a_stop_are_stored_separately) {
    for (iw_time_us_t at_us = 1; at_us <= 100; at_us++) {
        waiting = 1;
        step(at_us);
        step(at_us); // Steps between the frames do not count.
    }
    TEST_ASSERT_EQUAL_UINT32(0, tape.before_count);
    gw_tape_mark(&tape);
    TEST_ASSERT_EQUAL_UINT32(GW_AROUND, tape.before_count);
    TEST_ASSERT_EQUAL_UINT64(100U - GW_AROUND + 1U, tape.before[0].at_us);
    TEST_ASSERT_EQUAL_UINT64(100, tape.before[GW_AROUND - 1U].at_us);
    TEST_ASSERT_EQUAL_UINT32(0, tape.after_count);
    for (iw_time_us_t at_us = 101; at_us <= 101U + 2U * GW_AROUND; at_us++) {
        waiting = 1;
        step(at_us);
    }
    TEST_ASSERT_EQUAL_UINT32(GW_AROUND, tape.after_count);
    TEST_ASSERT_EQUAL_UINT64(101, tape.after[0].at_us);
    TEST_ASSERT_EQUAL_UINT64(100, tape.before[GW_AROUND - 1U].at_us);
}

TEST(test_tape_few_frames_before_a_stop_are_all_stored) {
    waiting = 3;
    step(1);
    gw_tape_mark(&tape);
    TEST_ASSERT_EQUAL_UINT32(3, tape.before_count);
}

TEST(test_tape_without_a_ring_records_nothing_and_passes_calls) {
    gw_tape_init(&tape, NULL);
    hal = gw_tape_hal(&tape, &port);
    waiting = 2;
    estop_answer = -1;
    step(1);
    gw_tape_mark(&tape);
    TEST_ASSERT_EQUAL(0, waiting);
    TEST_ASSERT_EQUAL(-1, hal.estop_pressed(hal.context));
    TEST_ASSERT_EQUAL_UINT32(0, tape.before_count);
}
