// SPDX-License-Identifier: MIT
// Codec, exhaustive: every id with every length, format and kind; every value of every field, encoded and decoded.
#include <stdio.h>
#include <string.h>

#include "message.h"
#include "unit.h"

#define POISON      0xA5
#define FIELDS_MAX  4
#define FORMAT_BITS 4

/// Field as in the table of the document, and its member in the struct of the codec.
typedef struct {
    size_t member;
    uint8_t byte;
    uint8_t width; ///< Bytes; 0: no such field.
    bool is_signed;
} field_t;

typedef struct {
    uint32_t id;
    uint8_t dlc;
    iw_codec_kind_t kind;
    iw_side_t side;
    field_t field[FIELDS_MAX];
} layout_t;

#define AT(member) offsetof(message_t, as.member)
#define SETPOINT_FIELDS                                                                                                \
    {                                                                                                                  \
        {AT(setpoint.type), 0, 1, false}, {AT(setpoint.speed_mm_s), 1, 2, true},                                       \
            {AT(setpoint.current_mA), 3, 2, true}, {                                                                   \
            0, 0, 0, false                                                                                             \
        }                                                                                                              \
    }
#define SPEED_FIELDS                                                                                                   \
    {                                                                                                                  \
        {AT(speed.speed_rpm), 0, 2, true}, {AT(speed.acceleration_raw), 2, 2, true}, {0, 0, 0, false}, {               \
            0, 0, 0, false                                                                                             \
        }                                                                                                              \
    }
#define STATUS_FIELDS                                                                                                  \
    {                                                                                                                  \
        {AT(status.battery_dV), 0, 1, false}, {AT(status.temperature_degC), 1, 1, false},                              \
            {AT(status.odometry_ticks), 2, 4, true}, {                                                                 \
            AT(status.cpu_percent), 6, 1, false                                                                        \
        }                                                                                                              \
    }
#define POSE_FIELDS                                                                                                    \
    {                                                                                                                  \
        {AT(pose.x_mm), 0, 2, true}, {AT(pose.y_mm), 2, 2, true}, {AT(pose.z_mm), 4, 2, true}, {                       \
            AT(pose.psi_mrad), 6, 2, true                                                                              \
        }                                                                                                              \
    }
#define FORCE_FIELDS                                                                                                   \
    {                                                                                                                  \
        {AT(force.force_raw), 0, 2, true}, {AT(force.debug_raw), 2, 2, true}, {0, 0, 0, false}, {                      \
            0, 0, 0, false                                                                                             \
        }                                                                                                              \
    }
#define OFFSET_FIELDS                                                                                                  \
    {                                                                                                                  \
        {AT(offset.offset_dN), 0, 2, true}, {0, 0, 0, false}, {0, 0, 0, false}, {                                      \
            0, 0, 0, false                                                                                             \
        }                                                                                                              \
    }

static const layout_t layouts[] = {
    {266, 5, IW_CODEC_SETPOINT, IW_LEFT, SETPOINT_FIELDS}, {298, 5, IW_CODEC_SETPOINT, IW_RIGHT, SETPOINT_FIELDS},
    {256, 4, IW_CODEC_SPEED, IW_LEFT, SPEED_FIELDS},       {288, 4, IW_CODEC_SPEED, IW_RIGHT, SPEED_FIELDS},
    {257, 7, IW_CODEC_STATUS, IW_LEFT, STATUS_FIELDS},     {289, 7, IW_CODEC_STATUS, IW_RIGHT, STATUS_FIELDS},
    {290, 8, IW_CODEC_POSE, IW_RIGHT, POSE_FIELDS},        {512, 4, IW_CODEC_FORCE, IW_LEFT, FORCE_FIELDS},
    {544, 4, IW_CODEC_FORCE, IW_RIGHT, FORCE_FIELDS},      {513, 2, IW_CODEC_OFFSET, IW_LEFT, OFFSET_FIELDS},
    {545, 2, IW_CODEC_OFFSET, IW_RIGHT, OFFSET_FIELDS},
};
#define LAYOUTS (sizeof layouts / sizeof layouts[0])

static const layout_t *layout_of(uint32_t id) {
    for (size_t i = 0; i < LAYOUTS; i++) {
        if (layouts[i].id == id) {
            return &layouts[i];
        }
    }
    return NULL;
}

static int64_t read_bytes(const field_t *field, const uint8_t *data) {
    int64_t value = 0;
    int64_t range = 1;
    for (unsigned i = 0; i < field->width; i++) {
        value = value * 256 + data[field->byte + i];
        range *= 256;
    }
    return (field->is_signed && value >= range / 2) ? value - range : value;
}

