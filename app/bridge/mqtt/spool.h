// SPDX-License-Identifier: MIT
/// Stores events that the broker has not confirmed yet: in memory, and in a file that survives the process.
///
/// The file is a journal: additions and confirmations are appended, each record with its CRC-32. A thread writes and
/// syncs all of it (spool_disk.h), so that a slow or broken disk delays no caller. An event survives the end of the
/// process as soon as the thread has written it, and a power failure as soon as the thread has synced it. Both usually
/// take milliseconds; while the disk is slow, events wait in memory. A truncated file is read up to the cut. At the
/// start, and when it has grown, the file is written again under a temporary name and renamed. If the disk accepts
/// nothing, the events stay in memory in order, `behind` is true, and the file is written again as soon as possible.
///
/// An event that the broker does not accept is set aside: it stays with a mark, and the confirmation of later events
/// does not remove it.
///
/// Bounded: beyond `max_bytes` the oldest event is dropped and counted. For use by one thread. Memory: `max_bytes`, and
/// as much again for each of the two jobs of spool_disk.h while the whole spool is written; while the file is read, twice
/// `max_bytes` in addition.
#ifndef MQTT_SPOOL_H
#define MQTT_SPOOL_H

#include "spool_disk.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/// Largest event with its name, in bytes.
#define MQTT_SPOOL_EVENT_MAX 8192U

typedef struct {
    int folder; ///< Descriptor of the directory; -1: none.
    mqtt_disk_t disk;
    size_t file_bytes;   ///< Size of the file with all records that were collected for it.
    bool busy;           ///< The thread writes.
    bool failed;         ///< The disk refused a job, and has accepted no whole file since.
    unsigned busy_polls; ///< Number of polls in a row in which the thread wrote the same.
    bool behind;         ///< The file lacks something: the disk is full, broken, or has not answered for seconds.
    uint8_t *data;       ///< Records, as in the file.
    size_t size;         ///< Size of `data`.
    size_t begin;        ///< Offset of the oldest record that is not confirmed.
    size_t end;          ///< Offset after the newest record.
    uint64_t last;       ///< Number of the newest event ever added.
    uint64_t mark;       ///< Value of the owner that is restored after a restart.
    size_t waiting;      ///< Number of events, including those that are set aside.
    size_t aside;        ///< Number of events that are set aside.
    uint64_t dropped;
} mqtt_spool_t;

/// An event. Valid until the next call that changes the spool.
typedef struct {
    uint64_t number; ///< Increases by one with each event.
    const char *name;
    const char *payload;
    size_t length; ///< Length of `payload`.
    bool aside;
} mqtt_spool_event_t;

/// Reads the file and locks the directory. Returns false with errno, and opens nothing: no memory, no such directory,
/// EPERM as in folder.h for the directory or the file in it, or EWOULDBLOCK if another process has it. Reading ends at
/// a damaged record.
bool mqtt_spool_open(mqtt_spool_t *self, const char *directory, size_t max_bytes);

/// Writes what is collected, once the whole spool if the file lacks something, and waits for the disk for at most a
/// second. Returns false if the disk has not finished.
bool mqtt_spool_flush(mqtt_spool_t *self);

/// Flushes and closes. Returns false if the disk has not finished, so the caller must end by _exit().
bool mqtt_spool_close(mqtt_spool_t *self);

/// Adds an event with the number `last` + 1, and stores `mark`. Returns false if it is too long; it then counts as
/// dropped.
bool mqtt_spool_add(mqtt_spool_t *self, const char *name, const char *payload, size_t length, uint64_t mark);

/// Writes the oldest unconfirmed event with a number above `number`. Returns false if there is none.
bool mqtt_spool_after(const mqtt_spool_t *self, uint64_t number, mqtt_spool_event_t *out_event);

/// Confirms all events up to `number`, except those that are set aside. If a power failure loses this, the events are
/// only sent again.
void mqtt_spool_confirm(mqtt_spool_t *self, uint64_t number);

/// The first function sets the event with this number aside, the second confirms such an event. Without such an event
/// they change nothing. After a restart of the process it is an event like the others.
void mqtt_spool_set_aside(mqtt_spool_t *self, uint64_t number);
void mqtt_spool_confirm_aside(mqtt_spool_t *self, uint64_t number);

/// Gives collected records to the thread, unless it still writes others. Call it in every round; it does not wait.
void mqtt_spool_sync(mqtt_spool_t *self);

/// Returns the descriptor for poll(): readable when the thread has finished and `sync` has work.
int mqtt_spool_fd(const mqtt_spool_t *self);

/// Begins to write the file again if it is behind, and judges how long the disk takes. Call it once a second; it does
/// not wait.
void mqtt_spool_poll(mqtt_spool_t *self);

#endif
