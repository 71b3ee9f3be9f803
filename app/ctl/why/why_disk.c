// SPDX-License-Identifier: MIT
#include "why_disk.h"

#include "recordings/events.h"
#include "recordings/recording.h"
#include "talk/ctl.h"
#include "text/text.h"
#include "why_print.h"

#include <dirent.h>
#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define PATH_SIZE 1024U
#define PREFIX    "stop-"
#define EVENTS    ".jsonl"
#define FRAMES    ".log"

static int tell_closed_directory(const char *directory, int error) {
    switch (error) {
    case ENOENT:
    case ENOTDIR:
        return ctl_fail(CTL_UNAVAILABLE,
                        "%s: there is no such directory; name the gateway's: iwheelctl why --list --directory DIR",
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

static void print_line(const char *name, const json_t *why) {
    char wall[32] = "--";
    struct tm local;
    const time_t seconds = (time_t)(json_integer_value(json_object_get(why, "wall_us")) / 1000000);
    const char *sentence = json_string_value(json_object_get(why, "sentence"));
    if (localtime_r(&seconds, &local) != NULL) {
        (void)strftime(wall, sizeof wall, "%Y-%m-%d %H:%M:%S", &local);
    }
    const unsigned long number = strtoul(name + sizeof PREFIX - 1U, NULL, 10);
    (void)printf("%6lu  %s  ", number, wall);
    text_safe((sentence != NULL) ? sentence : "-- (the recording is cut)", stdout);
    (void)putchar('\n');
}

static void list_one(const char *directory, const char *name, bool json) {
    char path[PATH_SIZE];
    events_t events;
    (void)snprintf(path, sizeof path, "%s/%s", directory, name);
    if (!events_open(&events, path)) {
        if (errno != EPROTO) { // That has been told.
            (void)ctl_fail(CTL_DATA, "%s: cannot be read: %s", path, strerror(errno));
        }
        return;
    }
    if (json && events.why != NULL) {
        (void)json_object_set_new(events.why, "recording", json_string(path));
        (void)text_json_value(events.why, stdout);
    } else if (!json) {
        print_line(name, events.why);
    }
    events_close(&events);
}

int why_disk_list(const char *directory, bool json) {
    struct dirent **names = NULL;
    const int count = scandir(directory, &names, is_recording, alphasort);
    if (count < 0) {
        return tell_closed_directory(directory, errno);
    }
    for (int i = 0; i < count; i++) {
        list_one(directory, names[i]->d_name, json);
        free(names[i]);
    }
    free((void *)names);
    if (!json) {
        (void)fputs((count > 0) ? "\n" : "", stdout);
        text_line(stdout, "%d stop%s recorded in %s%s", count, (count == 1) ? "" : "s", directory,
                  (count > 0) ? "; one of them with its frames: iwheelctl why NUMBER" : "");
    }
    return CTL_OK;
}

/// The path of the recording's .jsonl; false if there is none.
static bool find(const char *directory, const char *name, char out_path[PATH_SIZE]) {
    struct dirent **names = NULL;
    bool found = false;
    if (strspn(name, "0123456789") != strlen(name)) {
        const char *ending = strrchr(name, '.');
        const bool is_file = ending != NULL && strchr(ending, '/') == NULL;
        const int n =
            snprintf(out_path, PATH_SIZE, "%.*s" EVENTS, (int)(is_file ? ending - name : (long)strlen(name)), name);
        return n > 0 && (size_t)n < PATH_SIZE;
    }
    const int count = scandir(directory, &names, is_recording, alphasort);
    for (int i = 0; i < count; i++) {
        if (strtoul(names[i]->d_name + sizeof PREFIX - 1U, NULL, 10) == strtoul(name, NULL, 10)) {
            found = true;
            (void)snprintf(out_path, PATH_SIZE, "%s/%s", directory, names[i]->d_name);
        }
        free(names[i]);
    }
    free((void *)names);
    return found;
}

/// Goes through the frames; keeps the last ones before the stop, prints them with those after it.
static int print_frames(const char *path, int64_t stop_us, size_t most) {
    static recording_t recording;
    static candump_t before[WHY_FRAMES_MAX];
    candump_t frame;
    size_t kept = 0;
    size_t after = 0;
    const int code = recording_open(&recording, path);
    if (code != CTL_OK) {
        return code;
    }
    (void)putchar('\n');
    while (after < most && recording_next(&recording, &frame)) {
        if (frame.time_us <= stop_us) {
            before[kept % most] = frame;
            kept++;
            continue;
        }
        for (size_t i = (kept > most) ? kept - most : 0U; after == 0U && i < kept; i++) {
            why_print_frame(&before[i % most], before[i % most].time_us - stop_us);
        }
        if (after == 0U) {
            why_print_moment();
        }
        why_print_frame(&frame, frame.time_us - stop_us);
        after++;
    }
    for (size_t i = (kept > most) ? kept - most : 0U; after == 0U && i < kept; i++) {
        why_print_frame(&before[i % most], before[i % most].time_us - stop_us);
    }
    return recording_close(&recording);
}

int why_disk_show(const char *directory, const char *name, size_t frames, bool json) {
    char path[PATH_SIZE];
    events_t events;
    if (!find(directory, name, path)) {
        return ctl_fail(CTL_DATA, "no stop %s is recorded in %s; see: iwheelctl why --list", name, directory);
    }
    if (!events_open(&events, path)) {
        return (errno == EPROTO) ? CTL_DATA : ctl_fail(CTL_DATA, "%s: cannot be read: %s", path, strerror(errno));
    }
    int code = CTL_OK;
    const int64_t stop_us = json_integer_value(json_object_get(events.why, "at_us")) +
                            json_integer_value(json_object_get(events.head, "wall_minus_monotonic_us"));
    if (json) {
        (void)text_json_value(events.why, stdout);
    } else if (why_print_stop(events.why)) {
        path[strlen(path) - (sizeof EVENTS - 1U)] = '\0';
        (void)snprintf(path + strlen(path), sizeof EVENTS, FRAMES);
        text_line(stdout, "recorded in %s; decide it again: iwheelctl replay %s", path, path);
        code = (frames > 0U) ? print_frames(path, stop_us, frames) : CTL_OK;
    }
    events_close(&events);
    return code;
}
