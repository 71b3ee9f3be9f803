// SPDX-License-Identifier: MIT
/// The serial port: opened for this program only, set to eight bits without translation, and written without waiting.
#ifndef SERIAL_PORT_H
#define SERIAL_PORT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/types.h>

/// Time of 500 bytes at 115200 bit/s.
#define SERIAL_PORT_LAST_MS 50U

typedef struct {
    int fd; ///< Descriptor; -1 if not open.
} serial_port_t;

/// Opens `path` with this bit rate. Returns 0, or an errno with cause and fix in `out_why`. EBUSY: another program has
/// it. Waiting bytes are dropped.
int serial_port_open(serial_port_t *self, const char *path, uint32_t baud, char *out_why, size_t size);
/// Closes it and drops the bytes that were not sent.
void serial_port_close(serial_port_t *self);
/// Closes it after the kernel has sent the last bytes, for which it waits at most SERIAL_PORT_LAST_MS. Returns false if
/// bytes were dropped. Does nothing if it is not open.
bool serial_port_end(serial_port_t *self);

/// Returns the number of bytes, 0 if there are none now, -1 if the port is gone.
ssize_t serial_port_read(const serial_port_t *self, char *out, size_t size);
ssize_t serial_port_write(const serial_port_t *self, const char *bytes, size_t length);

/// Drops the bytes that the kernel has not sent yet.
void serial_port_discard(const serial_port_t *self);

/// Returns true if a port can be set to this rate.
bool serial_port_has_baud(uint32_t baud);

#endif
