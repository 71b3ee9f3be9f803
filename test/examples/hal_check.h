// SPDX-License-Identifier: MIT
/// Calls the functions of an example HAL, and makes the frames of the tests.
#ifndef HAL_CHECK_H
#define HAL_CHECK_H

#include "iwheel/codec.h"
#include "iwheel/hal.h"

#include "unit.h"

#define LEFT  IW_ID_LEFT_SETPOINT
#define RIGHT IW_ID_RIGHT_SETPOINT

/// Returns a setpoint whose bytes depend on `value`.
static inline iw_can_frame_t setpoint(uint32_t id, uint8_t value) {
    return (iw_can_frame_t){.id = id, .data = {1, 0, value, 0, 100}, .dlc = 5};
}

static inline int send_pair(const iw_hal_t *hal, uint8_t value) {
    const iw_can_frame_t pair[] = {setpoint(LEFT, value), setpoint(RIGHT, value)};
    return hal->send(hal->context, pair, IW_SIDES);
}

/// The next frame is `id` of this kind; for a setpoint, with the bytes of `value`.
static inline void expect_frame(const iw_hal_t *hal, uint32_t id, iw_can_kind_t kind, uint8_t value) {
    iw_can_frame_t frame = {.id = 0};
    TEST_ASSERT_EQUAL_INT(1, hal->receive(hal->context, &frame));
    TEST_ASSERT_EQUAL_HEX32(id, frame.id);
    TEST_ASSERT_EQUAL_INT(kind, frame.kind);
    if (frame.dlc > 2U) {
        TEST_ASSERT_EQUAL_UINT8(value, frame.data[2]);
    }
}

static inline void expect_echoes(const iw_hal_t *hal, uint8_t value) {
    expect_frame(hal, LEFT, IW_CAN_ECHO, value);
    expect_frame(hal, RIGHT, IW_CAN_ECHO, value);
}

static inline void expect_none(const iw_hal_t *hal) {
    iw_can_frame_t frame;
    TEST_ASSERT_EQUAL_INT(0, hal->receive(hal->context, &frame));
}

static inline void expect_state(const iw_hal_t *hal, iw_bus_state_t state) {
    TEST_ASSERT_EQUAL_INT(state, hal->bus_state(hal->context));
}

#endif
