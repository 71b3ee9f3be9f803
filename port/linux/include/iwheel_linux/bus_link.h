// SPDX-License-Identifier: MIT
/// @file
/// State of the link to the bus as the kernel reports it, and the check of its bit timing.
///
/// The port reads this state and never changes it, except for a purge (hal.h), which sets the link down and up.
#ifndef IWHEEL_LINUX_BUS_LINK_H
#define IWHEEL_LINUX_BUS_LINK_H

#include "iwheel/can_frame.h"
#include "iwheel/types.h"

#ifdef __cplusplus
extern "C" {
#endif

/// Presence of the interface.
typedef enum {
    IWL_LINK_LOCAL = 0, ///< Not an interface of the kernel. Only `echo_proven` of the fields below is valid.
    IWL_LINK_ABSENT,    ///< No interface has this name.
    IWL_LINK_NOT_CAN,   ///< The interface with this name is not a CAN interface.
    IWL_LINK_DOWN,
    IWL_LINK_UP,
} iwl_link_presence_t;

/// Result of the last purge.
typedef enum {
    IWL_LINK_PURGE_NONE = 0,    ///< There was no purge.
    IWL_LINK_PURGE_DONE,        ///< The link was set down and up.
    IWL_LINK_PURGE_NOT_ALLOWED, ///< CAP_NET_ADMIN is missing.
    IWL_LINK_PURGE_FAILED,      ///< Setting the link down or up failed: see the presence.
} iwl_link_purge_t;

/// State of the link. Numbers that are 0 are not reported by the kernel.
typedef struct {
    iwl_link_presence_t presence; ///< Presence of the interface.
    iwl_link_purge_t purge;       ///< Result of the last purge.
    bool is_virtual;              ///< The interface has no bit timing (vcan, the local bus).
    bool echo_proven;    ///< An echo proves that the frame was on the bus (IFF_ECHO, and no mode that makes it false).
    bool is_mute;        ///< The controller is in listen-only mode and cannot send.
    uint32_t bitrate_hz; ///< Bit rate in bit/s.
    uint16_t sample_point_permille; ///< Sample point in permille of the bit.
    uint32_t restart_ms;            ///< Delay of the automatic restart after bus-off; 0 if there is none.
    uint32_t queue_length;          ///< Length of the transmit queue of the interface in frames.
    uint32_t changes;               ///< Changes with every change of the fields above.
    uint32_t lost;                  ///< Frames lost because the port received too slowly, since the link was opened.
    uint32_t room_bytes;            ///< Size of the receive buffer as the kernel counts it.
    uint32_t load_permille;         ///< Bus load in the last full second, without stuff bits (up to a fifth more).
} iwl_bus_link_t;

/// Largest deviation of the sample point without a warning. Interface of the gateway, [bus] sample_point_permille.
#define IWL_TIMING_NEAR_PERMILLE 5U
/// A larger deviation contradicts the configured sample point.
#define IWL_TIMING_WRONG_PERMILLE 25U
/// With a longer transmit queue, old setpoints could wait in it when a dead bus recovers.
#define IWL_LINK_QUEUE_MAX 4U

/// Requested size of the receive buffer. The kernel doubles it (`room_bytes`) and counts about 780 bytes per frame, so
/// it holds half a second of a full bus. Without CAP_NET_ADMIN the limit is net.core.rmem_max, by default a twentieth
/// of this.
#define IWL_LINK_ROOM_BYTES (4U * 1024U * 1024U)

/// Comparison of the link's bit timing with that of the wheels.
typedef enum {
    IWL_TIMING_VIRTUAL = 0, ///< The link has no bit timing.
    IWL_TIMING_UNKNOWN,     ///< The bit rate or the sample point is not reported; the reported one is right.
    IWL_TIMING_RIGHT,
    IWL_TIMING_NEAR,  ///< The sample point differs by more than IWL_TIMING_NEAR_PERMILLE.
    IWL_TIMING_WRONG, ///< Another bit rate, or the sample point differs by more than IWL_TIMING_WRONG_PERMILLE.
} iwl_timing_t;

/// Compares the reported bit timing with the required one.
iwl_timing_t iwl_timing_judge(const iwl_bus_link_t *link, uint32_t bitrate_hz, uint16_t sample_point_permille);

/// Returns the number of bits of the frame on the bus, with the gap after it, without stuff bits.
static inline uint32_t iwl_bus_frame_bits(const iw_can_frame_t *frame) {
    // Start, id, control, checksum, acknowledgement, end and gap of a classic frame (ISO 11898-1). The data bytes are
    // added.
    const uint32_t around = ((frame->id & IW_CAN_EXTENDED) != 0U) ? 67U : 47U;
    return around + 8U * (((frame->id & IW_CAN_REMOTE) != 0U) ? 0U : frame->dlc);
}

/// Returns true if both have the same state of the interface. Purge, changes, lost, room and load are not compared.
bool iwl_bus_link_is_same(const iwl_bus_link_t *one, const iwl_bus_link_t *other);

#ifdef __cplusplus
}
#endif
#endif
