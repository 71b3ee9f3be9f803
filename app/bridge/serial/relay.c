// SPDX-License-Identifier: MIT
#include "relay.h"

#include "common/reach.h"
#include "iwheel_linux/clock.h"

#include <errno.h>
#include <inttypes.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/signalfd.h>
#include <sysexits.h>

/// One event per descriptor, so that a descriptor without an event has nothing to read.
#define EVENTS_PER_WAIT (SOCK_CLIENTS_MAX + 6)
/// Number of reads of the port in one cycle.
#define READS_PER_CYCLE 4U
/// Largest time of bytes in the kernel's buffer, so that the line never pauses: a line is that old when it is sent.
#define AHEAD_US 2000U
/// Interval of attempts to open the port.
#define BACKOFF_MIN_US 100000U
#define BACKOFF_MAX_US 2000000U
/// Longest wait of the loop.
#define IDLE_US 1000000U

static void watch_port(relay_t *self, int operation) {
    struct epoll_event interest = {.events = EPOLLIN, .data = {.u64 = SOCK_TAG_BUS}};
    interest.events |= (self->out_length > 0U) ? (uint32_t)EPOLLOUT : 0U;
    (void)epoll_ctl(self->clients.epoll_fd, operation, self->port.fd, &interest);
}

/// Sets the reason for clients that connect, and logs it if it is new.
static void set_trouble(relay_t *self, const char *words) {
    if (strcmp(self->trouble, words) != 0) {
        (void)snprintf(self->trouble, sizeof self->trouble, "%s", words);
        sock_log(&self->log, SOCK_LOG_WARNING, "%s", self->trouble);
    }
}

/// Closes the port and opens it again later, with a longer delay each time until a board answers.
static void lose_port(relay_t *self, const char *words) {
    serial_port_close(&self->port); // This also removes it from the epoll set.
    serial_link_init(&self->link, self->now_us);
    relay_drop_clients(self);
    self->out_length = 0;
    self->out_sent = 0;
    self->retry_us = self->now_us + self->backoff_us;
    self->backoff_us = (self->backoff_us < BACKOFF_MAX_US / 2U) ? self->backoff_us * 2U : BACKOFF_MAX_US;
    set_trouble(self, words);
}

/// Opens the port. Returns 0 or the errno.
static int open_port(relay_t *self) {
    char why[512];
    const int error =
        serial_port_open(&self->port, self->settings->board.port, self->settings->board.baud, why, sizeof why);
    if (error != 0) {
        lose_port(self, why);
        return error;
    }
    serial_link_init(&self->link, self->now_us);
    serial_trouble_begin(&self->judged, self->now_us);
    self->asked_us = 0;
    self->free_us = self->now_us;
    memcpy(self->out, "\n", 1); // Ends an incomplete line of another program.
    self->out_length = 1;
    self->out_sent = 0;
    watch_port(self, EPOLL_CTL_ADD);
    return 0;
}

/// The board has answered, or has restarted: clients of the board before are closed.
static void greet(relay_t *self) {
    sock_log(&self->log, SOCK_LOG_INFO, "board on %s: start %s, version %s", self->settings->board.port,
             self->link.boot, (self->link.version[0] != '\0') ? self->link.version : "unknown");
    if (self->link.fault_cause != 0) {
        sock_log(&self->log, SOCK_LOG_WARNING,
                 "the board restarted after a fault: cause 0x%08" PRIX32 " at 0x%08" PRIX32 "; report both numbers",
                 (uint32_t)self->link.fault_cause, (uint32_t)self->link.fault_pc);
    }
    self->backoff_us = BACKOFF_MIN_US;
    self->trouble[0] = '\0';
    relay_drop_clients(self);
}

static void take_news(relay_t *self, serial_news_t news, const iwn_line_t *line) {
    switch (news) {
    case SERIAL_NEWS_LINE:
        relay_take_line(self, line);
        break;
    case SERIAL_NEWS_LINKED:
        greet(self);
        break;
    case SERIAL_NEWS_LOST:
        set_trouble(self, "the board has restarted");
        relay_drop_clients(self);
        serial_trouble_begin(&self->judged, self->now_us);
        self->asked_us = 0;
        break;
    case SERIAL_NEWS_NONE:
    default:
        break;
    }
}

