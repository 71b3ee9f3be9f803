// SPDX-License-Identifier: MIT
/// Listening sockets of the page: those of systemd (iwheel-web.socket), which stay open while the bridge restarts, or
/// its own.
///
/// A page on loopback binds both 127.0.0.1 and [::1]: `localhost` may mean either, and any local user could bind a free
/// one.
#ifndef WEB_LISTEN_H
#define WEB_LISTEN_H

#include "backlog.h"
#include "web_settings.h"

/// Opens the sockets. Returns 0 and sets the sockets (-1: none), or an exit code with a line on stderr. The addresses
/// of passed sockets are read from the kernel.
int web_listen(const web_settings_t *settings, int out_fds[WEB_BACKLOG_LISTENERS]);

/// Checks that other machines can reach only sockets of this process that the configuration opens to them. Returns 0,
/// or an exit code with a line on stderr. Call it after all sockets are open.
int web_listen_verify(const web_settings_t *settings, const int fds[WEB_BACKLOG_LISTENERS]);

/// Removes the socket file of `web_listen`.
void web_listen_end(const web_settings_t *settings);

#endif
