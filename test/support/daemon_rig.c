// SPDX-License-Identifier: MIT
#include "daemon_rig.h"

#include "daemon.h"
#include "sockets/sock_clients.h"

#include "iwheel_linux/clock.h"
#include "iwheel_northbound/json_in.h"

#include "unity.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

/// Far later than any clock of the test machine, so its timers never expire.
#define START_US  UINT64_C(1000000000000000)
#define UPTIME_US UINT64_C(600000000)
#define REPLY_MS  20U

daemon_rig_t daemon_rig;

// The clocks ---------------------------------------------------------------------------------------------------------------

iw_time_us_t iwl_clock_now_us(void) {
    daemon_rig.now_us += daemon_rig.poll_takes_us;
    return daemon_rig.now_us;
}

iw_time_us_t iwl_clock_awake_us(iw_time_us_t suspended_us) {
    return daemon_rig.now_us + daemon_rig.suspended_us - suspended_us;
}

iw_time_us_t iwl_clock_read(iw_time_us_t *out_suspended_us) {
    *out_suspended_us = daemon_rig.suspended_us;
    return daemon_rig.now_us;
}

iw_time_us_t iwl_clock_suspended_us(void) {
    return daemon_rig.suspended_us;
}

int64_t iwl_clock_wall_us(void) {
    return (int64_t)(daemon_rig.now_us - START_US);
}

// Bus and button -----------------------------------------------------------------------------------------------------------

int iwl_bus_open(iwl_backend_store_t *self, const char *name) {
    (void)self;
    (void)name;
    return 0;
}

void iwl_bus_close(iwl_backend_store_t *self) {
    (void)self;
}

void iwl_bus_poll(iwl_backend_store_t *self, iw_time_us_t now_us) {
    (void)self;
    (void)now_us;
}

void iwl_bus_waited(iwl_backend_store_t *self, bool ready) {
    (void)self;
    (void)ready;
}

iw_time_us_t iwl_bus_next_us(const iwl_backend_store_t *self) {
    (void)self;
    return IW_NEVER;
}

static int send_one(daemon_rig_t *rig, const iw_can_frame_t *frame) {
    const iw_side_t side = (frame->id == IW_ID_LEFT_SETPOINT) ? IW_LEFT : IW_RIGHT;
    if (rig->bus < IW_BUS_PASSIVE) {
        return -1;
    }
    if (rig->full) {
        return 0;
    }
    rig->sent[side]++;
    rig->commanded_mm_s[side] = (int16_t)(frame->data[1] << 8 | frame->data[2]);
    rig->unmarked += (rig->commanded_mm_s[side] == 0 || daemon_rig_marked()) ? 0U : 1U;
    rig->most_mm_s =
        (abs(rig->commanded_mm_s[side]) > rig->most_mm_s) ? (int16_t)abs(rig->commanded_mm_s[side]) : rig->most_mm_s;
    rig->commanded_mA[side] = (int16_t)(frame->data[3] << 8 | frame->data[4]);
    rig->sent_us = rig->now_us;
    rig->sent_waits = rig->waits;
    sim_world_submit(&rig->world, rig->now_us, rig->port, frame);
    return 1;
}

int iwl_bus_send(iwl_backend_store_t *self, const iw_can_frame_t *frames, uint32_t count) {
    (void)self;
    for (uint32_t i = 0; i < count; i++) {
        const int result = send_one(&daemon_rig, &frames[i]);
        if (result <= 0) {
            return (i > 0U) ? (int)i : result;
        }
    }
    return (int)count;
}

int iwl_bus_receive(iwl_backend_store_t *self, iw_can_frame_t *out_frame) {
    daemon_rig_t *rig = &daemon_rig;
    (void)self;
    if (rig->rx_next == rig->rx_count) {
        rig->rx_next = rig->rx_count = 0;
        return 0;
    }
    *out_frame = rig->rx[rig->rx_next++];
    return 1;
}