static void read_port(relay_t *self) {
    char bytes[4096];
    for (unsigned i = 0; i < READS_PER_CYCLE && self->port.fd >= 0; i++) {
        const ssize_t count = serial_port_read(&self->port, bytes, sizeof bytes);
        for (ssize_t n = 0; n < count; n++) {
            iwn_line_t line;
            const serial_news_t news = serial_link_put(&self->link, bytes[n], self->now_us, &line);
            take_news(self, news, &line);
        }
        if (count < 0) {
            lose_port(self, "the port has gone: was the cable pulled?");
        }
        if (count < (ssize_t)sizeof bytes) {
            return;
        }
    }
}

/// Sets the reason why no board answers, by the bytes since the last time. The log gets each loss of a board.
static void explain(relay_t *self, bool fell_silent) {
    const serial_place_t place = {self->settings->board.port, self->settings->board.baud};
    const serial_report_t report = serial_trouble_judge(&self->judged, &self->link.noise, self->now_us);
    if (report != SERIAL_REPORT_KEEP) {
        serial_trouble_write(&self->link.noise, &place, self->trouble, sizeof self->trouble);
    }
    if (report == SERIAL_REPORT_LOG || fell_silent) {
        sock_log(&self->log, SOCK_LOG_WARNING, "%s", self->trouble);
    }
    serial_link_forget_noise(&self->link);
}

static void poll_link(relay_t *self) {
    const bool fell_silent = serial_link_fell_silent(&self->link, self->now_us);
    if (fell_silent) {
        serial_trouble_begin(&self->judged, self->now_us);
    }
    if (fell_silent ||
        (self->port.fd >= 0 && self->link.state == SERIAL_SILENT && self->now_us >= self->judged.judge_us)) {
        explain(self, fell_silent);
    }
    if (fell_silent) { // Its clients are informed.
        relay_drop_clients(self);
    }
}

/// Writes as far as possible; a new line only when the lines before have been sent.
static void write_port(relay_t *self) {
    const bool waited = self->out_length > 0U;
    while (self->port.fd >= 0) {
        if (self->out_length == 0U && self->free_us <= self->now_us + AHEAD_US) {
            self->out_length = relay_next_line(self, self->out, sizeof self->out);
            self->out_sent = 0;
        }
        if (self->out_length == 0U) {
            break;
        }
        const ssize_t count =
            serial_port_write(&self->port, &self->out[self->out_sent], self->out_length - self->out_sent);
        if (count < 0) {
            lose_port(self, "the port has gone: was the cable pulled?");
            return;
        }
        const uint64_t begin_us = (self->free_us > self->now_us) ? self->free_us : self->now_us;
        if (count > 0) {
            self->free_us = begin_us + (uint64_t)count * 10000000U / self->settings->board.baud;
            self->written_us = self->now_us;
        }
        self->out_sent += (size_t)count;
        if (self->out_sent < self->out_length) {
            break; // The buffer is full; free space in it wakes the loop.
        }
        self->out_length = 0;
    }
    if (self->port.fd >= 0 && (waited || self->out_length > 0U)) {
        watch_port(self, EPOLL_CTL_MOD);
    }
}

/// Bytes that the kernel holds for so long are old, and so are all bytes after them.
static void poll_port(relay_t *self) {
    if (self->port.fd < 0 && self->now_us >= self->retry_us) {
        (void)open_port(self);
    } else if (self->port.fd >= 0 && self->out_length > 0U && self->now_us >= self->written_us + RELAY_STUCK_US &&
               self->now_us >= self->free_us + RELAY_STUCK_US) {
        serial_port_discard(&self->port);
        lose_port(self, "the port accepts no data any more: does the board hang, or block the line?");
    }
}

static int watch(const relay_t *self, int fd, uint64_t tag) {
    struct epoll_event interest = {.events = EPOLLIN, .data = {.u64 = tag}};
    return (fd < 0 || epoll_ctl(self->clients.epoll_fd, EPOLL_CTL_ADD, fd, &interest) == 0) ? 0 : errno;
}

static int open_loop(relay_t *self) {
    sigset_t set;
    (void)sigemptyset(&set);
    (void)sigaddset(&set, SIGTERM);
    (void)sigaddset(&set, SIGINT);
    (void)sigprocmask(SIG_BLOCK, &set, NULL);
    self->signal_fd = signalfd(-1, &set, SFD_NONBLOCK | SFD_CLOEXEC);
    const int error = sock_wakeup_open(&self->wakeup);
    self->clients.epoll_fd = self->wakeup.fd;
    if (self->signal_fd < 0 || error != 0 || watch(self, self->signal_fd, SOCK_TAG_SIGNAL) != 0 ||
        watch(self, self->clients.listener[SOCK_DRIVE].fd, SOCK_TAG_LISTENER) != 0 ||
        watch(self, self->clients.listener[SOCK_WATCH].fd, SOCK_TAG_WATCH_LISTENER) != 0) {
        (void)fputs("iwheel-serial: cannot create the descriptors for the event loop; raise the limit of open files\n",
                    stderr);
        return EX_UNAVAILABLE;
    }
    return 0;
}

