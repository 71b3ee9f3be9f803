// SPDX-License-Identifier: MIT
/// A connection to a unix socket that reconnects automatically.
///
///     DOWN --due: connect works--> UP --hang-up or error--> DOWN (attempts: immediately, then after each back-off)
///
/// The back-off doubles from IWL_UNIX_LINK_RETRY_MIN_US to IWL_UNIX_LINK_RETRY_MAX_US and is reset by every success.
/// The owner watches the epoll set, which is the same for all connections.
#ifndef IWL_UNIX_LINK_H
#define IWL_UNIX_LINK_H

#include "iwheel/types.h"

#define IWL_UNIX_LINK_RETRY_MIN_US 20000U
#define IWL_UNIX_LINK_RETRY_MAX_US 200000U

typedef struct {
    const char *path;
    iw_time_us_t retry_us; ///< Time of the next attempt; IW_NEVER while up.
    uint32_t backoff_us;
    int type; ///< SOCK_STREAM or SOCK_SEQPACKET.
    int watch_fd;
    int fd; ///< Descriptor; -1 if down.
} iwl_unix_link_t;

/// Returns true for `unix:PATH`.
bool iwl_unix_link_is_name(const char *name);

/// Opens the link and tries to connect. Returns 0 or an errno (no descriptors left, name too long). A failed connection
/// is not an error.
int iwl_unix_link_open(iwl_unix_link_t *self, const char *name, int type);
void iwl_unix_link_close(iwl_unix_link_t *self);

bool iwl_unix_link_is_up(const iwl_unix_link_t *self);

/// Closes the connection, because the peer is gone. The next `iwl_unix_link_poll` connects again, or after a failure
/// waits for the back-off.
void iwl_unix_link_lose(iwl_unix_link_t *self);

/// Connects if it is due. Returns true if the link has come up in this call.
bool iwl_unix_link_poll(iwl_unix_link_t *self, iw_time_us_t now_us);

#endif
