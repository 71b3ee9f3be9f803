// SPDX-License-Identifier: MIT
// The simulated bus: time on the wire, arbitration, acknowledgement, queues of the adapters.
#include "iwheel_sim/sim_bus.h"

#include "unit.h"

#include <string.h>

#define START_US UINT64_C(1000000)
#define MS       UINT64_C(1000)
#define SECOND   UINT64_C(1000000)

static sim_bus_t bus;

void setUp(void) {
    memset(&bus, 0xA5, sizeof bus);
    sim_bus_init(&bus, START_US);
}

static iw_can_frame_t frame_of(uint32_t id, uint8_t dlc) {
    return (iw_can_frame_t){.id = id, .dlc = dlc};
}

static void expect_next(iw_time_us_t now_us, uint32_t id, uint8_t port) {
    sim_delivery_t delivery;
    TEST_ASSERT_TRUE(sim_bus_step(&bus, now_us, &delivery));
    TEST_ASSERT_EQUAL_HEX32(id, delivery.frame.id);
    TEST_ASSERT_EQUAL_UINT8(port, delivery.port);
}

static void expect_none(iw_time_us_t now_us) {
    sim_delivery_t delivery;
    TEST_ASSERT_FALSE(sim_bus_step(&bus, now_us, &delivery));
}

static void submit(iw_time_us_t now_us, uint8_t port, uint32_t id) {
    iw_can_frame_t const frame = frame_of(id, 4U);
    TEST_ASSERT_TRUE(sim_bus_submit(&bus, now_us, port, &frame));
}

TEST(test_bus_frame_bits_match_format_and_length) {
    iw_can_frame_t frame = frame_of(256U, 8U);
    TEST_ASSERT_EQUAL_UINT32(120U, sim_bus_frame_bits(&frame));
    frame.dlc = 0U;
    TEST_ASSERT_EQUAL_UINT32(50U, sim_bus_frame_bits(&frame));
    frame = frame_of(256U | IW_CAN_EXTENDED, 8U);
    TEST_ASSERT_EQUAL_UINT32(142U, sim_bus_frame_bits(&frame));
    frame = frame_of(256U | IW_CAN_REMOTE, 8U);
    TEST_ASSERT_EQUAL_UINT32(50U, sim_bus_frame_bits(&frame));
}

TEST(test_bus_delivers_at_the_end_of_the_frame_and_not_before) {
    sim_delivery_t delivery;
    sim_bus_open(&bus, 0U, 4U, false);
    submit(START_US + 10U, 0U, 256U);
    TEST_ASSERT_EQUAL_UINT64(START_US + 10U, sim_bus_next_us(&bus));
    expect_none(START_US + 10U);
    TEST_ASSERT_EQUAL_UINT64(START_US + 10U + 85U, sim_bus_next_us(&bus));
    expect_none(START_US + 10U + 84U);
    TEST_ASSERT_TRUE(sim_bus_step(&bus, START_US + 10U + 85U, &delivery));
    TEST_ASSERT_EQUAL_UINT64(START_US + 10U + 85U, delivery.end_us);
    TEST_ASSERT_EQUAL_UINT64(IW_NEVER, sim_bus_next_us(&bus));
}

TEST(test_bus_lowest_id_wins_when_several_wait) {
    for (uint8_t port = 0U; port < 5U; port++) {
        sim_bus_open(&bus, port, 4U, false);
    }
    submit(START_US, 0U, 545U);
    submit(START_US, 1U, 266U);
    submit(START_US, 2U, 256U | IW_CAN_REMOTE);
    submit(START_US, 3U, 256U);
    submit(START_US, 4U, (256U << 18) | IW_CAN_EXTENDED);
    expect_next(START_US + SECOND, 256U, 3U);
    expect_next(START_US + SECOND, 256U | IW_CAN_REMOTE, 2U);
    expect_next(START_US + SECOND, (256U << 18) | IW_CAN_EXTENDED, 4U);
    expect_next(START_US + SECOND, 266U, 1U);
    expect_next(START_US + SECOND, 545U, 0U);
    expect_none(START_US + SECOND);
}

TEST(test_bus_frame_under_way_is_not_replaced_by_a_lower_id) {
    sim_bus_open(&bus, 0U, 4U, false);
    sim_bus_open(&bus, 1U, 4U, false);
    submit(START_US, 0U, 545U);
    submit(START_US + 1U, 1U, 256U);
    expect_next(START_US + SECOND, 545U, 0U);
    expect_next(START_US + SECOND, 256U, 1U);
}

