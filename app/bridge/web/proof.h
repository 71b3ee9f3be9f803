// SPDX-License-Identifier: MIT
/// Judges the sender of a request: the request proves that its sender has the token, and never contains the token,
/// because the port may temporarily belong to another program.
///
/// A sender draws a session of 32 hexadecimal digits, reads the nonce of the bridge (`GET /api/challenge`) and sends in
/// each request
///
///     Authorization: IWheel SESSION NONCE SEQUENCE MAC
///     MAC = HMAC-SHA-256(token, METHOD "\n" TARGET "\n" SESSION "\n" NONCE "\n" SEQUENCE), 64 digits
///
/// with a SEQUENCE that counts from 1 in each session (the last 64 may arrive in any order, each once). A session
/// begins with a nonce that is younger than 20 s, and uses that nonce until it ends. For programs that only read there
/// is a second secret, derived from the token, which is sent as `Bearer`: a client with it may read, but cannot drive,
/// reset or arm.
///
/// Pure except for the HMAC of GnuTLS: no socket, no clock. Fixed memory.
#ifndef WEB_PROOF_H
#define WEB_PROOF_H

#include "common/secret.h"

#include <stdbool.h>
#include <stdint.h>

/// A nonce is renewed after this time; the previous one stays valid for the same time.
#define WEB_NONCE_US    10000000U
#define WEB_SESSIONS    128U
#define WEB_TARGET_SIZE 512U ///< Size of the longest request target with its terminator.
#define WEB_MAC_SIZE    65U

typedef enum {
    WEB_PROOF_NONE,  ///< No proof was sent.
    WEB_PROOF_WRONG, ///< Not made with this token, used before, or the token itself.
    WEB_PROOF_OVER,  ///< The session or its nonce is unknown: the client must begin another session.
    WEB_PROOF_READ,  ///< The sender has the secret for reading.
    WEB_PROOF_FULL   ///< The sender has the token.
} web_proof_t;

typedef struct {
    char id[BRIDGE_SECRET_SIZE]; ///< Empty: free.
    char nonce[BRIDGE_SECRET_SIZE];
    uint64_t newest; ///< Largest sequence.
    uint64_t seen;   ///< Bit n: `newest` - n was received.
    uint64_t used_us;
    uint64_t number; ///< Number of this session, from 1 in each run of the bridge.
} web_session_t;

typedef struct {
    char nonce[2][BRIDGE_SECRET_SIZE]; ///< The current one and the previous one.
    uint64_t renew_us;
    uint64_t begun; ///< Number of sessions so far.
    web_session_t sessions[WEB_SESSIONS];
} web_proofs_t;

/// Parts of a request that the proof covers.
typedef struct {
    const char *method;
    const char *target;        ///< As received, with its arguments.
    const char *authorization; ///< NULL: not sent.
} web_claim_t;

/// Returns the nonce for a new session; NULL if the kernel has no random numbers.
const char *web_proofs_nonce(web_proofs_t *self, uint64_t now_us);

/// Judges one request. WEB_PROOF_FULL: sets `*out_session` to the number of its session, otherwise to 0.
web_proof_t web_proofs_judge(web_proofs_t *self, const char *token, const web_claim_t *claim, uint64_t now_us,
                             uint64_t *out_session);

/// Derives the secret for reading from this token.
void web_read_secret(const char *token, char out[BRIDGE_SECRET_SIZE]);

#endif
