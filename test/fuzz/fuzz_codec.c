// SPDX-License-Identifier: MIT
// Any bytes as a frame: decoding returns the values of its bytes, and encoding returns the same bytes.
#include "fuzz_sequence.h"

#include "../support/message.h"
#include "iwheel/codec.h"

static uint8_t least_dlc(iw_codec_kind_t kind) {
    static const uint8_t table[] = {
        [IW_CODEC_SETPOINT] = IW_DLC_SETPOINT, [IW_CODEC_SPEED] = IW_DLC_SPEED, [IW_CODEC_STATUS] = IW_DLC_STATUS,
        [IW_CODEC_POSE] = IW_DLC_POSE,         [IW_CODEC_FORCE] = IW_DLC_FORCE, [IW_CODEC_OFFSET] = IW_DLC_OFFSET,
    };
    return table[kind];
}

static iw_can_frame_t take_frame(fuzz_bytes_t *bytes) {
    static const uint16_t ids[] = {266, 298, 256, 288, 257, 289, 290, 512, 544, 513, 545};
    iw_can_frame_t frame = {0};
    const uint8_t choice = fuzz_byte(bytes);
    if (choice < 0xC0U) {
        frame.id = ids[choice % (sizeof ids / sizeof ids[0])];
    } else {
        frame.id = (uint32_t)fuzz_word(bytes) << 16;
        frame.id |= fuzz_word(bytes);
    }
    frame.dlc = fuzz_byte(bytes) % 16U;
    frame.kind = fuzz_byte(bytes);
    for (size_t i = 0; i < IW_CAN_DATA_MAX; i++) {
        frame.data[i] = fuzz_byte(bytes);
    }
    return frame;
}

static void judge(const iw_can_frame_t *frame, const message_t *message) {
    iw_can_frame_t again;
    fuzz_require(frame->id <= IW_CAN_ID_MASK, "only 11-bit data frames are decoded");
    fuzz_require(frame->dlc >= least_dlc(message->kind) && frame->dlc <= IW_CAN_DATA_MAX, "short frames are refused");
    fuzz_require(message_encode(message, &again) == IW_OK, "a decoded frame can be encoded");
    fuzz_require(again.id == frame->id && again.dlc == least_dlc(message->kind),
                 "to the same id, in the table's length");
    if (message->kind == IW_CODEC_SETPOINT) {
        fuzz_require(memcmp(again.data, frame->data, 3) == 0, "type and speed of a setpoint survive");
        const int32_t current = message->as.setpoint.current_mA;
        const bool within = current >= -IW_CURRENT_LIMIT_mA && current <= IW_CURRENT_LIMIT_mA;
        fuzz_require((memcmp(again.data, frame->data, 5) == 0) == within, "the current too, unless it was clamped");
    } else if (message->kind == IW_CODEC_FORCE || message->kind == IW_CODEC_SPEED || message->kind == IW_CODEC_STATUS ||
               message->kind == IW_CODEC_POSE || message->kind == IW_CODEC_OFFSET) {
        fuzz_require(memcmp(again.data, frame->data, again.dlc) == 0, "the bytes survive");
    }
}

/// A frame as take_frame reads it.
static size_t fuzz_unit(const uint8_t *data, size_t size) {
    const size_t length = (data[0] < 0xC0U) ? 11U : 15U;
    return (length < size) ? length : size;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    fuzz_bytes_t bytes = {data, size, 0};
    while (bytes.at < bytes.size) {
        const iw_can_frame_t frame = take_frame(&bytes);
        message_t message;
        if (message_decode(&frame, &message)) {
            fuzz_position("accepted");
            judge(&frame, &message);
        } else {
            fuzz_position("refused");
        }
    }
    return 0;
}
