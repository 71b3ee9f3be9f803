// SPDX-License-Identifier: MIT
// Codec: golden vectors, and rules that no single vector shows.
#include <string.h>

#include "golden_vectors.h"
#include "unit.h"

#define POISON 0xA5

static void assert_same_bytes(const iw_can_frame_t *expected, const iw_can_frame_t *actual, const char *name) {
    TEST_ASSERT_EQUAL_HEX32_MESSAGE(expected->id, actual->id, name);
    TEST_ASSERT_EQUAL_UINT8_MESSAGE(expected->dlc, actual->dlc, name);
    TEST_ASSERT_EQUAL_UINT8_MESSAGE(expected->kind, actual->kind, name);
    TEST_ASSERT_EQUAL_HEX8_ARRAY_MESSAGE(expected->data, actual->data, IW_CAN_DATA_MAX, name);
}

static void assert_same_motion(const message_t *expected, const message_t *actual, const char *name) {
    if (expected->kind == IW_CODEC_SETPOINT) {
        TEST_ASSERT_EQUAL_UINT8_MESSAGE(expected->as.setpoint.type, actual->as.setpoint.type, name);
        TEST_ASSERT_EQUAL_INT16_MESSAGE(expected->as.setpoint.speed_mm_s, actual->as.setpoint.speed_mm_s, name);
        TEST_ASSERT_EQUAL_INT16_MESSAGE(expected->as.setpoint.current_mA, actual->as.setpoint.current_mA, name);
    } else if (expected->kind == IW_CODEC_SPEED) {
        TEST_ASSERT_EQUAL_INT16_MESSAGE(expected->as.speed.speed_rpm, actual->as.speed.speed_rpm, name);
        TEST_ASSERT_EQUAL_INT16_MESSAGE(expected->as.speed.acceleration_raw, actual->as.speed.acceleration_raw, name);
    } else if (expected->kind == IW_CODEC_STATUS) {
        TEST_ASSERT_EQUAL_INT32_MESSAGE(expected->as.status.odometry_ticks, actual->as.status.odometry_ticks, name);
        TEST_ASSERT_EQUAL_UINT8_MESSAGE(expected->as.status.battery_dV, actual->as.status.battery_dV, name);
        TEST_ASSERT_EQUAL_UINT8_MESSAGE(expected->as.status.temperature_degC, actual->as.status.temperature_degC, name);
        TEST_ASSERT_EQUAL_UINT8_MESSAGE(expected->as.status.cpu_percent, actual->as.status.cpu_percent, name);
    }
}

static void assert_same_rest(const message_t *expected, const message_t *actual, const char *name) {
    if (expected->kind == IW_CODEC_POSE) {
        TEST_ASSERT_EQUAL_INT16_MESSAGE(expected->as.pose.x_mm, actual->as.pose.x_mm, name);
        TEST_ASSERT_EQUAL_INT16_MESSAGE(expected->as.pose.y_mm, actual->as.pose.y_mm, name);
        TEST_ASSERT_EQUAL_INT16_MESSAGE(expected->as.pose.z_mm, actual->as.pose.z_mm, name);
        TEST_ASSERT_EQUAL_INT16_MESSAGE(expected->as.pose.psi_mrad, actual->as.pose.psi_mrad, name);
    } else if (expected->kind == IW_CODEC_FORCE) {
        TEST_ASSERT_EQUAL_INT16_MESSAGE(expected->as.force.force_raw, actual->as.force.force_raw, name);
        TEST_ASSERT_EQUAL_INT16_MESSAGE(expected->as.force.debug_raw, actual->as.force.debug_raw, name);
    } else if (expected->kind == IW_CODEC_OFFSET) {
        TEST_ASSERT_EQUAL_INT16_MESSAGE(expected->as.offset.offset_dN, actual->as.offset.offset_dN, name);
    }
}

static void assert_same_message(const message_t *expected, const message_t *actual, const char *name) {
    TEST_ASSERT_EQUAL_INT_MESSAGE(expected->kind, actual->kind, name);
    TEST_ASSERT_EQUAL_INT_MESSAGE(expected->side, actual->side, name);
    assert_same_motion(expected, actual, name);
    assert_same_rest(expected, actual, name);
}

