// SPDX-License-Identifier: MIT
#include "settings.h"

#include <ctype.h>
#include <errno.h>
#include <ini.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#define LINE_MAX_LENGTH 197U ///< inih's own.
#define KEYS            15U

typedef enum { NUMBER, CHOICE, NAME, PATH } kind_t;

/// A choice is a bool: `words[0]` false, `words[1]` true.
typedef struct {
    const char *section;
    const char *key;
    const char *help;
    kind_t kind;
    size_t offset;
    uint32_t min; ///< NAME: characters at least.
    uint32_t max; ///< NAME and PATH: characters at most.
    const char *words[2];
} setting_t;

#define AT(field) offsetof(ros_settings_t, field)
#define SWITCH(field)                                                                                                  \
    CHOICE, AT(field), 0, 0, {                                                                                         \
        "no", "yes"                                                                                                    \
    }

static const setting_t keys[KEYS] = {
    {"gateway",
     "socket",
     "Of the gateway; to watch only, its watch socket suffices.",
     PATH,
     AT(gateway.socket),
     1,
     107,
     {NULL, NULL}},
    {"ros", "domain", "DDS domain, ROS_DOMAIN_ID of the others; 0..232.", NUMBER, AT(ros.domain), 0, 232, {NULL, NULL}},
    {"ros",
     "network",
     "default: as CYCLONEDDS_URI says; loopback: this machine only, without multicast.",
     CHOICE,
     AT(ros.loopback),
     0,
     0,
     {"default", "loopback"}},
    {"ros",
     "release",
     "jazzy: Iron and newer; humble: Humble and older. Only `ros2 node list` depends on it.",
     CHOICE,
     AT(ros.humble),
     0,
     0,
     {"jazzy", "humble"}},
    {"ros",
     "namespace",
     "Before all names, for several machines in one domain; empty: none.",
     NAME,
     AT(ros.ns),
     0,
     64,
     {NULL, NULL}},
    {"ros", "node", "Name in `ros2 node list`.", NAME, AT(ros.node), 1, 64, {NULL, NULL}},
    {"drive", "enabled", "no: watch only. WHO REACHES THE DDS DOMAIN MAY DRIVE AND ARM.", SWITCH(drive.enabled)},
    {"drive", "command", "What cmd_vel is.", CHOICE, AT(drive.stamped), 0, 0, {"twist", "twist_stamped"}},
    {"drive",
     "timeout_ms",
     "Silence of cmd_vel after which the bridge stops the wheels; 50..500. The lease may end earlier.",
     NUMBER,
     AT(drive.timeout_ms),
     50,
     500,
     {NULL, NULL}},
    {"drive", "auto_arm",
     "yes: a command after 500 ms of zeros or silence arms, but not after a stop with another reason than silence.",
     SWITCH(drive.auto_arm)},
    {"drive", "allow_reset", "yes: the service iwheel/reset resets a latched stop.", SWITCH(drive.allow_reset)},
    {"odometry",
     "rate_hz",
     "Of odom, joint_states, wrench; 1..100.",
     NUMBER,
     AT(odometry.rate_hz),
     1,
     100,
     {NULL, NULL}},
    {"odometry", "odom_frame", "Frame of odom.", NAME, AT(odometry.odom_frame), 1, 64, {NULL, NULL}},
    {"odometry", "base_frame", "Frame of the machine.", NAME, AT(odometry.base_frame), 1, 64, {NULL, NULL}},
    {"odometry", "tf", "yes: publish the transform too (no, if robot_localization does).", SWITCH(odometry.tf)},
};

typedef struct {
    FILE *in;
    FILE *err;
    const char *name;
    unsigned line;
    unsigned errors;
    unsigned seen[KEYS];
    ros_settings_t settings;
} loader_t;

void ros_settings_default(ros_settings_t *out_settings) {
    static const ros_settings_t standard = {
        .gateway = {"/run/iwheel/gateway.sock"},
        .ros = {.node = "iwheel"},
        .drive = {.enabled = true, .timeout_ms = 500},
        .odometry = {.rate_hz = 50, .odom_frame = "odom", .base_frame = "base_link"},
    };
    *out_settings = standard;
}

