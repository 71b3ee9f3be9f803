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

/// Interval of reading entries after the stop.
#define FOLLOW_MS 50
/// Number of attempts if another process uses a number first.
#define TRIES 8U
/// A faster wheel was in motion: the default of rest_rpm.
#define REST_RPM 2
/// Size of a ring entry on the disk (a line of candump), and the largest reserve.
#define RESERVE_PER_ENTRY 48U
#define RESERVE_MAX       ((uint64_t)4U * 1024U * 1024U)

typedef struct {
    int fd;
    const blackbox_ring_t *ring;
    const gw_box_config_t *config;
    blackbox_entry_t *copy; ///< Buffer for all entries of the ring.
    const gw_box_order_t *order;
    const char *bus; ///< Name in the file of frames.
    FILE *frames_file;
    FILE *events_file;
    uint64_t next; ///< Number of the next entry to write.
    uint64_t frames;
    int error;      ///< Errno of the first failed write of this attempt.
    bool in_motion; ///< A wheel turned at the stop, or was commanded to.
    gw_box_result_t result;
    char line[GW_BOX_LINE_SIZE]; ///< Buffer of a line.
} writer_t;

/// Stores the errno of a failed call, because stdio stores only that there was one.
static void keep_error(writer_t *self, bool failed) {
    if (failed && self->error == 0) {
        self->error = (errno != 0) ? errno : EIO;
    }
}