static void assert_untouched(const void *object, size_t size, const char *name) {
    const uint8_t *bytes = object;
    for (size_t i = 0; i < size; i++) {
        TEST_ASSERT_EQUAL_HEX8_MESSAGE(POISON, bytes[i], name);
    }
}

TEST(test_golden_table_covers_all_eleven_messages) {
    static const uint32_t ids[] = {256, 257, 266, 288, 289, 290, 298, 512, 513, 544, 545};
    for (size_t i = 0; i < sizeof ids / sizeof ids[0]; i++) {
        unsigned found = 0;
        for (size_t v = 0; v < GOLDEN_VECTORS; v++) {
            found += (golden_vectors[v].frame.id == ids[i]) ? 1U : 0U;
        }
        TEST_ASSERT_EQUAL_UINT(5, found);
    }
    TEST_ASSERT_EQUAL_UINT(55, GOLDEN_VECTORS);
}

TEST(test_decode_golden_frame_returns_golden_values) {
    for (size_t v = 0; v < GOLDEN_VECTORS; v++) {
        const golden_vector_t *golden = &golden_vectors[v];
        message_t message;
        memset(&message, POISON, sizeof message);
        TEST_ASSERT_TRUE_MESSAGE(message_decode(&golden->frame, &message), golden->name);
        assert_same_message(&golden->message, &message, golden->name);
    }
}

TEST(test_encode_golden_values_returns_golden_frame) {
    for (size_t v = 0; v < GOLDEN_VECTORS; v++) {
        const golden_vector_t *golden = &golden_vectors[v];
        iw_can_frame_t frame;
        memset(&frame, POISON, sizeof frame);
        TEST_ASSERT_EQUAL_INT_MESSAGE(IW_OK, message_encode(&golden->message, &frame), golden->name);
        assert_same_bytes(&golden->frame, &frame, golden->name);
    }
}

TEST(test_decode_longer_frame_ignores_the_additional_bytes) {
    for (size_t v = 0; v < GOLDEN_VECTORS; v++) {
        const golden_vector_t *golden = &golden_vectors[v];
        for (uint8_t dlc = golden->frame.dlc; dlc <= IW_CAN_DATA_MAX; dlc++) {
            iw_can_frame_t frame = golden->frame;
            message_t message;
            memset(&message, POISON, sizeof message);
            memset(frame.data + golden->frame.dlc, 0xFF, IW_CAN_DATA_MAX - (size_t)golden->frame.dlc);
            frame.dlc = dlc;
            TEST_ASSERT_TRUE_MESSAGE(message_decode(&frame, &message), golden->name);
            assert_same_message(&golden->message, &message, golden->name);
        }
    }
}

TEST(test_decode_shorter_frame_is_refused_output_unchanged) {
    for (size_t v = 0; v < GOLDEN_VECTORS; v++) {
        const golden_vector_t *golden = &golden_vectors[v];
        for (uint8_t dlc = 0; dlc < golden->frame.dlc; dlc++) {
            iw_can_frame_t frame = golden->frame;
            iw_codec_wheel_t decoded[IW_SIDES];
            memset(decoded, POISON, sizeof decoded);
            frame.dlc = dlc;
            TEST_ASSERT_EQUAL_INT_MESSAGE(IW_CODEC_BAD_LENGTH, iw_codec_decode(&frame, decoded), golden->name);
            assert_untouched(decoded, sizeof decoded, golden->name);
        }
    }
}

/// Returns offset and size of the values of a kind.
static void place_of(iw_codec_kind_t kind, size_t *out_at, size_t *out_size) {
#define PLACE(kind, member) [kind] = { offsetof(iw_codec_wheel_t, member), sizeof(((iw_codec_wheel_t *)NULL)->member) }
    static const size_t places[][2] = {PLACE(IW_CODEC_SPEED, speed),   PLACE(IW_CODEC_STATUS, status),
                                       PLACE(IW_CODEC_FORCE, force),   PLACE(IW_CODEC_POSE, pose),
                                       PLACE(IW_CODEC_OFFSET, offset), PLACE(IW_CODEC_SETPOINT, setpoint)};
#undef PLACE
    *out_at = places[kind][0];
    *out_size = places[kind][1];
}

