// SPDX-License-Identifier: MIT
// The simulated world: wheels, bus, clients and other nodes together.
#include "iwheel_sim/world.h"

#include "message.h"
#include "unit.h"

#include <string.h>

#define START_US UINT64_C(1000000)
#define MS       UINT64_C(1000)
#define SECOND   UINT64_C(1000000)
#define HISTORY  4096U

static sim_world_t world;
static sim_delivery_t history[HISTORY]; ///< Setpoints and frames of unknown ids that were on the bus.
static uint32_t count;
static uint32_t telemetry;

void setUp(void) {
    memset(&world, 0xA5, sizeof world);
    sim_world_init(&world, NULL, START_US, 1U);
    count = 0U;
    telemetry = 0U;
}

static iw_can_frame_t frame_of(uint32_t id, uint8_t dlc) {
    return (iw_can_frame_t){.id = id, .dlc = dlc};
}

static iw_can_frame_t setpoint(iw_side_t side, int16_t speed_mm_s) {
    iw_codec_setpoint_t const command = {speed_mm_s, 2000, 1U};
    iw_can_frame_t frame;
    (void)iw_codec_encode_setpoint(side, &command, IW_DLC_SETPOINT, &frame);
    return frame;
}

static void run_until(iw_time_us_t until_us) {
    sim_delivery_t delivery;
    while (sim_world_step(&world, until_us, &delivery)) {
        message_t message;
        if (message_decode(&delivery.frame, &message) && message.kind != IW_CODEC_SETPOINT) {
            telemetry += 1U;
        } else {
            TEST_ASSERT_LESS_THAN_UINT32(HISTORY, count);
            history[count++] = delivery;
        }
    }
}

/// A client that sends both wheels the same setpoint every 20 ms.
static iw_time_us_t drive(uint8_t port, iw_time_us_t from_us, iw_time_us_t until_us, int16_t speed_mm_s) {
    iw_time_us_t now_us = from_us;
    for (; now_us < until_us; now_us += 20U * MS) {
        run_until(now_us);
        for (unsigned side = 0U; side < IW_SIDES; side++) {
            iw_can_frame_t const frame = setpoint((iw_side_t)side, speed_mm_s);
            sim_world_submit(&world, now_us, port, &frame);
        }
    }
    return now_us;
}

static int16_t commanded_mm_s(uint32_t index) {
    return (int16_t)((history[index].frame.data[1] << 8) | history[index].frame.data[2]);
}

TEST(test_world_load_of_telemetry_alone_is_five_to_six_percent) {
    run_until(START_US + 10U * SECOND);
    uint64_t const before_us = world.bus.busy_us;
    telemetry = 0U;
    run_until(START_US + 20U * SECOND);
    TEST_ASSERT_UINT32_WITHIN(3U, 6170U, telemetry);
    TEST_ASSERT_UINT64_WITHIN(50000U, 560000U, world.bus.busy_us - before_us);
}

/// Sleeps and steps as a program would, and stores every delivery in `history`. Returns the number of wake-ups.
static uint32_t sleep_until(iw_time_us_t until_us, iw_time_us_t (*wake_us)(const sim_world_t *)) {
    uint32_t wakes = 0U;
    for (iw_time_us_t now_us = wake_us(&world); now_us <= until_us; now_us = wake_us(&world)) {
        sim_delivery_t delivery;
        wakes += 1U;
        while (sim_world_step(&world, now_us, &delivery)) {
            TEST_ASSERT_LESS_THAN_UINT32(HISTORY, count);
            TEST_ASSERT_TRUE(delivery.end_us <= now_us && now_us - delivery.end_us <= SIM_WORLD_FRAME_US);
            history[count++] = delivery;
        }
    }
    return wakes;
}

TEST(test_world_woken_at_frame_ends_delivers_the_same_frames) {
    static sim_delivery_t every_step[HISTORY];
    uint32_t const wakes = sleep_until(START_US + 3U * SECOND, sim_world_next_us);
    uint32_t const command = count;
    memcpy(every_step, history, sizeof history);
    setUp();
    uint32_t const fewer = sleep_until(START_US + 3U * SECOND + SIM_WORLD_FRAME_US, sim_world_wake_us);
    TEST_ASSERT_GREATER_THAN_UINT32(1000U, command);
    TEST_ASSERT_UINT32_WITHIN(2U, command, count);
    for (uint32_t i = 0U; i < command; i++) {
        TEST_ASSERT_EQUAL_UINT64(every_step[i].end_us, history[i].end_us);
        TEST_ASSERT_EQUAL_UINT32(every_step[i].frame.id, history[i].frame.id);
        TEST_ASSERT_EQUAL_UINT8_ARRAY(every_step[i].frame.data, history[i].frame.data, IW_CAN_DATA_MAX);
    }
    TEST_ASSERT_LESS_THAN_UINT32(wakes * 6U / 10U, fewer);
}

