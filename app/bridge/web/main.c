// SPDX-License-Identifier: MIT
#include "common/bridge_service.h"
#include "common/program.h"
#include "lan.h"
#include "web_server.h"

#include "web_texts.h"

#ifdef IWHEEL_WEB_QR
#include <qrencode.h>
#endif
#include <errno.h>
#include <string.h>
#include <sysexits.h>
#include <unistd.h>

#define PRINT_URL  BRIDGE_OWN
#define PRINT_READ (BRIDGE_OWN + 1)
#define RUN_LAN    (BRIDGE_OWN + 2)

#ifdef IWHEEL_WEB_QR
static bool is_dark(const QRcode *code, int x, int y) {
    return x >= 0 && y >= 0 && x < code->width && y < code->width && (code->data[y * code->width + x] & 1U) != 0U;
}
#endif

/// Prints a QR code: one line of characters has two rows of squares, as half blocks, dark on light in any terminal.
static void print_qr(const char *text) {
#ifdef IWHEEL_WEB_QR
    QRcode *code = (isatty(STDOUT_FILENO) == 1) ? QRcode_encodeString(text, 0, QR_ECLEVEL_L, QR_MODE_8, 1) : NULL;
    const int border = 2;
    if (code == NULL && isatty(STDOUT_FILENO) == 1) {
        (void)fprintf(stderr, "iwheel-web: no QR code: %s; type the address into the phone\n", strerror(errno));
    }
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

/// Returns 0 if the output was written, or an exit code with a line on stderr.
static int end_output(void) {
    if (fflush(stdout) == 0) {
        return 0;
    }
    (void)fprintf(stderr,
                  "iwheel-web: standard output: %s; send it to a terminal, or to a file on a disk with free space\n",
                  strerror(errno));
    return EX_IOERR;
}

static int print_read(const web_settings_t *settings) {
    web_token_t token = {.path = settings->web.token_file, .only_reads = true};
    char secret[BRIDGE_SECRET_SIZE];
    bool changed = false;
    if (!web_token_refresh(&token, &changed, stderr)) {
        return EX_NOPERM;
    }
    web_read_secret(token.text, secret);
    (void)printf("%s\n", secret);
    return end_output();
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
        return end_output();
    }
    (void)snprintf(name, sizeof name, "%s", settings->web.listen);
    if (wild && !web_lan_address(name)) {
        (void)fprintf(stderr, "iwheel-web: no address for other machines: %s; connect this machine to a network\n",
                      strerror(errno));
        if (gethostname(name, sizeof name - 1U) != 0) {
            (void)snprintf(name, sizeof name, "localhost");
        }
    }
    const bool v6 = strchr(name, ':') != NULL;
    char url[256];
    (void)snprintf(url, sizeof url, "%s://%s%s%s:%u/#token=%s", web_settings_has_tls(settings) ? "https" : "http",
                   v6 ? "[" : "", name, v6 ? "]" : "", settings->web.port, token.text);
    (void)printf("%s\n", url);
    print_qr(url);
    return end_output();
}

static int check(const web_settings_t *settings) {
    web_server_t server;
    int code = web_server_check(&server, settings);
    if (code == 0 && !web_token_judge(&server.token, stderr)) {
        code = EX_CONFIG;
    }
    web_server_close(&server);
    if (code == 0) {
        (void)printf("iwheel-web: configuration and files are in order\n");
        code = end_output();
    }
    return code;
}

static int loop(web_server_t *server) {
    bridge_service_t service;
    bridge_service_open(&service);
    bridge_service_notify(&service, "READY=1");
    for (;;) {
        int fds[WEB_SERVER_FDS];
        struct pollfd waits[WEB_SERVER_FDS + 1U] = {{bridge_link_fd(&server->link.gateway), POLLIN, 0}};
        web_server_fds(server, fds);
        for (size_t i = 0; i < WEB_SERVER_FDS; i++) {
            waits[i + 1U] = (struct pollfd){fds[i], POLLIN, 0};
        }
        if (!bridge_service_wait(waits, sizeof waits / sizeof waits[0], web_server_wait_ms(server))) {
            bridge_service_notify(&service, "STOPPING=1");
            return 0;
        }
        const int code = web_server_step(server);
        if (code != 0) {
            return code;
        }
        bridge_service_round(&service, bridge_now_us());
    }
}

/// Runs the bridge. `shows`: prints the address for a phone, with the token, as soon as the bridge listens.
static int run(const web_settings_t *settings, bool shows) {
    static web_server_t server;
    bridge_service_take_signals();
    int code = web_server_open(&server, settings);
    if (code == 0 && shows) {
        code = print_url(settings);
    }
    if (code == 0) {
        (void)fprintf(stderr, "iwheel-web: on %s port %u%s\n", settings->web.listen, settings->web.port,
                      shows ? "" : "; its address with the token: iwheel-web --url");
        code = loop(&server);
    }
    web_server_close(&server);
    return code;
}

int main(int count, char **arguments) {
    static web_settings_t settings;
    const bridge_program_t program = {
        .form = &web_settings_form,
        .path = WEB_SETTINGS_PATH,
        .help = web_help,
        .own = {{"url", NULL}, {"read-secret", NULL}, {"lan", NULL}},
        .settings = &settings,
        .standard = &web_settings_standard,
    };
    int action = BRIDGE_RUN;
    settings = web_settings_standard;
    const int code = bridge_program_begin(&program, count, arguments, &action);
    if (code != BRIDGE_GO) {
        return code;
    }
    if (action == PRINT_URL) {
        return print_url(&settings);
    }
    if (action == PRINT_READ) {
        return print_read(&settings);
    }
    if (action == RUN_LAN) {
        const int prepared = web_lan_prepare(&settings);
        return (prepared == 0) ? run(&settings, true) : prepared;
    }
    return (action == BRIDGE_CHECK) ? check(&settings) : run(&settings, false);
}
