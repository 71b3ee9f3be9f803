// SPDX-License-Identifier: MIT
/// File operations of the two processes of the black box in the record directory: its files, the lines in them,
/// writing, reading.
#ifndef GATEWAY_BOX_FILES_H
#define GATEWAY_BOX_FILES_H

#include "recording.h"

#include "blackbox_ring.h"

#include <stdio.h>

/// Only files with the writer's form of name are removed.
#define GW_BOX_PREFIX  "stop-"
#define GW_BOX_ENDINGS 3U

/// Endings of the files of frames, of other entries, and of the configuration.
extern const char *const gw_box_endings[GW_BOX_ENDINGS];

/// Returns the index of an ending; GW_BOX_ENDINGS if it is none.
unsigned gw_box_files_ending(const char *text);

/// Returns the length of a file name without its ending, or 0 if the writer creates no such name: "stop-", six to ten
/// digits, '-', a cause in small letters and '_', ".log", ".jsonl" or ".conf".
size_t gw_box_files_stem(const char *name);

/// Opens the directory, and creates it if only its last part is missing. Returns a descriptor, or -1 and errno, which
/// may be a reason of owners.h.
int gw_box_files_open(const char *directory);

/// Returns the number after the highest existing one.
uint32_t gw_box_files_next(int directory);

/// Number of files that one pass over the directory reads: those of 10,900 recordings. More files need more passes.
/// Only existing files use memory.
#define GW_BOX_SURVEYED 32768U

/// Limits of the directory, and recordings that may be removed.
typedef struct {
    size_t recordings; ///< Largest number of recordings ...
    uint64_t bytes;    ///< ... and of their total size.
    uint32_t below;    ///< Only recordings with lower numbers are removed.
    bool in_motion;    ///< Recordings of stops in motion may be removed too, when no other is left.
    uint32_t running;  ///< The recording with this number is still being written, and is not removed; 0: none.
} gw_box_limits_t;

/// Removes recordings until the rest fits `limits`: first those of stops at standstill, then the others, the oldest of
/// each kind first. The time grows linearly with the number of files.
void gw_box_files_rotate(int directory, const gw_box_limits_t *limits);

/// Removes one recording with a number below `limits->below`, in the order above. Returns false if there is none.
/// The sizes in `limits` do not count.
bool gw_box_files_drop_oldest(int directory, const gw_box_limits_t *limits);

/// Removes the oldest recordings on request until `most` of them are left.
void gw_box_files_limit_requested(int directory, size_t most);

/// Allocates this many bytes in a file of the directory, unless the file exists. A file system without this function
/// has no reserve.
void gw_box_files_reserve(int directory, uint64_t bytes);

/// Releases the reserve. Returns false if there is none.
bool gw_box_files_release(int directory);

/// Removes all files of a recording.
void gw_box_files_remove(int directory, uint32_t number);

/// Creates a new file with the name STEM + `ending`. Returns NULL and errno if it exists or cannot be created.
FILE *gw_box_files_create(int directory, const char *stem, const char *ending);

/// Lines of a recording. Pure functions.
///
/// Longest line of the file of events.
#define GW_BOX_LINE_SIZE 4096U

/// First line: version and meaning of the times. The functions return the length without terminator; 0 if it does not
/// fit.
size_t gw_box_line_head(const gw_box_config_t *config, const gw_box_order_t *order, bool from_start,
                        char out_line[GW_BOX_LINE_SIZE]);

/// Second line: the stop. `in_motion`: a wheel turned, or was commanded to.
size_t gw_box_line_stop(const gw_box_order_t *order, bool in_motion, char out_line[GW_BOX_LINE_SIZE]);

/// Returns true if by the first two lines of an event file no wheel turned or was commanded to. Recordings of
/// earlier versions are judged by the commanded speeds. A text without that information is not harmless.
bool gw_box_line_is_harmless(const char *lines);

/// Line of an entry other than a frame; `frames` is the number of frames before it in the file of frames.
size_t gw_box_line_entry(const blackbox_entry_t *entry, uint64_t frames, char out_line[GW_BOX_LINE_SIZE]);

/// Line for entries that were overwritten before they could be written.
size_t gw_box_line_lost(uint64_t entries, uint64_t frames, char out_line[GW_BOX_LINE_SIZE]);

/// Last line. A recording without it is incomplete.
size_t gw_box_line_end(uint64_t frames, char out_line[GW_BOX_LINE_SIZE]);

/// Process that writes the black box to disk. It waits for orders and writes each as a recording of three files
///
///     stop-000017-wheel_lost.log     the frames, in candump's log form
///     stop-000017-wheel_lost.jsonl   the stop, and all other inputs of the core, one JSON object per line
///     stop-000017-wheel_lost.conf    the configuration in force
///
/// and returns the result. Only this process waits for a slow, full or missing disk.
///
/// Runs until the gateway has ended. If the gateway was sending setpoints, it then writes a last recording. `fd` is the
/// socket to the gateway.
void gw_box_writer_run(int fd, const blackbox_ring_t *ring, const gw_box_config_t *config);

/// Process that reads recordings for clients, one answer per question, so that neither the loop nor the writer waits
/// for a disk because of a reader.
///
/// It reads only regular files in the record directory with the writer's form of name, owned by the gateway's user,
/// root or the service's user. It follows no links, accepts no paths, and reports none.
///
/// Size of a piece: its base64 form has no padding unless it is the last.
#define GW_BOX_PIECE 24576U
/// Largest number of listed recordings. The writer retains no more, except a recording at standstill after
/// GW_BOX_KEEP_MAX in motion.
#define GW_BOX_LISTED (GW_BOX_KEEP_MAX + 4U)

/// Answers from the present files. It waits for the disk.
void gw_box_reader_answer(const char *directory, const gw_box_question_t *question, gw_box_answer_t *out_answer);

/// Runs until the gateway has ended. `fd` is the socket to the gateway.
void gw_box_reader_run(int fd, const char *directory);

#endif
