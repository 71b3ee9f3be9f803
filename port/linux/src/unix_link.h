// SPDX-License-Identifier: MIT
/// A connection to a unix socket that comes back by itself: connect, lose, wait, connect again.
///
///     DOWN --due: connect works--> UP --hang-up or error--> DOWN (attempts: at once, then after each back-off)
///
/// The back-off doubles from IWL_UNIX_LINK_RETRY_MIN_US to IWL_UNIX_LINK_RETRY_MAX_US and starts anew with every
/// success. The epoll set stays the same over all connections: it is what others watch.
#ifndef IWL_UNIX_LINK_H
#define IWL_UNIX_LINK_H

#include "iwheel/types.h"

#define IWL_UNIX_LINK_RETRY_MIN_US 20000U
#define IWL_UNIX_LINK_RETRY_MAX_US 200000U

typedef struct {
    const char *path;
    iw_time_us_t retry_us; ///< When to connect again; IW_NEVER while up.
    uint32_t backoff_us;
    int type; ///< SOCK_STREAM or SOCK_SEQPACKET.
    int watch_fd;
    int fd; ///< -1: down.
} iwl_unix_link_t;

/// True for `unix:PATH`.
bool iwl_unix_link_is_name(const char *name);

/// 0, or an errno (no descriptors left, name too long). Tries to connect at once; failing that is no error.
int iwl_unix_link_open(iwl_unix_link_t *self, const char *name, int type);
void iwl_unix_link_close(iwl_unix_link_t *self);

bool iwl_unix_link_is_up(const iwl_unix_link_t *self);

/// The other side is gone: closes. The next `iwl_unix_link_poll` connects again; if that fails, it waits for the
/// back-off.
void iwl_unix_link_lose(iwl_unix_link_t *self);

/// Connects if it is due. True if the link came up now.
bool iwl_unix_link_poll(iwl_unix_link_t *self, iw_time_us_t now_us);

#endif
