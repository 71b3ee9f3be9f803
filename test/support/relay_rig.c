// SPDX-License-Identifier: MIT
#include "relay_rig.h"

#include "iwheel_linux/clock.h"

#include "unity.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#define STEP_MS 1U
#define FOLDER  "/tmp/serial_relay_XXXXXX"

relay_t relay;
serial_settings_t settings;
uint64_t now_us;
char folder[] = FOLDER;
char to_relay[8192]; // Bytes that the board has written and the relay has not read yet.
size_t to_relay_length;
char to_board[65536]; // All bytes that the relay has written.
static size_t to_board_length;
bool port_is_full;
bool port_is_missing;
int client_fd;
unsigned step;
char received[1024];
char guest_got[512];
bool guest_is_closed;
static int guest_fd = -1;
static bool (*script)(void); // Called before each wait; true: the relay ends.

// ---- replacements of the port, the clock and the wait -------------------------------------------------------------

iw_time_us_t iwl_clock_now_us(void) {
    return now_us;
}

iw_time_us_t iwl_clock_awake_us(iw_time_us_t suspended_us) {
    return now_us - suspended_us;
}

iw_time_us_t iwl_clock_read(iw_time_us_t *out_suspended_us) {
    *out_suspended_us = 0;
    return now_us;
}

iw_time_us_t iwl_clock_suspended_us(void) {
    return 0;
}

int64_t iwl_clock_wall_us(void) {
    return (int64_t)now_us;
}

int serial_port_open(serial_port_t *self, const char *path, uint32_t baud, char *out_why, size_t size) {
    (void)path;
    (void)baud;
    if (port_is_missing) {
        (void)snprintf(out_why, size, "port: plug the board in");
        self->fd = -1;
        return ENOENT;
    }
    self->fd = eventfd(0, EFD_CLOEXEC);
    return 0;
}

void serial_port_close(serial_port_t *self) {
    if (self->fd >= 0) {
        (void)close(self->fd);
    }
    self->fd = -1;
}

bool serial_port_end(serial_port_t *self) {
    serial_port_close(self);
    return true;
}

ssize_t serial_port_read(const serial_port_t *self, char *out, size_t size) {
    const size_t count = (to_relay_length < size) ? to_relay_length : size;
    (void)self;
    memcpy(out, to_relay, count);
    memmove(to_relay, &to_relay[count], to_relay_length - count);
    to_relay_length -= count;
    return (ssize_t)count;
}

ssize_t serial_port_write(const serial_port_t *self, const char *bytes, size_t length) {
    (void)self;
    if (port_is_full) {
        return 0;
    }
    TEST_ASSERT_TRUE(to_board_length + length < sizeof to_board);
    memcpy(&to_board[to_board_length], bytes, length);
    to_board_length += length;
    to_board[to_board_length] = '\0';
    return (ssize_t)length;
}

void serial_port_discard(const serial_port_t *self) {
    (void)self;
}

bool serial_port_has_baud(uint32_t baud) {
    return baud > 0U;
}

int sock_wakeup_open(sock_wakeup_t *self) {
    self->fd = epoll_create1(EPOLL_CLOEXEC);
    return 0;
}

void sock_wakeup_close(sock_wakeup_t *self) {
    (void)close(self->fd);
}

int sock_wakeup_wait(const sock_wakeup_t *self, struct epoll_event *events, int max, iw_time_us_t read_us,
                     iw_time_us_t until_us) {
    (void)read_us;
    (void)until_us;
    now_us += STEP_MS * 1000U;
    const bool ends = script();
    step++;
    int count = epoll_wait(self->fd, events, max - 2, 0);
    if (to_relay_length > 0U) {
        events[count++] = (struct epoll_event){.events = EPOLLIN, .data = {.u64 = SOCK_TAG_BUS}};
    }
    if (ends) {
        events[count++] = (struct epoll_event){.events = EPOLLIN, .data = {.u64 = SOCK_TAG_SIGNAL}};
    }
    return count;
}

// ---- the board and a client ---------------------------------------------------------------------------------------

void board_writes(uint8_t channel, uint64_t t_us, const char *json) {
    const iwn_line_t line = {.channel = channel, .stamped = true, .t_us = t_us, .json = json, .length = strlen(json)};
    to_relay_length += iwn_line_write(&line, &to_relay[to_relay_length], sizeof to_relay - to_relay_length);
}

