// SPDX-License-Identifier: MIT
// Key of a lease.
#include "answers.h"

#include <sys/random.h>

/// Length of a key: 128 bits.
#define KEY_BYTES (IWN_LEASE_KEY_MAX / 2U)

bool gw_grant_draw_key(char out_key[IWN_LEASE_KEY_MAX + 1U]) {
    static const char digits[] = "0123456789abcdef";
    uint8_t bytes[KEY_BYTES];
    if (getrandom(bytes, sizeof bytes, GRND_NONBLOCK) != (ssize_t)sizeof bytes) {
        return false;
    }
    for (size_t i = 0; i < KEY_BYTES; i++) {
        out_key[2U * i] = digits[bytes[i] >> 4];
        out_key[2U * i + 1U] = digits[bytes[i] & 15U];
    }
    out_key[IWN_LEASE_KEY_MAX] = '\0';
    return true;
}

bool gw_grant_is_same_key(const char a[IWN_LEASE_KEY_MAX + 1U], const char b[IWN_LEASE_KEY_MAX + 1U]) {
    unsigned difference = 0;
    for (size_t i = 0; i <= IWN_LEASE_KEY_MAX; i++) {
        difference |= (unsigned)(uint8_t)a[i] ^ (uint8_t)b[i];
    }
    return difference == 0U;
}
