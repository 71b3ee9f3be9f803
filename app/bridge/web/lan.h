// SPDX-License-Identifier: MIT
/// `--lan`: the page for phones of the same network, with a certificate of its own. It changes where the bridge listens, never what it permits.
#ifndef WEB_LAN_H
#define WEB_LAN_H

#include "web_settings.h"

#include <netinet/in.h>

/// Lets the page be reached by IPv4 from other machines. A certificate that the configuration names stays; else one is made next to the
/// token, once, and again when it is over. 0, or an exit code with a line on stderr.
int web_lan_prepare(web_settings_t *settings);

/// The address by which other machines reach this one; false: there is none.
bool web_lan_address(char out[INET_ADDRSTRLEN]);

#endif
