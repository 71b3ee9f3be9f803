// SPDX-License-Identifier: MIT
/// The first samples of writers of Fast DDS. Pure: no DDS, no I/O.
///
/// Fast DDS matches our reader and writes at once; CycloneDDS (0.10.2) drops what comes before it knows the writer, and never asks for it:
/// its first ACKNACK, which should bring a heartbeat, is none for Fast DDS (the count is 0, and the base 1 instead of 0), and the first
/// heartbeat that comes it takes for the beginning. A stop was lost for good. So `rtps_ask_firsts` changes these ACKNACKs on their way out,
/// by which writers are found sooner too, and `rtps_await_firsts` the heartbeats on their way in. For what was written before it matched our
/// reader Fast DDS sends a GAP.
#ifndef ROS2_FIRSTS_H
#define ROS2_FIRSTS_H

#include "rtps.h"

/// Writers that are remembered; of more, the oldest is forgotten.
#define FIRSTS_WRITERS 64U
/// So long after its first heartbeat a writer is new. Later CycloneDDS may have lost and found it, and Fast DDS not: then it answers nothing for
/// what was acknowledged once, and to wait for that would be for ever.
#define FIRSTS_NEW_US 5000000

typedef struct {
    struct {
        uint8_t guid[ROS_PREFIX_SIZE + 4U];
        int64_t since_us;
    } writers[FIRSTS_WRITERS];
    size_t count; ///< Of all that ever came.
} rtps_firsts_t;

/// Puts a heartbeat of the same writer that says "nothing yet" before each heartbeat of a new one, so that all that it has is missing and
/// asked for. Returns the new length. `size`: of the room for the message; where that is too small, or the message damaged, nothing changes.
size_t rtps_await_firsts(rtps_firsts_t *self, int64_t now_us, uint8_t *message, size_t length, size_t size);

/// Makes the first ACKNACKs to writers of Fast DDS its own, in place; the counts of all others are one higher. False: there is none.
bool rtps_ask_firsts(uint8_t *message, size_t length);

#endif
