// SPDX-License-Identifier: MIT
#include "web_server.h"

#include "common/bridge_service.h"
#include "listen.h"

#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sysexits.h>
#include <unistd.h>

#define POLL_US         1000000U
#define LONGEST_WAIT_MS 250
#define NEWCOMERS_MAX   16U
/// Largest table of a fleet: a thousand machines need about 500 kB.
#define FLEET_BYTES_MAX 1048576
/// Memory of a connection: for a request with its headers, and for a part of the answer.
#define BYTES_PER_CONNECTION 16384U

static int complain(int code, const char *what, const char *fix) {
    (void)fprintf(stderr, "iwheel-web: %s: %s\n", what, fix);
    return code;
}

char *web_server_fleet(const web_server_t *self, size_t *out_length) {
    const int fd = open(self->settings->fleet.source, O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_NOCTTY | O_CLOEXEC);
    struct stat status = {.st_size = 0};
    const bool good = fd >= 0 && fstat(fd, &status) == 0 && S_ISREG(status.st_mode) && status.st_size > 0 &&
                      status.st_size <= FLEET_BYTES_MAX;
    char *text = good ? malloc((size_t)status.st_size) : NULL;
    const ssize_t length = (text != NULL) ? read(fd, text, (size_t)status.st_size) : -1;
    if (fd >= 0) {
        (void)close(fd);
    }
    if (length <= 0 || text[0] != '{') {
        free(text);
        return NULL;
    }
    *out_length = (size_t)length;
    return text;
}

static int read_page(web_server_t *self) {
    char path[256];
    const web_route_t *routes = web_routes();
    for (size_t i = 0; routes[i].path != NULL && routes[i].verb == WEB_FILE && i < WEB_FILES; i++) {
        (void)snprintf(path, sizeof path, "%s/%s", self->settings->web.page, routes[i].file);
        if (!page_file_read(&self->files[i], path)) {
            return complain(EX_CONFIG, path, "cannot be read; set page under [web] to the folder of the page's files");
        }
    }
    return 0;
}

/// Returns false if other users may read the file. A missing file is reported when it is read.
static bool is_secret(const char *path) {
    struct stat status;
    return stat(path, &status) != 0 || (status.st_mode & 0027U) == 0U;
}

static int read_certificate(web_server_t *self) {
    size_t length = 0;
    if (!web_settings_has_tls(self->settings)) {
        return 0;
    }
    self->certificate = page_read_all(self->settings->web.certificate, &length);
    if (self->certificate == NULL) {
        return complain(EX_CONFIG, self->settings->web.certificate,
                        "cannot be read; set it to a PEM file that the bridge's user may read");
    }
    if (!is_secret(self->settings->web.key)) {
        return complain(
            EX_NOPERM, self->settings->web.key,
            "may be read by others, or written by its group; chmod it to 0640, and set its group to the bridge's");
    }
    self->key = page_read_all(self->settings->web.key, &length);
    return (self->key != NULL) ? 0
                               : complain(EX_CONFIG, self->settings->web.key,
                                          "cannot be read; set it to a PEM file that the bridge's user may read");
}

/// Callback of the library at the start and the end of a connection.
static void take_peer(void *context, struct MHD_Connection *connection, void **place,
                      enum MHD_ConnectionNotificationCode what) {
    web_server_t *self = context;
    if (what == MHD_CONNECTION_NOTIFY_STARTED) {
        const union MHD_ConnectionInfo *info = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CONNECTION_FD);
        web_peer_t *peer = calloc(1, sizeof(*peer));
        if (peer != NULL) {
            *peer = (web_peer_t){
                .fd = (info != NULL) ? info->connect_fd : -1, .since_us = self->now_us, .next = self->peers};
            self->peers = peer;
        }
        *place = peer;
        return;
    }
    for (web_peer_t **at = &self->peers; *at != NULL; at = &(*at)->next) {
        if (*at == *place) {
            web_peer_t *peer = *at;
            *at = peer->next;
            free(peer);
            break;
        }
    }
    *place = NULL;
}

__attribute__((format(printf, 2, 0))) static void discard_log(void *context, const char *format, va_list list) {
    (void)context; // Input of hostile peers is not logged.
    (void)format;
    (void)list;
}

/// Unescapes like the library, except that a text with a NUL stays as received and so matches no path or name.
static size_t unescape(void *context, struct MHD_Connection *connection, char *text) {
    (void)context;
    (void)connection;
    return (strstr(text, "%00") != NULL) ? strlen(text) : MHD_http_unescape(text);
}

