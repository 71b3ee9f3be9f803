// SPDX-License-Identifier: MIT
#include "firsts.h"

#include <string.h>

#define VENDOR_AT        6U
#define ACKNACK          0x06U
#define HEARTBEAT        0x07U
#define INFO_DESTINATION 0x0EU
#define FINAL            0x02U
#define WRITER_AT        8U
#define FIRST_AT         12U
#define LAST_AT          20U
#define COUNT_AT         28U
#define HEARTBEAT_SIZE   32U
#define BASE_AT          12U
#define BITS_AT          20U
#define SET_AT           24U
#define BITS_MAX         256U

/// Vendor id of eProsima in the header of a message; also the first bytes of Fast DDS's GUIDs.
static const uint8_t FAST_DDS[2] = {1, 15};

static bool is_message(const uint8_t *message, size_t length) {
    return length >= RTPS_HEADER && memcmp(message, "RTPS", 4) == 0;
}

/// Returns true for a writer of the application, false for a writer of discovery.
static bool is_users(const uint8_t *writer) {
    return writer[3] == 2U || writer[3] == 3U;
}

/// Returns true if the first heartbeat of the writer is this one, or came less than FIRSTS_NEW_US ago. Stores the
/// writer.
static bool is_new(rtps_firsts_t *self, int64_t now_us, const uint8_t *message, const uint8_t *writer) {
    uint8_t guid[sizeof self->writers[0].guid];
    memcpy(guid, message + RTPS_PREFIX_AT, ROS_PREFIX_SIZE);
    memcpy(guid + ROS_PREFIX_SIZE, writer, sizeof guid - ROS_PREFIX_SIZE);
    for (size_t i = 0; i < self->count && i < FIRSTS_WRITERS; i++) {
        if (memcmp(self->writers[i].guid, guid, sizeof guid) == 0) {
            return now_us - self->writers[i].since_us < FIRSTS_NEW_US;
        }
    }
    const size_t at = self->count++ % FIRSTS_WRITERS;
    memcpy(self->writers[at].guid, guid, sizeof guid);
    self->writers[at].since_us = now_us;
    return true;
}

/// Returns true for a heartbeat of a writer that has samples.
static bool is_heartbeat(const rtps_part_t *part) {
    if (part->bytes[0] != HEARTBEAT || part->size < HEARTBEAT_SIZE || !is_users(part->bytes + WRITER_AT)) {
        return false;
    }
    const int64_t first = rtps_read_sequence(part->bytes + FIRST_AT, part->little);
    return first > 0 && first <= rtps_read_sequence(part->bytes + LAST_AT, part->little);
}

/// Changes a heartbeat so that the same writer reports to the same reader that it has no samples yet.
static void empty(uint8_t *bytes, bool little) {
    bytes[1] = (uint8_t)((little ? RTPS_LITTLE : 0U) | FINAL);
    rtps_write(HEARTBEAT_SIZE - RTPS_SUBMESSAGE, 2, little, bytes + 2);
    rtps_write_sequence(rtps_read_sequence(bytes + FIRST_AT, little) - 1, little, bytes + LAST_AT);
    rtps_write(rtps_read(bytes + COUNT_AT, 4, little) - 1U, 4, little, bytes + COUNT_AT);
}

/// Returns true if the message ends where its last submessage ends.
static bool is_whole(const uint8_t *message, size_t length) {
    rtps_part_t part;
    size_t at = RTPS_HEADER;
    while (at < length && rtps_part_at(message, length, at, &part)) {
        at += part.size;
    }
    return at == length;
}

size_t rtps_await_firsts(rtps_firsts_t *self, int64_t now_us, uint8_t *message, size_t length, size_t size) {
    rtps_part_t part;
    if (!is_message(message, length) || memcmp(message + VENDOR_AT, FAST_DDS, sizeof FAST_DDS) != 0 ||
        !is_whole(message, length)) {
        return length;
    }
    for (size_t at = RTPS_HEADER; rtps_part_at(message, length, at, &part); at += part.size) {
        if (is_heartbeat(&part) && length + HEARTBEAT_SIZE <= size &&
            is_new(self, now_us, message, part.bytes + WRITER_AT)) {
            memmove(message + at + HEARTBEAT_SIZE, message + at, length - at);
            empty(message + at, part.little);
            length += HEARTBEAT_SIZE;
            at += HEARTBEAT_SIZE;
        }
    }
    return length;
}

/// Changes an ACKNACK. Returns false for any other or damaged submessage.
static bool make_request(uint8_t *bytes, const rtps_part_t *part) {
    if (bytes[0] != ACKNACK || part->size < SET_AT + 4U) {
        return false;
    }
    const uint32_t bits = rtps_read(bytes + BITS_AT, 4, part->little);
    const size_t count_at = SET_AT + (bits + 31U) / 32U * 4U;
    if (bits > BITS_MAX || count_at + 4U > part->size) {
        return false;
    }
    const uint32_t count = rtps_read(bytes + count_at, 4, part->little);
    if (count == 0U && bits == 0U) { // CycloneDDS counts from 1.
        rtps_write_sequence(0, part->little, bytes + BASE_AT);
    }
    rtps_write(count + 1U, 4, part->little, bytes + count_at);
    return true;
}

bool rtps_ask_firsts(uint8_t *message, size_t length) {
    bool changed = false;
    bool to_fast_dds = false;
    rtps_part_t part;
    for (size_t at = RTPS_HEADER; is_message(message, length) && at < length; at += part.size) {
        if (!rtps_part_at(message, length, at, &part)) {
            return changed;
        }
        if (part.bytes[0] == INFO_DESTINATION && part.size >= RTPS_SUBMESSAGE + ROS_PREFIX_SIZE) {
            to_fast_dds = memcmp(part.bytes + RTPS_SUBMESSAGE, FAST_DDS, sizeof FAST_DDS) == 0;
        }
        changed = (to_fast_dds && make_request(message + at, &part)) || changed;
    }
    return changed;
}
