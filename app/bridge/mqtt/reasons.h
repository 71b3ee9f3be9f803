// SPDX-License-Identifier: MIT
/// What the codes of libmosquitto and of brokers mean.
#ifndef MQTT_REASONS_H
#define MQTT_REASONS_H

#include <stdbool.h>

/// Of a CONNACK, or of a DISCONNECT of MQTT 5.
const char *mqtt_reason_of(int code, bool is_5);

/// True of trouble of the moment when a message was published; any other result is of the message, for ever.
bool mqtt_reason_may_pass(int result);

/// True if what waits to be read of this connection, without TLS, begins with a CONNACK that refuses.
bool mqtt_reason_is_refusal(int fd);

#endif
