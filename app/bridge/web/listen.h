// SPDX-License-Identifier: MIT
/// The listening sockets of the page: those that systemd holds (iwheel-web.socket), also while the bridge restarts, or its own.
///
/// A page on loopback has both 127.0.0.1 and [::1]: `localhost` may mean either, and the one that is free any local user could take.
#ifndef WEB_LISTEN_H
#define WEB_LISTEN_H

#include "door.h"
#include "web_settings.h"

/// 0 with the sockets (-1: none); or an exit code, with a line on stderr. The addresses are read from the kernel.
int web_listen(const web_settings_t *settings, int out_fds[WEB_DOOR_LISTENERS]);

/// 0 if other machines can reach none of this process's sockets but those that the configuration opens to them; or an exit code, with a line
/// on stderr. Call it when everything is open.
int web_listen_verify(const web_settings_t *settings, const int fds[WEB_DOOR_LISTENERS]);

/// Removes what `web_listen` made in the file system.
void web_listen_end(const web_settings_t *settings);

#endif
