// SPDX-License-Identifier: MIT
/// The serial port: opened for this program alone, set to eight bits without any translation, and written to without ever waiting.
#ifndef SERIAL_PORT_H
#define SERIAL_PORT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/types.h>

typedef struct {
    int fd; ///< -1: not open.
} serial_port_t;

/// Opens `path` with this many bits a second. 0; or an errno, with cause and cure in `out_why`: EBUSY means that another program
/// has it. What waits in it is thrown away.
int serial_port_open(serial_port_t *self, const char *path, uint32_t baud, char *out_why, size_t size);
void serial_port_close(serial_port_t *self);

/// Bytes, 0 if there are none for now, -1 if the port has gone.
ssize_t serial_port_read(const serial_port_t *self, char *out, size_t size);
ssize_t serial_port_write(const serial_port_t *self, const char *bytes, size_t length);

/// Throws away what the kernel has not sent yet.
void serial_port_discard(const serial_port_t *self);

/// True if a port can be set to this rate.
bool serial_port_has_baud(uint32_t baud);

#endif
