// SPDX-License-Identifier: MIT
// What a request that permits motion must show: the key of the lease, and that it is no older than the last stop.
#include "dispatch.h"

#include "status/observe.h"
#include "wheels/wheels.h"

#include "iwheel_northbound/refuse.h"

#include <sys/random.h>

/// Of a lease's key: 128 bits.
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

static iw_time_us_t later(iw_time_us_t a_us, iw_time_us_t b_us) {
    return (a_us > b_us) ? a_us : b_us;
}

bool gw_grant_is_late(const gw_answers_t *self, const iwn_request_t *request, iwn_refusal_t *out_refusal) {
    if (!request->has_t_us && !request->has_stop) {
        return false;
    }
    const iw_snapshot_t seen = gw_wheels_look(self->wheels);
    const gw_status_t *status = self->status;
    const iwn_moment_t moment = {
        .now_us = self->wheels->now_us,
        .stopped_us = later(seen.stop->at_us, later(status->stopped_by.at_us, status->estopped_by.at_us)),
        .stop = seen.stop->number,
        .max_age_ms = self->max_age_ms,
    };
    return iwn_refuse_late(request, &moment, out_refusal);
}
