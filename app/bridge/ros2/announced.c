// SPDX-License-Identifier: MIT
#include "announced.h"

#include <string.h>

#define DATA             0x15U
#define DATA_FRAG        0x16U
#define HAS_QOS          0x02U
#define DATA_TO_QOS_AT   6U
#define DATA_COUNTS_FROM 8U
#define DATA_WRITER_AT   12U
#define DATA_HEADER      24U
#define FRAG_FIRST_AT    24U ///< Position in DATA_FRAG of the number of its first fragment, which counts from 1.
#define FRAG_HEADER      36U
#define ENCAPSULATION    4U
#define PARAMETER        4U ///< Size of a parameter's id and length.
#define PID_PAD          0x0000U
#define PID_SENTINEL     0x0001U
#define PID_USER_DATA    0x002CU
#define PID_TOPIC_DATA   0x002EU ///< The id of group data lies between the two.

/// Returns true for a whole sample and for the first fragment of a sample: the list of parameters begins there.
static bool begins_a_sample(const rtps_part_t *part) {
    if (part->bytes[0] == DATA_FRAG) {
        return part->size >= FRAG_HEADER && rtps_read(part->bytes + FRAG_FIRST_AT, 4, part->little) == 1U;
    }
    return part->bytes[0] == DATA && part->size >= DATA_HEADER;
}

typedef enum { OF_A_WRITER = 0, OF_A_READER, OF_A_PARTICIPANT, NO_ANNOUNCEMENT } announcement_t;

/// Returns the kind of announcement, by the writer that sent it (RTPS 2.2, table 9.2).
static announcement_t announcement_of(const rtps_part_t *part) {
    static const uint8_t writers[NO_ANNOUNCEMENT][4] = {{0, 0, 3, 0xC2}, {0, 0, 4, 0xC2}, {0, 1, 0, 0xC2}};
    unsigned kind = begins_a_sample(part) ? OF_A_WRITER : NO_ANNOUNCEMENT;
    while (kind < NO_ANNOUNCEMENT && memcmp(part->bytes + DATA_WRITER_AT, writers[kind], sizeof writers[kind]) != 0) {
        kind++;
    }
    return (announcement_t)kind;
}

/// Walks a list of parameters from `at`. Returns the position behind the list; 0: the list does not end within `size`.
/// `change`: large free data becomes padding.
static size_t walk(uint8_t *bytes, size_t size, size_t at, bool little, bool change) {
    while (at + PARAMETER <= size) {
        const uint32_t id = rtps_read(bytes + at, 2, little);
        const size_t length = rtps_read(bytes + at + 2U, 2, little);
        if (id == PID_SENTINEL) {
            return at + PARAMETER;
        }
        if (change && id >= PID_USER_DATA && id <= PID_TOPIC_DATA && length > ANNOUNCED_DATA_MAX) {
            rtps_write(PID_PAD, 2, little, bytes + at);
        }
        if (length > size - at - PARAMETER) { // The message is damaged, or the list continues in the next fragment.
            return 0;
        }
        at += PARAMETER + length;
    }
    return 0;
}

static void drop_of(uint8_t *bytes, const rtps_part_t *part) {
    size_t at = DATA_COUNTS_FROM + rtps_read(bytes + DATA_TO_QOS_AT, 2, part->little);
    if ((bytes[1] & HAS_QOS) != 0U) {
        at = walk(bytes, part->size, at, part->little, false);
    }
    // Only a list of parameters, in either byte order.
    if (at < DATA_HEADER || at + ENCAPSULATION > part->size || bytes[at] != 0U || (bytes[at + 1U] & ~1U) != 2U) {
        return;
    }
    (void)walk(bytes, part->size, at + ENCAPSULATION, bytes[at + 1U] == 3U, true);
}

bool rtps_drop_large_data(uint8_t *message, size_t length) {
    rtps_part_t part;
    bool has_writer = false;
    if (length < RTPS_HEADER || memcmp(message, "RTPS", 4) != 0) {
        return false;
    }
    for (size_t at = RTPS_HEADER; at < length && rtps_part_at(message, length, at, &part); at += part.size) {
        const announcement_t kind = announcement_of(&part);
        if (kind != NO_ANNOUNCEMENT) {
            drop_of(message + at, &part);
        }
        has_writer = has_writer || kind == OF_A_WRITER;
    }
    return has_writer;
}
