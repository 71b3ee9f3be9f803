// SPDX-License-Identifier: MIT
/// What other machines can reach of this process: its internet sockets as the kernel reports them, not as a configuration names them.
///
/// A socket receives from other machines if it is a listening TCP socket, a UDP socket with a port and without a peer, or a raw socket; if
/// its address is not a loopback address; and if it is not bound to the interface `lo`. Only the sockets that are open now are read: call it
/// after the start of every library that opens some.
#ifndef BRIDGE_REACH_H
#define BRIDGE_REACH_H

#include <stdbool.h>
#include <stddef.h>

/// The text for one socket with its terminator.
#define BRIDGE_REACH_TEXT 128U

/// How many sockets of this process receive from other machines, without the `count` descriptors in `except` (NULL: there is none). The
/// address of one of them, or why the sockets cannot be read (then at least 1), is in `out_text`.
unsigned bridge_reach_count(const int *except, size_t count, char out_text[BRIDGE_REACH_TEXT]);

/// True if no socket receives from other machines, except those. Otherwise prints one line of `program` on stderr.
bool bridge_reach_is_local(const char *program, const int *except, size_t count);

/// Binds each socket that receives from other machines to the interface `lo`, and waits until it has passed on what it received before.
/// False, with errno: the kernel refuses it (before Linux 5.7), or a socket never became empty. It does not wait longer than a second.
bool bridge_reach_bind_lo(void);

#endif
