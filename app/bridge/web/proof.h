// SPDX-License-Identifier: MIT
/// Who asks: a request proves that its sender has the token, and never carries it. The port may belong to another program for a moment.
///
/// A sender draws a session of 32 hexadecimal digits, reads the bridge's nonce (`GET /api/challenge`) and sends with each request
///
///     Authorization: IWheel SESSION NONCE SEQUENCE MAC
///     MAC = HMAC-SHA-256(token, METHOD "\n" TARGET "\n" SESSION "\n" NONCE "\n" SEQUENCE), 64 digits
///
/// with a SEQUENCE that counts up from 1 in each session (the last 64 may come in any order, each once). A session begins with a nonce that
/// is younger than 20 s, and then has that nonce. For programs that only read there is a second secret, made from the token, which is sent
/// as `Bearer`: who gets it may read, and cannot drive, reset or arm.
///
/// Pure but for the HMAC of GnuTLS: no socket, no clock. Fixed memory.
#ifndef WEB_PROOF_H
#define WEB_PROOF_H

#include "common/secret.h"

#include <stdbool.h>
#include <stdint.h>

/// Nonces are renewed after this time; the one before counts as long again.
#define WEB_NONCE_US    10000000U
#define WEB_SESSIONS    128U
#define WEB_TARGET_SIZE 512U ///< Longest request target with its terminator.
#define WEB_MAC_SIZE    65U

typedef enum {
    WEB_PROOF_NONE,  ///< No proof was given.
    WEB_PROOF_WRONG, ///< Not made with this token, used before, or the token itself.
    WEB_PROOF_OVER,  ///< The session or its nonce is not known: begin another session.
    WEB_PROOF_READ,  ///< Has the secret for reading.
    WEB_PROOF_FULL   ///< Has the token.
} web_proof_t;

typedef struct {
    char id[BRIDGE_SECRET_SIZE]; ///< Empty: free.
    char nonce[BRIDGE_SECRET_SIZE];
    uint64_t newest; ///< Sequence.
    uint64_t seen;   ///< Bit n: `newest` - n was there.
    uint64_t used_us;
    uint64_t number; ///< Counts the sessions of this bridge, from 1.
} web_session_t;

typedef struct {
    char nonce[2][BRIDGE_SECRET_SIZE]; ///< This one, and the one before.
    uint64_t renew_us;
    uint64_t begun; ///< Sessions.
    web_session_t sessions[WEB_SESSIONS];
} web_proofs_t;

/// What of a request the proof is about.
typedef struct {
    const char *method;
    const char *target;        ///< As it was sent, with its arguments.
    const char *authorization; ///< NULL: not sent.
} web_claim_t;

/// The nonce for a session that begins now; NULL: the kernel gives no random numbers.
const char *web_proofs_nonce(web_proofs_t *self, uint64_t now_us);

/// Judges one request. WEB_PROOF_FULL: `*out_session` is the number of its session, else 0.
web_proof_t web_proofs_judge(web_proofs_t *self, const char *token, const web_claim_t *claim, uint64_t now_us,
                             uint64_t *out_session);

/// The secret for reading that belongs to this token.
void web_read_secret(const char *token, char out[BRIDGE_SECRET_SIZE]);

#endif
