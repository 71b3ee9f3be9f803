// SPDX-License-Identifier: MIT
#include "relay.h"

#include <getopt.h>
#include <stdlib.h>
#include <sysexits.h>
#include <unistd.h>

typedef enum { RUN = 0, CHECK, PRINT_CONFIG, VERSION, HELP } action_t;

enum { OPTION_PORT = 256, OPTION_BAUD, OPTION_SOCKET, OPTION_WATCH_SOCKET, OPTION_CHECK, OPTION_PRINT };

static const struct option long_options[] = {
    {"config", required_argument, NULL, 'c'},
    {"port", required_argument, NULL, OPTION_PORT},
    {"baud", required_argument, NULL, OPTION_BAUD},
    {"socket", required_argument, NULL, OPTION_SOCKET},
    {"watch-socket", required_argument, NULL, OPTION_WATCH_SOCKET},
    {"check", no_argument, NULL, OPTION_CHECK},
    {"print-config", no_argument, NULL, OPTION_PRINT},
    {"version", no_argument, NULL, 'V'},
    {"help", no_argument, NULL, 'h'},
    {NULL, 0, NULL, 0},
};

/// The keys that options stand for.
static const struct {
    int option;
    const char *name;
    const char *key;
} overrides[] = {{OPTION_PORT, "--port", "board.port"},
                 {OPTION_BAUD, "--baud", "board.baud"},
                 {OPTION_SOCKET, "--socket", "northbound.socket"},
                 {OPTION_WATCH_SOCKET, "--watch-socket", "northbound.watch_socket"}};
#define OVERRIDES (sizeof overrides / sizeof overrides[0])

typedef struct {
    action_t action;
    const char *config;
    const char *value[OVERRIDES]; ///< NULL: not given.
} options_t;

static void help(void) {
    (void)fputs("iwheel-serial: joins a board that is a gateway of its own, on a serial port,\n"
                "to the sockets that iwheelctl, the clients and the bridges know.\n"
                "It moves nothing itself.\n"
                "\n"
                "usage: iwheel-serial [options]\n"
                "  -c, --config FILE   configuration (" SERIAL_SETTINGS_PATH ", if it exists)\n"
                "      --port PATH     serial port of the board\n"
                "      --baud RATE     its speed, as the image was built\n"
                "      --socket PATH   where clients connect\n"
                "      --watch-socket PATH  where clients connect that may not drive, or none\n"
                "      --check         check configuration and board; move nothing\n"
                "      --print-config  print the configuration in force\n"
                "      --version, --help\n"
                "\n"
                "exit codes: 0 ok, 1 a check failed, 64 usage, 69 port or socket in use,\n"
                "77 permission, 78 configuration\n",
                stdout);
}

static int misuse(const char *what, const char *word) {
    (void)fprintf(stderr, "iwheel-serial: %s%s; see iwheel-serial --help\n", word, what);
    return EX_USAGE;
}

/// False if it is none of ours.
static bool take_option(int option, options_t *options) {
    for (size_t i = 0; i < OVERRIDES; i++) {
        if (overrides[i].option == option) {
            options->value[i] = optarg;
            return true;
        }
    }
    switch (option) {
    case 'c':
        options->config = optarg;
        return true;
    case OPTION_CHECK:
        options->action = CHECK;
        return true;
    case OPTION_PRINT:
        options->action = PRINT_CONFIG;
        return true;
    default:
        return false;
    }
}

/// 0, or an exit code after a complaint.
static int parse(int argc, char **argv, options_t *options) {
    opterr = 0;
    for (int option = getopt_long(argc, argv, ":c:hV", long_options, NULL); option != -1;
         option = getopt_long(argc, argv, ":c:hV", long_options, NULL)) {
        if (option == 'V' || option == 'h') {
            options->action = (option == 'V') ? VERSION : HELP;
            return 0;
        }
        if (!take_option(option, options)) {
            return misuse((option == ':') ? " needs a value" : " is no option of this program", argv[optind - 1]);
        }
    }
    return (optind < argc) ? misuse(" means nothing: there are options only", argv[optind]) : 0;
}

static int configure(const options_t *options, serial_settings_t *settings) {
    const char *path = (options->config != NULL) ? options->config : SERIAL_SETTINGS_PATH;
    serial_settings_default(settings);
    int result = 0;
    if (options->config != NULL || access(path, F_OK) == 0) {
        result = settings_load(&serial_settings_form, path, settings, stderr);
    }
    for (size_t i = 0; i < OVERRIDES && result == 0; i++) {
        settings_report_t report = {.name = overrides[i].name, .err = stderr};
        if (options->value[i] != NULL) {
            result = settings_override(&serial_settings_form, &report, overrides[i].key, options->value[i], settings);
        }
    }
    return result;
}

/// Asks the board who it is, for two seconds.
static int check(const serial_settings_t *settings, relay_t *relay) {
    serial_port_t port;
    serial_link_t *link = &relay->link;
    char words[512];
    char ask[64] = "\n"; // Half a line of before ends here.
    const iwn_line_t question = {.json = RELAY_ASK, .length = sizeof RELAY_ASK - 1U};
    const size_t length = 1U + iwn_line_write(&question, &ask[1], sizeof ask - 1U);
    (void)puts("ok    configuration");
    if (serial_port_open(&port, settings->board.port, settings->board.baud, words, sizeof words) != 0) {
        (void)printf("fail  %s\n", words);
        return 1;
    }
    serial_link_init(link, bridge_now_us());
    for (unsigned i = 0; i < 200U && !link->linked; i++) {
        char bytes[512];
        iwn_line_t line;
        if (i % 30U == 0U) {
            (void)serial_port_write(&port, ask, length);
        }
        (void)usleep(10000);
        const ssize_t count = serial_port_read(&port, bytes, sizeof bytes);
        for (ssize_t n = 0; n < count; n++) {
            (void)serial_link_put(link, bytes[n], bridge_now_us(), &line);
        }
    }
    serial_port_close(&port);
    if (!link->linked) {
        serial_link_explain(link, settings->board.port, settings->board.baud, words, sizeof words);
        (void)printf("fail  %s\n", words);
        return 1;
    }
    (void)printf("ok    board on %s: version %s\n", settings->board.port, link->version);
    return 0;
}

static int act(const options_t *options) {
    serial_settings_t settings;
    const int result = configure(options, &settings);
    if (result != 0) {
        return result;
    }
    if (options->action == PRINT_CONFIG) {
        serial_settings_t standard;
        serial_settings_default(&standard);
        settings_print(&serial_settings_form, &settings, &standard, NULL, stdout);
        return 0;
    }
    relay_t *relay = calloc(1, sizeof *relay);
    if (relay == NULL) {
        (void)fputs("iwheel-serial: not enough memory to start\n", stderr);
        return EX_UNAVAILABLE;
    }
    const int code = (options->action == CHECK) ? check(&settings, relay) : relay_run(relay, &settings);
    free(relay);
    return code;
}

int main(int argc, char **argv) {
    options_t options = {.action = RUN};
    const int result = parse(argc, argv, &options);
    if (result != 0) {
        return result;
    }
    if (options.action == VERSION) {
        (void)puts("iwheel-serial " IWHEEL_VERSION);
        return 0;
    }
    if (options.action == HELP) {
        help();
        return 0;
    }
    return act(&options);
}