TEST(test_decode_writes_only_the_values_of_the_frame) {
    for (size_t v = 0; v < GOLDEN_VECTORS; v++) {
        const golden_vector_t *golden = &golden_vectors[v];
        iw_codec_wheel_t decoded[IW_SIDES];
        size_t at;
        size_t size;
        memset(decoded, POISON, sizeof decoded);
        TEST_ASSERT_EQUAL_INT_MESSAGE(golden->message.kind, iw_codec_decode(&golden->frame, decoded), golden->name);
        place_of(golden->message.kind, &at, &size);
        memset((uint8_t *)&decoded[golden->message.side] + at, POISON, size);
        assert_untouched(decoded, sizeof decoded, golden->name);
    }
}

TEST(test_codec_find_agrees_with_decode_for_every_id) {
    for (uint32_t id = 0; id <= IW_CAN_ID_MASK; id++) {
        const iw_codec_row_t *row = iw_codec_find(id);
        iw_codec_wheel_t decoded[IW_SIDES];
        const iw_can_frame_t frame = {.id = id, .dlc = IW_CAN_DATA_MAX};
        const iw_codec_kind_t kind = iw_codec_decode(&frame, decoded);
        TEST_ASSERT_EQUAL_INT(kind == IW_CODEC_UNKNOWN, row == NULL);
        if (row != NULL) {
            TEST_ASSERT_EQUAL_UINT32(id, row->id);
            TEST_ASSERT_EQUAL_INT(kind, row->kind);
            TEST_ASSERT_EQUAL_INT(iw_codec_side(id), row->side);
        }
    }
}

TEST(test_codec_row_length_agrees_with_decode_and_encode) {
    for (size_t i = 0; i < IW_CODEC_ROWS; i++) {
        const iw_codec_row_t *row = &iw_codec_rows[i];
        const iw_codec_wheel_t zero = {.pose = {0, 0, 0, 0}};
        iw_codec_wheel_t decoded[IW_SIDES];
        iw_can_frame_t frame;
        TEST_ASSERT_EQUAL_INT(IW_OK, iw_codec_encode((iw_codec_kind_t)row->kind, (iw_side_t)row->side, &zero, &frame));
        TEST_ASSERT_EQUAL_UINT8(row->length, frame.dlc);
        TEST_ASSERT_EQUAL_UINT8(row->length, iw_codec_length((iw_codec_kind_t)row->kind));
        TEST_ASSERT_EQUAL_INT(row->kind, iw_codec_decode(&frame, decoded));
        frame.dlc--;
        TEST_ASSERT_EQUAL_INT(IW_CODEC_BAD_LENGTH, iw_codec_decode(&frame, decoded));
    }
}

TEST(test_codec_name_of_each_kind) {
    TEST_ASSERT_EQUAL_STRING("speed", iw_codec_name(IW_CODEC_SPEED));
    TEST_ASSERT_EQUAL_STRING("status", iw_codec_name(IW_CODEC_STATUS));
    TEST_ASSERT_EQUAL_STRING("force", iw_codec_name(IW_CODEC_FORCE));
    TEST_ASSERT_EQUAL_STRING("pose", iw_codec_name(IW_CODEC_POSE));
    TEST_ASSERT_EQUAL_STRING("offset", iw_codec_name(IW_CODEC_OFFSET));
    TEST_ASSERT_EQUAL_STRING("setpoint", iw_codec_name(IW_CODEC_SETPOINT));
}

TEST(test_decode_own_echo_returns_the_same_values) {
    for (size_t v = 0; v < GOLDEN_VECTORS; v++) {
        iw_can_frame_t frame = golden_vectors[v].frame;
        message_t message;
        memset(&message, POISON, sizeof message);
        frame.kind = IW_CAN_ECHO;
        TEST_ASSERT_TRUE_MESSAGE(message_decode(&frame, &message), golden_vectors[v].name);
        assert_same_message(&golden_vectors[v].message, &message, golden_vectors[v].name);
    }
}

TEST(test_decode_setpoint_of_another_sender_is_not_clamped) {
    const iw_can_frame_t frame = {.id = IW_ID_LEFT_SETPOINT, .dlc = 5, .data = {0xEE, 0x80, 0x00, 0x7F, 0xFF}};
    message_t message;
    memset(&message, POISON, sizeof message);
    TEST_ASSERT_TRUE(message_decode(&frame, &message));
    TEST_ASSERT_EQUAL_UINT8(0xEE, message.as.setpoint.type);
    TEST_ASSERT_EQUAL_INT16(-32767 - 1, message.as.setpoint.speed_mm_s);
    TEST_ASSERT_EQUAL_INT16(32767, message.as.setpoint.current_mA);
}

