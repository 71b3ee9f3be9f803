// SPDX-License-Identifier: MIT
/// @file
/// What the kernel reports of the link to the bus, and whether its bit timing is the wheels'.
///
/// The port reads and never sets any of this; the one exception is a purge (hal.h), which takes the link down and up.
#ifndef IWHEEL_LINUX_BUS_LINK_H
#define IWHEEL_LINUX_BUS_LINK_H

#include "iwheel/can_frame.h"
#include "iwheel/types.h"

/// Whether the interface is there.
typedef enum {
    IWL_LINK_LOCAL = 0, ///< Not an interface of the kernel: of the fields below only `echo_proven` means anything.
    IWL_LINK_ABSENT,    ///< No interface has this name now.
    IWL_LINK_NOT_CAN,   ///< An interface has it, but it is no CAN interface.
    IWL_LINK_DOWN,
    IWL_LINK_UP,
} iwl_link_presence_t;

/// What became of the last purge.
typedef enum {
    IWL_LINK_PURGE_NONE = 0,    ///< None was needed yet.
    IWL_LINK_PURGE_DONE,        ///< The link was taken down and up.
    IWL_LINK_PURGE_NOT_ALLOWED, ///< That needs CAP_NET_ADMIN.
    IWL_LINK_PURGE_FAILED,      ///< Down was done or not, up was not: see the presence.
} iwl_link_purge_t;

/// Numbers that are 0 are not reported.
typedef struct {
    iwl_link_presence_t presence; ///< Now.
    iwl_link_purge_t purge;       ///< What became of the last one.
    bool is_virtual;              ///< It has no bit timing at all (vcan, the local bus).
    bool echo_proven;    ///< An echo proves that the frame was on the bus (IFF_ECHO, and no mode that makes it a lie).
    bool is_mute;        ///< The controller is in listen-only mode: nothing can be sent.
    uint32_t bitrate_hz; ///< Bit/s.
    uint16_t sample_point_permille; ///< Of the bit.
    uint32_t restart_ms;            ///< After bus-off the controller tries again by itself; 0: never.
    uint32_t queue_length;          ///< Frames that may wait in front of the controller.
    uint32_t changes;               ///< Another number than before: something above has changed.
    uint32_t lost;                  ///< Frames that came faster than we took them, since the link was last opened.
    uint32_t room_bytes;            ///< For frames that have come and were not taken yet, as the kernel counts them.
    uint32_t load_permille;         ///< Of the last whole second, without stuff bits (up to a fifth more is possible).
} iwl_bus_link_t;

/// Off by more than this: worth a warning. Interface of the gateway, [bus] sample_point_permille.
#define IWL_TIMING_NEAR_PERMILLE 5U
/// Off by more than this: contradicted.
#define IWL_TIMING_WRONG_PERMILLE 25U
/// More frames than this in front of the controller could be old setpoints when a dead bus revives.
#define IWL_LINK_QUEUE_MAX 4U

/// Room that is asked for; granted, the kernel counts it twice (`room_bytes`), and each frame as about 780 bytes: half
/// a second of a full bus. Without CAP_NET_ADMIN it gives no more than net.core.rmem_max, as a rule a twentieth of this.
#define IWL_LINK_ROOM_BYTES (4U * 1024U * 1024U)

/// What the link's timing is beside the wheels'.
typedef enum {
    IWL_TIMING_VIRTUAL = 0, ///< There is none.
    IWL_TIMING_UNKNOWN,     ///< The bit rate or the sample point is not reported; what is reported is right.
    IWL_TIMING_RIGHT,
    IWL_TIMING_NEAR,  ///< The sample point is off by more than IWL_TIMING_NEAR_PERMILLE.
    IWL_TIMING_WRONG, ///< Another bit rate, or a sample point off by more than IWL_TIMING_WRONG_PERMILLE.
} iwl_timing_t;

/// Compares what the link reports with what the wheels need.
iwl_timing_t iwl_timing_judge(const iwl_bus_link_t *link, uint32_t bitrate_hz, uint16_t sample_point_permille);

/// Bits that the frame occupies on the bus, with the gap behind it, without stuff bits.
static inline uint32_t iwl_bus_frame_bits(const iw_can_frame_t *frame) {
    // Start, id, control, checksum, acknowledgement, end and gap of a classic frame (ISO 11898-1), and the bytes.
    const uint32_t around = ((frame->id & IW_CAN_EXTENDED) != 0U) ? 67U : 47U;
    return around + 8U * (((frame->id & IW_CAN_REMOTE) != 0U) ? 0U : frame->dlc);
}

/// True if both tell the same of the interface: purge, changes, lost, room and load aside.
bool iwl_bus_link_is_same(const iwl_bus_link_t *one, const iwl_bus_link_t *other);

#endif