TEST(test_world_client_receives_its_echoes_within_1_ms) {
    uint8_t const port = sim_world_connect(&world);
    (void)drive(port, START_US + SECOND, START_US + 2U * SECOND, 300);
    run_until(START_US + 2U * SECOND);
    TEST_ASSERT_EQUAL_UINT32(100U, count);
    for (uint32_t i = 0U; i < count; i++) {
        iw_time_us_t const sent_us = START_US + SECOND + (i / 2U) * 20U * MS;
        TEST_ASSERT_EQUAL_UINT8(port, history[i].port);
        TEST_ASSERT_EQUAL_HEX32((i % 2U == 0U) ? 266U : 298U, history[i].frame.id);
        TEST_ASSERT_LESS_THAN_UINT64(sent_us + MS, history[i].end_us);
    }
}

TEST(test_world_power_cut_retains_queued_setpoints_until_power_on) {
    uint8_t const port = sim_world_connect(&world);
    iw_time_us_t now_us = drive(port, START_US + SECOND, START_US + 3U * SECOND, 1000);
    run_until(now_us);
    count = 0U;
    sim_world_power(&world, now_us, false);
    iw_time_us_t const back_us = now_us + 10U * SECOND;
    now_us = drive(port, now_us, now_us + 100U * MS, 1000);
    now_us = drive(port, now_us, back_us, 0);
    run_until(back_us);
    TEST_ASSERT_EQUAL_UINT32(0U, count);
    sim_world_power(&world, back_us, true);
    run_until(back_us + 390U * MS);
    TEST_ASSERT_EQUAL_UINT32(0U, count);
    run_until(back_us + 500U * MS);
    TEST_ASSERT_EQUAL_UINT32(SIM_QUEUE_DEFAULT, count);
    for (uint32_t i = 0U; i < count; i++) {
        TEST_ASSERT_EQUAL_INT16(1000, commanded_mm_s(i));
    }
    TEST_ASSERT_GREATER_THAN_INT32(100000, world.pair.wheel[IW_LEFT].motion.speed_um_s);
    TEST_ASSERT_GREATER_THAN_UINT32(900U, world.dropped);
}

TEST(test_world_queue_of_one_retains_one_frame) {
    uint8_t const port = sim_world_connect(&world);
    sim_world_queue(&world, 1U);
    run_until(START_US + SECOND);
    sim_world_power(&world, START_US + SECOND, false);
    (void)drive(port, START_US + SECOND, START_US + 2U * SECOND, 800);
    sim_world_power(&world, START_US + 2U * SECOND, true);
    run_until(START_US + 3U * SECOND);
    TEST_ASSERT_EQUAL_UINT32(1U, count);
    TEST_ASSERT_EQUAL_HEX32(266U, history[0].frame.id);
}

TEST(test_world_rebooting_wheel_leaves_one_that_acknowledges) {
    uint8_t const port = sim_world_connect(&world);
    run_until(START_US + SECOND);
    sim_world_reboot(&world, START_US + SECOND, IW_LEFT);
    (void)drive(port, START_US + SECOND, START_US + SECOND + 100U * MS, 100);
    run_until(START_US + SECOND + 100U * MS);
    TEST_ASSERT_EQUAL_UINT32(10U, count);
    TEST_ASSERT_EQUAL_UINT32(0U, world.pair.wheel[IW_LEFT].motion.setpoints);
    TEST_ASSERT_EQUAL_UINT32(5U, world.pair.wheel[IW_RIGHT].motion.setpoints);
}

TEST(test_world_ack_off_delays_frames_of_clients_only) {
    uint8_t const port = sim_world_connect(&world);
    run_until(START_US + SECOND);
    sim_world_ack(&world, START_US + SECOND, false);
    telemetry = 0U;
    (void)drive(port, START_US + SECOND, START_US + 2U * SECOND, 100);
    run_until(START_US + 2U * SECOND);
    TEST_ASSERT_EQUAL_UINT32(0U, count);
    TEST_ASSERT_GREATER_THAN_UINT32(600U, telemetry);
    sim_world_ack(&world, START_US + 2U * SECOND, true);
    run_until(START_US + 2U * SECOND + 5U * MS);
    TEST_ASSERT_EQUAL_UINT32(SIM_QUEUE_DEFAULT, count);
}

