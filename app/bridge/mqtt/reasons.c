// SPDX-License-Identifier: MIT
#include "reasons.h"

#include <mosquitto.h>
#include <mqtt_protocol.h>
#include <stdint.h>
#include <sys/socket.h>

const char *mqtt_reason_of(int code, bool is_5) {
    if (!is_5) {
        return mosquitto_connack_string(code);
    }
    return (code == MQTT_RC_UNSUPPORTED_PROTOCOL_VERSION)
               ? "it does not support MQTT 5; set protocol = 3.1.1 under [broker]"
               : mosquitto_reason_string(code);
}

bool mqtt_reason_may_pass(int result) {
    return result == MOSQ_ERR_NOMEM || result == MOSQ_ERR_NO_CONN || result == MOSQ_ERR_CONN_LOST ||
           result == MOSQ_ERR_ERRNO || result == MOSQ_ERR_TLS;
}

bool mqtt_reason_is_refusal(int fd) {
    uint8_t head[4] = {0};
    return recv(fd, head, sizeof head, MSG_PEEK | MSG_DONTWAIT) == (ssize_t)sizeof head && head[0] == 0x20U &&
           head[3] != 0U;
}
