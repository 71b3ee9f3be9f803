// SPDX-License-Identifier: MIT
#include "recordings/ctl_recording.h"
#include "recordings/events.h"
#include "replay.h"
#include "talk/ctl.h"
#include "text/ctl_text.h"

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

/// A longer gap without frames is cut to this.
#define GAP_US     60000000U
#define PATH_SIZE  1024U
#define FRAMES_END ".log"

typedef struct {
    const char *path;
    ctl_t *ctl; ///< To ask the gateway; NULL if the recording is a local file, whose other files are local too.
    replay_out_t out;
    iw_config_t config; ///< Radius 0 if there is no configuration.
    recording_t recording;
    events_t events;
    replay_t replay;
    // Next frame and next entry, not used yet.
    candump_t frame;
    bool has_frame;
    blackbox_entry_t entry;
    uint64_t entry_frames;
    bool has_entry;
    uint64_t fed; ///< Number of used frames.
    int64_t wall_minus_us;
    uint64_t cut_us; ///< Later times are earlier by this.
    iw_time_us_t group_us;
    bool group; ///< Frames wait for their step.
    bool samples;
    uint64_t backwards;
    int64_t size; ///< Size of the file in bytes; 0: unknown.
} verb_replay_t;

/// Replaces the ending of FILE.log. Returns false if the path has another ending or is too long.
static bool path_next_to(const char *path, const char *ending, char out[PATH_SIZE]) {
    const size_t length = strlen(path);
    const size_t cut = sizeof FRAMES_END - 1U;
    if (length <= cut || strcmp(path + length - cut, FRAMES_END) != 0) {
        return false;
    }
    const int n = snprintf(out, PATH_SIZE, "%.*s%s", (int)(length - cut), path, ending);
    return n > 0 && (size_t)n < PATH_SIZE;
}

static int parse_words(verb_replay_t *self, int count, char **words) {
    const option_t options[] = {
        {OPTION("--config", config_option_load, &self->config)},
        {OPTION("--interface", option_text, &self->recording.only)},
        {OPTION("--samples", NULL, &self->samples)},
        {.name = NULL},
    };
    const words_syntax_t syntax = {"replay", options, words_is_file, &self->path};
    const int code = words_read(&syntax, count, words);
    return (code != CTL_OK || self->path != NULL)
               ? code
               : ctl_fail(CTL_USAGE, "replay needs a recording; see: iwheelctl replay --help");
}

/// Finds the configuration that was in force: it is next to the gateway's own recordings.
static int find_config(verb_replay_t *self) {
    char path[PATH_SIZE];
    if (self->config.radius_mm != 0U) {
        return CTL_OK;
    }
    const int fd = path_next_to(self->path, ".conf", path) ? source_open(self->ctl, path, SOURCE_WHOLE) : -1;
    if (fd < 0 && self->samples) {
        iw_config_default(&self->config);
        return ctl_fail(CTL_OK,
                        "%s: no configuration is next to it: signs and units of force are those of the wheels' "
                        "document; name one: --config FILE",
                        self->path);
    }
    if (fd < 0) {
        return ctl_fail(CTL_USAGE, "%s: no configuration is next to it; name one: iwheelctl replay FILE --config FILE",
                        self->path);
    }
    return config_option_take(path, fd, &self->config);
}

/// Opens the file of requests and answers. Returns 0 also if there is none.
static int find_events(verb_replay_t *self) {
    static char path[PATH_SIZE];
    errno = ENOENT;
    FILE *file = path_next_to(self->path, ".jsonl", path) ? source_stream(self->ctl, path, SOURCE_WHOLE) : NULL;
    if (file == NULL && errno == ENOENT) {
        return CTL_OK;
    }
    if (!events_open(&self->events, path, file)) {
        return (errno == EPROTO) ? CTL_DATA : ctl_fail(CTL_DATA, "%s: cannot be read: %s", path, strerror(errno));
    }
    self->wall_minus_us = json_integer_value(json_object_get(self->events.head, "wall_minus_monotonic_us"));
    return CTL_OK;
}

static void flush_group(verb_replay_t *self) {
    if (self->group) {
        self->group = false;
        replay_step(&self->replay, self->group_us);
    }
}

