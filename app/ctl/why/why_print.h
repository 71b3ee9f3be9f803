// SPDX-License-Identifier: MIT
/// A stop for people: its sentence, when it was, the frames around it. The same for the gateway's answer and for a
/// recording on disk.
#ifndef WHY_PRINT_H
#define WHY_PRINT_H

#include "candump.h"

#include <jansson.h>

/// Frames on either side that the gateway keeps at the most.
#define WHY_FRAMES_MAX 40U

/// Sentence and time of `why`, which is a reply or the line of a recording. False: there was no stop, which has been said.
bool why_print_stop(const json_t *why);

/// One frame, `since_us` after the stop (negative: before).
void why_print_frame(const candump_t *frame, int64_t since_us);

/// The line between the frames before and after.
void why_print_moment(void);

/// The last `most` of the frames before and the first `most` after, as the gateway tells them. Nothing if there are none.
void why_print_told(const json_t *why, size_t most);

#endif
