// SPDX-License-Identifier: MIT
/// Which gateway is meant when nobody said so?
#ifndef FIND_SOCKET_H
#define FIND_SOCKET_H

#include <stddef.h>

/// Where gateways put their sockets, one per bus.
#define FIND_SOCKET_DIRECTORY "/run/iwheel"

typedef enum {
    FIND_SOCKET_ONE = 0,
    FIND_SOCKET_NONE,
    FIND_SOCKET_SEVERAL, ///< `out` has their paths, separated by blanks, as far as they fit.
    FIND_SOCKET_DENIED,  ///< The directory may not be read.
} find_socket_t;

/// Looks for sockets named *.sock in `directory`. With FIND_SOCKET_ONE its path is in `out`.
find_socket_t find_socket(const char *directory, char *out, size_t size);

#endif
