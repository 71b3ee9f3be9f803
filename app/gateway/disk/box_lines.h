// SPDX-License-Identifier: MIT
/// The black box's entries as the lines of a recording. Pure.
#ifndef GATEWAY_BOX_LINES_H
#define GATEWAY_BOX_LINES_H

#include "recording.h"

#include "blackbox_ring.h"

/// The longest line of the file beside the frames.
#define GW_BOX_LINE_SIZE 4096U

/// First line: what this is and how its times are to be read. Lengths are without a terminator, 0: it did not fit.
size_t gw_box_line_head(const gw_box_wish_t *wish, const gw_box_order_t *order, bool from_start,
                        char out_line[GW_BOX_LINE_SIZE]);

/// Second line: the stop.
size_t gw_box_line_stop(const gw_box_order_t *order, char out_line[GW_BOX_LINE_SIZE]);

/// An entry that is no frame; `frames` stand before it in the file of frames.
size_t gw_box_line_entry(const blackbox_entry_t *entry, uint64_t frames, char out_line[GW_BOX_LINE_SIZE]);

/// Entries that were overwritten before they could be written.
size_t gw_box_line_lost(uint64_t entries, uint64_t frames, char out_line[GW_BOX_LINE_SIZE]);

/// Last line, without which a recording is not whole.
size_t gw_box_line_end(uint64_t frames, char out_line[GW_BOX_LINE_SIZE]);

#endif