static void write_bytes(const field_t *field, int64_t value, uint8_t *data) {
    for (unsigned i = field->width; i-- > 0;) {
        const int64_t low = ((value % 256) + 256) % 256;
        data[field->byte + i] = (uint8_t)low;
        value = (value - low) / 256;
    }
}

static int64_t read_member(const field_t *field, const message_t *message) {
    const uint8_t *place = (const uint8_t *)message + field->member;
    int32_t wide;
    int16_t half;
    if (field->width == 4) {
        memcpy(&wide, place, sizeof wide);
        return wide;
    }
    if (field->width == 2) {
        memcpy(&half, place, sizeof half);
        return half;
    }
    return *place;
}

static void write_member(const field_t *field, int64_t value, message_t *message) {
    uint8_t *place = (uint8_t *)message + field->member;
    const int32_t wide = (int32_t)value;
    const int16_t half = (int16_t)value;
    if (field->width == 4) {
        memcpy(place, &wide, sizeof wide);
    } else if (field->width == 2) {
        memcpy(place, &half, sizeof half);
    } else {
        *place = (uint8_t)value;
    }
}

static bool decodes_to_the_table(const layout_t *layout, const iw_can_frame_t *frame) {
    message_t message;
    memset(&message, POISON, sizeof message);
    if (!message_decode(frame, &message) || message.kind != layout->kind || message.side != layout->side) {
        return false;
    }
    for (size_t f = 0; f < FIELDS_MAX && layout->field[f].width > 0; f++) {
        if (read_member(&layout->field[f], &message) != read_bytes(&layout->field[f], frame->data)) {
            return false;
        }
    }
    return true;
}

static bool encodes_to_the_table(const layout_t *layout, const iw_can_frame_t *frame) {
    message_t message;
    iw_can_frame_t expected = *frame;
    iw_can_frame_t actual;
    memset(&message, POISON, sizeof message);
    memset(&actual, POISON, sizeof actual);
    message.kind = layout->kind;
    message.side = layout->side;
    for (size_t f = 0; f < FIELDS_MAX && layout->field[f].width > 0; f++) {
        write_member(&layout->field[f], read_bytes(&layout->field[f], frame->data), &message);
    }
    if (layout->kind == IW_CODEC_SETPOINT) {
        const field_t *current = &layout->field[2];
        const int64_t wanted = read_bytes(current, frame->data);
        write_bytes(current, (wanted > 2000) ? 2000 : (wanted < -2000) ? -2000 : wanted, expected.data);
    }
    return message_encode(&message, &actual) == IW_OK && actual.id == expected.id && actual.dlc == expected.dlc &&
           actual.kind == expected.kind && memcmp(actual.data, expected.data, IW_CAN_DATA_MAX) == 0;
}

static void fail_for(const iw_can_frame_t *frame, const char *what) {
    char text[96];
    (void)snprintf(text, sizeof text, "%s: id 0x%08lX dlc %u kind %u data %02X %02X %02X %02X %02X %02X %02X %02X",
                   what, (unsigned long)frame->id, frame->dlc, frame->kind, frame->data[0], frame->data[1],
                   frame->data[2], frame->data[3], frame->data[4], frame->data[5], frame->data[6], frame->data[7]);
    TEST_FAIL_MESSAGE(text);
}

static void check_frame(const layout_t *layout, const iw_can_frame_t *frame) {
    if (!decodes_to_the_table(layout, frame)) {
        fail_for(frame, "decoded wrongly");
    }
    if (!encodes_to_the_table(layout, frame)) {
        fail_for(frame, "encoded wrongly");
    }
}

/// Returns a frame of this message with `background` in all its bytes and zeros after its length.
static iw_can_frame_t frame_of(const layout_t *layout, uint8_t background) {
    iw_can_frame_t frame;
    memset(&frame, 0, sizeof frame);
    frame.id = layout->id;
    frame.dlc = layout->dlc;
    frame.kind = IW_CAN_RECEIVED;
    memset(frame.data, background, layout->dlc);
    return frame;
}

static void sweep_narrow_field(const layout_t *layout, const field_t *field, uint8_t background) {
    iw_can_frame_t frame = frame_of(layout, background);
    const int64_t values = (field->width == 2) ? 65536 : 256;
    for (int64_t value = 0; value < values; value++) {
        write_bytes(field, value, frame.data);
        check_frame(layout, &frame);
    }
}

