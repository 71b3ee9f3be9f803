// SPDX-License-Identifier: MIT
#include "config_value.h"

#include <string.h>

/// Where the remark after a value begins.
#define REMARK_COLUMN 34

static void print_key(const config_key_t *row, const gateway_config_t *config, const gateway_config_t *defaults,
                      FILE *out) {
    char choices[64];
    char value[CONFIG_MESSAGE_SIZE];
    (void)fputs("; ", out);
    for (const char *c = row->help; *c != '\0'; c++) {
        (void)fputs((*c == '\n') ? "\n; " : (char[2]){*c, '\0'}, out);
    }
    const bool set = config_value_format(row, config, value);
    const int width = fprintf(out, "\n%s%s = %s", set ? "" : ";", row->key, set ? value : "?") - 1;
    config_value_choices(row, choices, sizeof choices);
    const bool has_default = config_value_format(row, defaults, value);
    (void)fprintf(out, "%*s ; %s%s%s%s\n", (width < REMARK_COLUMN) ? REMARK_COLUMN - width : 0, "", choices,
                  (choices[0] != '\0') ? ", " : "", has_default ? "default " : "no default", value);
}

static void print_note(const char *note, FILE *out) {
    if (note != NULL) {
        (void)fprintf(out, "; %s\n", note);
    }
}

static const char *no_note(const void *context, const char *section, const char *key) {
    (void)context;
    (void)section;
    (void)key;
    return NULL;
}

void gateway_config_print(const gateway_config_t *config, FILE *out) {
    gateway_config_print_noted(config, no_note, NULL, out);
}

void gateway_config_print_noted(const gateway_config_t *config, gateway_config_note_t note, const void *context,
                                FILE *out) {
    gateway_config_t defaults;
    const char *section = "";
    gateway_config_default(&defaults);
    (void)fputs(
        "; Configuration of the iWheel gateway. A key left out has its default; an unknown one is an error. Two have "
        "no\n"
        "; default and must be set before the wheels may move: setpoint_type and current_role.\n",
        out);
    if (config->core.listen_only) {
        (void)fputs("; In force from the command line: --listen-only, nothing is ever sent.\n", out);
    }
    for (size_t i = 0; i < config_key_count; i++) {
        if (strcmp(config_keys[i].section, section) != 0) {
            section = config_keys[i].section;
            (void)fprintf(out, "\n[%s]\n", section);
        }
        print_note(note(context, config_keys[i].section, config_keys[i].key), out);
        print_key(&config_keys[i], config, &defaults, out);
    }
}
