// SPDX-License-Identifier: MIT
// Command line of the fleet console.
#include "fleet_verbs.h"

#include "begin/begin.h"
#include "common/bridge_service.h"

#include "mqtt_texts.h"

#include <getopt.h>
#include <stdarg.h>
#include <string.h>
#include <sysexits.h>
#include <unistd.h>

#define DAY_US 86400000000LL
#define WAIT_S 60U

typedef enum { TABLE, HISTORY, RECORDINGS, RECORDING, VERBS } verb_t;

/// Verbs that allow an option.
#define IN(verb)      (1U << (verb))
#define IN_RECORDINGS (IN(RECORDINGS) | IN(RECORDING))
#define EVERYWHERE    (IN(TABLE) | IN(HISTORY) | IN_RECORDINGS)

typedef struct {
    verb_t verb;
    const char *path; ///< Path of the configuration; NULL: not named.
    bool until;       ///< --until is present.
    unsigned used;    ///< Verbs in which all present options are allowed.
    fleet_wanted_t wanted;
} words_t;

static volatile sig_atomic_t end_asked;

static void ask_end(int number) {
    (void)number;
    end_asked = 1;
}

__attribute__((format(printf, 1, 2))) static int misuse(const char *format, ...) {
    va_list list;
    va_start(list, format);
    (void)fputs("iwheel-fleet: ", stderr);
    (void)vfprintf(stderr, format, list);
    (void)fputs("; see iwheel-fleet --help\n", stderr);
    va_end(list);
    return EX_USAGE;
}

/// Returns -1 to continue, otherwise the exit code.
static int take_number(const char *option, uint64_t *out_number) {
    uint32_t number = 0;
    if (!settings_digits(optarg, strlen(optarg), &number) || number == 0U) {
        return misuse("%s needs a number of seconds, not \"%.40s\"", option, optarg);
    }
    *out_number = number;
    return -1;
}

static int take_when(const char *option, int64_t *out_us) {
    return history_when(optarg, out_us)
               ? -1
               : misuse("%s needs a time such as 2026-11-21T22:00, not \"%.40s\"", option, optarg);
}

static int take_last(history_config_t *span) {
    int64_t last_us = 0;
    if (!history_span(optarg, &last_us)) {
        return misuse("--last needs a span such as 90min, 12h or 7d, not \"%.40s\"", optarg);
    }
    span->since_us = bridge_wall_us() - last_us;
    return -1;
}

static int take_option(words_t *self, int option) {
    static const struct {
        int option;
        unsigned where;
    } places[] = {{'f', IN(TABLE)},
                  {'l', IN(HISTORY)},
                  {'s', IN(HISTORY)},
                  {'u', IN(HISTORY)},
                  {'a', IN(HISTORY)},
                  {'w', IN_RECORDINGS},
                  {'o', IN(RECORDING) | IN(TABLE)}};
    for (size_t i = 0; i < sizeof places / sizeof places[0]; i++) {
        self->used &= (places[i].option == option) ? places[i].where : EVERYWHERE;
    }
    switch (option) {
    case 'c':
        self->path = optarg;
        return -1;
    case 'f':
        return take_number("--for", &self->wanted.seconds);
    case 'w':
        return take_number("--wait", &self->wanted.wait_s);
    case 'l':
        return take_last(&self->wanted.span);
    case 's':
        return take_when("--since", &self->wanted.span.since_us);
    case 'u':
        self->until = true;
        return take_when("--until", &self->wanted.span.until_us);
    case 'a':
        self->wanted.span.all = true;
        return -1;
    case 'j':
        self->wanted.json = true;
        return -1;
    case 'o':
        self->wanted.out = optarg;
        return -1;
    case 'V':
        (void)printf("iwheel-fleet " IWHEEL_VERSION "\n");
        return 0;
    case 'h':
        (void)fputs(mqtt_fleet_help, stdout);
        return 0;
    case ':':
        return misuse("an option needs a value");
    default:
        return misuse("there is no such option");
    }
}

