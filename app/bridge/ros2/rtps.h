// SPDX-License-Identifier: MIT
/// RTPS messages as DDS sends them: a header, then submessages, each in its own order of bytes. Pure: no DDS, no I/O.
#ifndef ROS2_RTPS_H
#define ROS2_RTPS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define ROS_PREFIX_SIZE 12U
/// Of a message, and where the prefix of its writers' GUIDs begins in it.
#define RTPS_HEADER    20U
#define RTPS_PREFIX_AT 8U
/// Of a submessage.
#define RTPS_SUBMESSAGE 4U
#define RTPS_LITTLE     0x01U

typedef struct {
    const uint8_t *bytes;
    size_t size; ///< With its header. 0: the message ends before it does.
    bool little;
} rtps_part_t;

/// The submessage at `at`. False: none.
bool rtps_part_at(const uint8_t *message, size_t length, size_t at, rtps_part_t *out);

uint32_t rtps_read(const uint8_t *bytes, size_t count, bool little);
void rtps_write(uint32_t value, size_t count, bool little, uint8_t *out);

/// Two words, the high one first, as RTPS has a sequence number.
int64_t rtps_read_sequence(const uint8_t *bytes, bool little);
void rtps_write_sequence(int64_t number, bool little, uint8_t *out);

#endif
