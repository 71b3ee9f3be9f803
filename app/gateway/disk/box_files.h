// SPDX-License-Identifier: MIT
/// What the two processes of the black box do with the record directory: its files, the lines in them, writing, reading.
#ifndef GATEWAY_BOX_FILES_H
#define GATEWAY_BOX_FILES_H

#include "recording.h"

#include "blackbox_ring.h"

#include <stdio.h>

/// The recordings in the record directory are numbered, few, and made of three files each. Only names of our own form are
/// ever removed.
#define GW_BOX_STEM_SIZE 64U
#define GW_BOX_PREFIX    "stop-"
#define GW_BOX_ENDINGS   3U

/// Of the frames, of everything else, of the configuration.
extern const char *const gw_box_endings[GW_BOX_ENDINGS];

/// Which of the endings it is; GW_BOX_ENDINGS if it is none.
unsigned gw_box_files_ending(const char *text);

/// Length of a file's name without its ending; 0 if the writer gives no such name: "stop-", six to ten digits, '-', a
/// cause in small letters and '_', ".log", ".jsonl" or ".conf".
size_t gw_box_files_stem(const char *name);

/// Opens the directory, made if only its last part is missing. A descriptor, or -1 with errno
/// or a reason of owners.h in it.
int gw_box_files_open(const char *directory);

/// The number after the highest there is.
uint32_t gw_box_files_next(int directory);

/// Files that one pass over the directory looks at, those of 10,900 recordings; more take more passes. Memory is used for files that
/// are there only.
#define GW_BOX_SURVEYED 32768U

/// What may stay in the directory, and what may be removed for it.
typedef struct {
    size_t recordings; ///< At most so many ...
    uint64_t bytes;    ///< ... that are together no larger than this.
    uint32_t below;    ///< Only recordings with lower numbers are removed.
    bool in_motion;    ///< Recordings of stops in motion may be removed too, once no other is left.
} gw_box_room_t;

/// Removes recordings until the rest fits into `room`: first those of stops at standstill, then the others, of each kind
/// the oldest first. Its time grows linearly with the number of files.
void gw_box_files_rotate(int directory, const gw_box_room_t *room);

/// Removes one recording below `below`, the first in the order above. False if there is none.
bool gw_box_files_drop_oldest(int directory, uint32_t below, bool in_motion);

/// Allocates that many bytes in a file of the directory, unless it exists already. File systems that cannot do so have
/// no reserve.
void gw_box_files_reserve(int directory, uint64_t bytes);

/// Gives the reserve back to the disk. False if there is none.
bool gw_box_files_release(int directory);

/// Removes all files of that recording.
void gw_box_files_remove(int directory, uint32_t number);

/// A new file STEM + `ending`, not yet there. NULL with errno.
FILE *gw_box_files_create(int directory, const char *stem, const char *ending);

/// The black box's entries as the lines of a recording are pure functions.
///
/// The longest line of the file beside the frames.
#define GW_BOX_LINE_SIZE 4096U

/// First line: what this is and how its times are to be read. Lengths are without a terminator, 0: it did not fit.
size_t gw_box_line_head(const gw_box_config_t *config, const gw_box_order_t *order, bool from_start,
                        char out_line[GW_BOX_LINE_SIZE]);

/// Second line: the stop. `in_motion`: a wheel turned, or was commanded to.
size_t gw_box_line_stop(const gw_box_order_t *order, bool in_motion, char out_line[GW_BOX_LINE_SIZE]);

/// Whether the first two lines of an event file say that neither wheel turned or was commanded to. Recordings of earlier
/// versions are judged by the commanded speeds alone; a text that does not say is not harmless.
bool gw_box_line_is_harmless(const char *lines);

/// An entry that is no frame; `frames` stand before it in the file of frames.
size_t gw_box_line_entry(const blackbox_entry_t *entry, uint64_t frames, char out_line[GW_BOX_LINE_SIZE]);

/// Entries that were overwritten before they could be written.
size_t gw_box_line_lost(uint64_t entries, uint64_t frames, char out_line[GW_BOX_LINE_SIZE]);

/// Last line, without which a recording is not whole.
size_t gw_box_line_end(uint64_t frames, char out_line[GW_BOX_LINE_SIZE]);

/// The process that writes the black box to disk: waits for orders, writes each as a recording of three files
///
///     stop-000017-wheel_lost.log     the frames, in candump's log form
///     stop-000017-wheel_lost.jsonl   the stop, and everything else that went into the core, one JSON object per line
///     stop-000017-wheel_lost.conf    the configuration in force
///
/// and tells the result. Slow, full and missing disks are its own affair.
///
/// Runs until the gateway is gone; then, if setpoints were being sent, writes a last recording. `fd` is the socket to the
/// gateway.
void gw_box_writer_run(int fd, const blackbox_ring_t *ring, const gw_box_config_t *config);

/// The process that reads recordings for clients: a question, an answer, so that neither the loop nor the writer waits for a disk
/// because somebody reads.
///
/// What may be read are ordinary files in the record directory whose names are of the form that the writer gives them, and which
/// the gateway's user, root or the service's user has written; nothing is followed. No path is taken, none is told.
///
/// Bytes of a piece: base64 of it has no padding unless it is the last.
#define GW_BOX_PIECE 24576U
/// Recordings that are listed; the writer keeps no more, but for a recording at standstill that came after
/// GW_BOX_KEEP_MAX in motion.
#define GW_BOX_LISTED (GW_BOX_KEEP_MAX + 4U)

/// Answers from the files as they are now. Waits for the disk.
void gw_box_reader_answer(const char *directory, const gw_box_question_t *question, gw_box_answer_t *out_answer);

/// Runs until the gateway is gone. `fd` is the socket to it.
void gw_box_reader_run(int fd, const char *directory);

#endif
