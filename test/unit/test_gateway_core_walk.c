// SPDX-License-Identifier: MIT
// Random walk: clients, buttons, faults and delays at random; the invariants are checked after each step.
#include "test_gateway_core_rig.h"
#include "unit.h"

static fixture_random_t chance;

/// Counts the events: a walk without events proves nothing.
typedef struct {
    uint32_t armed;
    uint32_t latched;
    uint32_t resets;
    uint32_t stops;
} tally_t;

static iw_client_t any_client(void) {
    return (fixture_random_in(&chance, 0, 3) == 0) ? OTHER : HOLDER;
}

static int32_t any_speed(void) {
    const int32_t limit = (fixture_random_in(&chance, 0, 20) == 0) ? 40000 : 1300;
    return (fixture_random_in(&chance, 0, 5) == 0) ? 0 : fixture_random_in(&chance, -limit, limit);
}

static void heal(void) {
    rig.bus.acknowledged = true;
    rig.bus.state = IW_BUS_ACTIVE;
    rig.bus.purge_result = fixture_random_in(&chance, 0, 1);
    rig.bus.echo_delay_us = (iw_time_us_t)fixture_random_in(&chance, 200, 6000);
    for (size_t side = 0; side < IW_SIDES; side++) {
        rig.bus.send_result[side] = 1;
        rig.wheel[side].mute = false;
        rig.wheel[side].rpm_fixed = false;
    }
    if (rig.bus.estop_level != 0) {
        gateway_rig_press(&rig, false);
    }
}

static void hurt(void) {
    const iw_side_t side = (fixture_random_in(&chance, 0, 1) == 0) ? IW_LEFT : IW_RIGHT;
    switch (fixture_random_in(&chance, 0, 9)) {
    case 0:
        rig.bus.acknowledged = false;
        break;
    case 1:
        fake_bus_break(&rig.bus, (fixture_random_in(&chance, 0, 1) == 0) ? IW_BUS_DOWN : IW_BUS_OFF);
        break;
    case 2:
        rig.bus.send_result[side] = fixture_random_in(&chance, -1, 0);
        break;
    case 3:
        rig.wheel[side].mute = true;
        break;
    case 4:
        rig.wheel[side].rpm_fixed = true;
        rig.wheel[side].rpm = (int16_t)fixture_random_in(&chance, -70, 70);
        break;
    case 5:
        gateway_rig_press(&rig, true);
        break;
    case 6:
        rig.bus.estop_edge = true;
        break;
    case 7:
        gateway_rig_foreign(&rig, (side == IW_LEFT) ? 266U : 298U);
        break;
    case 8:
        rig.wheel[side].ticks += fixture_random_in(&chance, -100000, 250000);
        break;
    default:
        rig.bus.flood = 700;
        break;
    }
}

static void random_request(void) {
    const int32_t choice = fixture_random_in(&chance, 0, 99);
    if (choice < 30) {
        const iw_client_t client = any_client(); // Arguments have no defined order of evaluation.
        (void)gateway_rig_request_arm(&rig, client, fixture_random_in(&chance, 0, 3) == 0);
    } else if (choice < 50) {
        (void)gateway_rig_reset(&rig);
    } else if (choice < 60) {
        gateway_rig_stop(&rig);
    } else if (choice < 63) {
        iw_gateway_disconnect(&rig.gateway, rig.now_us, any_client());
    } else if (choice < 66) {
        iw_gateway_estop(&rig.gateway, rig.now_us, any_client());
    } else {
        const iw_client_t client = any_client();
        const int32_t left_mm_s = any_speed();
        (void)gateway_rig_drive(&rig, client, left_mm_s, any_speed());
    }
}

/// One client drives for a while.
static void random_drive(void) {
    const int32_t left_mm_s = any_speed();
    const int32_t right_mm_s = any_speed();
    for (int32_t n = fixture_random_in(&chance, 1, 12); n > 0; n--) {
        (void)gateway_rig_drive(&rig, HOLDER, left_mm_s, right_mm_s);
        gateway_rig_run(&rig, (iw_time_us_t)fixture_random_in(&chance, 1000, 100000));
    }
}

