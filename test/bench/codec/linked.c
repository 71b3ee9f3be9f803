// SPDX-License-Identifier: MIT
/// What a linker keeps of the codec for a program that reads all messages and sends setpoints.
#include "iwheel/proto.h"

iw_status_t bench_linked_decode(const iw_can_frame_t *frame, iw_proto_message_t *out_message);
bool bench_linked_encode(iw_side_t side, const iw_proto_setpoint_t *setpoint, iw_can_frame_t *out_frame);

iw_status_t bench_linked_decode(const iw_can_frame_t *frame, iw_proto_message_t *out_message) {
    return iw_proto_decode(frame, out_message);
}

bool bench_linked_encode(iw_side_t side, const iw_proto_setpoint_t *setpoint, iw_can_frame_t *out_frame) {
    return iw_proto_encode_setpoint(side, setpoint, IW_DLC_SETPOINT, out_frame);
}
