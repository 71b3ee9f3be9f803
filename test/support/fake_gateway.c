// SPDX-License-Identifier: MIT
#include "fake_gateway.h"

#include "unity.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

void fake_gateway_open(fake_gateway_t *self) {
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    *self = (fake_gateway_t){.greets = true};
    for (int i = 0; i < FAKE_CONNECTIONS; i++) {
        self->fd[i] = -1;
    }
    (void)snprintf(self->path, sizeof self->path, "%s/iwheel-fake-%d.sock",
                   (getenv("TMPDIR") != NULL) ? getenv("TMPDIR") : "/tmp", (int)getpid());
    (void)unlink(self->path);
    (void)snprintf(address.sun_path, sizeof address.sun_path, "%s", self->path);
    self->listen_fd = socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    TEST_ASSERT_EQUAL(0, bind(self->listen_fd, (const struct sockaddr *)&address, sizeof address));
    TEST_ASSERT_EQUAL(0, listen(self->listen_fd, 8));
}

void fake_gateway_close(fake_gateway_t *self) {
    for (int i = 0; i < self->count; i++) {
        fake_gateway_hang_up(self, i);
    }
    if (self->listen_fd >= 0) {
        (void)close(self->listen_fd);
        self->listen_fd = -1;
    }
    (void)unlink(self->path);
}

void fake_gateway_accept(fake_gateway_t *self) {
    int fd = -1;
    while (self->count < FAKE_CONNECTIONS &&
           (fd = accept4(self->listen_fd, NULL, NULL, SOCK_NONBLOCK | SOCK_CLOEXEC)) >= 0) {
        char hello[160];
        self->fd[self->count++] = fd;
        (void)snprintf(hello, sizeof hello,
                       "{\"event\":\"hello\",\"t_us\":1,\"name\":\"iwheel-gateway\",\"api\":1,\"client\":%d,\"rights\":"
                       "\"drive\"}",
                       self->count);
        if (self->greets) {
            fake_gateway_send(self, self->count - 1, hello);
        }
    }
}

bool fake_gateway_read(fake_gateway_t *self, int connection, char *out, size_t size) {
    size_t length = 0;
    char byte = 0;
    while (self->fd[connection] >= 0 && recv(self->fd[connection], &byte, 1, MSG_DONTWAIT) == 1) {
        if (byte == '\n') {
            out[length] = '\0';
            return true;
        }
        TEST_ASSERT_TRUE(length + 1U < size);
        out[length++] = byte;
    }
    TEST_ASSERT_EQUAL_MESSAGE(0, length, "half a line");
    return false;
}

bool fake_gateway_is_closed(const fake_gateway_t *self, int connection) {
    char byte = 0;
    return self->fd[connection] < 0 || recv(self->fd[connection], &byte, 1, MSG_DONTWAIT | MSG_PEEK) == 0;
}

void fake_gateway_reply(fake_gateway_t *self, int connection, const char *line, bool ok, const char *fields) {
    char reply[512];
    const long id = strtol(strstr(line, "\"id\":") + 5, NULL, 10);
    (void)snprintf(reply, sizeof reply, "{\"id\":%ld,\"ok\":%s%s}", id, ok ? "true" : "false", fields);
    fake_gateway_send(self, connection, reply);
}

void fake_gateway_send(fake_gateway_t *self, int connection, const char *line) {
    char text[600];
    const int length = snprintf(text, sizeof text, "%s\n", line);
    (void)send(self->fd[connection], text, (size_t)length, MSG_NOSIGNAL | MSG_DONTWAIT);
}

void fake_gateway_hang_up(fake_gateway_t *self, int connection) {
    if (self->fd[connection] >= 0) {
        (void)close(self->fd[connection]);
        self->fd[connection] = -1;
    }
}
