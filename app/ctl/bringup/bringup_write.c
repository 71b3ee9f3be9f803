// SPDX-License-Identifier: MIT
// The resulting configuration: written whole or not at all; an existing file is replaced only after a question.
#include "bringup.h"

#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

/// Size of a text in the assumption store, terminator included.
#define HOW_SIZE 128U

void bringup_note(bringup_t *self, const char *section, const char *key, const char *item, const char *format, ...) {
    unsigned at = 0;
    while (at < self->notes && (strcmp(self->note[at].section, section) != 0 || strcmp(self->note[at].key, key) != 0)) {
        at++;
    }
    if (at == BRINGUP_NOTES) {
        return;
    }
    bringup_note_t *note = &self->note[at];
    if (at == self->notes) {
        self->notes = at + 1U;
    }
    note->section = section;
    note->key = key;
    note->item = item;
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(note->text, sizeof note->text, format, arguments);
    va_end(arguments);
}

void bringup_fit_rest(iw_config_t *core) {
    const iw_config_rest_t rest = iw_config_rest(core);
    if (core->rest_rpm > rest.max) {
        core->rest_rpm = rest.standard;
    }
}

bool bringup_is_confirmed(const bringup_t *self, const char *item) {
    for (unsigned i = 0; i < self->notes; i++) {
        if (self->note[i].item != NULL && strcmp(self->note[i].item, item) == 0) {
            return true;
        }
    }
    return false;
}

static const bringup_note_t *find_note(const bringup_t *self, const char *section, const char *key) {
    for (unsigned i = 0; i < self->notes; i++) {
        if (strcmp(self->note[i].section, section) == 0 && strcmp(self->note[i].key, key) == 0) {
            return &self->note[i];
        }
    }
    return NULL;
}

/// Notes for the comments in the file.
typedef struct {
    const bringup_t *bringup;
    char date[16];
    char text[BRINGUP_NOTE_SIZE + 40U];
} commenter_t;

static const char *comment(const void *context, const char *section, const char *key) {
    // The text belongs to this module; the printer of the configuration only passes the pointer through.
    commenter_t *self = *(commenter_t *const *)context;
    const bringup_note_t *note = find_note(self->bringup, section, key);
    if (note == NULL) {
        return NULL;
    }
    (void)snprintf(self->text, sizeof self->text, "BRINGUP %s, %s: %s", self->date,
                   (note->item != NULL) ? "confirmed" : "noted", note->text);
    return self->text;
}

static void print_head(const char *date, FILE *out) {
    (void)fprintf(out,
                  "; Written by iwheelctl bringup on %s. Lines that begin with BRINGUP state how a value was found.\n",
                  date);
}

/// Moves the new file to its place; an existing file is renamed to PATH.old.
static bool put_in_place(const char *temporary, const char *path) {
    char old[512];
    if (access(path, F_OK) == 0) {
        (void)snprintf(old, sizeof old, "%.500s.old", path);
        if (rename(path, old) != 0) {
            return false;
        }
        talk_print("The old file is now %s.", old);
    }
    return rename(temporary, path) == 0;
}

/// Writes the text to a file next to `path` and moves it to `path`.
static bool write_text(const char *path, const char *text, size_t length, bool saved) {
    char temporary[512];
    (void)snprintf(temporary, sizeof temporary, "%.500s.new", path);
    FILE *file = fopen(temporary, "we");
    if (file == NULL) {
        talk_print("Cannot write %s: %s. Choose another file.", temporary, strerror(errno));
        return false;
    }
    (void)fwrite(text, 1, length, file);
    if (saved) {
        bringup_print_mark(text, length, file);
    }
    const bool written = fflush(file) == 0 && ferror(file) == 0 && fsync(fileno(file)) == 0;
    if (fclose(file) != 0 || !written || !put_in_place(temporary, path)) {
        talk_print("Cannot write %s: %s. Choose another file.", path, strerror(errno));
        (void)unlink(temporary);
        return false;
    }
    return true;
}

bool bringup_write_file(bringup_t *self, const char *path, bool saved) {
    commenter_t commenter = {.bringup = self};
    commenter_t *const context = &commenter;
    struct tm local;
    const time_t now = time(NULL);
    char *text = NULL;
    size_t length = 0;
    if (localtime_r(&now, &local) != NULL) {
        (void)strftime(commenter.date, sizeof commenter.date, "%Y-%m-%d", &local);
    }
    FILE *memory = open_memstream(&text, &length);
    if (memory == NULL) {
        (void)ctl_fail(CTL_INTERNAL, "out of memory");
        return false;
    }
    print_head(commenter.date, memory);
    gateway_config_print_noted(&self->config, comment, (const void *)&context, memory);
    const bool complete = fclose(memory) == 0;
    const bool written = complete && write_text(path, text, length, saved);
    free(text);
    return written;
}

