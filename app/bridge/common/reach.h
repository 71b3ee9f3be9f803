// SPDX-License-Identifier: MIT
/// Finds the internet sockets of this process that other machines can reach: as the kernel reports them, not as a
/// configuration names them.
///
/// A socket receives from other machines if it is a listening TCP socket, a UDP socket with a port and without a peer,
/// or a raw socket; if its address is not a loopback address; and if it is not bound to the interface `lo`. Only
/// sockets that are open now are read: call it after the start of every library that opens sockets.
#ifndef BRIDGE_REACH_H
#define BRIDGE_REACH_H

#include <stdbool.h>
#include <stddef.h>

/// Size of the text for one socket with its terminator.
#define BRIDGE_REACH_TEXT 128U

/// Returns the number of sockets of this process that receive from other machines, without the `count` descriptors in
/// `except` (NULL: none). Sets `out_text` to the address of one of them, or to the reason why the sockets cannot be
/// read (the result is then at least 1).
unsigned bridge_reach_count(const int *except, size_t count, char out_text[BRIDGE_REACH_TEXT]);

/// Returns true if no socket receives from other machines, except those. Otherwise prints one line of `program` on
/// stderr.
bool bridge_reach_is_local(const char *program, const int *except, size_t count);

/// Binds each socket that receives from other machines to the interface `lo`, and waits until its earlier input is
/// passed on, at most a second. Returns false with errno if the kernel refuses it (before Linux 5.7), or if a socket
/// did not become empty.
bool bridge_reach_bind_lo(void);

#endif
