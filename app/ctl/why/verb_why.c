// SPDX-License-Identifier: MIT
#include "ctl_why.h"
#include "decode/frame.h"
#include "status/advice.h"
#include "talk/ctl.h"
#include "talk/ctl_words.h"
#include "text/ctl_text.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/// Default number of frames before and after the stop.
#define FRAMES_USUAL 12U

typedef struct {
    const char *directory; ///< NULL if the option is absent.
    const char *name;      ///< Name of a recording; NULL: none.
    size_t frames;
    bool list;
} words_t;

static int take_frames(const option_t *option, const char *verb, const char *text) {
    char *end = NULL;
    (void)verb;
    const unsigned long number = (text != NULL && text[0] >= '0' && text[0] <= '9') ? strtoul(text, &end, 10) : 0UL;
    if (end == NULL || *end != '\0' || number > WHY_FRAMES_MAX) {
        return ctl_fail(CTL_USAGE, "--frames needs a number of frames before and after the stop, 0 to %u",
                        WHY_FRAMES_MAX);
    }
    *(size_t *)option->out = number;
    return CTL_OK;
}

/// Returns true for a number, or the path of a file.
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

static void print_when(const json_t *why) {
    char wall[TEXT_CELL];
    char age[TEXT_CELL] = "";
    const json_t *wall_us = json_object_get(why, "wall_us");
    const json_t *age_ms = json_object_get(why, "age_ms");
    if (age_ms != NULL) {
        text_decimal(age_ms, 3, "s ago", age);
    }
    if (json_is_integer(wall_us)) {
        text_when(json_integer_value(wall_us), wall);
        (void)printf("at %s%s%s", wall, (age_ms != NULL) ? ", " : "", age);
    } else { // A board has no wall clock.
        (void)fputs((age_ms != NULL) ? age : "at --", stdout);
    }
    (void)printf("; %s\n", json_is_true(json_object_get(why, "latched")) ? "it latched" : "it did not latch");
}

bool why_print_stop(const json_t *why) {
    const char *sentence = json_string_value(json_object_get(why, "sentence"));
    if (sentence == NULL || sentence[0] == '\0') {
        (void)puts("no stop since the gateway's start");
        return false;
    }
    text_safe(sentence, stdout);
    (void)putchar('\n');
    if (!json_is_integer(json_object_get(why, "at_us")) && json_object_get(why, "at_us") != NULL) {
        return false; // There was no stop: the sentence reports it.
    }
    print_when(why);
    return true;
}

void why_print_frame(const candump_t *frame, int64_t since_us) {
    char since[32];
    decoded_t decoded;
    iw_config_t config;
    const iw_can_frame_t core = candump_to_core(frame);
    const int64_t size_us = (since_us < 0) ? -since_us : since_us;
    iw_config_default(&config);
    decode_fields(&core, &config, &decoded);
    (void)snprintf(since, sizeof since, "%c%" PRId64 ".%01" PRId64 " ms", (since_us < 0) ? '-' : '+', size_us / 1000,
                   size_us % 1000 / 100);
    frame_print(since, frame, &decoded);
}

void why_print_moment(void) {
    (void)puts("------ stop ---------------------------------------------------------------");
}

static void print_frame(const json_t *json, int64_t stop_us) {
    int64_t at_us = 0;
    const candump_t frame = frame_from_json(json, &at_us);
    why_print_frame(&frame, at_us - stop_us);
}

/// Prints the last `most` of the frames before and the first `most` after the stop, as the gateway sent them; nothing
/// if there are none.
static void print_frames(const json_t *why, size_t most) {
    const json_t *before = json_object_get(why, "frames_before");
    const json_t *after = json_object_get(why, "frames_after");
    const size_t count = json_array_size(before);
    const int64_t stop_us = json_integer_value(json_object_get(why, "at_us"));
    if (count + json_array_size(after) == 0U || most == 0U) {
        return;
    }
    (void)putchar('\n');
    for (size_t i = (count > most) ? count - most : 0U; i < count; i++) {
        print_frame(json_array_get(before, i), stop_us);
    }
    why_print_moment();
    for (size_t i = 0; i < json_array_size(after) && i < most; i++) {
        print_frame(json_array_get(after, i), stop_us);
    }
}

static void print_recording(const json_t *reply) {
    const char *path = json_string_value(json_object_get(reply, "recording"));
    const char *error = json_string_value(json_object_get(reply, "recording_error"));
    if (path != NULL) {
        text_line(stdout, "recorded in %s; to replay it: iwheelctl replay %s", path, path);
    } else if (error != NULL) {
        text_line(stdout, "not recorded on disk: %s; the gateway's log has the fix", error);
    }
}

/// Prints the present fix for send_stalled. The sentence is as old as the stop, and only the present status shows
/// whether power or a lost echo is the cause.
static void print_stalled(ctl_t *self) {
    char fix[ADVICE_SIZE];
    json_t *status = near_ask(self, json_pack("{s:s}", "cmd", "status"));
    if (advice_is_present(status, "send_stalled") && advice_fix(status, "send_stalled", fix)) {
        text_line(stdout, "send_stalled is still present: %s", fix);
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
            print_frames(reply, frames);
        }
    }
    json_decref(reply);
    return code;
}

/// Returns the directory of the recordings; a running gateway is asked first.
static const char *find_directory(ctl_t *self, const words_t *words, json_t **out_owner) {
    if (words->directory != NULL) {
        return words->directory;
    }
    near_gateway_t gateway = {0};
    near_find(self, NULL, &gateway);
    json_decref(gateway.status);
    *out_owner = (gateway.result == NEAR_FOUND) ? near_ask(self, json_pack("{s:s}", "cmd", "why")) : NULL;
    const char *directory = json_string_value(json_object_get(*out_owner, "directory"));
    return (directory != NULL) ? directory : WHY_DISK_DIRECTORY;
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