iw_bus_state_t iwl_bus_state(iwl_backend_store_t *self) {
    (void)self;
    return daemon_rig.bus;
}

int iwl_bus_purge(iwl_backend_store_t *self) {
    (void)self;
    return 0;
}

static void rig_close(void *self) {
    (void)self;
}

static void rig_tend(void *self, iw_time_us_t now_us) {
    (void)self;
    (void)now_us;
}

static iw_time_us_t rig_next_us(const void *self) {
    (void)self;
    return IW_NEVER;
}

int iwl_bus_fd(const iwl_backend_store_t *self) {
    (void)self;
    return daemon_rig.bus_fd;
}

const iwl_bus_link_t *iwl_bus_link(const iwl_backend_store_t *self) {
    (void)self;
    return &daemon_rig.link;
}

static int rig_estop_fd(const void *self) {
    (void)self;
    return daemon_rig.estop_fd;
}

static int rig_pressed(void *self, bool quiet) {
    daemon_rig_t *rig = &daemon_rig;
    if (self == &rig->daemon->wheels.hal.estop2) {
        return rig->estop2;
    }
    const bool pulse = rig->estop_pulse && !quiet; // The port reads edges only after the wait has reported the line.
    rig->polls++;
    rig->unpolled_us = rig->now_us - rig->polled_us;
    rig->polled_us = rig->now_us;
    rig->estop_reported = rig->estop;
    rig->estop_pulse = rig->estop_pulse && quiet;
    return (rig->estop == 0 && pulse) ? 1 : rig->estop;
}

static int rig_trouble(const void *self) {
    (void)self;
    return (daemon_rig.estop < 0) ? ENODEV : 0;
}

static const iwl_estop_ops_t estop_ops = {.close = rig_close,
                                          .watch_fd = rig_estop_fd,
                                          .poll = rig_tend,
                                          .next_us = rig_next_us,
                                          .pressed = rig_pressed,
                                          .trouble = rig_trouble,
                                          .present = true};

// The wait -----------------------------------------------------------------------------------------------------------------

static void take_from_world(daemon_rig_t *rig) {
    sim_delivery_t delivery;
    while (sim_world_step(&rig->world, rig->now_us, &delivery)) {
        if (rig->rx_count < DAEMON_RX_MAX) {
            rig->rx[rig->rx_count] = delivery.frame;
            rig->rx[rig->rx_count++].kind = (delivery.port == rig->port) ? IW_CAN_ECHO : IW_CAN_RECEIVED;
        }
    }
}

/// Makes a descriptor readable or not.
static void show(int fd, bool readable) {
    const uint64_t one = 1;
    uint64_t count;
    if (readable) {
        (void)!write(fd, &one, sizeof one);
    } else {
        (void)!read(fd, &count, sizeof count);
    }
}

static int find_events(daemon_rig_t *rig, int fd, struct epoll_event *events, int max) {
    show(rig->bus_fd, rig->rx_next < rig->rx_count);
    show(rig->estop_fd, rig->estop_pulse || (rig->estop != rig->estop_reported && !rig->estop_silent));
    const int count = epoll_wait(fd, events, max, 0);
    return (count > 0) ? count : 0;
}

static iw_time_us_t earlier(iw_time_us_t a_us, iw_time_us_t b_us) {
    return (a_us < b_us) ? a_us : b_us;
}

int sock_wakeup_open(sock_wakeup_t *self) {
    *self = (sock_wakeup_t){.fd = epoll_create1(EPOLL_CLOEXEC)};
    return (self->fd < 0) ? errno : 0;
}

void sock_wakeup_close(sock_wakeup_t *self) {
    (void)close(self->fd);
}

