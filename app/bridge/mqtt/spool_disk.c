// SPDX-License-Identifier: MIT
#include "spool_disk.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <unistd.h>

static const char fresh[] = MQTT_SPOOL_FILE ".new";

static bool write_all(int file, const uint8_t *at, size_t length) {
    while (length > 0U) {
        const ssize_t written = write(file, at, length);
        if (written < 0 && errno == EINTR) {
            continue;
        }
        if (written <= 0) {
            return false;
        }
        at += written;
        length -= (size_t)written;
    }
    return true;
}

static void close_file(mqtt_disk_t *self) {
    if (self->file >= 0) {
        (void)close(self->file);
    }
    self->file = -1;
}

/// Writes a new file, which then replaces the old one. A complete file exists at any time.
static bool replace(mqtt_disk_t *self, const mqtt_job_t *job) {
    (void)unlinkat(self->folder, fresh, 0);
    const int file = openat(self->folder, fresh, O_CREAT | O_EXCL | O_WRONLY | O_NOFOLLOW | O_CLOEXEC, 0600);
    const bool good = file >= 0 && write_all(file, job->bytes, job->used) && fdatasync(file) == 0 &&
                      renameat(self->folder, fresh, self->folder, MQTT_SPOOL_FILE) == 0;
    if (!good) {
        if (file >= 0) {
            (void)close(file);
            (void)unlinkat(self->folder, fresh, 0);
        }
        return false;
    }
    (void)fsync(self->folder);
    close_file(self);
    self->file = file;
    return true;
}

/// Nothing is appended after a job that failed, because records after an incomplete one would not be read.
static bool append(mqtt_disk_t *self, const mqtt_job_t *job) {
    const bool good =
        self->file >= 0 && write_all(self->file, job->bytes, job->used) && (!job->synced || fdatasync(self->file) == 0);
    if (!good) {
        close_file(self);
    }
    return good;
}

static void *serve(void *context) {
    mqtt_disk_t *self = context;
    const uint64_t one = 1;
    for (;;) {
        while (sem_wait(&self->given) != 0) { // EINTR
        }
        if (atomic_load(&self->state) == MQTT_DISK_END) {
            close_file(self);
            return NULL;
        }
        const mqtt_job_t *job = &self->jobs[1U - self->mine]; // The caller changes `mine` only when it gives a job.
        const bool good = job->whole ? replace(self, job) : append(self, job);
        atomic_store(&self->state, good ? MQTT_DISK_DONE : MQTT_DISK_FAILED);
        (void)!write(self->wake, &one, sizeof one);
    }
}

static void release(mqtt_disk_t *self) {
    free(self->jobs[0].bytes);
    free(self->jobs[1].bytes);
    if (self->wake >= 0) {
        (void)close(self->wake);
    }
    (void)sem_destroy(&self->given);
}

bool mqtt_disk_open(mqtt_disk_t *self, int folder, size_t size) {
    *self = (mqtt_disk_t){.folder = folder, .size = size, .file = -1, .wake = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)};
    (void)sem_init(&self->given, 0, 0);
    self->jobs[0].bytes = malloc(size);
    self->jobs[1].bytes = malloc(size);
    int error = errno;
    if (self->wake >= 0 && self->jobs[0].bytes != NULL && self->jobs[1].bytes != NULL) {
        error = pthread_create(&self->thread, NULL, serve, self);
        if (error == 0) {
            return true;
        }
    }
    release(self);
    errno = error;
    return false;
}

void mqtt_disk_drop(mqtt_disk_t *self) {
    mqtt_job_t *job = &self->jobs[self->mine];
    job->used = 0;
    job->whole = false;
    job->synced = false;
}

void mqtt_disk_begin(mqtt_disk_t *self) {
    mqtt_disk_drop(self);
    self->jobs[self->mine].whole = true;
}

bool mqtt_disk_put(mqtt_disk_t *self, const void *bytes, size_t length, bool synced) {
    mqtt_job_t *job = &self->jobs[self->mine];
    if (length > self->size - job->used) {
        return false;
    }
    memcpy(job->bytes + job->used, bytes, length);
    job->used += length;
    job->synced = job->synced || synced;
    return true;
}

void mqtt_disk_give(mqtt_disk_t *self) {
    if (atomic_load(&self->state) != MQTT_DISK_IDLE || !mqtt_disk_has_more(self)) {
        return;
    }
    self->given_whole = self->jobs[self->mine].whole;
    self->mine = 1U - self->mine;
    mqtt_disk_drop(self);
    atomic_store(&self->state, MQTT_DISK_BUSY);
    (void)sem_post(&self->given);
}

mqtt_disk_state_t mqtt_disk_result(mqtt_disk_t *self, bool *out_whole) {
    uint64_t count = 0;
    (void)!read(self->wake, &count, sizeof count);
    const mqtt_disk_state_t state = (mqtt_disk_state_t)atomic_load(&self->state);
    *out_whole = self->given_whole;
    if (state == MQTT_DISK_DONE || state == MQTT_DISK_FAILED) {
        atomic_store(&self->state, MQTT_DISK_IDLE);
    }
    return state;
}

bool mqtt_disk_has_more(const mqtt_disk_t *self) {
    return self->jobs[self->mine].used > 0U;
}

void mqtt_disk_wait(const mqtt_disk_t *self, int wait_ms) {
    struct pollfd wake = {.fd = self->wake, .events = POLLIN};
    (void)poll(&wake, 1, wait_ms);
}

bool mqtt_disk_close(mqtt_disk_t *self) {
    if (atomic_load(&self->state) == MQTT_DISK_BUSY) {
        return false;
    }
    atomic_store(&self->state, MQTT_DISK_END);
    (void)sem_post(&self->given);
    (void)pthread_join(self->thread, NULL);
    release(self);
    return true;
}
