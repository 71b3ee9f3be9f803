// SPDX-License-Identifier: MIT
/// The process that reads recordings for clients: a question, an answer, so that neither the loop nor the writer waits for a disk
/// because somebody reads.
///
/// What may be read are ordinary files in the record directory whose names are of the form that the writer gives them, and which
/// the gateway's user, root or the service's user has written; nothing is followed. No path is taken, none is told.
#ifndef GATEWAY_BOX_READER_H
#define GATEWAY_BOX_READER_H

#include "recording.h"

/// Bytes of a piece: base64 of it has no padding unless it is the last.
#define GW_BOX_PIECE 24576U
/// Recordings that are listed; the writer keeps fewer.
#define GW_BOX_LISTED 64U

/// True if the writer could have given a file that name: "stop-", six to ten digits, '-', a cause in small letters and '_',
/// ".log", ".jsonl" or ".conf".
bool gw_box_reader_knows(const char *name);

/// Answers from the files as they are now. Waits for the disk.
void gw_box_reader_answer(const char *directory, const gw_box_question_t *question, gw_box_answer_t *out_answer);

/// Runs until the gateway is gone. `fd` is the socket to it.
void gw_box_reader_run(int fd, const char *directory);

/// CRC-32 as of zlib and Ethernet, of bytes behind those whose CRC is `before` (0: none).
uint32_t gw_box_crc32(uint32_t before, const uint8_t *bytes, size_t length);

#endif
