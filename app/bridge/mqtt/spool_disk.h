// SPDX-License-Identifier: MIT
/// Writes the file of a spool in a thread of its own, so that no disk delays the caller.
///
/// A job is either a piece that is appended to the file, or a whole file that replaces the old one. The caller collects
/// one job while the thread writes the other one:
///
///     IDLE --give--> BUSY --written and synced--> DONE --result--> IDLE
///                      '--the disk refuses it---> FAILED --result--> IDLE
///
/// There is no lock: BUSY belongs to the thread, all other states belong to the caller. The caller makes no system call
/// that waits for the disk. A job that failed is lost: then only a whole file helps.
///
/// For use by one thread. Memory: twice the size of a job, of which only the written part is used.
#ifndef MQTT_SPOOL_DISK_H
#define MQTT_SPOOL_DISK_H

#include <pthread.h>
#include <semaphore.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/// Name of the file in its directory.
#define MQTT_SPOOL_FILE "events"

typedef enum { MQTT_DISK_IDLE, MQTT_DISK_BUSY, MQTT_DISK_DONE, MQTT_DISK_FAILED, MQTT_DISK_END } mqtt_disk_state_t;

typedef struct {
    uint8_t *bytes;
    size_t used;
    bool whole;  ///< It replaces the file.
    bool synced; ///< It must survive a power failure. A whole file always does.
} mqtt_job_t;

typedef struct {
    int folder; ///< Descriptor of the directory; the owner closes it after `close`.
    size_t size;
    mqtt_job_t jobs[2];
    unsigned mine;    ///< Index of the job that the caller collects.
    bool given_whole; ///< The job given last is whole.
    atomic_int state; ///< mqtt_disk_state_t
    int wake;         ///< Readable after a job has ended.
    sem_t given;
    pthread_t thread;
    int file; ///< Thread: descriptor; -1: none.
} mqtt_disk_t;

/// Starts the thread. `size`: largest job in bytes. Writes nothing: the first job must be whole. Returns false with
/// errno.
bool mqtt_disk_open(mqtt_disk_t *self, int folder, size_t size);

/// Drops the collected job. The second function then begins a whole one.
void mqtt_disk_drop(mqtt_disk_t *self);
void mqtt_disk_begin(mqtt_disk_t *self);

/// Adds bytes to the collected job. Returns false and adds nothing if they do not fit.
bool mqtt_disk_put(mqtt_disk_t *self, const void *bytes, size_t length, bool synced);

/// Gives the collected job to the thread, unless it is empty or the thread has another one.
void mqtt_disk_give(mqtt_disk_t *self);

/// Returns BUSY, IDLE, or once after each job DONE or FAILED. `*out_whole`: that job was whole.
mqtt_disk_state_t mqtt_disk_result(mqtt_disk_t *self, bool *out_whole);

/// Returns true if a job is collected and not given.
bool mqtt_disk_has_more(const mqtt_disk_t *self);

/// Waits until a job has ended, at most this long. The only function that waits.
void mqtt_disk_wait(const mqtt_disk_t *self, int wait_ms);

/// Ends the thread, closes the file and drops the collected job. Returns false if the thread still waits for the disk;
/// nothing is freed then, and the caller must end by _exit().
bool mqtt_disk_close(mqtt_disk_t *self);

#endif
