// SPDX-License-Identifier: MIT
#include "socketcan_socket.h"

#include <linux/can/error.h>
#include <string.h>
#include <sys/socket.h>

IW_STATIC_ASSERT(IW_CAN_EXTENDED == CAN_EFF_FLAG && IW_CAN_REMOTE == CAN_RTR_FLAG && IW_CAN_ERROR == CAN_ERR_FLAG,
                 socketcan_flags_are_those_of_the_kernel);
IW_STATIC_ASSERT(sizeof(struct can_frame) == 16, socketcan_frame_size);

/// The filter compares the whole id and no format bit: a known id passes in every format, to be counted.
void iwl_socketcan_filters(iwl_socketcan_share_t share, struct can_filter *out_filters) {
    const canid_t invert = (share == IWL_SOCKETCAN_OTHERS) ? CAN_INV_FILTER : 0U;
    for (size_t i = 0; i < IWL_SOCKETCAN_IDS; i++) {
        out_filters[i] = (struct can_filter){.can_id = iw_codec_rows[i].id | invert, .can_mask = CAN_EFF_MASK};
    }
}

iw_can_frame_t iwl_socketcan_translate(const struct can_frame *raw, int flags) {
    const bool extended = (raw->can_id & CAN_EFF_FLAG) != 0U;
    iw_can_frame_t frame = {
        .id = raw->can_id & (extended ? CAN_EFF_MASK | CAN_EFF_FLAG : CAN_SFF_MASK),
        .dlc = (raw->len <= IW_CAN_DATA_MAX) ? raw->len : (uint8_t)IW_CAN_DATA_MAX,
        .kind = (uint8_t)(((flags & MSG_CONFIRM) != 0) ? IW_CAN_ECHO : IW_CAN_RECEIVED),
    };
    frame.id |= raw->can_id & CAN_RTR_FLAG;
    frame.id |= ((flags & MSG_TRUNC) != 0) ? IW_CAN_FD : 0U;
    memcpy(frame.data, raw->data, sizeof frame.data);
    return frame;
}

/// Bus errors (CAN_ERR_BUSERROR) are not requested: a disturbed bus causes thousands per second, and the states
/// suffice.
uint32_t iwl_can_error_mask(void) {
    return CAN_ERR_CRTL | CAN_ERR_BUSOFF | CAN_ERR_RESTARTED;
}

iwl_can_error_t iwl_can_error_of(const struct can_frame *raw) {
    const uint8_t controller = ((raw->can_id & CAN_ERR_CRTL) != 0U) ? raw->data[1] : 0U;
    if ((raw->can_id & CAN_ERR_BUSOFF) != 0U) {
        return IWL_CAN_ERROR_BUS_OFF;
    }
    if ((raw->can_id & CAN_ERR_RESTARTED) != 0U) {
        return IWL_CAN_ERROR_RESTARTED;
    }
    if ((controller & (CAN_ERR_CRTL_RX_PASSIVE | CAN_ERR_CRTL_TX_PASSIVE)) != 0U) {
        return IWL_CAN_ERROR_PASSIVE;
    }
    if ((controller & (CAN_ERR_CRTL_RX_WARNING | CAN_ERR_CRTL_TX_WARNING | CAN_ERR_CRTL_ACTIVE)) != 0U) {
        return IWL_CAN_ERROR_ACTIVE;
    }
    return IWL_CAN_ERROR_NOTHING;
}
