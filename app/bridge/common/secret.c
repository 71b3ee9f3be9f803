// SPDX-License-Identifier: MIT
#include "secret.h"

#include <stddef.h>
#include <stdio.h>
#include <string.h>
#include <sys/random.h>

bool bridge_secret_draw(char out[BRIDGE_SECRET_SIZE]) {
    unsigned char bytes[(BRIDGE_SECRET_SIZE - 1U) / 2U];
    out[0] = '\0';
    if (getrandom(bytes, sizeof bytes, 0) != (ssize_t)sizeof bytes) {
        return false;
    }
    for (size_t i = 0; i < sizeof bytes; i++) {
        (void)snprintf(out + 2U * i, 3, "%02x", bytes[i]);
    }
    return true;
}

bool bridge_secret_is(const char *secret, const char *candidate) {
    const size_t length = strlen(secret);
    const size_t candidate_length = strlen(candidate);
    unsigned difference = (length == candidate_length && length > 0U) ? 0U : 1U;
    for (size_t i = 0; i < candidate_length; i++) {
        difference |=
            (unsigned)(unsigned char)candidate[i] ^ (unsigned)(unsigned char)secret[(length > 0U) ? i % length : 0U];
    }
    return difference == 0U;
}
