// SPDX-License-Identifier: MIT
// Core and assumption store: the right to arm, the validity of a force, and the length of frames.
#include "gateway_rig.h"
#include "message.h"

#include "unit.h"

static gateway_rig_t rig;

void setUp(void) {
    gateway_rig_init(&rig);
    gateway_rig_run(&rig, MS(500));
}

static iw_assumption_store_t *assumptions(void) {
    return &rig.gateway.assumptions;
}

static iw_force_validity_t force_validity(iw_side_t side) {
    const iw_snapshot_t seen = gateway_rig_snapshot(&rig);
    return iw_snapshot_force_validity(&seen, side);
}

TEST(test_arm_with_contradicted_guard_of_motion_is_refused) {
    static const iw_assumption_item_t guards[] = {IW_ASSUMPTION_SETPOINT_TYPE,      IW_ASSUMPTION_CURRENT_ROLE,
                                                  IW_ASSUMPTION_FEEDBACK_SIGN_LEFT, IW_ASSUMPTION_FEEDBACK_SIGN_RIGHT,
                                                  IW_ASSUMPTION_MOUNT_SIGN_LEFT,    IW_ASSUMPTION_MOUNT_SIGN_RIGHT};
    for (size_t i = 0; i < sizeof guards / sizeof guards[0]; i++) {
        iw_assumption_contradict(assumptions(), guards[i], IW_SOURCE_OPERATOR, 0);
        TEST_ASSERT_TRUE(iw_assumption_guards_motion(guards[i]));
        TEST_ASSERT_EQUAL_INT(guards[i], assumptions()->doubt);
        TEST_ASSERT_EQUAL_INT(IW_REFUSE_CONTRADICTED, gateway_rig_request_arm(&rig, HOLDER, false));
        TEST_ASSERT_FALSE(iw_gateway_arming(&rig.gateway));
        iw_assumption_confirm(assumptions(), guards[i], IW_SOURCE_OPERATOR, 0);
    }
    TEST_ASSERT_EQUAL_INT(IW_ASSUMPTION_ITEMS, assumptions()->doubt);
    gateway_rig_arm(&rig);
}

TEST(test_arm_with_other_contradicted_assumptions_is_granted) {
    unsigned others = 0;
    for (unsigned item = 0; item < IW_ASSUMPTION_ITEMS; item++) {
        if (!iw_assumption_guards_motion((iw_assumption_item_t)item)) {
            iw_assumption_contradict(assumptions(), (iw_assumption_item_t)item, IW_SOURCE_OPERATOR, 0);
            others++;
        }
    }
    TEST_ASSERT_EQUAL_UINT(IW_ASSUMPTION_ITEMS - 6U, others);
    TEST_ASSERT_EQUAL_INT(IW_ASSUMPTION_ITEMS, assumptions()->doubt);
    gateway_rig_arm(&rig);
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, iw_gateway_state(&rig.gateway));
}

TEST(test_arm_of_latched_gateway_is_refused_as_latched) {
    iw_assumption_contradict(assumptions(), IW_ASSUMPTION_SETPOINT_TYPE, IW_SOURCE_OPERATOR, 0);
    iw_gateway_estop(&rig.gateway, rig.now_us, HOLDER);
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_LATCHED, gateway_rig_request_arm(&rig, HOLDER, false));
}

TEST(test_takeover_with_contradicted_assumption_is_refused) {
    gateway_rig_arm(&rig);
    iw_assumption_contradict(assumptions(), IW_ASSUMPTION_MOUNT_SIGN_RIGHT, IW_SOURCE_OPERATOR, 0);
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_CONTRADICTED, gateway_rig_request_arm(&rig, HOLDER + 1U, true));
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, iw_gateway_state(&rig.gateway));
}

static void know(iw_assumption_state_t state, iw_source_t source, int32_t figure) {
    const iw_assumption_entry_t entry = {.state = state, .source = source, .figure = figure};
    iw_gateway_set_assumption(&rig.gateway, IW_ASSUMPTION_MOUNT_SIGN_LEFT, &entry);
}

static void assert_known(iw_assumption_state_t state, iw_source_t source, int32_t figure) {
    const iw_assumption_entry_t *entry = &assumptions()->entry[IW_ASSUMPTION_MOUNT_SIGN_LEFT];
    TEST_ASSERT_EQUAL_INT(state, entry->state);
    TEST_ASSERT_EQUAL_INT(source, entry->source);
    TEST_ASSERT_EQUAL_INT32(figure, entry->figure);
}

TEST(test_assumption_set_by_the_caller_guards_motion) {
    know(IW_CONTRADICTED, IW_SOURCE_OPERATOR, -3);
    assert_known(IW_CONTRADICTED, IW_SOURCE_OPERATOR, -3);
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_CONTRADICTED, gateway_rig_request_arm(&rig, HOLDER, false));
    know(IW_ASSUMED, IW_SOURCE_DOCUMENT, 0);
    assert_known(IW_CONTRADICTED, IW_SOURCE_OPERATOR, -3);
    know(IW_CONFIRMED, IW_SOURCE_OPERATOR, 4);
    assert_known(IW_CONFIRMED, IW_SOURCE_OPERATOR, 4);
    gateway_rig_arm(&rig);
}

