// SPDX-License-Identifier: MIT
/// Reads and writes the parts of RTPS messages, the format of DDS: a header, then submessages, each in its own byte
/// order. Pure: no DDS, no I/O.
#ifndef ROS2_RTPS_H
#define ROS2_RTPS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define ROS_PREFIX_SIZE 12U
/// Size of a message's header, and position of its writers' GUID prefix in it.
#define RTPS_HEADER    20U
#define RTPS_PREFIX_AT 8U
/// Size of a submessage's header.
#define RTPS_SUBMESSAGE 4U
#define RTPS_LITTLE     0x01U

typedef struct {
    const uint8_t *bytes;
    size_t size; ///< Size with its header; 0: the message ends before the submessage does.
    bool little; ///< The submessage is little endian.
} rtps_part_t;

/// Writes the submessage at `at` to `*out`. Returns false if there is none, or not all of it.
bool rtps_part_at(const uint8_t *message, size_t length, size_t at, rtps_part_t *out);

/// Read and write an integer of `count` bytes, at most 4.
uint32_t rtps_read(const uint8_t *bytes, size_t count, bool little);
void rtps_write(uint32_t value, size_t count, bool little, uint8_t *out);

/// Read and write a sequence number in RTPS's form: two words of 4 bytes, the high one first.
int64_t rtps_read_sequence(const uint8_t *bytes, bool little);
void rtps_write_sequence(int64_t number, bool little, uint8_t *out);

#endif
