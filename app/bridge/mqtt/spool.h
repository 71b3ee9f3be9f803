// SPDX-License-Identifier: MIT
/// Events that the broker has not confirmed yet: in memory, and in one file that outlives the process.
///
/// The file is a journal: what is added and what is confirmed is appended, each record with its CRC-32. After `add` an event outlives
/// the process; the power too, as soon as the disk has done what `sync` began. A file that was cut anywhere reads as everything before the
/// cut; at the start, and when it has grown, it is written anew beside the old one and put in its place. If the disk takes nothing, the events
/// stay in memory, in order, and the file is written again as soon as that works; `behind` says so meanwhile.
///
/// An event that the broker does not accept is set aside: it stays, is marked, and what is confirmed behind it does not remove it.
///
/// Bounded: beyond `max_bytes` the oldest is dropped and counted. For one thread; a second one of its own waits for the disk, so that a slow
/// one holds up nobody.
#ifndef MQTT_SPOOL_H
#define MQTT_SPOOL_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/// The longest event with its name.
#define MQTT_SPOOL_EVENT_MAX 8192U
#define MQTT_SPOOL_FILE      "events"

/// For the thread that waits for the disk.
typedef enum { MQTT_SYNC_IDLE, MQTT_SYNC_BUSY, MQTT_SYNC_FAILED } mqtt_sync_state_t;
typedef struct {
    int file;
    atomic_int state; ///< mqtt_sync_state_t
} mqtt_sync_t;

typedef struct {
    int folder; ///< Its directory; -1: none.
    int file;   ///< -1: none.
    size_t file_bytes;
    bool behind;   ///< The file lacks something: the disk is full or broken.
    bool unsynced; ///< Something in it has to be brought to the disk.
    mqtt_sync_t sync;
    uint8_t *data;  ///< Records, as in the file.
    size_t size;    ///< Of `data`.
    size_t begin;   ///< The oldest record that is not confirmed.
    size_t end;     ///< Behind the newest.
    uint64_t last;  ///< Number of the newest event ever added.
    uint64_t mark;  ///< What the owner wants to know after a restart.
    size_t waiting; ///< Events, those that are set aside among them.
    size_t aside;   ///< Events that are set aside.
    uint64_t dropped;
} mqtt_spool_t;

/// An event. Valid until the next call that changes the spool.
typedef struct {
    uint64_t number; ///< Grows by one with each event.
    const char *name;
    const char *payload;
    size_t length; ///< Of `payload`.
    bool aside;
} mqtt_spool_event_t;

/// Reads what is there, and keeps others out. False, with errno: no memory, no such directory, EPERM as in folder.h, for the directory or the file in
/// it, or EWOULDBLOCK: another process has it; then nothing is open. A record that is
/// damaged ends the reading.
bool mqtt_spool_open(mqtt_spool_t *self, const char *directory, size_t max_bytes);

/// Waits for the disk, a second at most; False: it is not done, so the process ends by _exit().
bool mqtt_spool_close(mqtt_spool_t *self);

/// Adds an event, which gets the number `last` + 1, and remembers `mark`. False: it is too long, and counted as dropped.
bool mqtt_spool_add(mqtt_spool_t *self, const char *name, const char *payload, size_t length, uint64_t mark);

/// The oldest one that is not confirmed with a number above `number`; false: there is none.
bool mqtt_spool_after(const mqtt_spool_t *self, uint64_t number, mqtt_spool_event_t *out_event);

/// All up to `number` are confirmed, except those that are set aside. Losing this with the power only sends them again.
void mqtt_spool_confirm(mqtt_spool_t *self, uint64_t number);

/// Sets the event with this number aside, or confirms one that was. Without such an event nothing changes. After a restart of the process
/// it is an event like the others.
void mqtt_spool_set_aside(mqtt_spool_t *self, uint64_t number);
void mqtt_spool_confirm_aside(mqtt_spool_t *self, uint64_t number);

/// Begins to bring to the disk what was added, unless that is going on; call it in every round. Waits for nothing.
void mqtt_spool_sync(mqtt_spool_t *self);

/// Tries to write the file again, if it is behind. Call it now and then.
void mqtt_spool_poll(mqtt_spool_t *self);

#endif
