// SPDX-License-Identifier: MIT
#include "box_files.h"

#include "candump.h"

#include "iwheel_linux/clock.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

/// How often the entries after the stop are fetched.
#define FOLLOW_MS 50
/// Numbers that somebody else may have taken meanwhile.
#define TRIES 8U

typedef struct {
    int fd;
    const blackbox_ring_t *ring;
    const gw_box_wish_t *wish;
    blackbox_entry_t *copy; ///< Room for as many entries as the ring has.
    const gw_box_order_t *order;
    const char *bus; ///< As the file of frames names it.
    FILE *frames_file;
    FILE *events_file;
    uint64_t next; ///< Number of the next entry to write.
    uint64_t frames;
    gw_box_result_t result;
    char line[GW_BOX_LINE_SIZE]; ///< Where each line is made.
} writer_t;

/// Writes what has been made in `line`.
static void put_line(const writer_t *self, FILE *file, size_t length) {
    (void)fwrite(self->line, 1, length, file);
}

static void write_entry(writer_t *self, const blackbox_entry_t *entry) {
    if (entry->kind != (uint8_t)BLACKBOX_FRAME) {
        put_line(self, self->events_file, gw_box_line_entry(entry, self->frames, self->line));
        return;
    }
    iw_can_frame_t frame = {.id = entry->number, .dlc = entry->a, .kind = entry->b};
    memcpy(frame.data, entry->as.data, sizeof frame.data);
    const candump_t out = candump_from_core(&frame, (int64_t)entry->at_us + self->order->wall_minus_us, self->bus);
    put_line(self, self->frames_file, candump_write(&out, self->line));
    self->frames++;
}

/// Writes the entries up to number `to`, those before `since_us` left out.
static void write_entries(writer_t *self, uint64_t to, iw_time_us_t since_us) {
    size_t count = 0;
    const uint64_t first = blackbox_ring_copy(self->ring, self->next, to, self->copy, &count);
    if (first > self->next && since_us == 0U) {
        put_line(self, self->events_file, gw_box_line_lost(first - self->next, self->frames, self->line));
    }
    for (size_t i = 0; i < count; i++) {
        if (self->copy[i].at_us >= since_us) {
            write_entry(self, &self->copy[i]);
        }
    }
    self->next = first + count;
}

/// When the first entry of the recording happened.
static iw_time_us_t begin_of(writer_t *self, iw_time_us_t since_us) {
    size_t count = 0;
    (void)blackbox_ring_copy(self->ring, 0, self->order->mark, self->copy, &count);
    for (size_t i = 0; i < count; i++) {
        if (self->copy[i].at_us >= since_us) {
            return self->copy[i].at_us;
        }
    }
    return self->order->note.stop.at_us;
}

/// True if the gateway has something to say, or is gone.
static bool is_called(const writer_t *self, int timeout_ms) {
    struct pollfd entry = {.fd = self->fd, .events = POLLIN};
    return poll(&entry, 1, timeout_ms) != 0;
}

/// What happens after the stop, until it is over or the next order waits.
static void follow(writer_t *self) {
    const iw_time_us_t until_us = self->order->note.stop.at_us + GW_BOX_AFTER_US;
    while (iw_clock_now_us() < until_us && !is_called(self, FOLLOW_MS)) {
        write_entries(self, UINT64_MAX, 0);
        (void)fflush(self->frames_file);
        (void)fflush(self->events_file);
    }
    write_entries(self, UINT64_MAX, 0);
}

/// 0 or an errno. Closes the file.
static int finish_file(FILE *file) {
    int error = (ferror(file) != 0) ? EIO : 0;
    if (fflush(file) != 0 || fsync(fileno(file)) != 0) {
        error = errno;
    }
    if (fclose(file) != 0 && error == 0) {
        error = errno;
    }
    return error;
}