__attribute__((format(printf, 2, 3))) static void complain(loader_t *loader, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    (void)fprintf(loader->err, "%s:%u: ", loader->name, loader->line);
    (void)vfprintf(loader->err, format, arguments);
    (void)fputc('\n', loader->err);
    va_end(arguments);
    loader->errors++;
}

static void *field(ros_settings_t *settings, const setting_t *row) {
    return (char *)settings + row->offset;
}

// ---- one value ----------------------------------------------------------------------------------------------------

static void take_number(loader_t *loader, const setting_t *row, const char *text) {
    char *end;
    errno = 0;
    const unsigned long value = strtoul(text, &end, 10);
    if (!isdigit((unsigned char)text[0]) || *end != '\0' || errno != 0 || value < row->min || value > row->max) {
        complain(loader, "%s = %s is no whole number from %u to %u; write one", row->key, text, row->min, row->max);
        return;
    }
    *(uint32_t *)field(&loader->settings, row) = (uint32_t)value;
}

static void take_choice(loader_t *loader, const setting_t *row, const char *text) {
    for (size_t i = 0; i < 2U; i++) {
        if (strcmp(text, row->words[i]) == 0) {
            *(bool *)field(&loader->settings, row) = i == 1U;
            return;
        }
    }
    complain(loader, "%s = %s is not known; write %s or %s", row->key, text, row->words[0], row->words[1]);
}

/// As ROS wants names: letters, digits, _ and between names /, not beginning with a digit.
static bool is_ros_name(const char *text) {
    bool first = true;
    for (; *text != '\0'; text++) {
        const unsigned char c = (unsigned char)*text;
        if ((first && isdigit(c)) || (!isalnum(c) && c != '_' && (c != '/' || first || text[1] == '\0'))) {
            return false;
        }
        first = c == '/';
    }
    return true;
}

static void take_text(loader_t *loader, const setting_t *row, const char *text) {
    if (row->kind == NAME) {
        text += (text[0] == '/') ? 1 : 0;
    }
    const size_t length = strlen(text);
    if (length < row->min || length > row->max) {
        complain(loader, "%s has %zu characters; write %u to %u", row->key, length, row->min, row->max);
    } else if (row->kind == NAME && !is_ros_name(text)) {
        complain(loader, "%s = %s is no name for ROS; use letters, digits and _, first no digit", row->key, text);
    } else {
        memcpy(field(&loader->settings, row), text, length + 1U);
    }
}

// ---- the file -----------------------------------------------------------------------------------------------------

/// What there is in a section; without a section, which there are.
static void list_known(const char *section, char *out, size_t size) {
    size_t used = 0;
    out[0] = '\0';
    for (size_t i = 0; i < KEYS; i++) {
        const bool again = section == NULL && i > 0 && strcmp(keys[i].section, keys[i - 1U].section) == 0;
        if (again || (section != NULL && strcmp(keys[i].section, section) != 0)) {
            continue;
        }
        const int n = snprintf(out + used, size - used, "%s%s", (used > 0) ? ", " : "",
                               (section != NULL) ? keys[i].key : keys[i].section);
        used += (n > 0 && (size_t)n < size - used) ? (size_t)n : 0U;
    }
}

static void complain_unknown(loader_t *loader, const char *section, const char *key) {
    char known[200];
    list_known(section, known, sizeof known);
    for (size_t i = 0; i < KEYS; i++) {
        if (strcmp(keys[i].key, key) == 0) {
            complain(loader, "%s is no key of [%s]; move it to [%s]", key, section, keys[i].section);
            return;
        }
    }
    if (known[0] == '\0') {
        list_known(NULL, known, sizeof known);
        complain(loader, "unknown section [%s]; known are: %s", section, known);
    } else {
        complain(loader, "unknown key %s in [%s]; known are: %s", key, section, known);
    }
}