/// Prints on a terminal how much of the file has been read, each 65536 frames.
static void report_progress(const verb_replay_t *self) {
    if (self->size > 0 && self->recording.frames % 65536U == 0U && text_live_columns(stderr) > 0U) {
        const int64_t there = (int64_t)lseek(self->recording.fd, 0, SEEK_CUR);
        (void)fprintf(stderr, "\r%3d %%\r", (int)(100 * there / self->size));
    }
}

static bool peek_frame(verb_replay_t *self) {
    if (!self->has_frame) {
        report_progress(self);
    }
    self->has_frame = self->has_frame || recording_next(&self->recording, &self->frame);
    return self->has_frame;
}

static bool peek_entry(verb_replay_t *self) {
    self->has_entry = self->has_entry || events_next(&self->events, &self->entry, &self->entry_frames);
    return self->has_entry;
}

static iw_time_us_t time_of(const verb_replay_t *self, const candump_t *frame) {
    const int64_t at_us = frame->time_us - self->wall_minus_us - (int64_t)self->cut_us;
    return (at_us > 0) ? (iw_time_us_t)at_us : 0U;
}

/// Adds the frame to those of the same time; frames of an earlier time step first.
static void use_frame(verb_replay_t *self, iw_time_us_t at_us) {
    const iw_can_frame_t core = candump_to_core(&self->frame);
    if (self->group && at_us != self->group_us) {
        flush_group(self);
    }
    if (!replay_frame(&self->replay, &core)) {
        flush_group(self);
        (void)replay_frame(&self->replay, &core);
    }
    self->group = true;
    self->group_us = at_us;
    self->has_frame = false;
    self->fed++;
}

static void use_entry(verb_replay_t *self) {
    const uint8_t kind = self->entry.kind;
    self->has_entry = false;
    if (kind == (uint8_t)BLACKBOX_NOT_SENT || kind == (uint8_t)BLACKBOX_PURGE) {
        replay_event(&self->replay, &self->entry); // An answer within the next step.
        return;
    }
    flush_group(self);
    if (self->entry.at_us < self->replay.now_us) {
        self->entry.at_us = self->replay.now_us;
    }
    if (kind == (uint8_t)BLACKBOX_STEP) {
        replay_step(&self->replay, self->entry.at_us);
    } else if (kind == (uint8_t)BLACKBOX_START) {
        replay_start(&self->replay, &self->config, &self->entry);
    } else {
        replay_event(&self->replay, &self->entry);
    }
}

/// Goes to the first entry with the state, and begins there.
static void begin_within(verb_replay_t *self) {
    while (peek_entry(self)) {
        while (self->fed < self->entry_frames && peek_frame(self)) {
            self->has_frame = false;
            self->fed++;
        }
        if (self->entry.kind == (uint8_t)BLACKBOX_STATE || self->entry.kind == (uint8_t)BLACKBOX_START) {
            break;
        }
        if (self->entry.kind == (uint8_t)BLACKBOX_ESTOP || self->entry.kind == (uint8_t)BLACKBOX_BUS) {
            replay_event(&self->replay, &self->entry);
        }
        self->has_entry = false;
    }
    if (self->has_entry && self->entry.kind == (uint8_t)BLACKBOX_STATE) {
        const bool reached = replay_warm(&self->replay, &self->config, &self->entry);
        replay_note(&self->out,
                    "begins while the gateway was running: its state %s; earlier force offsets and assumptions are "
                    "unknown",
                    reached ? "is restored" : "could not be restored, so decisions differ");
        self->has_entry = false;
    }
}

static void name_things(verb_replay_t *self) {
    const char *estop = json_string_value(json_object_get(self->events.head, "estop"));
    const char *bus = json_string_value(json_object_get(self->events.head, "bus"));
    self->replay.estop_name = (estop != NULL) ? estop : "line";
    self->replay.bus_name = (bus != NULL) ? bus : "";
}

/// Replays exactly: steps, requests and answers at their recorded places.
static void replay_exactly(verb_replay_t *self) {
    if (!self->samples) {
        replay_note(&self->out, "%s, with its requests and the port's answers; times in seconds from its first entry",
                    self->path);
    }
    if (peek_entry(self)) {
        replay_init(&self->replay, &self->config, self->entry.at_us, self->out);
        name_things(self);
        self->replay.compares = true;
        if (self->entry.kind != (uint8_t)BLACKBOX_START) {
            self->replay.quiet = true;
            begin_within(self);
            self->replay.quiet = false;
        }
    }
    for (;;) {
        const bool entry = peek_entry(self);
        if (entry && (self->entry_frames <= self->fed || !peek_frame(self))) {
            use_entry(self);
        } else if (peek_frame(self)) {
            use_frame(self, time_of(self, &self->frame));
        } else {
            break;
        }
    }
    flush_group(self);
}

