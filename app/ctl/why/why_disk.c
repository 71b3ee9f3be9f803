// SPDX-License-Identifier: MIT
#include "ctl_why.h"

#include "recordings/ctl_recording.h"
#include "recordings/events.h"
#include "text/ctl_text.h"

#include <dirent.h>
#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define PATH_SIZE 1024U
#define NAME_SIZE 256U
#define PREFIX    "stop-"
#define EVENTS    ".jsonl"
#define FRAMES    ".log"

static int report_closed_directory(const char *directory, int error) {
    switch (error) {
    case ENOENT:
    case ENOTDIR:
        return ctl_fail(CTL_UNAVAILABLE,
                        "%s: the directory does not exist; name the gateway's: iwheelctl why --list --directory DIR",
                        directory);
    case EACCES:
        return ctl_fail(CTL_PERMISSION, "%s: you may not read it; sudo usermod -aG iwheel $USER, then log in again",
                        directory);
    default:
        return ctl_fail(CTL_UNAVAILABLE, "%s: cannot be read: %s", directory, strerror(error));
    }
}

static int is_recording(const struct dirent *entry) {
    const char *ending = strrchr(entry->d_name, '.');
    return strncmp(entry->d_name, PREFIX, sizeof PREFIX - 1U) == 0 && ending != NULL && strcmp(ending, EVENTS) == 0;
}

/// Adds a name from the gateway's list or from the disk.
static void add_name(json_t *names, const char *stem, const char *ending) {
    char name[NAME_SIZE];
    const int n = snprintf(name, sizeof name, "%s%s", stem, ending);
    if (n > 0 && (size_t)n < sizeof name && strchr(name, '/') == NULL) {
        (void)json_array_append_new(names, json_string_nocheck(name));
    }
}

/// Adds the names on disk. Returns false, with errno, on failure.
static bool names_on_disk(json_t *names, const char *directory) {
    struct dirent **found = NULL;
    const int count = scandir(directory, &found, is_recording, alphasort);
    for (int i = 0; i < count; i++) {
        add_name(names, found[i]->d_name, "");
        free(found[i]);
    }
    free((void *)found);
    return count >= 0;
}

static bool names_of_gateway(json_t *names, ctl_t *ctl) {
    json_t *reply = source_list(ctl);
    size_t i = 0;
    const json_t *entry = NULL;
    json_array_foreach(json_object_get(reply, "recordings"), i, entry) {
        const char *stem = json_string_value(json_object_get(entry, "name"));
        if (stem != NULL && json_is_integer(json_object_get(entry, "jsonl_bytes"))) {
            add_name(names, stem, EVENTS);
        }
    }
    json_decref(reply);
    return reply != NULL;
}

/// Returns the recordings' .jsonl files, the oldest first. The gateway is asked first if there is one: this may be
/// another machine, with recordings of its own. Returns NULL, with errno, on failure.
static json_t *find_names(const why_disk_t *where) {
    json_t *names = json_array();
    if ((where->ctl != NULL && names_of_gateway(names, where->ctl)) || names_on_disk(names, where->directory)) {
        return names;
    }
    json_decref(names);
    return NULL;
}

static void print_line(const char *name, const json_t *why) {
    char wall[TEXT_CELL];
    const char *sentence = json_string_value(json_object_get(why, "sentence"));
    text_when(json_integer_value(json_object_get(why, "wall_us")), wall);
    const unsigned long number = strtoul(name + sizeof PREFIX - 1U, NULL, 10);
    (void)printf("%6lu  %s  ", number, wall);
    text_safe((sentence != NULL) ? sentence : "-- (the recording is cut)", stdout);
    (void)putchar('\n');
}

static void list_one(const why_disk_t *self, const char *name) {
    char path[PATH_SIZE];
    events_t events;
    (void)snprintf(path, sizeof path, "%s/%s", self->directory, name);
    if (!events_open(&events, path, source_stream(self->ctl, path, 1))) { // The stop is in the first piece.
        if (errno != EPROTO) {                                            // This has been reported.
            (void)ctl_fail(CTL_DATA, "%s: cannot be read: %s", path, strerror(errno));
        }
        return;
    }
    if (self->json && events.why != NULL) {
        (void)json_object_set_new(events.why, "recording", json_string(path));
        (void)text_json_value(events.why, stdout);
    } else if (!self->json) {
        print_line(name, events.why);
    }
    events_close(&events);
}