static struct MHD_Daemon *start(web_server_t *self) {
    // Only TLS 1.2 and 1.3 with authenticated encryption and forward secrecy.
    static char priorities[] = "SECURE128:-VERS-ALL:+VERS-TLS1.3:+VERS-TLS1.2:-CIPHER-ALL:+AES-256-GCM:+AES-128-GCM:"
                               "+CHACHA20-POLY1305:-MAC-ALL:+AEAD:-KX-ALL:+ECDHE-ECDSA:+ECDHE-RSA";
    const struct MHD_OptionItem tls[] = {
        {MHD_OPTION_HTTPS_MEM_CERT, 0, self->certificate},
        {MHD_OPTION_HTTPS_MEM_KEY, 0, self->key},
        {MHD_OPTION_HTTPS_PRIORITIES, 0, priorities},
        {MHD_OPTION_END, 0, NULL},
    };
    const struct MHD_OptionItem plain[] = {{MHD_OPTION_END, 0, NULL}};
    const unsigned flags = MHD_USE_EPOLL | MHD_USE_NO_LISTEN_SOCKET | MHD_ALLOW_SUSPEND_RESUME |
                           ((self->certificate != NULL) ? MHD_USE_TLS : 0U);
    return MHD_start_daemon(
        flags, 0, NULL, NULL, web_call_handle, self, MHD_OPTION_EXTERNAL_LOGGER, discard_log, NULL, MHD_OPTION_ARRAY,
        (self->certificate != NULL) ? tls : plain, MHD_OPTION_CONNECTION_LIMIT, self->settings->web.max_connections,
        MHD_OPTION_CONNECTION_TIMEOUT, 15U, MHD_OPTION_CONNECTION_MEMORY_LIMIT, (size_t)BYTES_PER_CONNECTION,
        MHD_OPTION_NOTIFY_COMPLETED, web_call_completed, self, MHD_OPTION_NOTIFY_CONNECTION, take_peer, self,
        MHD_OPTION_URI_LOG_CALLBACK, web_call_new, self, MHD_OPTION_UNESCAPE_CALLBACK, unescape, NULL,
        MHD_OPTION_STRICT_FOR_CLIENT, 1, MHD_OPTION_END);
}

int web_server_check(web_server_t *self, const web_settings_t *settings) {
    *self = (web_server_t){.settings = settings, .backlog = {.listen_fds = {-1, -1}, .epoll_fd = -1}};
    self->now_us = bridge_now_us();
    self->token = (web_token_t){.path = settings->web.token_file, .hours = settings->web.token_hours};
    const int code = read_page(self);
    return (code != 0) ? code : read_certificate(self);
}

int web_server_open(web_server_t *self, const web_settings_t *settings) {
    bool changed = false;
    int fds[WEB_BACKLOG_LISTENERS];
    int code = web_server_check(self, settings);
    if (code != 0) {
        return code;
    }
    if (!web_token_refresh(&self->token, &changed, stderr)) {
        return EX_CONFIG;
    }
    if (!web_link_open(&self->link, settings->gateway.socket, settings->gateway.rate_hz, settings->drive.enabled)) {
        return complain(EX_OSERR, "memory", "there is not enough");
    }
    if (!bridge_secret_draw(self->boot)) {
        return complain(EX_OSERR, "no random numbers", "see dmesg");
    }
    code = web_listen(settings, fds);
    if (code != 0) {
        return code;
    }
    if (!web_backlog_open(&self->backlog, fds)) {
        return complain(EX_OSERR, "cannot wait for connections", strerror(errno));
    }
    self->daemon = start(self);
    if (self->daemon == NULL) {
        return complain(EX_CONFIG, settings->web.certificate,
                        "does not fit the key; set certificate and key to a pair of PEM files");
    }
    return web_listen_verify(settings, self->backlog.listen_fds);
}

void web_server_close(web_server_t *self) {
    self->ending = true;
    for (web_call_t *stream = self->streams; stream != NULL; stream = stream->next) {
        web_call_resume(stream);
    }
    if (self->daemon != NULL) {
        (void)MHD_run(self->daemon);
        web_link_close(&self->link); // Answers pending requests.
        MHD_stop_daemon(self->daemon);
    }
    if (self->backlog.listen_fds[0] >= 0) {
        web_backlog_close(&self->backlog);
        web_listen_end(self->settings);
    }
    for (size_t i = 0; i < WEB_FILES; i++) {
        page_file_free(&self->files[i]);
    }
    free(self->certificate);
    free(self->key);
}

static void show_out(web_peer_t *peer) {
    peer->state = WEB_PEER_LEAVING;
    (void)shutdown(peer->fd, SHUT_RDWR);
}

/// Closes connections whose request is not complete within WEB_HEADER_US.
static void close_idle_peers(const web_server_t *self) {
    for (web_peer_t *peer = self->peers; peer != NULL; peer = peer->next) {
        if (peer->state == WEB_PEER_IDLE && self->now_us - peer->since_us > WEB_HEADER_US) {
            show_out(peer);
        }
    }
}

/// Returns the number of connections to accept between two rounds of the library: their requests are then read before
/// they could be closed for newer ones.
static unsigned newcomers_max(const web_server_t *self) {
    const unsigned quarter = self->settings->web.max_connections / 4U;
    return (quarter < NEWCOMERS_MAX) ? quarter : NEWCOMERS_MAX;
}

unsigned web_server_streams_max(const web_server_t *self) {
    return self->settings->web.max_connections * 5U / 8U;
}

