// SPDX-License-Identifier: MIT
#include "common/service.h"
#include "server.h"

#include <getopt.h>
#include <poll.h>
#ifdef IWHEEL_WEB_QR
#include <qrencode.h>
#endif
#include <signal.h>
#include <string.h>
#include <sysexits.h>
#include <unistd.h>

typedef enum { RUN, CHECK, PRINT, URL, VERSION, HELP } action_t;

#ifdef IWHEEL_WEB_QR
static bool is_dark(const QRcode *code, int x, int y) {
    return x >= 0 && y >= 0 && x < code->width && y < code->width && (code->data[y * code->width + x] & 1U) != 0U;
}
#endif

static volatile sig_atomic_t end_asked;

static void ask_end(int number) {
    (void)number;
    end_asked = 1;
}

static void help(FILE *out) {
    (void)fputs("iwheel-web: a page that shows what the wheels do, and stops them. It drives only if\n"
                "configured to. No safety function.\n"
                "\n"
                "usage: iwheel-web [options]\n"
                "  -c, --config FILE   configuration (" WEB_SETTINGS_PATH ", if it exists)\n"
                "      --check         check configuration and files; open nothing\n"
                "      --print-config  print the configuration in force\n"
                "      --url           print the page's address with its token; on a\n"
                "                      terminal as a QR code too\n"
                "      --version, --help\n"
                "\n"
                "exit codes: 0 ok, 64 usage, 69 cannot listen, 71 no memory, 77 permission,\n"
                "78 configuration\n",
                out);
}

static int misuse(const char *what) {
    (void)fprintf(stderr, "iwheel-web: %.200s; see iwheel-web --help\n", what);
    return EX_USAGE;
}

static int parse(int count, char **arguments, const char **out_path, action_t *out_action) {
    static const struct option options[] = {
        {"config", required_argument, NULL, 'c'},
        {"check", no_argument, NULL, CHECK},
        {"print-config", no_argument, NULL, PRINT},
        {"url", no_argument, NULL, URL},
        {"version", no_argument, NULL, VERSION},
        {"help", no_argument, NULL, HELP},
        {NULL, 0, NULL, 0},
    };
    int option = 0;
    opterr = 0;
    while ((option = getopt_long(count, arguments, ":c:", options, NULL)) != -1) {
        if (option == 'c') {
            *out_path = optarg;
        } else if (option == '?' || option == ':') {
            return misuse((option == ':') ? "an option needs a value" : "there is no such option");
        } else {
            *out_action = (action_t)option;
        }
    }
    return (optind < count) ? misuse("there are options only") : 0;
}

static int configure(const char *path, web_settings_t *out_settings) {
    web_settings_default(out_settings);
    if (path == NULL && access(WEB_SETTINGS_PATH, F_OK) != 0) {
        return 0;
    }
    return settings_load(&web_settings_form, (path != NULL) ? path : WEB_SETTINGS_PATH, out_settings, stderr);
}

/// Two rows of squares in one of characters: upper and lower half blocks, dark on light whatever the terminal's colours.
static void print_qr(const char *text) {
#ifdef IWHEEL_WEB_QR
    QRcode *code = (isatty(STDOUT_FILENO) == 1) ? QRcode_encodeString(text, 0, QR_ECLEVEL_L, QR_MODE_8, 1) : NULL;
    const int border = 2;
    for (int y = -border; code != NULL && y < code->width + border; y += 2) {
        (void)fputs("\033[30;107m", stdout);
        for (int x = -border; x < code->width + border; x++) {
            const bool upper = is_dark(code, x, y);
            const bool lower = is_dark(code, x, y + 1);
            (void)fputs((upper && lower) ? "\u2588" : upper ? "\u2580" : lower ? "\u2584" : " ", stdout);
        }
        (void)fputs("\033[0m\n", stdout);
    }
    QRcode_free(code);
#else
    (void)text;
#endif
}