/// State of the force of the left wheel: provenance, observation, and the assumptions of unit and offset.
typedef struct {
    iw_offset_provenance_t provenance;
    iw_unit_observation_t source;
    iw_assumption_entry_t unit;
    iw_assumption_entry_t included;
    iw_force_validity_t expected;
} force_case_t;

#define ASSUMED                                                                                                        \
    { IW_ASSUMED, IW_SOURCE_DOCUMENT, 0 }
#define CONTRADICTED                                                                                                   \
    { IW_CONTRADICTED, IW_SOURCE_BUS, 0 }
#define SETTLED                                                                                                        \
    { IW_CONFIRMED, IW_SOURCE_OPERATOR, 0 }

TEST(test_force_validity_follows_sensor_and_assumptions) {
    static const force_case_t cases[] = {
        {IW_OFFSET_WHEEL, IW_UNIT_CN, ASSUMED, ASSUMED, IW_FORCE_VALID},
        {IW_OFFSET_WHEEL, IW_UNIT_DN, ASSUMED, ASSUMED, IW_FORCE_UNIT_CONTRADICTED},
        {IW_OFFSET_WHEEL, IW_UNIT_DN, SETTLED, ASSUMED, IW_FORCE_OFFSET_DOUBTED},
        {IW_OFFSET_WHEEL, IW_UNIT_DN, ASSUMED, SETTLED, IW_FORCE_UNIT_CONTRADICTED},
        {IW_OFFSET_OPERATOR, IW_UNIT_DN, SETTLED, ASSUMED, IW_FORCE_VALID},
        {IW_OFFSET_WHEEL, IW_UNIT_OFFSET_REMOVED, ASSUMED, ASSUMED, IW_FORCE_OFFSET_REMOVED},
        {IW_OFFSET_WHEEL, IW_UNIT_OFFSET_REMOVED, ASSUMED, SETTLED, IW_FORCE_OFFSET_DOUBTED},
        {IW_OFFSET_WHEEL, IW_UNIT_OFFSET_REMOVED, SETTLED, ASSUMED, IW_FORCE_OFFSET_REMOVED},
        {IW_OFFSET_OPERATOR, IW_UNIT_OFFSET_REMOVED, ASSUMED, ASSUMED, IW_FORCE_VALID},
        {IW_OFFSET_WHEEL, IW_UNIT_UNCLEAR, SETTLED, ASSUMED, IW_FORCE_OFFSET_DOUBTED},
        {IW_OFFSET_WHEEL, IW_UNIT_CN, CONTRADICTED, ASSUMED, IW_FORCE_UNIT_CONTRADICTED},
        {IW_OFFSET_OPERATOR, IW_UNIT_CN, CONTRADICTED, ASSUMED, IW_FORCE_UNIT_CONTRADICTED},
        {IW_OFFSET_WHEEL, IW_UNIT_CN, ASSUMED, CONTRADICTED, IW_FORCE_OFFSET_REMOVED},
        {IW_OFFSET_OPERATOR, IW_UNIT_CN, ASSUMED, CONTRADICTED, IW_FORCE_VALID},
        {IW_OFFSET_NONE, IW_UNIT_CN, CONTRADICTED, CONTRADICTED, IW_FORCE_NO_OFFSET},
        {IW_OFFSET_NONE, IW_UNIT_DN, SETTLED, SETTLED, IW_FORCE_NO_OFFSET},
    };
    iw_force_t *const force = &rig.gateway.force[IW_LEFT];
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        force->raw_us = rig.now_us;
        force->raw = 100;
        force->provenance = cases[i].provenance;
        force->observation = cases[i].source;
        assumptions()->entry[IW_ASSUMPTION_FORCE_UNIT_LEFT] = cases[i].unit;
        assumptions()->entry[IW_ASSUMPTION_OFFSET_INCLUDED] = cases[i].included;
        TEST_ASSERT_EQUAL_INT(cases[i].expected, force_validity(IW_LEFT));
        TEST_ASSERT_EQUAL_INT(IW_FORCE_NO_TELEMETRY, force_validity(IW_RIGHT));
    }
}

TEST(test_force_validity_of_the_right_wheel_uses_its_own_unit) {
    iw_force_t *const force = &rig.gateway.force[IW_RIGHT];
    force->raw_us = rig.now_us;
    force->provenance = IW_OFFSET_WHEEL;
    iw_assumption_contradict(assumptions(), IW_ASSUMPTION_FORCE_UNIT_LEFT, IW_SOURCE_BUS, 0);
    TEST_ASSERT_EQUAL_INT(IW_FORCE_VALID, force_validity(IW_RIGHT));
    iw_assumption_contradict(assumptions(), IW_ASSUMPTION_FORCE_UNIT_RIGHT, IW_SOURCE_BUS, 0);
    TEST_ASSERT_EQUAL_INT(IW_FORCE_UNIT_CONTRADICTED, force_validity(IW_RIGHT));
}

