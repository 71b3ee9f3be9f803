// SPDX-License-Identifier: MIT
// Confirmed results of a bringup that ended early: saved in a configuration file, and read from it to continue.
#include "bringup.h"

#include "iwheel_northbound/line.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define MARK      "; BRINGUP SAVED "
#define CONFIRMED ", confirmed: "

/// Results that can be confirmed, and the step that finds them.
static const struct {
    const char *section;
    const char *key;
    const char *item;
    unsigned step;
} results[] = {
    {"wheels", "gear_ratio", "gear_ratio", 3},
    {"wheels", "setpoint_type", "setpoint_type", 4},
    {"wheels", "current_role", "current_role", 5},
    {"left", "invert", "mount_sign_left", 6},
    {"right", "invert", "mount_sign_right", 6},
    {"left", "force_unit", "force_unit_left", 7},
    {"right", "force_unit", "force_unit_right", 7},
    {"wheels", "radius_mm", "wheel_radius", 8},
    {"wheels", "track_mm", "track", 8}, // The track is measured with the pushed distance of step 8.
    {"wheels", "track_mm", "track", 9},
};
#define RESULTS (sizeof results / sizeof results[0])

bool bringup_is_restored(const bringup_t *self, unsigned step) {
    bool any = false;
    for (size_t i = 0; i < RESULTS; i++) {
        if (results[i].step == step) {
            any = true;
            if (!bringup_is_confirmed(self, results[i].item)) {
                return false;
            }
        }
    }
    return any;
}

void bringup_print_mark(const char *text, size_t length, FILE *out) {
    (void)fprintf(out, MARK "%08" PRIX32 "\n", iwn_line_crc(0, text, length));
}

/// Stores a confirmed result whose line is `key = value` in this section.
static void restore(bringup_t *self, const char *section, const char *line, const char *how) {
    const size_t length = strcspn(line, " =");
    for (size_t i = 0; i < RESULTS; i++) {
        if (strcmp(results[i].section, section) == 0 && strlen(results[i].key) == length &&
            strncmp(results[i].key, line, length) == 0) {
            bringup_note(self, results[i].section, results[i].key, results[i].item, "%s", how);
            return;
        }
    }
}

/// Reads the comments of the results. Changes `text`.
static void restore_all(bringup_t *self, char *text) {
    char section[32] = "";
    const char *how = NULL;
    for (char *line = strtok(text, "\n"); line != NULL; line = strtok(NULL, "\n")) {
        if (line[0] == '[') {
            (void)snprintf(section, sizeof section, "%.*s", (int)strcspn(line + 1, "]"), line + 1);
        } else if (strncmp(line, "; BRINGUP ", 10U) == 0) {
            how = strstr(line, CONFIRMED);
        } else if (line[0] != ';') {
            if (how != NULL) {
                restore(self, section, line, how + strlen(CONFIRMED));
            }
            how = NULL;
        }
    }
}

void bringup_read_saved(bringup_t *self, const char *path) {
    static char text[GATEWAY_CONFIG_FILE_MAX + 1U];
    FILE *file = (path != NULL) ? fopen(path, "re") : NULL;
    if (file == NULL) {
        return;
    }
    text[fread(text, 1, sizeof text - 1U, file)] = '\0';
    (void)fclose(file);
    char *mark = strstr(text, MARK);
    if (mark == NULL) {
        return;
    }
    const uint32_t stored = (uint32_t)strtoul(mark + strlen(MARK), NULL, 16);
    if (stored != iwn_line_crc(0, text, (size_t)(mark - text))) {
        talk_print("%s was changed after bringup had saved it: its results do not count as confirmed.", path);
        return;
    }
    *mark = '\0';
    restore_all(self, text);
}

void bringup_resume(bringup_t *self) {
    if (self->notes == 0U) {
        return;
    }
    talk_print("The file of --from has %u confirmed results of an earlier bringup. They are right only for the same "
               "wheels, mounted in the same way.",
               self->notes);
    if (!talk_yes(self, "The same wheels, mounted in the same way?", false)) {
        self->notes = 0;
    }
}