int sock_wakeup_wait(const sock_wakeup_t *self, struct epoll_event *events, int max, iw_time_us_t now_us,
                     iw_time_us_t end_us) {
    daemon_rig_t *rig = &daemon_rig;
    rig->wait_from_us = now_us; // In this rig a cycle takes no time.
    rig->waits++;
    rig->now_us += rig->stolen_us;
    rig->stolen_us = 0;
    while (true) {
        take_from_world(rig);
        const int count = find_events(rig, self->fd, events, max);
        if (count > 0 || (rig->now_us >= end_us && rig->now_us < rig->until_us)) {
            rig->estop_pulse = rig->estop_pulse || (rig->estop_late && count > 0);
            rig->estop_late = rig->estop_late && count == 0;
            return count;
        }
        if (rig->now_us >= rig->until_us) {
            errno = ECANCELED; // Ends the loop without a cycle.
            return -1;
        }
        const iw_time_us_t next_us = earlier(earlier(sim_world_wake_us(&rig->world), end_us), rig->until_us);
        rig->now_us = (next_us > rig->now_us) ? next_us : rig->now_us + 1U;
    }
}

// The rig ------------------------------------------------------------------------------------------------------------------

static int listen_somewhere(void) {
    const struct sockaddr_un address = {.sun_family = AF_UNIX};
    const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0);
    TEST_ASSERT_EQUAL_INT(0, bind(fd, (const struct sockaddr *)&address, sizeof address.sun_family)); // Any free name.
    TEST_ASSERT_EQUAL_INT(0, listen(fd, 128));
    return fd;
}

static void begin_core(gw_daemon_t *daemon) {
    gw_wheels_t *wheels = &daemon->wheels;
    wheels->hal = (iwl_hal_t){.estop_ops = &estop_ops, .estop_last = -1};
    wheels->now_us = daemon_rig.now_us;
    daemon->loop.suspended_us = daemon_rig.suspended_us;
    TEST_ASSERT_EQUAL_INT(IW_CONFIG_OK, gw_wheels_begin(wheels, &daemon->config.core, daemon->box.ring,
                                                        gw_runtime_crashed(&daemon->runtime)));
    gw_bus_facts_follow(&daemon->facts, wheels, false);
}

void daemon_rig_start(void) {
    daemon_rig_t *rig = &daemon_rig;
    gw_daemon_t *daemon = (gw_daemon_t *)calloc(1, sizeof *daemon);
    rig->daemon = daemon;
    gateway_config_default(&daemon->config);
    fixture_config(&daemon->config.core);
    daemon->config.core.hold = rig->hold;
    (void)snprintf(daemon->config.bus.interface, sizeof daemon->config.bus.interface, "unix:%.60s/bus", rig->folder);
    sock_log_open(&daemon->log, SOCK_LOG_ERROR);
    gw_daemon_compose(daemon);
    TEST_ASSERT_EQUAL_INT(0, gw_runtime_open(&daemon->runtime, daemon->config.bus.interface,
                                             daemon->config.northbound.socket, rig->folder, stderr));
    TEST_ASSERT_EQUAL_INT(0, gw_box_open(&daemon->box, &(gw_box_config_t){.blackbox_s = 0}));
    for (unsigned right = 0; right < SOCK_RIGHTS; right++) {
        daemon->clients.listener[right] =
            (sock_listener_t){.config = {.right = (sock_right_t)right}, .fd = listen_somewhere(), .reserve_fd = -1};
    }
    daemon->assumptions.answered = true; // This rig has no assumption store.
    daemon->assumptions.write_us = IW_NEVER;
    begin_core(daemon);
    TEST_ASSERT_EQUAL_INT(0, gw_loop_open(daemon));
    gw_notify_open(&daemon->notify);
}

void daemon_rig_crash(void) {
    gw_daemon_t *daemon = daemon_rig.daemon;
    for (uint32_t i = 0; i < SOCK_CLIENTS_MAX; i++) {
        if (daemon->clients.client[i].id != IW_CLIENT_NONE) {
            (void)close(daemon->clients.client[i].fd);
        }
    }
    gw_loop_close(daemon);
    gw_notify_close(&daemon->notify);
    for (unsigned right = 0; right < SOCK_RIGHTS; right++) {
        (void)close(daemon->clients.listener[right].fd);
        if (daemon->clients.listener[right].reserve_fd >= 0) {
            (void)close(daemon->clients.listener[right].reserve_fd);
        }
    }
    gw_box_close(&daemon->box);
    gw_runtime_close(&daemon->runtime);
    sock_log_close(&daemon->log);
    free(daemon);
    daemon_rig.daemon = NULL;
}