/// Flushes both; the errno of what did not work, as early as possible.
static int flush(writer_t *self) {
    return (fflush(self->frames_file) != 0 || fflush(self->events_file) != 0) ? errno : 0;
}

static int write_config(writer_t *self, int directory, const char *stem) {
    FILE *file = gw_box_files_create(directory, stem, ".conf");
    if (file == NULL) {
        return errno;
    }
    (void)fputs(self->wish->config, file);
    return finish_file(file);
}

static int fill_files(writer_t *self) {
    const iw_stop_t *stop = &self->order->note.stop;
    const iw_time_us_t length_us = (iw_time_us_t)self->wish->blackbox_s * 1000000U;
    const iw_time_us_t since_us = (stop->at_us > length_us) ? stop->at_us - length_us : 1U;
    const iw_time_us_t begin_us = begin_of(self, since_us);
    const bool from_start = blackbox_ring_is_whole(self->ring) && begin_us <= self->copy[0].at_us;
    self->next = 0;
    self->frames = 0;
    self->result.ms = (uint32_t)((stop->at_us - begin_us) / IW_US_PER_MS);
    put_line(self, self->events_file, gw_box_line_head(self->wish, self->order, from_start, self->line));
    put_line(self, self->events_file, gw_box_line_stop(self->order, self->line));
    write_entries(self, self->order->mark, since_us);
    const int error = flush(self);
    if (error != 0) {
        return error;
    }
    follow(self);
    self->result.frames = (uint32_t)self->frames;
    put_line(self, self->events_file, gw_box_line_end(self->frames, self->line));
    return flush(self);
}

/// One attempt: all files of the recording, or none.
static int write_files(writer_t *self, int directory, uint32_t number) {
    char stem[GW_BOX_STEM_SIZE];
    (void)snprintf(stem, sizeof stem, "stop-%06u-%s", (unsigned)number, self->order->cause);
    (void)snprintf(self->result.path, sizeof self->result.path, "%s/%s.log", self->wish->directory, stem);
    int error = write_config(self, directory, stem);
    if (error == EEXIST) {
        return error; // Somebody else's: the gateway before us may still be writing its last.
    }
    self->frames_file = (error == 0) ? gw_box_files_create(directory, stem, ".log") : NULL;
    self->events_file = (self->frames_file != NULL) ? gw_box_files_create(directory, stem, ".jsonl") : NULL;
    error = (error == 0 && self->events_file == NULL) ? errno : error;
    if (self->events_file != NULL) {
        error = fill_files(self);
        const int events_error = finish_file(self->events_file);
        error = (error != 0) ? error : events_error;
    }
    if (self->frames_file != NULL) {
        const int frames_error = finish_file(self->frames_file);
        error = (error != 0) ? error : frames_error;
    }
    if (error != 0) {
        gw_box_files_remove(directory, number);
    }
    return error;
}

/// A full disk costs the oldest recordings, as far as there are any.
static int write_recording(writer_t *self) {
    const int directory = gw_box_files_open(self->wish->directory);
    if (directory < 0) {
        return errno;
    }
    uint32_t number = gw_box_files_next(directory);
    int error = write_files(self, directory, number);
    for (unsigned i = 0; i < TRIES && error == EEXIST; i++) {
        number++;
        error = write_files(self, directory, number);
    }
    while ((error == ENOSPC || error == EDQUOT) && gw_box_files_drop_oldest(directory, number)) {
        error = write_files(self, directory, number);
    }
    gw_box_files_rotate(directory, GW_BOX_RECORDINGS_MAX, GW_BOX_BYTES_MAX);
    (void)fsync(directory);
    (void)close(directory);
    return error;
}

static void carry_out(writer_t *self, const gw_box_order_t *order) {
    self->order = order;
    self->result = (gw_box_result_t){.number = order->note.stop.number};
    self->result.error = write_recording(self);
    self->order = NULL;
    (void)send(self->fd, &self->result, sizeof self->result, MSG_NOSIGNAL);
}