TEST(test_world_queue_of_a_disconnected_client_is_dropped) {
    uint8_t const port = sim_world_connect(&world);
    run_until(START_US + SECOND);
    sim_world_power(&world, START_US + SECOND, false);
    (void)drive(port, START_US + SECOND, START_US + 2U * SECOND, 800);
    sim_world_disconnect(&world, START_US + 2U * SECOND, port);
    sim_world_power(&world, START_US + 2U * SECOND, true);
    run_until(START_US + 4U * SECOND);
    TEST_ASSERT_EQUAL_UINT32(0U, count);
}

TEST(test_world_accepts_its_maximum_of_clients_only) {
    for (unsigned i = 0U; i < SIM_WORLD_CLIENTS; i++) {
        TEST_ASSERT_EQUAL_UINT8(SIM_PORT_CLIENT + i, sim_world_connect(&world));
    }
    TEST_ASSERT_EQUAL_UINT8(SIM_BUS_NONE, sim_world_connect(&world));
    sim_world_disconnect(&world, START_US, SIM_PORT_CLIENT + 3U);
    TEST_ASSERT_EQUAL_UINT8(SIM_PORT_CLIENT + 3U, sim_world_connect(&world));
}

TEST(test_world_bus_off_drops_frames_of_clients) {
    uint8_t const port = sim_world_connect(&world);
    run_until(START_US + SECOND);
    sim_world_ack(&world, START_US + SECOND, false);
    (void)drive(port, START_US + SECOND, START_US + SECOND + 40U * MS, 500);
    sim_world_bus_off(&world, START_US + SECOND + 40U * MS, true);
    sim_world_ack(&world, START_US + SECOND + 40U * MS, true);
    (void)drive(port, START_US + SECOND + 40U * MS, START_US + 2U * SECOND, 500);
    sim_world_bus_off(&world, START_US + 2U * SECOND, false);
    run_until(START_US + 3U * SECOND);
    TEST_ASSERT_EQUAL_UINT32(0U, count);
    (void)drive(port, START_US + 3U * SECOND, START_US + 3U * SECOND + 20U * MS, 500);
    run_until(START_US + 4U * SECOND);
    TEST_ASSERT_EQUAL_UINT32(2U, count);
}

TEST(test_world_foreign_master_sends_pairs_every_20_ms) {
    run_until(START_US + SECOND);
    world.foreign.due_us = START_US + SECOND;
    world.foreign.setpoint.speed_mm_s = 400;
    run_until(START_US + 2U * SECOND);
    TEST_ASSERT_UINT32_WITHIN(2U, 100U, count);
    TEST_ASSERT_EQUAL_UINT8(SIM_PORT_FOREIGN, history[0].port);
    TEST_ASSERT_EQUAL_INT16(400, commanded_mm_s(0U));
    TEST_ASSERT_INT32_WITHIN(1000, 400000, world.pair.wheel[IW_LEFT].motion.speed_um_s);
    world.foreign.due_us = IW_NEVER;
    count = 0U;
    run_until(START_US + 3U * SECOND);
    TEST_ASSERT_LESS_OR_EQUAL_UINT32(2U, count);
}

TEST(test_world_foreign_once_is_one_pair) {
    run_until(START_US + SECOND);
    sim_world_foreign_once(&world, START_US + SECOND);
    run_until(START_US + 2U * SECOND);
    TEST_ASSERT_EQUAL_UINT32(2U, count);
}

TEST(test_world_injected_frame_is_delivered_unchanged) {
    iw_can_frame_t frame = frame_of(0x12345U | IW_CAN_EXTENDED, 3U);
    frame.data[2] = 0x5AU;
    run_until(START_US + SECOND);
    sim_world_inject(&world, START_US + SECOND, &frame);
    run_until(START_US + 2U * SECOND);
    TEST_ASSERT_EQUAL_UINT32(1U, count);
    TEST_ASSERT_EQUAL_HEX32(frame.id, history[0].frame.id);
    TEST_ASSERT_EQUAL_UINT8(frame.dlc, history[0].frame.dlc);
    TEST_ASSERT_EQUAL_MEMORY(frame.data, history[0].frame.data, sizeof frame.data);
    TEST_ASSERT_EQUAL_UINT8(SIM_PORT_INJECT, history[0].port);
}

TEST(test_world_babbling_low_id_fills_the_bus) {
    run_until(START_US + SECOND);
    world.babble = (sim_babble_t){START_US + SECOND, 100U, frame_of(1U, 8U)};
    telemetry = 0U;
    run_until(START_US + SECOND + 200U * MS);
    TEST_ASSERT_LESS_THAN_UINT32(5U, telemetry);
    TEST_ASSERT_GREATER_THAN_UINT32(1600U, count);
    world.babble.due_us = IW_NEVER;
    run_until(START_US + SECOND + 210U * MS);
    TEST_ASSERT_GREATER_THAN_UINT32(8U, telemetry);
}