static const char *value_of(const bringup_t *self, const bringup_note_t *note, char out_value[32]) {
    const iw_config_t *core = &self->config.core;
    const iw_side_t side = (strcmp(note->section, "left") == 0) ? IW_LEFT : IW_RIGHT;
    if (strcmp(note->key, "setpoint_type") == 0) {
        (void)snprintf(out_value, 32, "%u", core->setpoint_type);
    } else if (strcmp(note->key, "current_role") == 0) {
        (void)snprintf(out_value, 32, "%s", (core->current_role == IW_ROLE_LIMIT) ? "limit" : "setpoint");
    } else if (strcmp(note->key, "invert") == 0) {
        (void)snprintf(out_value, 32, "%s", core->invert[side] ? "yes" : "no");
    } else if (strcmp(note->key, "force_unit") == 0) {
        (void)snprintf(out_value, 32, "%s", (core->force_unit[side] == IW_FORCE_CN) ? "cN" : "dN");
    } else if (strcmp(note->key, "gear_ratio") == 0) {
        (void)snprintf(out_value, 32, (core->gear_per == 1U) ? "%u" : "%u/%u", core->gear_turns, core->gear_per);
    } else if (strcmp(note->key, "radius_mm") == 0) {
        (void)snprintf(out_value, 32, "%u", core->radius_mm);
    } else if (strcmp(note->key, "track_mm") == 0) {
        (void)snprintf(out_value, 32, "%u", self->config.core.track_mm);
    } else {
        out_value[0] = '\0';
    }
    return out_value;
}

static void report_findings(const bringup_t *self) {
    char value[32];
    talk_print("Results:");
    for (unsigned i = 0; i < self->notes; i++) {
        const bringup_note_t *note = &self->note[i];
        (void)printf("  %s [%s] %s%s%s\n", (note->item != NULL) ? "confirmed" : "noted    ", note->section, note->key,
                     (value_of(self, note, value)[0] != '\0') ? " = " : "", value);
        talk_print("    %s", note->text);
    }
}

/// Returns the text of a note as the assumption store stores it.
static const char *how_of(const bringup_note_t *note, char out_how[HOW_SIZE]) {
    (void)snprintf(out_how, HOW_SIZE, "bringup: %.*s", (int)(HOW_SIZE - sizeof("bringup: ")), note->text);
    return out_how;
}

/// Confirms the noted items in the assumption store, through a gateway that stores them where the real gateway reads
/// them. Returns false if any of them was not accepted.
static bool confirm_all(bringup_t *self) {
    char value[32];
    bool accepted = trial_start_with_records(self);
    for (unsigned i = 0; i < self->notes && accepted; i++) {
        const bringup_note_t *note = &self->note[i];
        if (note->item != NULL) {
            char how[HOW_SIZE];
            json_t *reply =
                near_ask(self->ctl, json_pack("{s:s,s:s,s:s,s:s}", "cmd", "confirm", "item", note->item, "value",
                                              value_of(self, note, value), "how", how_of(note, how)));
            accepted = strcmp(text_word(reply, "state"), "confirmed") == 0;
            json_decref(reply);
        }
    }
    trial_stop(self);
    return accepted;
}

/// Returns true if the written files will belong to the gateway: it could not replace the files of another user.
static bool may_keep(const bringup_t *self) {
    struct stat status;
    const char *directory = self->config.record.directory;
    return stat(directory, &status) == 0 && S_ISDIR(status.st_mode) && status.st_uid == geteuid() &&
           access(directory, W_OK | X_OK) == 0;
}

/// Confirms the results if that is possible here, and prints what remains to be done with the file.
static void report_next(bringup_t *self, const char *path) {
    char value[32];
    if (may_keep(self) && confirm_all(self)) {
        talk_print("The confirmed results are stored in %s. Next: iwheel-gateway -c %s", self->config.record.directory,
                   path);
        return;
    }
    talk_print("Next: iwheel-gateway -c %s, and when it runs, confirm the results:", path);
    for (unsigned i = 0; i < self->notes; i++) {
        const bringup_note_t *note = &self->note[i];
        if (note->item != NULL) {
            char how[HOW_SIZE];
            (void)printf("  iwheelctl confirm %s %s --how '%s'\n", note->item, value_of(self, note, value),
                         how_of(note, how));
        }
    }
}

void bringup_write(bringup_t *self) {
    char path[BRINGUP_ANSWER_SIZE];
    talk_step(BRINGUP_STEPS, "the configuration");
    trial_stop(self);
    report_findings(self);
    do {
        talk_ask(self, "Write it to", self->out_path, path);
    } while ((access(path, F_OK) == 0 && !talk_yes(self, "That file exists. Replace it?", false)) ||
             !bringup_write_file(self, path, false));
    talk_print("Written to %s.", path);
    report_next(self, path);
}