static void receive_empty(uint32_t id, uint8_t length) {
    fake_bus_put_empty(&rig.bus, id, length);
    gateway_rig_step(&rig);
}

TEST(test_length_other_than_in_the_table_contradicts_the_dlc) {
    for (size_t i = 0; i < IW_CODEC_ROWS; i++) {
        const iw_codec_row_t *row = &iw_codec_rows[i];
        if (row->kind == IW_CODEC_SETPOINT) {
            continue;
        }
        for (int off = -1; off <= 1; off += 2) {
            const uint8_t length = (uint8_t)(row->length + off);
            gateway_rig_init(&rig);
            gateway_rig_run(&rig, MS(100));
            TEST_ASSERT_EQUAL_INT(IW_CONFIRMED, assumptions()->entry[IW_ASSUMPTION_DLC].state);
            receive_empty(row->id, length);
            TEST_ASSERT_EQUAL_INT(IW_CONTRADICTED, assumptions()->entry[IW_ASSUMPTION_DLC].state);
            TEST_ASSERT_EQUAL_INT32(length, assumptions()->entry[IW_ASSUMPTION_DLC].figure);
        }
    }
}

TEST(test_length_contradiction_is_recorded_once) {
    receive_empty(IW_ID_LEFT_FORCE, 5);
    const uint32_t changes = assumptions()->changes;
    receive_empty(IW_ID_LEFT_FORCE, 6);
    receive_empty(IW_ID_LEFT_FORCE, 1);
    gateway_rig_run(&rig, MS(100));
    TEST_ASSERT_EQUAL_UINT32(changes, assumptions()->changes);
    TEST_ASSERT_EQUAL_INT32(5, assumptions()->entry[IW_ASSUMPTION_DLC].figure);
}

TEST(test_length_of_other_frames_does_not_change_the_dlc) {
    receive_empty(IW_ID_LEFT_SPEED | IW_CAN_REMOTE, 0);
    receive_empty(IW_ID_LEFT_SPEED | IW_CAN_EXTENDED, 8);
    receive_empty(300, 1);
    receive_empty(IW_ID_LEFT_SETPOINT, 8);
    TEST_ASSERT_EQUAL_INT(IW_CONFIRMED, assumptions()->entry[IW_ASSUMPTION_DLC].state);
}

TEST(test_length_of_status_alone_confirms_the_dlc) {
    gateway_rig_init(&rig);
    rig.wheel[IW_LEFT].mute = true;
    rig.wheel[IW_RIGHT].mute = true;
    receive_empty(IW_ID_LEFT_SPEED, IW_DLC_SPEED);
    receive_empty(IW_ID_RIGHT_POSE, IW_DLC_POSE);
    receive_empty(IW_ID_LEFT_FORCE, IW_DLC_FORCE);
    TEST_ASSERT_EQUAL_INT(IW_ASSUMED, assumptions()->entry[IW_ASSUMPTION_DLC].state);
    receive_empty(IW_ID_LEFT_STATUS, IW_DLC_STATUS);
    TEST_ASSERT_EQUAL_INT(IW_CONFIRMED, assumptions()->entry[IW_ASSUMPTION_DLC].state);
}

TEST(test_assumption_set_as_assumed_changes_nothing) {
    static const iw_assumption_entry_t assumed = {IW_ASSUMED, IW_SOURCE_OPERATOR, 0};
    const uint32_t changes = assumptions()->changes;
    iw_gateway_set_assumption(&rig.gateway, IW_ASSUMPTION_CURRENT_ROLE, &assumed);
    TEST_ASSERT_EQUAL_UINT32(changes, assumptions()->changes);
    TEST_ASSERT_EQUAL_INT(IW_ASSUMED, assumptions()->entry[IW_ASSUMPTION_CURRENT_ROLE].state);
}

TEST(test_is_sending_from_arm_until_the_zeros_end) {
    TEST_ASSERT_FALSE(iw_gateway_is_sending(&rig.gateway));
    TEST_ASSERT_EQUAL_INT(IW_REFUSE_NONE, iw_gateway_arm(&rig.gateway, rig.now_us, HOLDER, false));
    TEST_ASSERT_TRUE(iw_gateway_is_sending(&rig.gateway));
    gateway_rig_arm(&rig);
    TEST_ASSERT_TRUE(iw_gateway_is_sending(&rig.gateway));
    gateway_rig_stop(&rig);
    TEST_ASSERT_TRUE(iw_gateway_is_sending(&rig.gateway));
    gateway_rig_run(&rig, MS(3000));
    TEST_ASSERT_FALSE(iw_gateway_is_sending(&rig.gateway));
    iw_gateway_estop(&rig.gateway, rig.now_us, HOLDER);
    TEST_ASSERT_FALSE(iw_gateway_is_sending(&rig.gateway));
}
