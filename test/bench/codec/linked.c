// SPDX-License-Identifier: MIT
/// The part of the codec that a linker retains for a program that reads all messages and sends setpoints.
#include "iwheel/codec.h"

iw_codec_kind_t bench_linked_decode(const iw_can_frame_t *frame, iw_codec_wheel_t wheel[IW_SIDES]);
bool bench_linked_encode(iw_side_t side, const iw_codec_setpoint_t *setpoint, iw_can_frame_t *out_frame);

iw_codec_kind_t bench_linked_decode(const iw_can_frame_t *frame, iw_codec_wheel_t wheel[IW_SIDES]) {
    return iw_codec_decode(frame, wheel);
}

bool bench_linked_encode(iw_side_t side, const iw_codec_setpoint_t *setpoint, iw_can_frame_t *out_frame) {
    return iw_codec_encode_setpoint(side, setpoint, IW_DLC_SETPOINT, out_frame);
}
