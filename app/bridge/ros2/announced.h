// SPDX-License-Identifier: MIT
/// What other programs of the domain announce of themselves, as it comes in. Pure: no DDS, no I/O.
///
/// DDS stores the announcement of every participant, writer and reader of a domain, with the free data in it (user, group and topic data), up to
/// 64 kB each. ROS puts less than 200 bytes there. More than ANNOUNCED_DATA_MAX becomes padding before CycloneDDS reads it, so that what a
/// stranger announces costs little memory. Of an announcement in fragments only what
/// begins in the first one; the unit's MemoryMax bounds the process.
#ifndef ROS2_ANNOUNCED_H
#define ROS2_ANNOUNCED_H

#include "rtps.h"

#define ANNOUNCED_DATA_MAX 512U

/// In place; the length stays. A message that is damaged or none changes nothing behind the damage.
void rtps_drop_large_data(uint8_t *message, size_t length);

#endif
