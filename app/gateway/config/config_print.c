// SPDX-License-Identifier: MIT
#include "config_value.h"

#include <string.h>

static void print_help(const config_key_t *row, const char *standard, FILE *out) {
    char choices[64];
    config_value_choices(row, choices, sizeof(choices));
    fputs("; ", out);
    for (const char *c = row->help; *c != '\0'; c++) {
        fputs(*c == '\n' ? "\n; " : (char[2]){*c, '\0'}, out);
    }
    if (choices[0] != '\0') {
        fprintf(out, " %s.", choices);
    }
    fprintf(out, "%s%s%s\n", standard[0] != '\0' ? " Default " : "", standard, standard[0] != '\0' ? "." : "");
}

void gateway_config_print(const gateway_config_t *config, FILE *out) {
    gateway_config_t defaults;
    char value[CONFIG_MESSAGE_SIZE];
    char standard[CONFIG_MESSAGE_SIZE];
    const char *section = "";
    gateway_config_default(&defaults);
    fputs("; Configuration of the iWheel gateway. Every key is optional; an unknown one is an error.\n", out);
    if (config->core.listen_only) {
        fputs("; In force from the command line: --listen-only, nothing is ever sent.\n", out);
    }
    for (size_t i = 0; i < config_key_count; i++) {
        const config_key_t *row = &config_keys[i];
        if (strcmp(row->section, section) != 0) {
            section = row->section;
            fprintf(out, "\n[%s]\n", section);
        }
        (void)config_value_format(row, &defaults, standard);
        print_help(row, standard, out);
        const bool set = config_value_format(row, config, value);
        fprintf(out, "%s%s = %s\n", set ? "" : ";", row->key, set ? value : "?");
    }
}
