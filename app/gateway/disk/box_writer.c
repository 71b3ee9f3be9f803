// SPDX-License-Identifier: MIT
#include "box_writer.h"

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
/// Interval of reading entries for the recording on request: a fraction of the time that the ring covers.
#define REQUEST_MS 200
/// Number of attempts if another process uses a number first.
#define TRIES 8U
/// A faster wheel was in motion: the default of rest_rpm.
#define REST_RPM 2
/// Size of a ring entry on the disk (a line of candump), and the largest reserve.
#define RESERVE_PER_ENTRY 48U
#define RESERVE_MAX       ((uint64_t)4U * 1024U * 1024U)

/// Returns the time of the first entry of the recording.
static iw_time_us_t begin_of(gw_writer_t *self, iw_time_us_t since_us) {
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
static bool is_called(const gw_writer_t *self, int timeout_ms) {
    struct pollfd entry = {.fd = self->fd, .events = POLLIN};
    return poll(&entry, 1, timeout_ms) != 0;
}

/// Writes the entries after the stop, until it is over or the next order waits.
static void follow(gw_writer_t *self) {
    const iw_time_us_t until_us = self->order->note.stop.at_us + GW_BOX_AFTER_US;
    while (iwl_clock_now_us() < until_us && !is_called(self, FOLLOW_MS)) {
        gw_writer_entries(self, UINT64_MAX, 0);
        gw_writer_flush(self);
        gw_request_step(self->request);
    }
    gw_writer_entries(self, UINT64_MAX, 0);
}

static void fill_files(gw_writer_t *self) {
    const iw_stop_t *stop = &self->order->note.stop;
    const iw_time_us_t length_us = (iw_time_us_t)self->config->blackbox_s * 1000000U;
    const iw_time_us_t since_us = (stop->at_us > length_us) ? stop->at_us - length_us : 1U;
    const iw_time_us_t begin_us = begin_of(self, since_us);
    const bool from_start = blackbox_ring_is_whole(self->ring) && begin_us <= self->copy[0].at_us;
    self->result.ms = (uint32_t)((stop->at_us - begin_us) / IW_US_PER_MS);
    gw_writer_head(self, from_start);
    gw_writer_entries(self, self->order->mark, since_us);
    gw_writer_flush(self);
    if (self->error != 0) {
        return; // As early as possible, because the rest needs two seconds.
    }
    follow(self);
    self->result.frames = (uint32_t)self->frames;
}

/// Makes one attempt to write all files of the recording. Returns 0 or the errno of the first failure; then there are
/// none.
static int write_files(gw_writer_t *self, int directory, uint32_t number) {
    if (gw_writer_open(self, directory, number) == 0) {
        fill_files(self);
        gw_writer_close(self);
    }
    if (self->error == EEXIST) {
        return EEXIST; // Another process has it: the previous gateway may still write its last recording.
    }
    if (self->error != 0) {
        gw_box_files_remove(directory, number);
    }
    return self->error;
}

/// Returns the number of the recording on request; 0 if none is being written.
static uint32_t running(const gw_writer_t *self) {
    return gw_request_runs(self->request) ? self->request->number : 0U;
}

/// Frees space on a full disk for recording `number`. For a stop at standstill it removes neither the reserve nor the
/// recording of a stop in motion.
static bool make_room(const gw_writer_t *self, int directory, uint32_t number) {
    const gw_box_limits_t limits = {.below = number, .in_motion = self->in_motion, .running = running(self)};
    return (self->in_motion && gw_box_files_release(directory)) || gw_box_files_drop_oldest(directory, &limits);
}

/// Reserves the size of a recording of a full ring, within limits.
static void reserve(const gw_writer_t *self, int directory) {
    const uint64_t bytes = (uint64_t)blackbox_ring_most(self->ring) * RESERVE_PER_ENTRY;
    gw_box_files_reserve(directory, (bytes < RESERVE_MAX) ? bytes : RESERVE_MAX);
}

/// Writes a recording. On a full disk it removes older recordings.
static int write_recording(gw_writer_t *self) {
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
    gw_box_files_rotate(directory, &(gw_box_limits_t){self->config->keep_stops, GW_BOX_BYTES_MAX, number,
                                                      self->in_motion, running(self)});
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

static last_seen_t find_last(gw_writer_t *self, uint64_t written) {
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

static bool is_in_motion(gw_writer_t *self, const gw_box_order_t *order) {
    const last_seen_t last = find_last(self, order->mark);
    for (unsigned side = 0; side < IW_SIDES; side++) {
        if (order->note.stop.applied.wheel[side].speed_mm_s != 0 || abs(last.rpm[side]) > REST_RPM) {
            return true;
        }
    }
    return false;
}

static void carry_out(gw_writer_t *self, const gw_box_order_t *order) {
    self->order = order;
    self->in_motion = is_in_motion(self, order);
    self->result = (gw_box_result_t){.number = order->note.stop.number};
    self->result.error = write_recording(self);
    self->order = NULL;
    (void)send(self->fd, &self->result, sizeof self->result, MSG_NOSIGNAL);
}

/// Reports an unusable directory immediately, not when the first stop is lost.
static void try_directory(gw_writer_t *self) {
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
static void note_death(gw_writer_t *self) {
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

/// Writes the recording on request until a message waits, or the gateway has ended.
static void wait_for_order(gw_writer_t *self) {
    do {
        gw_request_step(self->request);
    } while (gw_request_runs(self->request) && !is_called(self, REQUEST_MS));
}

static void follow_orders(gw_writer_t *self) {
    gw_box_order_t order;
    for (;;) {
        wait_for_order(self);
        const ssize_t got = recv(self->fd, &order, sizeof order, 0);
        if (got < 0 && errno == EINTR) {
            continue;
        }
        if (got != (ssize_t)sizeof order) {
            note_death(self);
            return;
        }
        switch (order.kind) {
        case GW_BOX_STOP:
            carry_out(self, &order);
            break;
        case GW_BOX_BEGIN:
            gw_request_begin(self->request, &order);
            break;
        case GW_BOX_END:
            gw_request_end(self->request, GW_BOX_BY_REQUEST);
            break;
        default:
            return;
        }
    }
}

void gw_box_writer_run(int fd, const blackbox_ring_t *ring, const gw_box_config_t *config) {
    static gw_writer_t self; // Too large for a stack.
    static gw_writer_t request;
    self = (gw_writer_t){.fd = fd, .ring = ring, .config = config, .most_bytes = UINT64_MAX};
    self.bus = (strncmp(config->bus, "unix:", 5) == 0) ? "local" : config->bus;
    self.copy = (blackbox_entry_t *)calloc(blackbox_ring_most(ring), sizeof *self.copy);
    if (self.copy == NULL) {
        return;
    }
    request = self;
    self.request = &request;
    try_directory(&self);
    follow_orders(&self);
    gw_request_end(&request, GW_BOX_BY_REQUEST);
    free(self.copy);
}
