// SPDX-License-Identifier: MIT
/// Makes CycloneDDS request the first samples of Fast DDS writers. Pure: no DDS, no I/O.
///
/// Fast DDS matches our reader and writes immediately. CycloneDDS (0.10.2) drops samples of a writer that it does not
/// know yet, and never requests them: Fast DDS does not accept CycloneDDS's first ACKNACK (its count is 0, and its base
/// 1 instead of 0), which should cause a heartbeat, and CycloneDDS begins with the first heartbeat that it receives. A
/// stop was lost for good. So `rtps_ask_firsts` changes these outgoing ACKNACKs, which also shortens discovery, and
/// `rtps_await_firsts` changes incoming heartbeats. For samples from before the match Fast DDS sends a GAP.
#ifndef ROS2_FIRSTS_H
#define ROS2_FIRSTS_H

#include "rtps.h"

/// Writers stored. A new one replaces the oldest.
#define FIRSTS_WRITERS 64U
/// A writer is new for this time after its first heartbeat. Later CycloneDDS may have lost and found the writer,
/// without Fast DDS noticing. Fast DDS then does not send again what was acknowledged once, and CycloneDDS would wait
/// for ever.
#define FIRSTS_NEW_US 5000000

typedef struct {
    struct {
        uint8_t guid[ROS_PREFIX_SIZE + 4U];
        int64_t since_us;
    } writers[FIRSTS_WRITERS];
    size_t count; ///< Number of all writers since the start.
} rtps_firsts_t;

/// Inserts before each heartbeat of a new writer a heartbeat of the same writer without samples. CycloneDDS then misses
/// all samples that the writer has, and requests them. Returns the new length. `size` is the size of the buffer; if it
/// is too small, or the message is damaged, nothing changes.
size_t rtps_await_firsts(rtps_firsts_t *self, int64_t now_us, uint8_t *message, size_t length, size_t size);

/// Changes the first ACKNACK to each Fast DDS writer to the form of Fast DDS, in place, and adds one to the count of
/// all others. Returns false if there is no ACKNACK.
bool rtps_ask_firsts(uint8_t *message, size_t length);

#endif
