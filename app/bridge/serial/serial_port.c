// SPDX-License-Identifier: MIT
#include "serial_port.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

static const struct {
    uint32_t baud;
    speed_t speed;
} speeds[] = {{115200, B115200}, {230400, B230400},   {460800, B460800},   {500000, B500000},   {576000, B576000},
              {921600, B921600}, {1000000, B1000000}, {1152000, B1152000}, {1500000, B1500000}, {2000000, B2000000}};

static speed_t speed_of(uint32_t baud) {
    for (size_t i = 0; i < sizeof speeds / sizeof speeds[0]; i++) {
        if (speeds[i].baud == baud) {
            return speeds[i].speed;
        }
    }
    return B0;
}

bool serial_port_has_baud(uint32_t baud) {
    return speed_of(baud) != B0;
}

/// Parses a line of /proc/locks, such as "1: FLOCK  ADVISORY  WRITE 4711 00:1c:23 0 EOF". Returns the process that
/// locks this file; 0 if the line is about another file.
static long holder_in(char *line, const struct stat *status) {
    char *rest = line;
    char *word[6];
    for (unsigned i = 0; i < 6U; i++) {
        word[i] = strtok_r((i == 0U) ? line : NULL, " ", &rest);
        if (word[i] == NULL) {
            return 0;
        }
    }
    char *end;
    const unsigned long major_number = strtoul(word[5], &end, 16);
    const unsigned long minor_number = (*end == ':') ? strtoul(end + 1, &end, 16) : 0U;
    const unsigned long long inode = (*end == ':') ? strtoull(end + 1, NULL, 10) : 0U;
    const bool ours = strcmp(word[1], "FLOCK") == 0 && inode == status->st_ino &&
                      makedev((unsigned)major_number, (unsigned)minor_number) == status->st_dev;
    return ours ? strtol(word[4], NULL, 10) : 0;
}

/// Returns the process that holds the lock of this port, by the kernel's list; 0 if unknown.
static long holder_of(const char *path) {
    struct stat status;
    char line[256];
    long found = 0;
    FILE *locks = (stat(path, &status) == 0) ? fopen("/proc/locks", "re") : NULL;
    while (locks != NULL && found == 0 && fgets(line, sizeof line, locks) != NULL) {
        found = holder_in(line, &status);
    }
    if (locks != NULL) {
        (void)fclose(locks);
    }
    return found;
}

static int complain(const char *path, int error, char *out_why, size_t size) {
    const char *fix = "choose another with [board] port";
    if (error == EBUSY || error == EWOULDBLOCK) {
        const long pid = holder_of(path);
        char name[32] = "another program";
        if (pid > 0) {
            (void)snprintf(name, sizeof name, "process %ld", pid);
        }
        (void)snprintf(out_why, size, "%s already uses %s, and two relays cannot share a port; end that one, or %s",
                       name, path, fix);
        return EBUSY;
    }
    if (error == EACCES || error == EPERM) {
        fix = "run as a user in its group: usermod -aG dialout USER";
    } else if (error == ENOENT || error == ENXIO || error == ENODEV) {
        fix = "plug the board in, or name its port with [board] port (ls /dev/serial/by-id)";
    } else if (error == ENOTTY) {
        fix = "it is not a serial port; name one with [board] port (ls /dev/serial/by-id)";
    }
    (void)snprintf(out_why, size, "port %s: %s; %s", path, strerror(error), fix);
    return error;
}

/// Sets 8N1 without translation and without modem lines: the relay must not reset the board by DTR.
static int configure(int fd, uint32_t baud) {
    struct termios mode;
    const speed_t speed = speed_of(baud);
    if (tcgetattr(fd, &mode) != 0) {
        return errno;
    }
    cfmakeraw(&mode);
    mode.c_cflag &= ~(tcflag_t)(CSTOPB | CRTSCTS | HUPCL);
    mode.c_cflag |= (tcflag_t)(CLOCAL | CREAD);
    mode.c_cc[VMIN] = 1; // So that 0 bytes mean that the port is gone.
    mode.c_cc[VTIME] = 0;
    if (cfsetispeed(&mode, speed) != 0 || cfsetospeed(&mode, speed) != 0 || tcsetattr(fd, TCSANOW, &mode) != 0 ||
        tcgetattr(fd, &mode) != 0) {
        return errno;
    }
    return (cfgetospeed(&mode) == speed) ? 0 : EINVAL; // tcsetattr succeeds if any part of it did.
}

/// The lock excludes another relay of any user. The exclusive mode excludes all programs except those of root that open
/// the port later.
static int claim(int fd) {
    if (flock(fd, LOCK_EX | LOCK_NB) != 0) {
        return errno;
    }
    return (ioctl(fd, TIOCEXCL) == 0) ? 0 : errno;
}

int serial_port_open(serial_port_t *self, const char *path, uint32_t baud, char *out_why, size_t size) {
    self->fd = open(path, O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    int error = (self->fd < 0) ? errno : claim(self->fd);
    if (error == 0) {
        error = configure(self->fd, baud);
    }
    if (error != 0) {
        serial_port_close(self);
        return complain(path, error, out_why, size);
    }
    (void)tcflush(self->fd, TCIOFLUSH);
    return 0;
}

static void release(serial_port_t *self) {
    (void)ioctl(self->fd, TIOCNXCL);
    (void)close(self->fd);
    self->fd = -1;
}

void serial_port_close(serial_port_t *self) {
    if (self->fd >= 0) {
        (void)tcflush(self->fd, TCIOFLUSH); // Otherwise the last close waits for a cable without a reader.
        release(self);
    }
}

/// Returns false if the number is unknown.
static bool has_sent_all(const serial_port_t *self) {
    int left = 0;
    return ioctl(self->fd, TIOCOUTQ, &left) == 0 && left == 0;
}

/// A flush would also drop bytes that the other end of a pseudo terminal has not read, so there is none after the last
/// byte.
bool serial_port_end(serial_port_t *self) {
    const struct timespec pause = {.tv_nsec = 1000000};
    if (self->fd < 0) {
        return true;
    }
    for (unsigned i = 0; i < SERIAL_PORT_LAST_MS && !has_sent_all(self); i++) {
        (void)nanosleep(&pause, NULL);
    }
    if (!has_sent_all(self)) {
        serial_port_close(self);
        return false;
    }
    release(self);
    return true;
}

/// Returns the number of bytes of a call. Nothing for now is not an error.
static ssize_t moved(ssize_t count) {
    return (count >= 0) ? count : (errno == EAGAIN || errno == EINTR) ? 0 : -1;
}

ssize_t serial_port_read(const serial_port_t *self, char *out, size_t size) {
    const ssize_t count = read(self->fd, out, size);
    return (count == 0) ? -1 : moved(count);
}

ssize_t serial_port_write(const serial_port_t *self, const char *bytes, size_t length) {
    return moved(write(self->fd, bytes, length));
}

void serial_port_discard(const serial_port_t *self) {
    (void)tcflush(self->fd, TCOFLUSH);
}