/// Returns the connection to close: the oldest one without a proof, otherwise the oldest one without a request. NULL if
/// there is none.
static web_peer_t *who_makes_room(const web_server_t *self) {
    web_peer_t *stranger = NULL;
    web_peer_t *idle = NULL;
    for (web_peer_t *peer = self->peers; peer != NULL; peer = peer->next) {
        if (peer->since_us == self->now_us) {
            continue; // Accepted after the last round of the library: its request is not read yet.
        }
        if (peer->state != WEB_PEER_LEAVING && !peer->known) {
            stranger = peer;
        } else if (peer->state == WEB_PEER_IDLE) {
            idle = peer;
        }
    }
    return (stranger != NULL) ? stranger : idle;
}

static unsigned count_peers(const web_server_t *self) {
    unsigned count = 0;
    for (const web_peer_t *peer = self->peers; peer != NULL; peer = peer->next) {
        count += (peer->state == WEB_PEER_LEAVING) ? 0U : 1U;
    }
    return count;
}

/// Passes connections that have sent something from the list of new ones to the library.
static void accept_new(web_server_t *self) {
    const unsigned newcomers = newcomers_max(self);
    unsigned count = count_peers(self);
    web_backlog_step(&self->backlog, self->now_us);
    for (unsigned i = 0; i < newcomers; i++) {
        struct sockaddr_storage address = {.ss_family = AF_UNSPEC};
        socklen_t size = sizeof address;
        const int fd = web_backlog_take(&self->backlog);
        if (fd < 0) {
            return;
        }
        web_peer_t *gives_way =
            (count + newcomers >= self->settings->web.max_connections) ? who_makes_room(self) : NULL;
        if (gives_way != NULL) {
            show_out(gives_way);
            self->crowded_out++;
            count--;
        }
        (void)getpeername(fd, (struct sockaddr *)&address, &size);
        // The library closes a connection that it refuses.
        count += (MHD_add_connection(self->daemon, fd, (struct sockaddr *)&address, size) == MHD_YES) ? 1U : 0U;
    }
}

static void check_token(web_server_t *self) {
    bool changed = false;
    (void)web_token_refresh(&self->token, &changed, stderr);
    for (web_call_t *stream = self->streams; changed && stream != NULL; stream = stream->next) {
        stream->verdict.route = NULL; // Begun with a token that is no longer valid.
        web_call_resume(stream);
    }
}

/// Ends driving and sends `stop` if the page that drives sends nothing: then no person is using the pad. A lease of
/// another client is not changed.
static void let_go(web_server_t *self) {
    bridge_lease_t *lease = &self->link.lease;
    if (bridge_lease_key(lease) == NULL) {
        web_driver_end(&self->driver);
    } else if (web_driver_silent(&self->driver, self->now_us)) {
        web_driver_end(&self->driver);
        bridge_lease_end(lease, self->now_us);
        (void)bridge_link_ask(&self->link.gateway, "{\"cmd\":\"stop\"}", NULL, NULL, self->now_us);
    }
}

int web_server_step(web_server_t *self) {
    self->now_us = bridge_now_us();
    if (self->streams != NULL) {
        self->link.polled_us = self->now_us;
    }
    const int code = web_link_step(&self->link, self->now_us);
    if (code != 0) {
        return code;
    }
    let_go(self);
    for (web_call_t *stream = self->streams; stream != NULL; stream = stream->next) {
        if (web_reader_waits(&stream->reader, &self->link.feed) || self->now_us - stream->written_us >= WEB_PULSE_US) {
            web_call_resume(stream);
        }
    }
    accept_new(self);
    (void)MHD_run(self->daemon);
    if (self->now_us >= self->poll_us) {
        self->poll_us = self->now_us + POLL_US;
        close_idle_peers(self);
        check_token(self);
    }
    return 0;
}

int web_server_wait_ms(const web_server_t *self) {
    const uint64_t now_us = bridge_now_us();
    const uint64_t link_us = web_link_next_us(&self->link, now_us);
    const uint64_t backlog_us = web_backlog_next_us(&self->backlog, now_us);
    const uint64_t next_us = (link_us < backlog_us) ? link_us : backlog_us;
    unsigned MHD_LONG_LONG http_ms = LONGEST_WAIT_MS;
    if (MHD_get_timeout(self->daemon, &http_ms) != MHD_YES || http_ms > LONGEST_WAIT_MS) {
        http_ms = LONGEST_WAIT_MS;
    }
    const uint64_t own_ms = (next_us <= now_us) ? 0U : (next_us - now_us + 999U) / 1000U;
    return (int)((own_ms < http_ms) ? own_ms : http_ms);
}

void web_server_fds(const web_server_t *self, int out_fds[WEB_SERVER_FDS]) {
    const union MHD_DaemonInfo *info = MHD_get_daemon_info(self->daemon, MHD_DAEMON_INFO_EPOLL_FD);
    out_fds[0] = (info != NULL) ? info->epoll_fd : -1;
    out_fds[1] = self->backlog.epoll_fd;
    for (unsigned i = 0; i < WEB_BACKLOG_LISTENERS; i++) {
        out_fds[2U + i] = web_backlog_fd(&self->backlog, i, bridge_now_us());
    }
}