void board_links(uint64_t t_us) {
    board_writes(0, t_us, "{\"event\":\"link\",\"boot\":\"" BOOT "\",\"version\":\"1\"}");
}

void board_answers(uint8_t channel, const char *words, const char *rest) {
    char text[128];
    const char *at = NULL;
    for (const char *next = to_board; (next = strstr(next, words)) != NULL; next++) {
        at = next;
    }
    TEST_ASSERT_NOT_NULL_MESSAGE(at, to_board);
    while (strncmp(at, "{\"id\":", 6) != 0) {
        TEST_ASSERT_TRUE(at > to_board);
        at--;
    }
    (void)snprintf(text, sizeof text, "{\"id\":%u,\"ok\":%s}", (unsigned)strtoul(&at[6], NULL, 10), rest);
    board_writes(channel, EARLY + 2 + step, text);
}

void connect_to(const char *path) {
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    (void)snprintf(address.sun_path, sizeof address.sun_path, "%s", path);
    client_fd = socket(AF_UNIX, SOCK_STREAM, 0);
    TEST_ASSERT_EQUAL_INT(0, connect(client_fd, (struct sockaddr *)&address, sizeof address));
}

void client_connects(void) {
    connect_to(settings.northbound.socket);
}

void client_writes(const char *line) {
    TEST_ASSERT_EQUAL_INT(strlen(line), write(client_fd, line, strlen(line)));
}

unsigned count_in(const char *text, const char *words) {
    unsigned count = 0;
    for (const char *at = text; (at = strstr(at, words)) != NULL; at++) {
        count++;
    }
    return count;
}

unsigned written(const char *words) {
    return count_in(to_board, words);
}

int run_code(bool (*play)(void)) {
    script = play;
    return relay_run(&relay, &settings);
}

void run(bool (*play)(void)) {
    TEST_ASSERT_EQUAL_INT(0, run_code(play));
}

void setUp(void) {
    memcpy(folder, FOLDER, sizeof FOLDER);
    TEST_ASSERT_NOT_NULL(mkdtemp(folder));
    now_us = 10000000;
    to_relay_length = to_board_length = 0;
    to_board[0] = '\0';
    port_is_full = port_is_missing = false;
    client_fd = -1;
    step = 0;
    settings = serial_settings_standard;
    settings.northbound.group[0] = '\0';
    settings.northbound.mode = 0600;
    (void)snprintf(settings.northbound.socket, sizeof settings.northbound.socket, "%s/drive", folder);
    (void)snprintf(settings.northbound.watch_socket, sizeof settings.northbound.watch_socket, "none");
}

void tearDown(void) {
    if (client_fd >= 0) {
        (void)close(client_fd);
    }
    (void)rmdir(folder);
}

void client_closes(void) {
    (void)close(client_fd);
    client_fd = -1;
}

void begin_with_the_board(void) {
    if (step == 2U) {
        board_links(EARLY);
    }
    if (step % 1000U == 999U) {
        board_links(EARLY + step);
    }
}

void begin_with_a_client(void) {
    begin_with_the_board();
    if (step == 10U) {
        client_connects();
    }
    if (step == 20U) {
        board_writes(1, EARLY + 1, "{\"event\":\"hello\"}");
    }
}

void client_receives(void) {
    const ssize_t length = recv(client_fd, received, sizeof received - 1U, MSG_DONTWAIT);
    received[(length > 0) ? length : 0] = '\0';
}

void guest_sends(const char *line) {
    const int owner = client_fd;
    client_connects();
    guest_fd = client_fd;
    client_fd = owner;
    TEST_ASSERT_EQUAL_INT(strlen(line), write(guest_fd, line, strlen(line)));
}

void guest_closes(void) {
    (void)close(guest_fd);
}

void guest_reads(void) {
    char byte;
    const ssize_t length = recv(guest_fd, guest_got, sizeof guest_got - 1U, MSG_DONTWAIT);
    guest_got[(length > 0) ? length : 0] = '\0';
    guest_is_closed = recv(guest_fd, &byte, 1U, MSG_DONTWAIT) == 0;
    guest_closes();
}
