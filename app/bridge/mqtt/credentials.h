// SPDX-License-Identifier: MIT
/// Files with the credentials of a program at a broker.
#ifndef MQTT_CREDENTIALS_H
#define MQTT_CREDENTIALS_H

#include "mqtt_settings.h"

/// Checks the files of TLS, and reads user and password; the caller frees them; NULL: none. A file with a secret that
/// other users may read is refused. Returns 0, or an exit code of sysexits with a line on stderr.
int mqtt_credentials_read(const mqtt_settings_t *settings, char **out_user, char **out_password);

#endif