TEST(test_world_babbling_high_id_delays_others_by_one_frame) {
    uint8_t const port = sim_world_connect(&world);
    run_until(START_US + SECOND);
    world.babble = (sim_babble_t){START_US + SECOND, 100U, frame_of(0x7FFU, 8U)};
    uint32_t setpoints = 0U;
    (void)drive(port, START_US + SECOND, START_US + SECOND + 200U * MS, 100);
    run_until(START_US + SECOND + 200U * MS);
    for (uint32_t i = 0U; i < count; i++) {
        if (history[i].port == port) {
            TEST_ASSERT_LESS_THAN_UINT64(START_US + SECOND + (setpoints / 2U) * 20U * MS + 900U, history[i].end_us);
            setpoints += 1U;
        }
    }
    TEST_ASSERT_EQUAL_UINT32(20U, setpoints);
}

static void apply_every_fault(void) {
    for (unsigned side = 0U; side < IW_SIDES; side++) {
        sim_wheel_t *const wheel = &world.pair.wheel[side];
        wheel->muted = true;
        wheel->loss_permille = 500U;
        wheel->force.load_mN = 1;
        wheel->force.forced_raw = 5;
        wheel->force.zero_removed = true;
        wheel->force.unit = (wheel->force.unit == IW_FORCE_CN) ? IW_FORCE_DN : IW_FORCE_CN;
        wheel->motion.runaway_mm_s = 100;
        wheel->motion.blocked = true;
        wheel->motion.swapped = true;
        sim_wheel_slow(wheel, 5000U);
    }
    world.foreign.due_us = START_US + SECOND;
    world.babble.due_us = START_US + SECOND;
    sim_world_power(&world, START_US + SECOND, false);
    sim_bus_stall(&world.bus, START_US + SECOND, true);
    sim_world_bus_off(&world, START_US + SECOND, true);
    sim_world_queue(&world, 9U);
    sim_world_ack(&world, START_US + SECOND, false);
}

TEST(test_world_heal_undoes_every_fault) {
    run_until(START_US + SECOND);
    apply_every_fault();
    sim_world_heal(&world, START_US + SECOND);
    uint8_t const port = sim_world_connect(&world);
    (void)drive(port, START_US + 2U * SECOND, START_US + 4U * SECOND, 300);
    run_until(START_US + 4U * SECOND);
    TEST_ASSERT_EQUAL_UINT32(200U, count);
    TEST_ASSERT_GREATER_THAN_UINT32(1500U, telemetry);
    for (unsigned side = 0U; side < IW_SIDES; side++) {
        TEST_ASSERT_INT32_WITHIN(1000, 300000, world.pair.wheel[side].motion.speed_um_s);
        TEST_ASSERT_GREATER_THAN_INT64(0, sim_motion_milli_rpm(&world.pair.wheel[side].motion));
    }
    TEST_ASSERT_EQUAL_INT(IW_FORCE_CN, world.pair.wheel[IW_LEFT].force.unit);
    TEST_ASSERT_EQUAL_INT(IW_FORCE_DN, world.pair.wheel[IW_RIGHT].force.unit);
    TEST_ASSERT_EQUAL_UINT8(SIM_QUEUE_DEFAULT, world.bus.port[port].depth);
}

static uint64_t hash_until(uint64_t hash, iw_time_us_t until_us) {
    sim_delivery_t delivery;
    while (sim_world_step(&world, until_us, &delivery)) {
        hash = hash * 31U + delivery.frame.id + delivery.end_us;
        for (unsigned i = 0U; i < delivery.frame.dlc; i++) {
            hash = hash * 31U + delivery.frame.data[i];
        }
    }
    return hash;
}

static uint64_t fingerprint(uint64_t seed, iw_time_us_t stride_us) {
    uint64_t hash = 0U;
    sim_world_init(&world, NULL, START_US, seed);
    uint8_t const port = sim_world_connect(&world);
    for (iw_time_us_t now_us = START_US; now_us < START_US + 5U * SECOND; now_us += stride_us) {
        hash = hash_until(hash, now_us);
        if (now_us % (20U * MS) == 0U) {
            iw_can_frame_t const frame = setpoint(IW_LEFT, 200);
            sim_world_submit(&world, now_us, port, &frame);
        }
    }
    return hash_until(hash, START_US + 5U * SECOND);
}

TEST(test_world_same_seed_and_times_give_the_same_bytes) {
    uint64_t const coarse = fingerprint(5U, 20U * MS);
    TEST_ASSERT_EQUAL_HEX64(coarse, fingerprint(5U, 20U * MS));
    TEST_ASSERT_EQUAL_HEX64(coarse, fingerprint(5U, 100U));
    TEST_ASSERT_NOT_EQUAL(coarse, fingerprint(6U, 20U * MS));
}
