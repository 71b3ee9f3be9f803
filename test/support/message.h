// SPDX-License-Identifier: MIT
/// A message as a value: tests put it on a bus and read it from there.
#ifndef IW_TEST_MESSAGE_H
#define IW_TEST_MESSAGE_H

#include "iwheel/codec.h"

/// `kind` selects the member of `as`.
typedef struct {
    iw_codec_kind_t kind;
    iw_side_t side;
    iw_codec_wheel_t as;
} message_t;

/// Returns its frame; IW_ERR_ID if there is no such message.
static inline iw_status_t message_encode(const message_t *message, iw_can_frame_t *out_frame) {
    return iw_codec_encode(message->kind, message->side, &message->as, out_frame);
}

/// Returns true and the message if the frame is one.
static inline bool message_decode(const iw_can_frame_t *frame, message_t *out_message) {
    iw_codec_wheel_t decoded[IW_SIDES] = {{{0, 0}, {0, 0, 0, 0}, {0, 0}, {0, 0, 0, 0}, {0, 0, 0}, {0}},
                                          {{0, 0}, {0, 0, 0, 0}, {0, 0}, {0, 0, 0, 0}, {0, 0, 0}, {0}}};
    const iw_codec_kind_t kind = iw_codec_decode(frame, decoded);
    if (kind >= IW_CODEC_KINDS) {
        return false;
    }
    out_message->kind = kind;
    out_message->side = iw_codec_side(frame->id);
    out_message->as = decoded[out_message->side];
    return true;
}

#endif
