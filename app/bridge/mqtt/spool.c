// SPDX-License-Identifier: MIT
#include "spool.h"

#include "folder.h"
#include "mqtt_settings.h"

#include "iwheel_northbound/line.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <unistd.h>

static const char magic[8] = {'i', 'w', 's', 'p', 'o', 'o', 'l', '1'};

/// A record: length after the head and CRC-32 (head); then a letter, a number and the mark; for an event also its name
/// with a NUL, and its payload. A CONFIRMED record has the number up to which events are confirmed.
#define SIZE_MIN  (2U * (size_t)MQTT_SPOOL_EVENT_MAX)
#define HEAD_SIZE 8U
#define BODY_SIZE 17U
#define CONFIRMED 'c'
#define ACCEPTED  'a' ///< Like CONFIRMED, but only for this event.
#define EVENT     'e'
#define ASIDE     'r' ///< An event that the broker does not accept. When a file is read it becomes an EVENT.
#define DONE_SIZE (HEAD_SIZE + BODY_SIZE)
/// Space of a job beyond a whole file, for records that are added before the thread receives it.
#define JOB_SLACK (8U * (size_t)MQTT_SPOOL_EVENT_MAX)
/// A job that the thread has in so many polls in a row is late: waiting events are not on the disk.
#define LATE_POLLS 5U
#define CLOSE_MS   10
#define CLOSE_MAX  100 ///< At most a second in all.
/// Largest number of an event, so that one more is always possible.
#define NUMBER_MAX ((uint64_t)INT64_MAX)

static void put(uint8_t *at, uint64_t number, size_t bytes) {
    for (size_t i = 0; i < bytes; i++) {
        at[i] = (uint8_t)(number >> (8U * i));
    }
}

static uint64_t get(const uint8_t *at, size_t bytes) {
    uint64_t number = 0;
    for (size_t i = 0; i < bytes; i++) {
        number |= (uint64_t)at[i] << (8U * i);
    }
    return number;
}

static size_t length_of(const uint8_t *record) {
    return HEAD_SIZE + (size_t)get(record, 4);
}

static uint64_t number_of(const uint8_t *record) {
    return get(record + HEAD_SIZE + 1U, 8);
}

static bool is_aside(const uint8_t *record) {
    return record[HEAD_SIZE] == ASIDE;
}

static uint64_t mark_of(const uint8_t *record) {
    return get(record + HEAD_SIZE + 9U, 8);
}

/// Completes a record whose rest, with this number of bytes, is already written.
static void seal(const mqtt_spool_t *self, uint8_t *record, uint8_t letter, uint64_t number, size_t rest) {
    record[HEAD_SIZE] = letter;
    put(record + HEAD_SIZE + 1U, number, 8);
    put(record + HEAD_SIZE + 9U, self->mark, 8);
    put(record, BODY_SIZE + rest, 4);
    put(record + 4, iwn_line_crc(0, record + HEAD_SIZE, BODY_SIZE + rest), 4);
}

/// Removes the record at this place; earlier records, which are set aside, move up.
static void forget_at(mqtt_spool_t *self, size_t at) {
    const size_t length = length_of(self->data + at);
    self->waiting--;
    self->aside -= is_aside(self->data + at) ? 1U : 0U;
    memmove(self->data + self->begin + length, self->data + self->begin, at - self->begin);
    self->begin += length;
}

/// Returns space for this number of bytes after the newest record; drops the oldest ones if necessary. `length` is at
/// most the whole size.
static uint8_t *make_room(mqtt_spool_t *self, size_t length) {
    while (self->end - self->begin + length > self->size) {
        forget_at(self, self->begin);
        self->dropped++;
    }
    if (self->end + length > self->size) {
        memmove(self->data, self->data + self->begin, self->end - self->begin);
        self->end -= self->begin;
        self->begin = 0;
    }
    return self->data + self->end;
}

static void forget_until(mqtt_spool_t *self, uint64_t number) {
    while (self->begin < self->end && number_of(self->data + self->begin) <= number) {
        forget_at(self, self->begin);
    }
}

/// Returns the place of the event with this number; `end` if there is none.
static size_t place_of(const mqtt_spool_t *self, uint64_t number) {
    size_t at = self->begin;
    while (at < self->end && number_of(self->data + at) != number) {
        at += length_of(self->data + at);
    }
    return at;
}

static void forget_one(mqtt_spool_t *self, uint64_t number) {
    const size_t at = place_of(self, number);
    if (at < self->end) {
        forget_at(self, at);
    }
}

/// Changes the letter of a record in memory, and its CRC.
static void set_letter(uint8_t *record, uint8_t letter) {
    record[HEAD_SIZE] = letter;
    put(record + 4, iwn_line_crc(0, record + HEAD_SIZE, length_of(record) - HEAD_SIZE), 4);
}