static void random_delay(void) {
    static const int32_t delays_us[] = {0, 1, 3000, 25000, 45000, 130000, 480000, 620000};
    const iw_time_us_t delay_us = (iw_time_us_t)delays_us[fixture_random_in(&chance, 0, 7)];
    gateway_rig_stall(&rig, delay_us);
}

/// Actions of a patient operator: repair all faults, wait, reset, arm.
static void recover(void) {
    heal();
    gateway_rig_run(&rig, (iw_time_us_t)fixture_random_in(&chance, 500000, 1300000));
    (void)gateway_rig_reset(&rig);
    (void)gateway_rig_request_arm(&rig, HOLDER, false);
    gateway_rig_run(&rig, MS(15));
}

static void random_event(void) {
    const int32_t choice = fixture_random_in(&chance, 0, 99);
    if (choice < 35) {
        random_drive();
    } else if (choice < 60) {
        random_request();
    } else if (choice < 66) {
        hurt();
    } else if (choice < 72) {
        heal();
    } else if (choice < 80) {
        recover();
    } else if (choice < 84) {
        random_delay();
    } else if (choice < 92) {
        gateway_rig_run(&rig, (iw_time_us_t)fixture_random_in(&chance, 1, 60000));
    } else {
        gateway_rig_run(&rig, (iw_time_us_t)fixture_random_in(&chance, 60000, 700000));
    }
}

static void count(tally_t *tally, iw_state_t before) {
    const iw_state_t after = state();
    tally->armed += (after == IW_STATE_ARMED && before != after) ? 1U : 0U;
    tally->latched += (after == IW_STATE_LATCHED && before != after) ? 1U : 0U;
    tally->stops += (after == IW_STATE_STOPPING && before != after) ? 1U : 0U;
    tally->resets += (before == IW_STATE_LATCHED && after != before) ? 1U : 0U;
}

static void walk(uint32_t seed, uint32_t steps) {
    tally_t tally = {0, 0, 0, 0};
    fixture_random_init(&chance, seed);
    rig.speed_period_us = MS(16);
    while (rig.steps < steps) {
        const iw_state_t before = state();
        random_event();
        count(&tally, before);
        TEST_ASSERT_NULL_MESSAGE(rig.judge.violation, rig.judge.violation);
    }
    TEST_ASSERT_TRUE_MESSAGE(tally.armed > steps / 5000U, "hardly ever armed");
    TEST_ASSERT_TRUE_MESSAGE(tally.latched > steps / 5000U, "hardly ever latched");
    TEST_ASSERT_TRUE_MESSAGE(tally.stops > steps / 10000U, "hardly ever stopped");
    TEST_ASSERT_TRUE_MESSAGE(tally.resets > steps / 5000U, "hardly ever reset");
    TEST_ASSERT_TRUE_MESSAGE(rig.judge.moving_frames > steps / 50U, "hardly ever moving");
    TEST_ASSERT_EQUAL_UINT32_MESSAGE(0, rig.gateway.sender.envelope.stopped, "the gate had to stop a frame");
}

TEST(test_gateway_walk_with_current_limit_meets_invariants) {
    walk(1, 250000);
}

TEST(test_gateway_walk_with_current_setpoint_meets_invariants) {
    rig.config.current_role = IW_ROLE_SETPOINT;
    gateway_rig_begin(&rig, false);
    walk(2, 250000);
}

TEST(test_gateway_walk_with_odd_configurations_meets_invariants) {
    rig.config.invert[IW_LEFT] = true;
    rig.config.invert[IW_RIGHT] = true;
    rig.config.period_ms = 7;
    rig.config.lease_ms = 300;
    rig.config.accel_mm_s2 = 20000;
    rig.config.decel_mm_s2 = 20000;
    rig.config.max_current_mA = 700;
    rig.config.setpoint_dlc = 8;
    gateway_rig_begin(&rig, false);
    walk(3, 250000);
    rig.config.period_ms = 50;
    rig.config.echo_ms = 20;
    rig.config.accel_mm_s2 = 50;
    rig.config.decel_mm_s2 = 5000;
    gateway_rig_begin(&rig, true);
    walk(4, 250000);
}
