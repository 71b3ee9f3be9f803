// SPDX-License-Identifier: MIT
/// Meaning of the codes of libmosquitto and of brokers.
#ifndef MQTT_REASONS_H
#define MQTT_REASONS_H

#include <stdbool.h>

/// Returns the text of a code of a CONNACK, or of a DISCONNECT of MQTT 5.
const char *mqtt_reason_of(int code, bool is_5);

/// Returns true if the result of a publish is a temporary error. Any other error is permanent for that message.
bool mqtt_reason_may_pass(int result);

/// Returns true if the unread input of a connection without TLS begins with a CONNACK that refuses.
bool mqtt_reason_is_refusal(int fd);

#endif