TEST(test_encode_pose_of_left_wheel_is_refused_output_unchanged) {
    const message_t message = {IW_CODEC_POSE, IW_LEFT, {.pose = {1, 2, 3, 4}}};
    iw_can_frame_t frame;
    memset(&frame, POISON, sizeof frame);
    TEST_ASSERT_EQUAL_INT(IW_ERR_ID, message_encode(&message, &frame));
    assert_untouched(&frame, sizeof frame, "left pose");
}

TEST(test_encode_setpoint_pads_every_length_with_zeros) {
    static const uint8_t bytes[IW_CAN_DATA_MAX] = {0x5A, 0x12, 0x34, 0xFF, 0xFE, 0, 0, 0};
    static const uint32_t ids[IW_SIDES] = {266, 298};
    const iw_codec_setpoint_t setpoint = {.type = 0x5A, .speed_mm_s = 0x1234, .current_mA = -2};
    for (int side = 0; side < IW_SIDES; side++) {
        for (uint8_t dlc = 5; dlc <= 8; dlc++) {
            iw_can_frame_t frame;
            memset(&frame, POISON, sizeof frame);
            TEST_ASSERT_FALSE(iw_codec_encode_setpoint((iw_side_t)side, &setpoint, dlc, &frame));
            TEST_ASSERT_EQUAL_HEX32(ids[side], frame.id);
            TEST_ASSERT_EQUAL_UINT8(dlc, frame.dlc);
            TEST_ASSERT_EQUAL_UINT8(IW_CAN_RECEIVED, frame.kind);
            TEST_ASSERT_EQUAL_HEX8_ARRAY(bytes, frame.data, IW_CAN_DATA_MAX);
        }
    }
}

/// Returns the current that the frame must contain for a wanted current.
static int32_t clamped(int32_t current_mA) {
    return (current_mA > 2000) ? 2000 : (current_mA < -2000) ? -2000 : current_mA;
}

static int32_t current_of(const iw_can_frame_t *frame) {
    const int32_t value = frame->data[3] * 256 + frame->data[4];
    return (value >= 32768) ? value - 65536 : value;
}

TEST(test_encode_setpoint_clamps_every_current_and_reports_it) {
    for (int32_t current = -32768; current <= 32767; current++) {
        const iw_codec_setpoint_t setpoint = {.type = 1, .speed_mm_s = -5, .current_mA = (int16_t)current};
        iw_can_frame_t frame;
        const bool reported = iw_codec_encode_setpoint(IW_RIGHT, &setpoint, 5, &frame);
        if (current_of(&frame) != clamped(current) || reported != (clamped(current) != current)) {
            TEST_ASSERT_EQUAL_INT32(clamped(current), current_of(&frame));
            TEST_ASSERT_EQUAL_INT_MESSAGE(clamped(current) != current, reported, "clamping must be reported");
        }
    }
}

TEST(test_encode_message_clamps_a_setpoint_too) {
    static const int16_t wanted[] = {-32767 - 1, -2001, -2000, 2000, 2001, 32767};
    for (size_t i = 0; i < sizeof wanted / sizeof wanted[0]; i++) {
        const message_t message = {IW_CODEC_SETPOINT, IW_LEFT, {.setpoint = {.current_mA = wanted[i]}}};
        iw_can_frame_t frame;
        TEST_ASSERT_EQUAL_INT(IW_OK, message_encode(&message, &frame));
        TEST_ASSERT_EQUAL_INT32(clamped(wanted[i]), current_of(&frame));
    }
}

TEST(test_encode_setpoint_does_not_change_its_argument) {
    iw_codec_setpoint_t setpoint = {.type = 9, .speed_mm_s = 7, .current_mA = 30000};
    iw_can_frame_t frame;
    TEST_ASSERT_TRUE(iw_codec_encode_setpoint(IW_LEFT, &setpoint, 5, &frame));
    TEST_ASSERT_EQUAL_INT16(30000, setpoint.current_mA);
}