/// Parses the verb, and the names after it.
static int take_words(words_t *self, int count, char **words) {
    static const char *const verbs[VERBS] = {
        [HISTORY] = "history", [RECORDINGS] = "recordings", [RECORDING] = "recording"};
    static const int most[VERBS] = {[TABLE] = 0, [HISTORY] = 2, [RECORDINGS] = 2, [RECORDING] = 3};
    for (unsigned i = HISTORY; count > 0 && i < (unsigned)VERBS; i++) {
        if (strcmp(words[0], verbs[i]) == 0) {
            self->verb = (verb_t)i;
        }
    }
    if (count > 0 && self->verb == TABLE) {
        return misuse("\"%.40s\" is not a verb; the verbs are history, recordings and recording", words[0]);
    }
    if (count > most[self->verb]) {
        return misuse("\"%.40s\" is one argument too many", words[most[self->verb]]);
    }
    self->wanted.id = (count > 1) ? words[1] : NULL;
    self->wanted.name = (count > 2) ? words[2] : NULL;
    if (self->wanted.id != NULL && !mqtt_settings_is_name(self->wanted.id)) {
        return misuse("\"%.40s\" is not the id of a machine: use letters, digits, _ and -", self->wanted.id);
    }
    if (self->wanted.id == NULL && (self->verb == RECORDINGS || self->verb == RECORDING)) {
        return misuse("%s needs the id of a machine", verbs[self->verb]);
    }
    return -1;
}

/// Refuses combinations that are not valid.
static int judge(words_t *self) {
    history_config_t *span = &self->wanted.span;
    if ((self->used & IN(self->verb)) == 0U) {
        return misuse("one of the options belongs to another verb");
    }
    if (self->verb == TABLE && self->wanted.json && self->wanted.seconds == 0U) {
        return misuse("--json needs --for SECONDS");
    }
    span->machine = self->wanted.id;
    span->json = self->wanted.json;
    if (!self->until) {
        span->until_us = bridge_wall_us();
    }
    if (span->since_us <= 0) {
        span->since_us = span->until_us - DAY_US;
    }
    return (span->since_us < span->until_us) ? -1 : misuse("--since must be before --until");
}

/// Returns -1 to continue, otherwise the exit code.
static int parse(words_t *self, int count, char **arguments) {
    static const struct option options[] = {
        {"config", required_argument, NULL, 'c'}, {"for", required_argument, NULL, 'f'},
        {"last", required_argument, NULL, 'l'},   {"since", required_argument, NULL, 's'},
        {"until", required_argument, NULL, 'u'},  {"wait", required_argument, NULL, 'w'},
        {"output", required_argument, NULL, 'o'}, {"all", no_argument, NULL, 'a'},
        {"json", no_argument, NULL, 'j'},         {"version", no_argument, NULL, 'V'},
        {"help", no_argument, NULL, 'h'},         {NULL, 0, NULL, 0},
    };
    int option = 0;
    int code = -1;
    opterr = 0;
    while (code < 0 && (option = getopt_long(count, arguments, ":c:o:", options, NULL)) != -1) {
        code = begin_is_value("iwheel-fleet", optarg) ? take_option(self, option) : EX_USAGE;
    }
    if (code < 0) {
        code = take_words(self, count - optind, arguments + optind);
    }
    return (code < 0) ? judge(self) : code;
}

int main(int count, char **arguments) {
    static int (*const verbs[VERBS])(const mqtt_settings_t *settings, const fleet_wanted_t *wanted) = {
        fleet_verb_table, fleet_verb_history, fleet_verb_recordings, fleet_verb_recording};
    static mqtt_settings_t settings;
    words_t words = {.used = EVERYWHERE, .wanted = {.wait_s = WAIT_S, .end_asked = &end_asked}};
    const struct sigaction action = {.sa_handler = ask_end};
    int code = begin_program("iwheel-fleet", count, arguments);
    if (code == 0) {
        code = parse(&words, count, arguments);
    }
    if (code >= 0) {
        return code;
    }
    settings = mqtt_settings_standard;
    if (words.path != NULL || access(FLEET_SETTINGS_PATH, F_OK) == 0) {
        code = settings_load(&mqtt_settings_form, (words.path != NULL) ? words.path : FLEET_SETTINGS_PATH, &settings,
                             stderr);
    }
    if (code > 0) {
        return code;
    }
    if (words.verb != HISTORY) { // HISTORY waits in a library that a signal does not wake; it just ends.
        (void)sigaction(SIGTERM, &action, NULL);
        (void)sigaction(SIGINT, &action, NULL);
    }
    return verbs[words.verb](&settings, &words.wanted);
}