static uint64_t earlier(uint64_t a_us, uint64_t b_us) {
    return (a_us < b_us) ? a_us : b_us;
}

/// Returns the time of the next action without input.
static uint64_t next_us(const relay_t *self) {
    const bool busy = sock_clients_count(&self->clients) > 0U || relay_stops_wait(self, self->now_us);
    uint64_t then_us = self->now_us + (busy ? RELAY_ALIVE_US / 2U : IDLE_US);
    then_us = earlier(then_us, earlier(self->ends_us, sock_service_next_us(&self->clients)));
    if (self->port.fd < 0) {
        return earlier(then_us, self->retry_us);
    }
    then_us = earlier(then_us, relay_channels_next_us(self));
    if (self->link.state == SERIAL_SILENT) {
        return earlier(then_us, earlier(self->asked_us + RELAY_ASK_US, self->judged.judge_us));
    }
    const bool waits = self->out_length == 0U && self->free_us > self->now_us + AHEAD_US;
    return waits ? earlier(then_us, self->free_us - AHEAD_US) : then_us;
}

/// Handles a loop that was delayed: requests that arrived in the meantime must not count as new.
static void judge_gap(relay_t *self) {
    if (self->planned_us == 0U || self->now_us <= self->planned_us + RELAY_GAP_US) {
        return;
    }
    const uint64_t away_us = self->now_us - self->planned_us;
    self->gap_us = self->now_us;
    if (sock_clients_count(&self->clients) == 0U) {
        return;
    }
    sock_log(&self->log, SOCK_LOG_WARNING, "the relay was delayed for %llu ms: it does not send waiting requests",
             (unsigned long long)(away_us / 1000U));
    if (away_us >= RELAY_LEFT_US) {
        relay_drop_clients(self); // The board has closed their channels.
    }
}

/// Returns true if a connection waits.
static bool note_event(relay_t *self, const struct epoll_event *event, bool *out_end) {
    switch (event->data.u64) {
    case SOCK_TAG_SIGNAL:
        *out_end = true;
        return false;
    case SOCK_TAG_LISTENER:
    case SOCK_TAG_WATCH_LISTENER:
        return true;
    case SOCK_TAG_BUS:
        if ((event->events & (EPOLLHUP | EPOLLERR)) != 0U && self->port.fd >= 0) {
            lose_port(self, "the port has gone: was the cable pulled?");
        }
        return false;
    default:
        sock_service_note(&self->clients, event);
        return false;
    }
}

/// Reads the clients before the board, so that a command never quotes a stamp that arrived while it waited.
static void cycle(relay_t *self, bool client_waits) {
    sock_service_clients(&self->clients, IW_CLIENT_NONE);
    if (self->port.fd >= 0) {
        read_port(self);
    }
    poll_port(self);
    poll_link(self);
    if (client_waits) {
        sock_service_accept(&self->clients);
    }
    relay_poll_channels(self);
    write_port(self);
    sock_service_flush(&self->clients, IW_CLIENT_NONE);
    bridge_service_round(&self->service, self->now_us);
}

/// Waits, then executes one cycle. Returns false if the wait failed.
static bool turn(relay_t *self, bool *out_end) {
    struct epoll_event events[EVENTS_PER_WAIT];
    const uint64_t then_us = sock_service_is_busy(&self->clients) ? 0U : next_us(self);
    bool knocks = false;
    self->planned_us = (then_us > self->now_us) ? then_us : self->now_us;
    const int count = sock_wakeup_wait(&self->wakeup, events, EVENTS_PER_WAIT, 0U, then_us);
    if (count < 0) {
        return errno == EINTR; // The wait has no result: waiting bytes must not count as new.
    }
    self->now_us = iwl_clock_now_us();
    self->clients.now_us = self->now_us;
    judge_gap(self);
    for (int i = 0; i < count; i++) {
        knocks = note_event(self, &events[i], out_end) || knocks;
    }
    cycle(self, knocks);
    return true;
}

static int loop(relay_t *self) {
    bool ends = false;
    bridge_service_notify(&self->service, "READY=1");
    while (!ends && turn(self, &ends)) {
    }
    return ends ? 0 : EX_SOFTWARE;
}

