// SPDX-License-Identifier: MIT
/// Limits the data that other programs of the domain announce about themselves. Pure: no DDS, no I/O.
///
/// DDS stores the announcement of every participant, writer and reader of a domain, with its free data (user, group and
/// topic data) of up to 64 kB each. ROS uses less than 200 bytes of it. Data longer than ANNOUNCED_DATA_MAX becomes
/// padding before CycloneDDS reads it, so that the announcement of an unknown program costs little memory. In an
/// announcement in fragments only data that begins in the first fragment is limited; the unit's MemoryMax bounds the
/// process.
#ifndef ROS2_ANNOUNCED_H
#define ROS2_ANNOUNCED_H

#include "rtps.h"

#define ANNOUNCED_DATA_MAX 512U

/// Changes the message in place; its length stays. Behind damage, and in other data than an RTPS message, nothing
/// changes. Returns true if the message announces a writer, or the end of one.
bool rtps_drop_large_data(uint8_t *message, size_t length);

#endif
