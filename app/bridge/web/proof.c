// SPDX-License-Identifier: MIT
#include "proof.h"

#include <gnutls/crypto.h>
#include <gnutls/gnutls.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#define WINDOW 64U

static void make_mac(const char *token, const char *text, char out[WEB_MAC_SIZE]) {
    unsigned char mac[32];
    out[0] = '\0';
    if (gnutls_hmac_fast(GNUTLS_MAC_SHA256, token, strlen(token), text, strlen(text), mac) == 0) {
        for (size_t i = 0; i < sizeof mac; i++) {
            (void)snprintf(out + 2U * i, 3, "%02x", mac[i]);
        }
    }
}

void web_read_secret(const char *token, char out[BRIDGE_SECRET_SIZE]) {
    char mac[WEB_MAC_SIZE];
    make_mac(token, "iwheel-web read", mac);
    (void)snprintf(out, BRIDGE_SECRET_SIZE, "%.32s", mac);
}

const char *web_proofs_nonce(web_proofs_t *self, uint64_t now_us) {
    if (self->nonce[0][0] == '\0' || now_us >= self->renew_us) {
        const bool long_ago = now_us >= self->renew_us + WEB_NONCE_US;
        memcpy(self->nonce[1], self->nonce[0], sizeof self->nonce[1]);
        if (long_ago) {
            self->nonce[1][0] = '\0';
        }
        if (!bridge_secret_draw(self->nonce[0])) {
            return NULL;
        }
        self->renew_us = now_us + WEB_NONCE_US;
    }
    return self->nonce[0];
}

static web_session_t *find(web_proofs_t *self, const char *id) {
    for (size_t i = 0; i < WEB_SESSIONS; i++) {
        if (strcmp(self->sessions[i].id, id) == 0) {
            return &self->sessions[i];
        }
    }
    return NULL;
}

/// Returns a place for a new session. A session whose first nonce may still be valid is not replaced, because its first
/// request could otherwise be repeated.
static web_session_t *find_place(web_proofs_t *self, uint64_t now_us) {
    web_session_t *oldest = &self->sessions[0];
    for (size_t i = 0; i < WEB_SESSIONS; i++) {
        web_session_t *one = &self->sessions[i];
        if (one->id[0] == '\0') {
            return one;
        }
        if (one->used_us < oldest->used_us) {
            oldest = one;
        }
    }
    return (now_us - oldest->used_us > (uint64_t)2 * WEB_NONCE_US) ? oldest : NULL;
}

static bool is_fresh(web_proofs_t *self, const char *nonce, uint64_t now_us) {
    return web_proofs_nonce(self, now_us) != NULL &&
           (bridge_secret_is(self->nonce[0], nonce) || bridge_secret_is(self->nonce[1], nonce));
}

/// Accepts each number once, and none that is older than the window.
static bool count_up(web_session_t *self, uint64_t sequence) {
    if (sequence > self->newest) {
        const uint64_t by = sequence - self->newest;
        self->seen = ((by < WINDOW) ? self->seen << by : 0U) | 1U;
        self->newest = sequence;
        return true;
    }
    const uint64_t back = self->newest - sequence;
    const uint64_t bit = (back < WINDOW) ? (uint64_t)1 << back : 0U;
    const bool is_new = bit != 0U && (self->seen & bit) == 0U;
    self->seen |= bit;
    return is_new;
}

static web_proof_t judge_mac(web_proofs_t *self, const char *token, const web_claim_t *claim, uint64_t now_us,
                             uint64_t *out_session) {
    char id[BRIDGE_SECRET_SIZE] = "";
    char nonce[BRIDGE_SECRET_SIZE] = "";
    char received[WEB_MAC_SIZE] = "";
    char mac[WEB_MAC_SIZE];
    char text[WEB_TARGET_SIZE + 160U];
    char digits[19] = "";
    int end = 0;
    const int found = sscanf(claim->authorization + strlen("IWheel "), "%32[0-9a-f] %32[0-9a-f] %18[0-9] %64[0-9a-f]%n",
                             id, nonce, digits, received, &end);
    const uint64_t sequence = strtoull(digits, NULL, 10);
    if (found != 4 || claim->authorization[strlen("IWheel ") + (size_t)end] != '\0' || sequence == 0U ||
        strlen(id) != 32U || strlen(nonce) != 32U || strlen(claim->target) >= WEB_TARGET_SIZE) {
        return WEB_PROOF_WRONG;
    }
    (void)snprintf(text, sizeof text, "%.16s\n%s\n%s\n%s\n%" PRIu64, claim->method, claim->target, id, nonce, sequence);
    make_mac(token, text, mac);
    if (token[0] == '\0' || !bridge_secret_is(mac, received)) {
        return WEB_PROOF_WRONG;
    }
    web_session_t *session = find(self, id);
    if (session == NULL) {
        session = is_fresh(self, nonce, now_us) ? find_place(self, now_us) : NULL;
        if (session == NULL) {
            return WEB_PROOF_OVER;
        }
        *session = (web_session_t){.number = ++self->begun};
        memcpy(session->id, id, sizeof session->id);
        memcpy(session->nonce, nonce, sizeof session->nonce);
    }
    session->used_us = now_us;
    if (strcmp(session->nonce, nonce) != 0 || !count_up(session, sequence)) {
        return WEB_PROOF_WRONG;
    }
    *out_session = session->number;
    return WEB_PROOF_FULL;
}

web_proof_t web_proofs_judge(web_proofs_t *self, const char *token, const web_claim_t *claim, uint64_t now_us,
                             uint64_t *out_session) {
    static const char scheme[] = "Bearer ";
    char secret[BRIDGE_SECRET_SIZE];
    *out_session = 0;
    if (claim->authorization == NULL) {
        return WEB_PROOF_NONE;
    }
    if (strncmp(claim->authorization, "IWheel ", 7) == 0) {
        return judge_mac(self, token, claim, now_us, out_session);
    }
    web_read_secret(token, secret);
    const bool reads = token[0] != '\0' && strncasecmp(claim->authorization, scheme, sizeof scheme - 1U) == 0 &&
                       bridge_secret_is(secret, claim->authorization + sizeof scheme - 1U);
    return reads ? WEB_PROOF_READ : WEB_PROOF_WRONG;
}