static int print_url(const web_settings_t *settings) {
    web_token_t token = {.path = settings->web.token_file, .only_reads = true};
    bool changed = false;
    if (!web_token_refresh(&token, &changed, stderr)) {
        return EX_NOPERM;
    }
    const bool wild = strcmp(settings->web.listen, "0.0.0.0") == 0 || strcmp(settings->web.listen, "::") == 0;
    char name[128];
    if (web_settings_is_unix(settings)) {
        (void)printf("http://HOST-OF-YOUR-PROXY/#token=%s\n", token.text);
        return 0;
    }
    (void)snprintf(name, sizeof name, "%s", settings->web.listen);
    if (wild && gethostname(name, sizeof name - 1U) != 0) {
        (void)snprintf(name, sizeof name, "localhost");
    }
    const bool v6 = strchr(name, ':') != NULL;
    char url[256];
    (void)snprintf(url, sizeof url, "%s://%s%s%s:%u/#token=%s", web_settings_has_tls(settings) ? "https" : "http",
                   v6 ? "[" : "", name, v6 ? "]" : "", settings->web.port, token.text);
    (void)printf("%s\n", url);
    print_qr(url);
    return 0;
}

static int check(const web_settings_t *settings) {
    web_server_t server;
    const int code = web_server_check(&server, settings);
    web_server_close(&server);
    if (code == 0) {
        (void)printf("iwheel-web: configuration and files are in order\n");
    }
    return code;
}

static int loop(web_server_t *server) {
    bridge_service_t service;
    sigset_t none;
    (void)sigemptyset(&none);
    bridge_service_open(&service);
    bridge_service_tell(&service, "READY=1");
    while (end_asked == 0) {
        int fds[WEB_SERVER_FDS];
        struct pollfd waits[WEB_SERVER_FDS + 1U] = {{web_link_fd(&server->link), POLLIN, 0}};
        web_server_fds(server, fds);
        for (size_t i = 0; i < WEB_SERVER_FDS; i++) {
            waits[i + 1U] = (struct pollfd){fds[i], POLLIN, 0};
        }
        const int wait_ms = web_server_wait_ms(server);
        const struct timespec wait = {wait_ms / 1000, (long)(wait_ms % 1000) * 1000000L};
        (void)ppoll(waits, sizeof waits / sizeof waits[0], &wait, &none);
        const int code = web_server_step(server);
        if (code != 0) {
            return code;
        }
        bridge_service_round(&service, bridge_now_us());
    }
    bridge_service_tell(&service, "STOPPING=1");
    return 0;
}

/// Both signals come only while the loop waits.
static void take_signals(void) {
    struct sigaction action = {.sa_handler = ask_end};
    sigset_t ours;
    (void)sigemptyset(&ours);
    (void)sigaddset(&ours, SIGTERM);
    (void)sigaddset(&ours, SIGINT);
    (void)sigprocmask(SIG_BLOCK, &ours, NULL);
    (void)sigaction(SIGTERM, &action, NULL);
    (void)sigaction(SIGINT, &action, NULL);
    (void)signal(SIGPIPE, SIG_IGN);
}

static int run(const web_settings_t *settings) {
    static web_server_t server;
    take_signals();
    int code = web_server_open(&server, settings);
    if (code == 0) {
        (void)fprintf(stderr, "iwheel-web: on %s port %u; its address with the token: iwheel-web --url\n",
                      settings->web.listen, settings->web.port);
        code = loop(&server);
    }
    web_server_close(&server);
    return code;
}

int main(int count, char **arguments) {
    static web_settings_t settings;
    const char *path = NULL;
    action_t action = RUN;
    int code = parse(count, arguments, &path, &action);
    if (code != 0) {
        return code;
    }
    if (action == HELP || action == VERSION) {
        if (action == HELP) {
            help(stdout);
        } else {
            (void)printf("iwheel-web " IWHEEL_VERSION "\n");
        }
        return 0;
    }
    code = configure(path, &settings);
    if (code != 0) {
        return code;
    }
    if (action == PRINT) {
        web_settings_t defaults;
        web_settings_default(&defaults);
        settings_print(&web_settings_form, &settings, &defaults, NULL, stdout);
        return 0;
    }
    return (action == CHECK) ? check(&settings) : (action == URL) ? print_url(&settings) : run(&settings);
}