static void close_listeners(relay_t *self) {
    for (unsigned right = 0; right < SOCK_RIGHTS; right++) {
        sock_listener_close(&self->clients.listener[right]);
        self->clients.listener[right].from_us = 0;
    }
}

/// Ends all clients, and runs until their stops are answered and the board has been sent the closes: leases end without
/// delay, and no stop is lost. Without a board nothing can be sent.
static void finish(relay_t *self) {
    bool again = false;
    bridge_service_notify(&self->service, "STOPPING=1");
    close_listeners(self);
    (void)epoll_ctl(self->clients.epoll_fd, EPOLL_CTL_DEL, self->signal_fd, NULL); // It would wake each wait.
    relay_end_clients(self);
    write_port(self);
    self->ends_us = self->now_us + RELAY_END_US;
    while (!relay_has_ended(self) && turn(self, &again)) {
    }
    relay_stops_report(self);
    relay_drop_clients(self);
    sock_service_flush(&self->clients, IW_CLIENT_NONE);
    sock_service_close_all(&self->clients);
    if (!serial_port_end(&self->port)) {
        sock_log(&self->log, SOCK_LOG_WARNING, "the port did not send the last lines; check that the wheels stop");
    }
}

static int open_sockets(relay_t *self) {
    const serial_settings_t *settings = self->settings;
    const sock_listener_config_t drive = {"iwheel-serial", SOCK_DRIVE, settings->northbound.socket,
                                          settings->northbound.group, settings->northbound.mode};
    const sock_listener_config_t watching = {"iwheel-serial", SOCK_WATCH, settings->northbound.watch_socket,
                                             settings->northbound.watch_group, settings->northbound.watch_mode};
    sock_listener_t *listener = self->clients.listener;
    int result = sock_listener_prepare(&listener[SOCK_DRIVE], &drive, stderr);
    if (result == 0) {
        result = sock_listener_open(&listener[SOCK_DRIVE], &self->log, stderr);
    }
    if (result == 0 && strcmp(watching.path, "none") != 0) {
        result = sock_listener_prepare(&listener[SOCK_WATCH], &watching, stderr);
        if (result == 0) {
            result = sock_listener_open(&listener[SOCK_WATCH], &self->log, stderr);
        }
    }
    return result;
}

static void compose(relay_t *self, const serial_settings_t *settings) {
    (void)signal(SIGPIPE, SIG_IGN); // Before the first log line, whose reader may be gone.
    memset(self, 0, sizeof *self);
    self->settings = settings;
    self->port.fd = -1;
    self->clients.handler = relay_handler(self);
    self->clients.log = &self->log;
    self->clients.most[SOCK_DRIVE] = settings->northbound.max_clients;
    self->clients.most[SOCK_WATCH] = settings->northbound.max_watchers;
    for (unsigned right = 0; right < SOCK_RIGHTS; right++) {
        self->clients.listener[right] = (sock_listener_t){.fd = -1, .reserve_fd = -1, .folder = {.fd = -1}};
    }
    self->backoff_us = BACKOFF_MIN_US;
    self->ends_us = UINT64_MAX;
    self->now_us = iwl_clock_now_us();
    self->clients.now_us = self->now_us;
    sock_log_open(&self->log, SOCK_LOG_INFO);
    self->log.program = "iwheel-serial";
}

/// Opens the port first: a relay that cannot open the port must not bind the sockets. A port that does not exist yet is
/// awaited.
static int open_all(relay_t *self) {
    int result = open_loop(self);
    if (result == 0 && open_port(self) == EBUSY) {
        return EX_UNAVAILABLE; // The reason was printed.
    }
    return result;
}

int relay_run(relay_t *self, const serial_settings_t *settings) {
    compose(self, settings);
    int result = open_sockets(self);
    if (result == 0) {
        result = open_all(self);
    }
    if (result == 0 && !bridge_reach_is_local("iwheel-serial", NULL, 0)) {
        result = EX_UNAVAILABLE;
    }
    if (result == 0) {
        bridge_service_open(&self->service);
        sock_log(&self->log, SOCK_LOG_INFO, "%s at %u bit/s, clients on %s", settings->board.port,
                 (unsigned)settings->board.baud, settings->northbound.socket);
        result = loop(self);
        finish(self);
    }
    serial_port_close(&self->port);
    close_listeners(self);
    sock_log_close(&self->log);
    return result;
}