/// Writes the contents of `line`.
static void put_line(writer_t *self, FILE *file, size_t length) {
    keep_error(self, fwrite(self->line, 1, length, file) != length);
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

/// Writes the entries up to number `to`, except those before `since_us`.
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

/// Returns the time of the first entry of the recording.
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

/// Returns true if the gateway has sent something, or has ended.
static bool is_called(const writer_t *self, int timeout_ms) {
    struct pollfd entry = {.fd = self->fd, .events = POLLIN};
    return poll(&entry, 1, timeout_ms) != 0;
}

static void flush(writer_t *self) {
    keep_error(self, fflush(self->frames_file) != 0);
    keep_error(self, fflush(self->events_file) != 0);
}

/// Writes the entries after the stop, until it is over or the next order waits.
static void follow(writer_t *self) {
    const iw_time_us_t until_us = self->order->note.stop.at_us + GW_BOX_AFTER_US;
    while (iwl_clock_now_us() < until_us && !is_called(self, FOLLOW_MS)) {
        write_entries(self, UINT64_MAX, 0);
        flush(self);
    }
    write_entries(self, UINT64_MAX, 0);
}

static void finish_file(writer_t *self, FILE *file) {
    keep_error(self, fflush(file) != 0);
    keep_error(self, fsync(fileno(file)) != 0);
    keep_error(self, fclose(file) != 0);
}

static void write_config(writer_t *self, int directory, const char *stem) {
    FILE *file = gw_box_files_create(directory, stem, ".conf");
    keep_error(self, file == NULL);
    if (file != NULL) {
        keep_error(self, fputs(self->config->config, file) < 0);
        finish_file(self, file);
    }
}

static void fill_files(writer_t *self) {
    const iw_stop_t *stop = &self->order->note.stop;
    const iw_time_us_t length_us = (iw_time_us_t)self->config->blackbox_s * 1000000U;
    const iw_time_us_t since_us = (stop->at_us > length_us) ? stop->at_us - length_us : 1U;
    const iw_time_us_t begin_us = begin_of(self, since_us);
    const bool from_start = blackbox_ring_is_whole(self->ring) && begin_us <= self->copy[0].at_us;
    self->next = 0;
    self->frames = 0;
    self->result.ms = (uint32_t)((stop->at_us - begin_us) / IW_US_PER_MS);
    put_line(self, self->events_file, gw_box_line_head(self->config, self->order, from_start, self->line));
    put_line(self, self->events_file, gw_box_line_stop(self->order, self->in_motion, self->line));
    write_entries(self, self->order->mark, since_us);
    flush(self);
    if (self->error != 0) {
        return; // As early as possible, because the rest needs two seconds.
    }
    follow(self);
    self->result.frames = (uint32_t)self->frames;
    flush(self); // The last line confirms the rest, so it is written after all of it.
    put_line(self, self->events_file, gw_box_line_end(self->frames, self->line));
}

/// Makes one attempt to write all files of the recording. Returns 0 or the errno of the first failure; then there are
/// none.
static int write_files(writer_t *self, int directory, uint32_t number) {
    char stem[GW_BOX_STEM_SIZE];
    (void)snprintf(stem, sizeof stem, "stop-%06u-%s", (unsigned)number, self->order->cause);
    (void)snprintf(self->result.path, sizeof self->result.path, "%s/%s.log", self->config->directory, stem);
    self->error = 0;
    write_config(self, directory, stem);
    if (self->error == EEXIST) {
        return EEXIST; // Another process has it: the previous gateway may still write its last recording.
    }
    self->frames_file = (self->error == 0) ? gw_box_files_create(directory, stem, ".log") : NULL;
    self->events_file = (self->frames_file != NULL) ? gw_box_files_create(directory, stem, ".jsonl") : NULL;
    keep_error(self, self->events_file == NULL);
    if (self->events_file != NULL) {
        fill_files(self);
        finish_file(self, self->events_file);
    }
    if (self->frames_file != NULL) {
        finish_file(self, self->frames_file);
    }
    if (self->error != 0) {
        gw_box_files_remove(directory, number);
    }
    return self->error;
}

/// Frees space on a full disk for recording `number`. For a stop at standstill it removes neither the reserve nor the
/// recording of a stop in motion.
static bool make_room(const writer_t *self, int directory, uint32_t number) {
    return (self->in_motion && gw_box_files_release(directory)) ||
           gw_box_files_drop_oldest(directory, number, self->in_motion);
}

/// Reserves the size of a recording of a full ring, within limits.
static void reserve(const writer_t *self, int directory) {
    const uint64_t bytes = (uint64_t)blackbox_ring_most(self->ring) * RESERVE_PER_ENTRY;
    gw_box_files_reserve(directory, (bytes < RESERVE_MAX) ? bytes : RESERVE_MAX);
}

/// Writes a recording. On a full disk it removes older recordings.
static int write_recording(writer_t *self) {
    const int directory = gw_box_files_open(self->config->directory);
    if (directory < 0) {
        return errno;
    }
    uint32_t number = gw_box_files_next(directory);
    int error = write_files(self, directory, number);
    for (unsigned i = 0; i < TRIES && error == EEXIST; i++) {
        number++;
        error = write_files(self, directory, number);
    }
    while ((error == ENOSPC || error == EDQUOT) && make_room(self, directory, number)) {
        error = write_files(self, directory, number);
    }
    gw_box_files_rotate(directory,
                        &(gw_box_limits_t){self->config->keep_stops, GW_BOX_BYTES_MAX, number, self->in_motion});
    reserve(self, directory);
    (void)fsync(directory);
    (void)close(directory);
    return error;
}

/// Last state of the bus before the stop.
typedef struct {
    iw_pair_t setpoints;   ///< In the wheels' own direction.
    int16_t rpm[IW_SIDES]; ///< Measured speed; 0 without telemetry.
} last_seen_t;

static last_seen_t find_last(writer_t *self, uint64_t written) {
    last_seen_t last = {.rpm = {0, 0}};
    size_t count = 0;
    (void)blackbox_ring_copy(self->ring, 0, written, self->copy, &count);
    for (size_t i = 0; i < count; i++) {
        iw_codec_wheel_t values[IW_SIDES];
        iw_can_frame_t frame = {.id = self->copy[i].number, .dlc = self->copy[i].a};
        memcpy(frame.data, self->copy[i].as.data, sizeof frame.data);
        if (self->copy[i].kind != (uint8_t)BLACKBOX_FRAME) {
            continue;
        }
        const iw_side_t side = iw_codec_side(frame.id);
        const iw_codec_kind_t kind = iw_codec_decode(&frame, values);
        if (kind == IW_CODEC_SETPOINT) {
            last.setpoints.wheel[side].speed_mm_s = values[side].setpoint.speed_mm_s;
        } else if (kind == IW_CODEC_SPEED) {
            last.rpm[side] = values[side].speed.speed_rpm;
        }
    }
    return last;
}

static bool is_in_motion(writer_t *self, const gw_box_order_t *order) {
    const last_seen_t last = find_last(self, order->mark);
    for (unsigned side = 0; side < IW_SIDES; side++) {
        if (order->note.stop.applied.wheel[side].speed_mm_s != 0 || abs(last.rpm[side]) > REST_RPM) {
            return true;
        }
    }
    return false;
}

static void carry_out(writer_t *self, const gw_box_order_t *order) {
    self->order = order;
    self->in_motion = is_in_motion(self, order);
    self->result = (gw_box_result_t){.number = order->note.stop.number};
    self->result.error = write_recording(self);
    self->order = NULL;
    (void)send(self->fd, &self->result, sizeof self->result, MSG_NOSIGNAL);
}

/// Reports an unusable directory immediately, not when the first stop is lost.
static void try_directory(writer_t *self) {
    const int directory = gw_box_files_open(self->config->directory);
    self->result = (gw_box_result_t){.error = (directory < 0) ? errno : 0};
    if (directory >= 0 && faccessat(directory, ".", W_OK, AT_EACCESS) != 0) {
        self->result.error = errno;
    }
    if (directory >= 0) {
        reserve(self, directory);
        (void)close(directory);
    }
    if (self->result.error != 0) {
        (void)send(self->fd, &self->result, sizeof self->result, MSG_NOSIGNAL);
    }
}

/// Handles a gateway that has ended without a message: writes a recording if it commanded the wheels.
static void note_death(writer_t *self) {
    gw_box_order_t order = {.cause = "gateway_died", .from = "armed", .mark = blackbox_ring_written(self->ring)};
    if (!atomic_load(&self->ring->sending)) {
        return;
    }
    (void)signal(
        SIGTERM,
        SIG_DFL); // A service manager that waits for this process before it starts the next gateway must not wait.
    iw_pair_t *applied = &order.note.stop.applied;
    order.note.wall_us = iwl_clock_wall_us();
    order.note.stop.at_us = iwl_clock_now_us();
    order.wall_minus_us = order.note.wall_us - (int64_t)order.note.stop.at_us;
    *applied = find_last(self, order.mark).setpoints;
    const unsigned long long ms = (unsigned long long)(order.note.stop.at_us / IW_US_PER_MS);
    (void)snprintf(
        order.note.sentence, sizeof order.note.sentence,
        "the gateway died while setpoints were being sent, the last ones left %d mm/s and right %d mm/s; only "
        "the wheels' own 1 s watchdog could stop them (at %llu.%03llu s); read its log and the kernel's (dmesg) for "
        "the "
        "reason, then start it again",
        applied->wheel[IW_LEFT].speed_mm_s, applied->wheel[IW_RIGHT].speed_mm_s, ms / 1000U, ms % 1000U);
    carry_out(self, &order);
}

void gw_box_writer_run(int fd, const blackbox_ring_t *ring, const gw_box_config_t *config) {
    gw_box_order_t order;
    static writer_t self; // Too large for a stack.
    self = (writer_t){.fd = fd, .ring = ring, .config = config};
    self.bus = (strncmp(config->bus, "unix:", 5) == 0) ? "local" : config->bus;
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