void daemon_rig_begin(void) {
    daemon_rig_t *rig = &daemon_rig;
    sim_pair_config_t pair;
    *rig = (daemon_rig_t){.now_us = START_US,
                          .bus = IW_BUS_ACTIVE,
                          .link = {.presence = IWL_LINK_LOCAL, .is_virtual = true, .echo_proven = true},
                          .folder = "/tmp/iwheel-daemon-XXXXXX"};
    TEST_ASSERT_NOT_NULL(mkdtemp(rig->folder));
    rig->bus_fd = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
    rig->estop_fd = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
    sim_pair_default(&pair);
    pair.age_us = UPTIME_US;
    sim_world_init(&rig->world, &pair, rig->now_us, 1);
    rig->port = sim_world_connect(&rig->world);
    daemon_rig_start();
    daemon_rig_run(1100);
}

void daemon_rig_end(void) {
    char path[128];
    if (daemon_rig.daemon != NULL) {
        daemon_rig_crash();
    }
    static const char *const left[] = {"bus.armed", "bus.gateway-lock", ""};
    for (size_t i = 0; i < sizeof left / sizeof left[0]; i++) {
        (void)snprintf(path, sizeof path, "%s/%s", daemon_rig.folder, left[i]);
        (void)remove(path);
    }
    (void)close(daemon_rig.bus_fd);
    (void)close(daemon_rig.estop_fd);
}

void daemon_rig_run(unsigned for_ms) {
    daemon_rig.until_us = daemon_rig.now_us + daemon_rig.stolen_us + MS(for_ms);
    daemon_rig.ended = gw_loop_run(daemon_rig.daemon) == 0;
}

int daemon_rig_knock(sock_right_t right) {
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    socklen_t length = sizeof address;
    const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0);
    TEST_ASSERT_EQUAL_INT(
        0, getsockname(daemon_rig.daemon->clients.listener[right].fd, (struct sockaddr *)&address, &length));
    TEST_ASSERT_EQUAL_INT(0, connect(fd, (const struct sockaddr *)&address, length));
    return fd;
}

int daemon_rig_connect_with(sock_right_t right) {
    const int fd = daemon_rig_knock(right);
    daemon_rig_run(2);
    return fd;
}

int daemon_rig_connect(void) {
    return daemon_rig_connect_with(SOCK_DRIVE);
}

void daemon_rig_send(int client, const char *lines) {
    TEST_ASSERT_EQUAL_INT((int)strlen(lines), (int)send(client, lines, strlen(lines), MSG_NOSIGNAL));
}

const char *daemon_rig_receive(int client) {
    static char text[1U << 20];
    const ssize_t length = recv(client, text, sizeof text - 1U, MSG_DONTWAIT);
    text[(length > 0) ? length : 0] = '\0';
    return text;
}

unsigned daemon_rig_count(const char *text, const char *words) {
    unsigned count = 0;
    for (const char *at = strstr(text, words); at != NULL; at = strstr(at + 1, words)) {
        count++;
    }
    return count;
}

/// Asserts that a line of the gateway is correct JSON.
static void assert_json(const char *line, size_t length) {
    static iwn_work_t work;
    static char why[128];
    iwn_json_t root;
    iwn_text_t fault = iwn_text_begin(why, sizeof why);
    TEST_ASSERT_TRUE_MESSAGE(iwn_json_check(line, length, &work, &root, &fault), why);
}