TEST(test_bus_frames_of_one_port_stay_in_order) {
    sim_bus_open(&bus, 0U, 4U, false);
    submit(START_US, 0U, 700U);
    submit(START_US, 0U, 1U);
    expect_next(START_US + SECOND, 700U, 0U);
    expect_next(START_US + SECOND, 1U, 0U);
}

TEST(test_bus_full_queue_drops_and_counts_the_newest) {
    iw_can_frame_t const frame = frame_of(5U, 4U);
    sim_bus_open(&bus, 0U, 2U, true);
    submit(START_US, 0U, 1U);
    submit(START_US, 0U, 2U);
    TEST_ASSERT_FALSE(sim_bus_submit(&bus, START_US, 0U, &frame));
    TEST_ASSERT_EQUAL_UINT32(1U, bus.port[0].overflows);
    sim_bus_acknowledge(&bus, START_US + SECOND, true);
    expect_next(START_US + 2U * SECOND, 1U, 0U);
    expect_next(START_US + 2U * SECOND, 2U, 0U);
    expect_none(START_US + 2U * SECOND);
}

TEST(test_bus_queue_wraps_around_many_times) {
    sim_bus_open(&bus, 0U, 3U, false);
    for (uint32_t i = 0U; i < 500U; i++) {
        submit(START_US + i * MS, 0U, i);
        submit(START_US + i * MS, 0U, i + 1000U);
        expect_next(START_US + (i + 1U) * MS, i, 0U);
        expect_next(START_US + (i + 1U) * MS, i + 1000U, 0U);
    }
    TEST_ASSERT_EQUAL_UINT32(1000U, bus.port[0].sent);
}

TEST(test_bus_unacknowledged_frame_waits_for_an_acknowledger) {
    sim_delivery_t delivery;
    sim_bus_open(&bus, 0U, 4U, true);
    submit(START_US, 0U, 266U);
    expect_none(START_US + 3600U * SECOND);
    TEST_ASSERT_EQUAL_UINT64(IW_NEVER, sim_bus_next_us(&bus));
    sim_bus_acknowledge(&bus, START_US + 3600U * SECOND, true);
    TEST_ASSERT_TRUE(sim_bus_step(&bus, START_US + 3601U * SECOND, &delivery));
    TEST_ASSERT_EQUAL_UINT64(START_US + 3600U * SECOND + 85U, delivery.end_us);
}

TEST(test_bus_frame_with_a_lost_acknowledgement_is_sent_again) {
    sim_bus_open(&bus, 0U, 4U, true);
    sim_bus_acknowledge(&bus, START_US, true);
    submit(START_US, 0U, 266U);
    expect_none(START_US + 50U);
    sim_bus_acknowledge(&bus, START_US + 50U, false);
    expect_none(START_US + SECOND);
    TEST_ASSERT_EQUAL_UINT32(0U, bus.port[0].sent);
    sim_bus_acknowledge(&bus, START_US + SECOND, true);
    expect_next(START_US + 2U * SECOND, 266U, 0U);
}

TEST(test_bus_stalled_delivers_all_frames_after_the_stall) {
    sim_bus_open(&bus, 0U, 4U, false);
    submit(START_US, 0U, 256U);
    expect_none(START_US + 50U);
    sim_bus_stall(&bus, START_US + 50U, true);
    submit(START_US + 60U, 0U, 257U);
    expect_none(START_US + SECOND);
    sim_bus_stall(&bus, START_US + SECOND, false);
    expect_next(START_US + 2U * SECOND, 256U, 0U);
    expect_next(START_US + 2U * SECOND, 257U, 0U);
}

TEST(test_bus_clear_drops_the_queue_and_the_frame_being_sent) {
    sim_bus_open(&bus, 0U, 4U, false);
    submit(START_US, 0U, 256U);
    submit(START_US, 0U, 257U);
    expect_none(START_US + 50U);
    sim_bus_clear(&bus, START_US + 50U, 0U);
    expect_none(START_US + SECOND);
    submit(START_US + SECOND, 0U, 258U);
    expect_next(START_US + 2U * SECOND, 258U, 0U);
}
