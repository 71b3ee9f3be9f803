// SPDX-License-Identifier: MIT
#include "simulator.h"

#include "begin/begin.h"

#include "sim_texts.h"

#include <getopt.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>
#include <unistd.h>

#define AGE_MAX_ms INT64_C(86400000)

/// Only q, V and h are also short options.
static const struct option long_options[] = {
    {"can", required_argument, NULL, 'c'},     {"estop", required_argument, NULL, 'e'},
    {"estop2", required_argument, NULL, 'f'},  {"control", required_argument, NULL, 'k'},
    {"script", required_argument, NULL, 's'},  {"log", required_argument, NULL, 'l'},
    {"log-direction", no_argument, NULL, 'd'}, {"no-keys", no_argument, NULL, 'n'},
    {"seed", required_argument, NULL, 'r'},    {"uptime", required_argument, NULL, 'u'},
    {"quiet", no_argument, NULL, 'q'},         {"version", no_argument, NULL, 'V'},
    {"help", no_argument, NULL, 'h'},          {NULL, 0, NULL, 0},
};

static int complain(const char *what, const char *value) {
    (void)fprintf(stderr, "iwheel-sim: %s%s\nTry: iwheel-sim --help\n", what, value);
    return EX_USAGE;
}

/// Sets the default path: in the user's folder that ends with the session, otherwise in /tmp.
static void default_path(char *out, const char *suffix) {
    const char *const runtime = getenv("XDG_RUNTIME_DIR");
    if (runtime != NULL && runtime[0] == '/') {
        (void)snprintf(out, SIM_PATH_BYTES, "%s/iwheel-sim.%s", runtime, suffix);
    } else {
        (void)snprintf(out, SIM_PATH_BYTES, "/tmp/iwheel-sim-%u.%s", (unsigned)getuid(), suffix);
    }
}

static int set_path(char *out, const char *value) {
    const char *const path = (strncmp(value, "unix:", 5U) == 0) ? value + 5 : value;
    if (path[0] == '\0' || strlen(path) >= SIM_PATH_BYTES) {
        return complain("a path is empty or too long: ", value);
    }
    (void)snprintf(out, SIM_PATH_BYTES, "%s", path);
    return -1;
}

static int set_can(sim_options_t *options, const char *value) {
    if (strncmp(value, "unix:", 5U) == 0) {
        options->can_interface[0] = '\0';
        return set_path(options->can_path, value);
    }
    if (value[0] == '\0' || strlen(value) >= sizeof options->can_interface || strchr(value, '/') != NULL) {
        return complain("--can must be unix:PATH or a CAN interface such as vcan0, not ", value);
    }
    (void)snprintf(options->can_interface, sizeof options->can_interface, "%s", value);
    return -1;
}

static int set_number(sim_options_t *options, int option, const char *value) {
    int64_t number = 0;
    if (option == 'r') {
        if (!sim_words_integer(value, (sim_range_t){0, INT64_MAX}, &number)) {
            return complain("--seed must be a whole number of at most 12 digits, not ", value);
        }
        options->seed = (uint64_t)number;
        return -1;
    }
    if (!sim_words_milli(value, (sim_range_t){0, AGE_MAX_ms}, &number)) {
        return complain("--uptime must be seconds from 0 to 86400, not ", value);
    }
    options->age_us = (uint64_t)number * IW_US_PER_MS;
    return -1;
}

static int set_option(sim_options_t *options, int option, const char *value) {
    switch (option) {
    case 'c':
        return set_can(options, value);
    case 'e':
        return set_path(options->estop_path, value);
    case 'f':
        return set_path(options->estop2_path, value);
    case 'k':
        return set_path(options->control_path, value);
    case 's':
        options->script_path = value;
        return -1;
    case 'l':
        options->log_path = value;
        return -1;
    case 'd':
        options->log_direction = true;
        return -1;
    case 'n':
        options->no_keys = true;
        return -1;
    case 'q':
        options->quiet = true;
        return -1;
    case 'V':
        (void)puts("iwheel-sim " IWHEEL_VERSION);
        return EX_OK;
    case 'h':
        (void)fputs(sim_help, stdout);
        return EX_OK;
    case '?':
        return complain("wrong arguments", "");
    default:
        return set_number(options, option, value);
    }
}

static int set_command(sim_options_t *options, int argc, char **argv) {
    size_t used = 0U;
    for (int i = optind; i < argc; i++) {
        int const length =
            snprintf(&options->command[used], sizeof options->command - used, "%s%s", (used > 0U) ? " " : "", argv[i]);
        used += (size_t)length;
        if (used >= sizeof options->command) {
            return complain("a command has at most 255 characters", "");
        }
    }
    return -1;
}

int sim_options_read(sim_options_t *out_options, int argc, char **argv) {
    int result = -1;
    int option = 0;
    *out_options = (sim_options_t){.seed = 1U};
    default_path(out_options->can_path, "bus");
    default_path(out_options->estop_path, "estop");
    default_path(out_options->control_path, "control");
    while (result < 0 && (option = getopt_long(argc, argv, "+qVh", long_options, NULL)) != -1) {
        result = begin_is_value("iwheel-sim", optarg) ? set_option(out_options, option, optarg) : EX_USAGE;
    }
    return (result < 0) ? set_command(out_options, argc, argv) : result;
}