/// Said at once, not when the first stop is lost.
static void try_directory(writer_t *self) {
    const int directory = gw_box_files_open(self->wish->directory);
    self->result = (gw_box_result_t){.error = (directory < 0) ? errno : 0};
    if (directory >= 0 && faccessat(directory, ".", W_OK, AT_EACCESS) != 0) {
        self->result.error = errno;
    }
    if (directory >= 0) {
        (void)close(directory);
    }
    if (self->result.error != 0) {
        (void)send(self->fd, &self->result, sizeof self->result, MSG_NOSIGNAL);
    }
}

/// The last setpoints that were on the bus, in the wheels' own sense.
static void find_last_setpoints(writer_t *self, uint64_t written, iw_pair_t *out_pair) {
    size_t count = 0;
    (void)blackbox_ring_copy(self->ring, 0, written, self->copy, &count);
    for (size_t i = 0; i < count; i++) {
        iw_codec_wheel_t told[IW_SIDES];
        iw_can_frame_t frame = {.id = self->copy[i].number, .dlc = self->copy[i].a};
        memcpy(frame.data, self->copy[i].as.data, sizeof frame.data);
        const iw_side_t side = iw_codec_side(frame.id);
        if (self->copy[i].kind == (uint8_t)BLACKBOX_FRAME && iw_codec_decode(&frame, told) == IW_CODEC_SETPOINT) {
            out_pair->wheel[side].speed_mm_s = told[side].setpoint.speed_mm_s;
        }
    }
}

/// The gateway is gone without a word. A record of it, if the wheels were under its command.
static void note_death(writer_t *self) {
    gw_box_order_t order = {.cause = "gateway_died", .from = "armed", .mark = blackbox_ring_written(self->ring)};
    if (!atomic_load(&self->ring->sending)) {
        return;
    }
    (void)signal(SIGTERM,
                 SIG_DFL); // A service manager that waits for us before it starts the next gateway must not wait.
    iw_pair_t *applied = &order.note.stop.applied;
    order.note.wall_us = iw_clock_wall_us();
    order.note.stop.at_us = iw_clock_now_us();
    order.wall_minus_us = order.note.wall_us - (int64_t)order.note.stop.at_us;
    find_last_setpoints(self, order.mark, applied);
    const unsigned long long ms = (unsigned long long)(order.note.stop.at_us / IW_US_PER_MS);
    (void)snprintf(
        order.note.sentence, sizeof order.note.sentence,
        "the gateway died while setpoints were being sent, the last ones left %d mm/s and right %d mm/s; only "
        "the wheels' own 1 s watchdog was left, at %llu.%03llu s; look for the reason in its log and in the "
        "kernel's (dmesg), then start it again",
        applied->wheel[IW_LEFT].speed_mm_s, applied->wheel[IW_RIGHT].speed_mm_s, ms / 1000U, ms % 1000U);
    carry_out(self, &order);
}

void gw_box_writer_run(int fd, const blackbox_ring_t *ring, const gw_box_wish_t *wish) {
    gw_box_order_t order;
    static writer_t self; // Too large for a stack.
    self = (writer_t){.fd = fd, .ring = ring, .wish = wish};
    self.bus = (strncmp(wish->bus, "unix:", 5) == 0) ? "local" : wish->bus;
    self.copy = (blackbox_entry_t *)calloc(blackbox_ring_most(ring), sizeof *self.copy);
    if (self.copy == NULL) {
        return;
    }
    try_directory(&self);
    for (;;) {
        const ssize_t got = recv(fd, &order, sizeof order, 0);
        if (got < 0 && errno == EINTR) {
            continue;
        }
        if (got != (ssize_t)sizeof order) {
            note_death(&self);
            break;
        }
        if (order.last) {
            break;
        }
        carry_out(&self, &order);
    }
    free(self.copy);
}
