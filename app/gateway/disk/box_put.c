// SPDX-License-Identifier: MIT
#include "box_writer.h"

#include "candump.h"

#include <errno.h>
#include <string.h>
#include <unistd.h>

/// Stores the errno of a failed call, because stdio stores only that there was one.
static void store_error(gw_writer_t *self, bool failed) {
    if (failed && self->error == 0) {
        self->error = (errno != 0) ? errno : EIO;
    }
}

/// Writes the contents of `line`.
static void put_line(gw_writer_t *self, FILE *file, size_t length) {
    store_error(self, fwrite(self->line, 1, length, file) != length);
    self->bytes += length;
}

static void put_entry(gw_writer_t *self, const blackbox_entry_t *entry) {
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

void gw_writer_entries(gw_writer_t *self, uint64_t to, iw_time_us_t since_us) {
    size_t count = 0;
    const uint64_t first = blackbox_ring_copy(self->ring, self->next, to, self->copy, &count);
    if (first > self->next && since_us == 0U) {
        put_line(self, self->events_file, gw_box_line_lost(first - self->next, self->frames, self->line));
    }
    for (size_t i = 0; i < count && self->bytes < self->most_bytes; i++) {
        if (self->copy[i].at_us >= since_us) {
            put_entry(self, &self->copy[i]);
        }
    }
    self->next = first + count;
}

void gw_writer_head(gw_writer_t *self, bool from_start) {
    put_line(self, self->events_file, gw_box_line_head(self->config, self->order, from_start, self->line));
    put_line(self, self->events_file, gw_box_line_stop(self->order, self->in_motion, self->line));
}

void gw_writer_flush(gw_writer_t *self) {
    store_error(self, fflush(self->frames_file) != 0);
    store_error(self, fflush(self->events_file) != 0);
}

static void close_file(gw_writer_t *self, FILE *file) {
    store_error(self, fflush(file) != 0);
    store_error(self, fsync(fileno(file)) != 0);
    store_error(self, fclose(file) != 0);
}

void gw_writer_close(gw_writer_t *self) {
    if (self->error == 0) {
        gw_writer_flush(self); // The last line confirms the rest, so it is written after all of it.
        put_line(self, self->events_file, gw_box_line_end(self->frames, self->line));
    }
    close_file(self, self->events_file);
    close_file(self, self->frames_file);
    self->frames_file = self->events_file = NULL;
}

static void write_config(gw_writer_t *self, int directory, const char *stem) {
    FILE *file = gw_box_files_create(directory, stem, ".conf");
    store_error(self, file == NULL);
    if (file != NULL) {
        store_error(self, fputs(self->config->config, file) < 0);
        close_file(self, file);
    }
}

int gw_writer_open(gw_writer_t *self, int directory, uint32_t number) {
    char stem[GW_BOX_STEM_SIZE];
    (void)snprintf(stem, sizeof stem, "stop-%06u-%s", (unsigned)number, self->order->cause);
    (void)snprintf(self->result.path, sizeof self->result.path, "%s/%s.log", self->config->directory, stem);
    self->error = 0;
    self->number = number;
    self->next = self->frames = self->bytes = 0;
    self->frames_file = self->events_file = NULL;
    write_config(self, directory, stem);
    if (self->error != 0) {
        return self->error;
    }
    self->frames_file = gw_box_files_create(directory, stem, ".log");
    self->events_file = (self->frames_file != NULL) ? gw_box_files_create(directory, stem, ".jsonl") : NULL;
    store_error(self, self->events_file == NULL);
    if (self->events_file == NULL && self->frames_file != NULL) {
        close_file(self, self->frames_file);
        self->frames_file = NULL;
    }
    return self->error;
}
