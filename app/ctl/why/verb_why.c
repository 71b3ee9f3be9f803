// SPDX-License-Identifier: MIT
#include "status/advice.h"
#include "talk/ctl.h"
#include "talk/near.h"
#include "talk/words.h"
#include "text/text.h"
#include "why.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/// Frames shown on either side if nobody says how many.
#define FRAMES_USUAL 12U

typedef struct {
    const char *directory; ///< NULL: not told.
    const char *name;      ///< Of a recording; NULL: none.
    size_t frames;
    bool list;
} words_t;

static int take_frames(const option_t *option, const char *verb, const char *text) {
    char *end = NULL;
    (void)verb;
    const unsigned long number = (text != NULL && text[0] >= '0' && text[0] <= '9') ? strtoul(text, &end, 10) : 0UL;
    if (end == NULL || *end != '\0' || number > WHY_FRAMES_MAX) {
        return ctl_fail(CTL_USAGE, "--frames wants a number of frames before and after the stop, 0 to %u",
                        WHY_FRAMES_MAX);
    }
    *(size_t *)option->out = number;
    return CTL_OK;
}

/// A number, or the path of a file.
static bool names_recording(const char *word) {
    return word[0] != '-' && (strspn(word, "0123456789") == strlen(word) || strpbrk(word, "./") != NULL);
}

static int parse(words_t *self, int count, char **words) {
    const option_t options[] = {
        {OPTION("--list", NULL, &self->list)},
        {OPTION("--frames", take_frames, &self->frames)},
        {OPTION("--directory", option_text, &self->directory), .wants = "the directory of the recordings"},
        {.name = NULL},
    };
    const words_syntax_t syntax = {"why", options, names_recording, &self->name};
    return words_read(&syntax, count, words);
}

static void print_recording(const json_t *reply) {
    const char *path = json_string_value(json_object_get(reply, "recording"));
    const char *error = json_string_value(json_object_get(reply, "recording_error"));
    if (path != NULL) {
        text_line(stdout, "recorded in %s; decide it again: iwheelctl replay %s", path, path);
    } else if (error != NULL) {
        text_line(stdout, "not recorded on disk: %s; the gateway's log tells the cure", error);
    }
}

/// The sentence is as old as the stop; whether it is a matter of power, or of a lost echo, is seen only now.
static void print_stalled(ctl_t *self) {
    char cure[ADVICE_SIZE];
    json_t *status = near_ask(self, json_pack("{s:s}", "cmd", "status"));
    if (advice_is_present(status, "send_stalled") && advice_cure(status, "send_stalled", cure)) {
        text_line(stdout, "send_stalled is there still: %s", cure);
    }
    json_decref(status);
}

static int ask(ctl_t *self, size_t frames) {
    json_t *reply = NULL;
    const int code = ctl_ask(self, json_pack("{s:s}", "cmd", "why"), &reply);
    if (code == CTL_OK && !self->json) {
        const bool stopped = why_print_stop(reply);
        print_stalled(self);
        if (stopped) {
            print_recording(reply);
            why_print_told(reply, frames);
        }
    }
    json_decref(reply);
    return code;
}

/// Where the gateway records: it knows best, if it is there.
static const char *find_directory(ctl_t *self, const words_t *words, json_t **out_owner) {
    if (words->directory != NULL) {
        return words->directory;
    }
    near_gateway_t gateway = {0};
    near_look(self, NULL, &gateway);
    json_decref(gateway.status);
    *out_owner = (gateway.result == NEAR_FOUND) ? near_ask(self, json_pack("{s:s}", "cmd", "why")) : NULL;
    const char *told = json_string_value(json_object_get(*out_owner, "directory"));
    return (told != NULL) ? told : WHY_DISK_DIRECTORY;
}

int verb_why(ctl_t *self, int count, char **words) {
    words_t parsed = {.frames = FRAMES_USUAL};
    json_t *owner = NULL;
    int code = parse(&parsed, count, words);
    if (code != CTL_OK) {
        return code;
    }
    if (!parsed.list && parsed.name == NULL) {
        return ask(self, parsed.frames);
    }
    const char *directory = find_directory(self, &parsed, &owner);
    const why_disk_t disk = {(parsed.directory == NULL) ? self : NULL, directory, self->json};
    code = parsed.list ? why_disk_list(&disk) : why_disk_show(&disk, parsed.name, parsed.frames);
    json_decref(owner);
    return code;
}
