// SPDX-License-Identifier: MIT
/// The files with which a program shows at a broker who it is.
#ifndef MQTT_CREDENTIALS_H
#define MQTT_CREDENTIALS_H

#include "mqtt_settings.h"

/// Checks the files of TLS, and reads user and password, which are the caller's to free; NULL: none. A file with a secret that others may read
/// is refused. 0, or an exit code of sysexits with a line on stderr.
int mqtt_credentials_read(const mqtt_settings_t *settings, char **out_user, char **out_password);

#endif
