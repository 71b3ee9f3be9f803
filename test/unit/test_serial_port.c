// SPDX-License-Identifier: MIT
// The end of the serial port: the last lines are sent, and the end takes a bounded time. The kernel is replaced.
#include "serial_port.h"

#include "unit.h"

#include <fcntl.h>
#include <stdarg.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <time.h>

static serial_port_t port;
static int queued;      ///< Bytes that the kernel has not sent yet.
static int sent_per_ms; ///< Bytes that it sends in a millisecond.
static unsigned pauses_ms;
static unsigned flushes;

int ioctl(int fd, unsigned long request, ...) {
    (void)fd;
    if (request == TIOCOUTQ) {
        va_list arguments;
        va_start(arguments, request);
        *va_arg(arguments, int *) = queued;
        va_end(arguments);
    }
    return 0;
}

int tcflush(int fd, int which) {
    (void)fd;
    flushes += (which == TCIOFLUSH) ? 1U : 0U;
    return 0;
}

int nanosleep(const struct timespec *span, struct timespec *left) {
    (void)left;
    TEST_ASSERT_EQUAL_INT(1000000, span->tv_nsec);
    pauses_ms++;
    queued = (queued > sent_per_ms) ? queued - sent_per_ms : 0;
    return 0;
}

void setUp(void) {
    port.fd = open("/dev/null", O_RDWR | O_CLOEXEC);
    queued = sent_per_ms = 0;
    pauses_ms = flushes = 0;
}

TEST(test_port_end_waits_until_the_last_bytes_are_sent) {
    queued = 100;
    sent_per_ms = 11;
    TEST_ASSERT_TRUE(serial_port_end(&port));
    TEST_ASSERT_EQUAL_UINT(10, pauses_ms);
    TEST_ASSERT_EQUAL_UINT(0, flushes);
    TEST_ASSERT_EQUAL_INT(-1, port.fd);
}

/// Without the flush the close would wait for the bytes.
TEST(test_port_end_drops_what_is_not_sent_in_time) {
    queued = 100;
    TEST_ASSERT_FALSE(serial_port_end(&port));
    TEST_ASSERT_EQUAL_UINT(SERIAL_PORT_LAST_MS, pauses_ms);
    TEST_ASSERT_EQUAL_UINT(1, flushes);
    TEST_ASSERT_EQUAL_INT(-1, port.fd);
}

TEST(test_port_end_of_a_closed_port_does_nothing) {
    serial_port_close(&port);
    TEST_ASSERT_TRUE(serial_port_end(&port));
    TEST_ASSERT_EQUAL_UINT(1, flushes);
    TEST_ASSERT_EQUAL_UINT(0, pauses_ms);
}