/// Four bytes have too many values for a full sweep: every value of each byte, and values near each power of two.
static void sweep_wide_field(const layout_t *layout, const field_t *field, uint8_t background) {
    iw_can_frame_t frame = frame_of(layout, background);
    for (unsigned byte = field->byte; byte < (unsigned)field->byte + field->width; byte++) {
        for (unsigned value = 0; value < 256; value++) {
            frame.data[byte] = (uint8_t)value;
            check_frame(layout, &frame);
        }
        frame.data[byte] = background;
    }
    for (unsigned bit = 0; bit < 32; bit++) {
        for (int64_t nearby = -2; nearby <= 2; nearby++) {
            write_bytes(field, ((int64_t)1 << bit) + nearby, frame.data);
            check_frame(layout, &frame);
            write_bytes(field, -((int64_t)1 << bit) + nearby, frame.data);
            check_frame(layout, &frame);
        }
    }
}

TEST(test_codec_every_value_of_every_field_encodes_and_decodes) {
    static const uint8_t backgrounds[] = {0x00, 0xFF, 0x80, 0x5A};
    for (size_t i = 0; i < LAYOUTS * sizeof backgrounds; i++) {
        const layout_t *layout = &layouts[i / sizeof backgrounds];
        for (size_t f = 0; f < FIELDS_MAX && layout->field[f].width > 0; f++) {
            const field_t *field = &layout->field[f];
            if (field->width == 4) {
                sweep_wide_field(layout, field, backgrounds[i % sizeof backgrounds]);
            } else {
                sweep_narrow_field(layout, field, backgrounds[i % sizeof backgrounds]);
            }
        }
    }
}

/// Returns the kind that the contract requires for a frame with this number, format and length.
static iw_codec_kind_t expected_kind(uint32_t number, uint32_t format, uint8_t dlc) {
    const layout_t *layout = layout_of(number);
    if (layout == NULL) {
        return IW_CODEC_UNKNOWN;
    }
    if (format != 0) {
        return IW_CODEC_BAD_FORMAT;
    }
    return (dlc < layout->dlc || dlc > IW_CAN_DATA_MAX) ? IW_CODEC_BAD_LENGTH : layout->kind;
}

static bool is_poison(const iw_codec_wheel_t decoded[IW_SIDES]) {
    iw_codec_wheel_t poison[IW_SIDES];
    memset(poison, POISON, sizeof poison);
    return memcmp(decoded, poison, sizeof poison) == 0;
}

static void check_kind(const iw_can_frame_t *frame, iw_codec_kind_t expected) {
    iw_codec_wheel_t decoded[IW_SIDES];
    memset(decoded, POISON, sizeof decoded);
    if (iw_codec_decode(frame, decoded) != expected) {
        fail_for(frame, "wrong kind");
    }
    if (is_poison(decoded) != (expected >= IW_CODEC_KINDS)) {
        fail_for(frame, "output must be written on success only");
    }
}

TEST(test_decode_every_id_length_and_format_gives_documented_kind) {
    static const uint32_t formats[FORMAT_BITS] = {IW_CAN_EXTENDED, IW_CAN_REMOTE, IW_CAN_ERROR, IW_CAN_FD};
    for (uint32_t number = 0; number <= IW_CAN_ID_MASK; number++) {
        for (unsigned rest = 0; rest < 2U * 16U * 16U; rest++) {
            uint32_t format = 0;
            for (unsigned bit = 0; bit < FORMAT_BITS; bit++) {
                format |= ((rest >> bit & 1U) != 0) ? formats[bit] : 0U;
            }
            iw_can_frame_t frame = {
                .id = number | format, .dlc = (uint8_t)(rest / 16U % 16U), .kind = (uint8_t)(rest / 256U)};
            memset(frame.data, 0x5A, sizeof frame.data);
            check_kind(&frame, expected_kind(number, format, frame.dlc));
        }
    }
}

TEST(test_decode_lengths_above_8_are_refused) {
    for (size_t i = 0; i < LAYOUTS; i++) {
        for (unsigned dlc = 9; dlc < 256; dlc++) {
            iw_can_frame_t frame = frame_of(&layouts[i], 0x11);
            frame.dlc = (uint8_t)dlc;
            check_kind(&frame, IW_CODEC_BAD_LENGTH);
        }
    }
}

/// A 29-bit id with the low 11 bits of a known id is another number, with and without the extended flag.
TEST(test_decode_29_bit_id_with_known_low_bits_is_unknown) {
    for (size_t i = 0; i < LAYOUTS; i++) {
        for (unsigned bit = 11; bit < 28; bit++) {
            iw_can_frame_t frame = frame_of(&layouts[i], 0x11);
            frame.dlc = IW_CAN_DATA_MAX;
            frame.id = layouts[i].id | (uint32_t)1 << bit;
            check_kind(&frame, IW_CODEC_UNKNOWN);
            frame.id |= IW_CAN_EXTENDED;
            check_kind(&frame, IW_CODEC_UNKNOWN);
        }
    }
}
