// SPDX-License-Identifier: MIT
/// `--lan`: the page for phones in the same network, with its own certificate. It changes where the bridge listens, not
/// what it permits.
#ifndef WEB_LAN_H
#define WEB_LAN_H

#include "web_settings.h"

#include <netinet/in.h>

/// Opens the page to other machines by IPv4. A configured certificate is used; otherwise a certificate is made next to
/// the token, and made again when it has expired. Returns 0, or an exit code with a line on stderr.
int web_lan_prepare(web_settings_t *settings);

/// Writes the address by which other machines reach this machine. Returns false with the reason in errno if there is
/// none.
bool web_lan_address(char out[INET_ADDRSTRLEN]);

#endif