int why_disk_list(const why_disk_t *self) {
    json_t *names = find_names(self);
    size_t i = 0;
    const json_t *name = NULL;
    if (names == NULL) {
        return report_closed_directory(self->directory, errno);
    }
    json_array_foreach(names, i, name) {
        list_one(self, json_string_value(name));
    }
    const size_t count = json_array_size(names);
    if (!self->json) {
        (void)fputs((count > 0U) ? "\n" : "", stdout);
        text_line(stdout, "%zu stop%s recorded in %s%s", count, (count == 1U) ? "" : "s", self->directory,
                  (count > 0U) ? "; to see one with its frames: iwheelctl why NUMBER" : "");
    }
    json_decref(names);
    return CTL_OK;
}

/// Finds the path of the recording's .jsonl. Returns false if there is none.
static bool find(const why_disk_t *self, const char *name, char out_path[PATH_SIZE]) {
    size_t i = 0;
    const json_t *each = NULL;
    bool found = false;
    if (strspn(name, "0123456789") != strlen(name)) {
        const char *ending = strrchr(name, '.');
        const bool is_file = ending != NULL && strchr(ending, '/') == NULL;
        const int n =
            snprintf(out_path, PATH_SIZE, "%.*s" EVENTS, (int)(is_file ? ending - name : (long)strlen(name)), name);
        return n > 0 && (size_t)n < PATH_SIZE;
    }
    json_t *names = find_names(self);
    json_array_foreach(names, i, each) {
        const char *const text = json_string_value(each);
        if (strtoul(text + sizeof PREFIX - 1U, NULL, 10) == strtoul(name, NULL, 10)) {
            found = true;
            (void)snprintf(out_path, PATH_SIZE, "%s/%s", self->directory, text);
        }
    }
    json_decref(names);
    return found;
}

/// Reads the frames, stores the last ones before the stop, and prints them with the frames after it.
static int print_frames(ctl_t *ctl, const char *path, int64_t stop_us, size_t most) {
    static recording_t recording;
    static candump_t before[WHY_FRAMES_MAX];
    candump_t frame;
    size_t earlier = 0;
    size_t after = 0;
    const int code = recording_open(&recording, ctl, path);
    if (code != CTL_OK) {
        return code;
    }
    (void)putchar('\n');
    while (after < most && recording_next(&recording, &frame)) {
        if (frame.time_us <= stop_us) {
            before[earlier % most] = frame;
            earlier++;
            continue;
        }
        for (size_t i = (earlier > most) ? earlier - most : 0U; after == 0U && i < earlier; i++) {
            why_print_frame(&before[i % most], before[i % most].time_us - stop_us);
        }
        if (after == 0U) {
            why_print_moment();
        }
        why_print_frame(&frame, frame.time_us - stop_us);
        after++;
    }
    for (size_t i = (earlier > most) ? earlier - most : 0U; after == 0U && i < earlier; i++) {
        why_print_frame(&before[i % most], before[i % most].time_us - stop_us);
    }
    return recording_close(&recording);
}

int why_disk_show(const why_disk_t *self, const char *name, size_t frames) {
    char path[PATH_SIZE];
    events_t events;
    if (!find(self, name, path)) {
        return ctl_fail(CTL_DATA, "stop %s is not recorded in %s; to list the stops: iwheelctl why --list", name,
                        self->directory);
    }
    if (!events_open(&events, path, source_stream(self->ctl, path, 1))) {
        return (errno == EPROTO) ? CTL_DATA : ctl_fail(CTL_DATA, "%s: cannot be read: %s", path, strerror(errno));
    }
    int code = CTL_OK;
    const int64_t stop_us = json_integer_value(json_object_get(events.why, "at_us")) +
                            json_integer_value(json_object_get(events.head, "wall_minus_monotonic_us"));
    if (self->json) {
        (void)text_json_value(events.why, stdout);
    } else if (why_print_stop(events.why)) {
        path[strlen(path) - (sizeof EVENTS - 1U)] = '\0';
        (void)snprintf(path + strlen(path), sizeof EVENTS, FRAMES);
        text_line(stdout, "recorded in %s; to replay it: iwheelctl replay %s", path, path);
        code = (frames > 0U) ? print_frames(self->ctl, path, stop_us, frames) : CTL_OK;
    }
    events_close(&events);
    return code;
}