bool mqtt_spool_after(const mqtt_spool_t *self, uint64_t number, mqtt_spool_event_t *out_event) {
    for (size_t at = self->begin; at < self->end; at += length_of(self->data + at)) {
        const uint8_t *record = self->data + at;
        if (number_of(record) > number) {
            const char *name = (const char *)record + HEAD_SIZE + BODY_SIZE;
            const size_t skip = HEAD_SIZE + BODY_SIZE + strlen(name) + 1U;
            *out_event = (mqtt_spool_event_t){number_of(record), name, (const char *)record + skip,
                                              length_of(record) - skip, is_aside(record)};
            return true;
        }
    }
    return false;
}

/// Collects the whole spool as a new file. It replaces everything that was collected before.
static void rewrite(mqtt_spool_t *self) {
    uint8_t first[DONE_SIZE];
    uint8_t last[DONE_SIZE];
    const bool empty = self->begin == self->end;
    const size_t size = self->end - self->begin;
    seal(self, first, CONFIRMED, empty ? self->last : number_of(self->data + self->begin) - 1U, 0);
    seal(self, last, ACCEPTED, self->last,
         0); // The newest event is the last record, unless it was confirmed before an older one.
    const bool gone = empty || place_of(self, self->last) == self->end;
    mqtt_disk_begin(&self->disk); // A job has space for all of this.
    (void)mqtt_disk_put(&self->disk, magic, sizeof magic, true);
    (void)mqtt_disk_put(&self->disk, first, sizeof first, true);
    (void)mqtt_disk_put(&self->disk, self->data + self->begin, size, true);
    (void)mqtt_disk_put(&self->disk, last, gone ? sizeof last : 0U, true);
    self->file_bytes = sizeof magic + sizeof first + size + (gone ? sizeof last : 0U);
}

/// Returns true if the file lacks something and the thread does not write it again: the next whole file has everything.
static bool needs_rewrite(const mqtt_spool_t *self) {
    return self->failed && !self->busy;
}

/// Collects a record for the file. While the thread writes a whole file, the record follows it: that file was collected
/// before.
static void append(mqtt_spool_t *self, const uint8_t *record, size_t length, bool synced) {
    if (needs_rewrite(self)) {
        return;
    }
    if (self->file_bytes + length > 2U * self->size || !mqtt_disk_put(&self->disk, record, length, synced)) {
        rewrite(self);
        return;
    }
    self->file_bytes += length;
}

static size_t read_event(mqtt_spool_t *self, const uint8_t *record, size_t length) {
    const uint64_t number = number_of(record);
    if ((record[HEAD_SIZE] != EVENT && !is_aside(record)) || number <= self->last ||
        memchr(record + HEAD_SIZE + BODY_SIZE, '\0', length - HEAD_SIZE - BODY_SIZE) == NULL) {
        return 0;
    }
    self->last = number;
    self->mark = mark_of(record);
    if (!mqtt_settings_is_name((const char *)record + HEAD_SIZE + BODY_SIZE)) { // No broker accepts such a topic.
        self->dropped++;
        return length;
    }
    uint8_t *copy = make_room(self, length);
    memcpy(copy, record, length);
    set_letter(copy, EVENT);
    self->end += length;
    self->waiting++;
    return length;
}

/// Reads one record of a file. Returns its length, or 0 at the end of the valid records.
static size_t read_record(mqtt_spool_t *self, const uint8_t *record, size_t left) {
    if (left < HEAD_SIZE + BODY_SIZE || get(record, 4) < BODY_SIZE || get(record, 4) > MQTT_SPOOL_EVENT_MAX ||
        length_of(record) > left) {
        return 0;
    }
    const size_t length = length_of(record);
    const uint64_t number = number_of(record);
    if (number > NUMBER_MAX || get(record + 4, 4) != iwn_line_crc(0, record + HEAD_SIZE, length - HEAD_SIZE)) {
        return 0;
    }
    if ((record[HEAD_SIZE] == CONFIRMED || record[HEAD_SIZE] == ACCEPTED) && length == DONE_SIZE) {
        if (record[HEAD_SIZE] == CONFIRMED) {
            forget_until(self, number);
        } else {
            forget_one(self, number);
        }
        if (number > self->last) {
            self->last = number;
        }
        self->mark = mark_of(record);
        return length;
    }
    return read_event(self, record, length);
}

static void read_file(mqtt_spool_t *self, int file) {
    const size_t size = 2U * self->size + MQTT_SPOOL_EVENT_MAX + DONE_SIZE;
    uint8_t *bytes = (file >= 0) ? malloc(size) : NULL;
    size_t length = 0;
    for (ssize_t got = 1; bytes != NULL && got > 0 && length < size; length += (size_t)((got > 0) ? got : 0)) {
        got = read(file, bytes + length, size - length);
    }
    if (bytes != NULL && length >= sizeof magic && memcmp(bytes, magic, sizeof magic) == 0) {
        size_t at = sizeof magic;
        for (size_t used = 1; used > 0U && at < length; at += used) {
            used = read_record(self, bytes + at, length - at);
        }
    }
    free(bytes);
    if (file >= 0) {
        (void)close(file);
    }
}

static void release(mqtt_spool_t *self) {
    if (self->folder >= 0) {
        (void)close(self->folder);
    }
    self->folder = -1;
    free(self->data);
    self->data = NULL;
}