static int take_value(void *context, const char *section, const char *key, const char *value) {
    loader_t *loader = context;
    for (size_t i = 0; i < KEYS; i++) {
        const setting_t *row = &keys[i];
        if (strcmp(row->section, section) != 0 || strcmp(row->key, key) != 0) {
            continue;
        }
        if (loader->seen[i] != 0) {
            complain(loader, "%s is here a second time (first on line %u); keep one", key, loader->seen[i]);
            return 1;
        }
        loader->seen[i] = loader->line;
        if (row->kind == NUMBER) {
            take_number(loader, row, value);
        } else if (row->kind == CHOICE) {
            take_choice(loader, row, value);
        } else {
            take_text(loader, row, value);
        }
        return 1;
    }
    complain_unknown(loader, section, key);
    return 1;
}

/// fgets for inih, which counts lines, keeps them whole, and takes leading blanks away: inih would join an indented line to the last value.
static char *next_line(char *out, int size, void *context) {
    loader_t *loader = context;
    if (fgets(out, size, loader->in) == NULL) {
        return NULL;
    }
    loader->line++;
    const size_t length = strlen(out);
    if (length > LINE_MAX_LENGTH && out[length - 1U] != '\n') {
        complain(loader, "is longer than %u characters; shorten it", LINE_MAX_LENGTH);
        for (int c = 0; c != '\n' && c != EOF;) {
            c = fgetc(loader->in);
        }
        (void)snprintf(out, (size_t)size, "\n");
    }
    const size_t blank = strspn(out, " \t");
    memmove(out, out + blank, strlen(out + blank) + 1U);
    if (strchr(";#[\r\n", out[0]) == NULL && strchr(out, '=') == NULL) {
        out[strcspn(out, "\r\n")] = '\0';
        complain(loader, "\"%.40s\" is not KEY = VALUE; add the '=' or begin the line with ;", out);
        (void)snprintf(out, (size_t)size, "\n");
    }
    return out;
}

int ros_settings_read(FILE *in, const char *name, ros_settings_t *out_settings, FILE *err) {
    loader_t loader = {.in = in, .err = err, .name = name};
    ros_settings_default(&loader.settings);
    const int result = ini_parse_stream(next_line, &loader, take_value, &loader);
    if (result != 0 && loader.errors == 0) {
        complain(&loader, "cannot be read; write [SECTION] and KEY = VALUE lines");
    }
    if (loader.errors > 0) {
        return ROS_SETTINGS_ERROR;
    }
    *out_settings = loader.settings;
    return 0;
}

int ros_settings_load(const char *path, ros_settings_t *out_settings, FILE *err) {
    FILE *in = fopen(path, "re");
    if (in == NULL) {
        (void)fprintf(err, "%s: cannot be opened (%s); create it from share/ros2.conf, or give another with -c FILE\n",
                      path, strerror(errno));
        return ROS_SETTINGS_ERROR;
    }
    const int result = ros_settings_read(in, path, out_settings, err);
    (void)fclose(in);
    return result;
}

void ros_settings_print(const ros_settings_t *settings, FILE *out) {
    ros_settings_t copy = *settings;
    for (size_t i = 0; i < KEYS; i++) {
        const setting_t *row = &keys[i];
        const void *value = field(&copy, row);
        if (i == 0 || strcmp(row->section, keys[i - 1U].section) != 0) {
            (void)fprintf(out, "%s[%s]\n", (i > 0) ? "\n" : "", row->section);
        }
        (void)fprintf(out, "; %s\n%s =", row->help, row->key);
        if (row->kind == NUMBER) {
            (void)fprintf(out, " %u\n", *(const uint32_t *)value);
        } else {
            const char *text = (row->kind == CHOICE) ? row->words[*(const bool *)value ? 1 : 0] : (const char *)value;
            (void)fprintf(out, "%s%s\n", (text[0] != '\0') ? " " : "", text);
        }
    }
}
