// SPDX-License-Identifier: MIT

#include "iwheel_northbound/json_out.h"

#include <stdio.h>

#define EXTENDED_ID_MASK 0x1FFFFFFFU

void iwn_out_frame(const iw_can_frame_t *frame, iw_time_us_t at_us, iwn_out_t *json) {
    const bool extended = (frame->id & IW_CAN_EXTENDED) != 0U;
    char data[2U * IW_CAN_DATA_MAX + 1U] = "";
    for (size_t i = 0; i < frame->dlc && i < IW_CAN_DATA_MAX; ++i) {
        (void)snprintf(&data[2U * i], 3U, "%02X", frame->data[i]);
    }
    iwn_out_int(json, "t_us", (int64_t)at_us);
    iwn_out_int(json, "id", frame->id & (extended ? EXTENDED_ID_MASK : IW_CAN_ID_MASK));
    iwn_out_int(json, "dlc", frame->dlc);
    iwn_out_text(json, "data", data);
    iwn_out_text(json, "kind", frame->kind == (uint8_t)IW_CAN_ECHO ? "echo" : "received");
    iwn_out_open(json, "flags", '[');
    if (extended) {
        iwn_out_text(json, NULL, "extended");
    }
    if ((frame->id & IW_CAN_REMOTE) != 0U) {
        iwn_out_text(json, NULL, "remote");
    }
    if (!extended && (frame->id & IW_CAN_FD) != 0U) {
        iwn_out_text(json, NULL, "fd");
    }
    iwn_out_close(json, ']');
}