/// Reads one complete line without its end. Returns false if there is none.
static bool take_line(int client, char *out_line, size_t size) {
    const ssize_t seen = recv(client, out_line, size - 1U, MSG_PEEK | MSG_DONTWAIT);
    const char *end = (seen > 0) ? (const char *)memchr(out_line, '\n', (size_t)seen) : NULL;
    if (end == NULL) {
        return false;
    }
    const size_t length = (size_t)(end - out_line) + 1U;
    (void)recv(client, out_line, length, MSG_DONTWAIT);
    assert_json(out_line, length - 1U);
    out_line[length - 1U] = '\0';
    return true;
}

const char *daemon_rig_ask(int client, const char *line) {
    char *reply = daemon_rig.reply;
    while (take_line(client, reply, sizeof daemon_rig.reply)) { // Earlier replies.
    }
    daemon_rig_send(client, line);
    daemon_rig_send(client, "\n");
    for (unsigned ms = 0; ms < REPLY_MS; ms++) {
        daemon_rig_run(1);
        while (take_line(client, reply, sizeof daemon_rig.reply)) {
            if (strstr(reply, "\"ok\":") != NULL) {
                return reply;
            }
        }
    }
    reply[0] = '\0';
    return reply;
}

void daemon_rig_arm(int client) {
    const char *reply = daemon_rig_ask(client, "{\"cmd\":\"arm\"}");
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(reply, "\"ok\":true"), reply);
    TEST_ASSERT_EQUAL_INT(IW_STATE_ARMED, daemon_rig_state());
}

void daemon_rig_drive(int client, int left_mm_s, int right_mm_s, unsigned for_ms) {
    char line[96];
    (void)snprintf(line, sizeof line, "{\"cmd\":\"drive\",\"left_mm_s\":%d,\"right_mm_s\":%d}", left_mm_s, right_mm_s);
    const iw_time_us_t until_us = daemon_rig.now_us + MS(for_ms);
    while (daemon_rig.now_us < until_us) {
        const iw_time_us_t begin_us = daemon_rig.now_us;
        const char *reply = daemon_rig_ask(client, line);
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(reply, "\"ok\":true"), reply);
        const unsigned used_ms = (unsigned)((daemon_rig.now_us - begin_us) / IW_US_PER_MS);
        daemon_rig_run((used_ms < 20U) ? 20U - used_ms : 1U);
    }
}

void daemon_rig_keep_log(void) {
    sock_log_t *log = &daemon_rig.daemon->log;
    sock_log_close(log);
    char path[] = "/tmp/iwheel-log-XXXXXX";
    log->fd = mkstemp(path);
    TEST_ASSERT_GREATER_OR_EQUAL_INT(0, log->fd);
    (void)unlink(path);
    log->level = SOCK_LOG_INFO;
}

const char *daemon_rig_log(void) {
    static char text[8192];
    const ssize_t length = pread(daemon_rig.daemon->log.fd, text, sizeof text - 1U, 0);
    TEST_ASSERT_GREATER_OR_EQUAL_INT(0, (int)length);
    text[length] = '\0';
    return text;
}

unsigned daemon_rig_logged(const char *words) {
    return daemon_rig_count(daemon_rig_log(), words);
}

bool daemon_rig_marked(void) {
    char path[128];
    (void)snprintf(path, sizeof path, "%s/bus.armed", daemon_rig.folder);
    return access(path, F_OK) == 0;
}

iw_state_t daemon_rig_state(void) {
    return iw_gateway_state(&daemon_rig.daemon->wheels.core);
}

void daemon_rig_begin_driving(int client) {
    daemon_rig_arm(client);
    daemon_rig_drive(client, 500, 500, 1000);
    TEST_ASSERT_EQUAL_INT(500, daemon_rig.commanded_mm_s[IW_LEFT]);
    TEST_ASSERT_EQUAL_INT(500, daemon_rig.commanded_mm_s[IW_RIGHT]);
}

bool daemon_rig_commands_zero(void) {
    return daemon_rig.commanded_mm_s[IW_LEFT] == 0 && daemon_rig.commanded_mm_s[IW_RIGHT] == 0;
}