bool mqtt_spool_open(mqtt_spool_t *self, const char *directory, size_t max_bytes) {
    *self = (mqtt_spool_t){.folder = mqtt_folder_open(directory)};
    self->size = (max_bytes > SIZE_MIN) ? max_bytes : SIZE_MIN;
    const bool ours = self->folder >= 0 && flock(self->folder, LOCK_EX | LOCK_NB) == 0;
    const int file = ours ? mqtt_folder_open_file(self->folder, MQTT_SPOOL_FILE) : -1;
    self->data = (ours && (file >= 0 || errno == ENOENT)) ? malloc(self->size) : NULL;
    if (self->data == NULL ||
        !mqtt_disk_open(&self->disk, self->folder, sizeof magic + DONE_SIZE + DONE_SIZE + self->size + JOB_SLACK)) {
        const int error = errno;
        if (file >= 0) {
            (void)close(file);
        }
        release(self);
        errno = error;
        return false;
    }
    read_file(self, file);
    rewrite(self);
    mqtt_disk_give(&self->disk);
    return true;
}

bool mqtt_spool_flush(mqtt_spool_t *self) {
    bool again = true;
    mqtt_spool_sync(self);
    for (int i = 0; i < CLOSE_MAX && (self->busy || (again && self->failed)); i++) {
        if (needs_rewrite(self)) {
            again = false;
            rewrite(self);
            mqtt_spool_sync(self);
        }
        mqtt_disk_wait(&self->disk, CLOSE_MS);
        mqtt_spool_sync(self);
    }
    return !self->busy;
}

bool mqtt_spool_close(mqtt_spool_t *self) {
    if (self->data == NULL) {
        return true;
    }
    if (!mqtt_spool_flush(self) || !mqtt_disk_close(&self->disk)) {
        return false;
    }
    release(self);
    return true;
}

bool mqtt_spool_add(mqtt_spool_t *self, const char *name, const char *payload, size_t length, uint64_t mark) {
    const size_t name_size = strlen(name) + 1U;
    const size_t rest = name_size + length;
    if (BODY_SIZE + rest > MQTT_SPOOL_EVENT_MAX) {
        self->dropped++;
        return false;
    }
    uint8_t *record = make_room(self, HEAD_SIZE + BODY_SIZE + rest);
    memcpy(record + HEAD_SIZE + BODY_SIZE, name, name_size);
    memcpy(record + HEAD_SIZE + BODY_SIZE + name_size, payload, length);
    self->last++;
    self->mark = mark;
    seal(self, record, EVENT, self->last, rest);
    self->end += HEAD_SIZE + BODY_SIZE + rest;
    self->waiting++;
    append(self, record, HEAD_SIZE + BODY_SIZE + rest, true);
    return true;
}

static void append_done(mqtt_spool_t *self, uint8_t letter, uint64_t number) {
    uint8_t done[DONE_SIZE];
    seal(self, done, letter, number, 0);
    append(self, done, sizeof done, false);
}

void mqtt_spool_confirm(mqtt_spool_t *self, uint64_t number) {
    if (self->aside == 0U) {
        forget_until(self, number);
        append_done(self, CONFIRMED, number);
        return;
    }
    for (size_t at = self->begin, next; at < self->end && number_of(self->data + at) <= number; at = next) {
        const uint64_t one = number_of(self->data + at);
        next = at + length_of(self->data + at);
        if (!is_aside(self->data + at)) {
            forget_at(self, at);
            append_done(self, ACCEPTED, one);
        }
    }
}

void mqtt_spool_set_aside(mqtt_spool_t *self, uint64_t number) {
    const size_t at = place_of(self, number);
    if (at < self->end && !is_aside(self->data + at)) {
        set_letter(self->data + at, ASIDE);
        self->aside++;
    }
}

void mqtt_spool_confirm_aside(mqtt_spool_t *self, uint64_t number) {
    forget_one(self, number);
    append_done(self, ACCEPTED, number);
}

/// Receives the result of the thread.
static void settle(mqtt_spool_t *self) {
    bool whole = false;
    const mqtt_disk_state_t state = mqtt_disk_result(&self->disk, &whole);
    self->busy = state == MQTT_DISK_BUSY;
    if (state == MQTT_DISK_FAILED) {
        self->failed = true;
        mqtt_disk_drop(&self->disk);
    } else if (state == MQTT_DISK_DONE && whole) {
        self->failed = false;
    }
    if (!self->busy) {
        self->busy_polls = 0;
    }
    self->behind = self->failed || self->busy_polls >= LATE_POLLS;
}

void mqtt_spool_sync(mqtt_spool_t *self) {
    settle(self);
    if (!self->busy && mqtt_disk_has_more(&self->disk)) {
        mqtt_disk_give(&self->disk);
        self->busy = true;
    }
}

void mqtt_spool_poll(mqtt_spool_t *self) {
    settle(self);
    if (self->busy) {
        self->busy_polls++;
    } else if (self->failed) {
        rewrite(self);
    }
    mqtt_spool_sync(self);
}

int mqtt_spool_fd(const mqtt_spool_t *self) {
    return self->disk.wake;
}