/// Steps at the times that the core requests until `at_us`; a long gap is cut. Returns the time.
static iw_time_us_t pass_time(verb_replay_t *self, iw_time_us_t at_us) {
    replay_t *replay = &self->replay;
    if (at_us < replay->now_us) {
        self->backwards++;
        return replay->now_us;
    }
    if (at_us - replay->now_us > GAP_US) {
        const iw_time_us_t cut_us = at_us - replay->now_us - GAP_US;
        replay_note(&self->out, "no frames for %" PRIu64 " s; the gap is shortened to %u s",
                    (at_us - replay->now_us) / 1000000U, GAP_US / 1000000U);
        self->cut_us += cut_us;
        replay->out.wall_less_us += (int64_t)cut_us;
        at_us -= cut_us;
    }
    while (replay->next_us < at_us) {
        replay_step(replay, replay->next_us);
    }
    return at_us;
}

/// Replays frames only: no requests, the bus is up, the e-stop is released.
static void replay_frames(verb_replay_t *self) {
    if (!self->samples) {
        replay_note(
            &self->out,
            "%s, frames only: no client arms. Setpoints marked T are the gateway's own, others another controller's",
            self->path);
    }
    self->recording.even = true; // No entry of a monotonic clock corrects its times.
    if (peek_frame(self)) {
        replay_init(&self->replay, &self->config, time_of(self, &self->frame), self->out);
    }
    while (peek_frame(self)) {
        iw_time_us_t at_us = time_of(self, &self->frame);
        if (!self->group || at_us != self->group_us) {
            flush_group(self);
            at_us = pass_time(self, at_us);
        }
        use_frame(self, at_us);
    }
    flush_group(self);
    if (self->backwards > 0U) {
        replay_note(&self->out, "time goes back %" PRIu64 " times; those frames count at the time before",
                    self->backwards);
    }
}

static int finish(verb_replay_t *self) {
    const int code = recording_close(&self->recording);
    if (self->fed > 0U && !self->recording.refused) {
        replay_finish(&self->replay);
    }
    if (self->events.lost > 0U || (self->events.file != NULL && !self->events.whole)) {
        replay_note(&self->out, "the recording is incomplete: %" PRIu64 " entries are missing%s", self->events.lost,
                    self->events.whole ? "" : ", and its end is missing too");
    }
    const bool bad = self->events.bad > 0U;
    events_close(&self->events);
    if (self->samples && self->recording.refused) {
        return CTL_USAGE; // Unlike bad lines, which are left out: the table ends too early.
    }
    return (code == CTL_OK && bad) ? CTL_DATA : code;
}

/// Interval of samples.
#define SAMPLES_US 20000U

static void begin_samples(verb_replay_t *self) {
    struct stat status;
    self->out.samples_us = SAMPLES_US;
    self->out.frames_only = self->events.file == NULL;
    self->out.wall_less_us = self->wall_minus_us;
    self->size = (fstat(self->recording.fd, &status) == 0 && S_ISREG(status.st_mode)) ? (int64_t)status.st_size : 0;
    replay_samples_begin(&self->out);
}

int verb_replay(ctl_t *self, int count, char **words) {
    static verb_replay_t replay;
    int code = parse_words(&replay, count, words);
    replay.out = (replay_out_t){.file = stdout, .json = self->json};
    if (code != CTL_OK) {
        return code;
    }
    if (replay.samples && self->json) {
        return ctl_fail(CTL_USAGE, "replay writes --samples or --json, not both");
    }
    replay.ctl = (access(replay.path, R_OK) != 0) ? self : NULL;
    code = recording_open(&replay.recording, replay.ctl, replay.path);
    if (code != CTL_OK) {
        return code;
    }
    code = find_config(&replay);
    if (code == CTL_OK) {
        code = find_events(&replay);
    }
    if (code != CTL_OK) {
        return code;
    }
    if (replay.samples) {
        begin_samples(&replay);
    }
    if (replay.events.file != NULL) {
        replay_exactly(&replay);
    } else {
        replay_frames(&replay);
    }
    return finish(&replay);
}
