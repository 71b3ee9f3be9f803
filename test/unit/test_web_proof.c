// SPDX-License-Identifier: MIT
// Proof that a client has the token, without the token on the connection. The hmac module of Python computed the MACs.
#include "proof.h"

#include "unit.h"

#include <stdio.h>
#include <string.h>

#define NOW 50000000U

static const char *token = "00112233445566778899aabbccddeeff";
static const char *const nonce = "0123456789abcdef0123456789abcdef";
static web_proofs_t proofs;
static uint64_t now_us;
static uint64_t session;

/// hmac.new(token, "POST\n/api/arm?t_us=1\nSESSION\nNONCE\nSEQUENCE", "sha256"), by sequence of the session "a" * 32.
static const char *const macs[] = {
    NULL,
    "fe3428590a62c367cc6b4c0d804e3422e347bcc097bb3b7ceafbf6eca95c573a",
    "d06b8d1257d4549cd2f71a11cf2fa39d6b477ed5049771a3b0982effc661fe0d",
    "9882322bc2d1ad0a3530af11c2d71913184430fd4096196949b637e83909cecd",
    "946a2b439a132272f9d70b738e2b822b6ee4cdcc990f9cdad45efb2e5c00ea78",
};

void setUp(void) {
    memset(&proofs, 0, sizeof proofs);
    (void)snprintf(proofs.nonce[0], sizeof proofs.nonce[0], "%s", nonce);
    now_us = NOW;
    proofs.renew_us = NOW + WEB_NONCE_US;
}

static web_proof_t judge(const char *method, const char *target, const char *authorization) {
    const web_claim_t claim = {method, target, authorization};
    return web_proofs_judge(&proofs, token, &claim, now_us, &session);
}

static web_proof_t arm(unsigned sequence) {
    char text[200];
    (void)snprintf(text, sizeof text, "IWheel aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa %s %u %s", nonce, sequence,
                   macs[sequence]);
    return judge("POST", "/api/arm?t_us=1", text);
}

TEST(test_proof_with_the_token_is_full_and_counts_once) {
    TEST_ASSERT_EQUAL(WEB_PROOF_FULL, arm(1));
    TEST_ASSERT_EQUAL_UINT64(1, session);
    TEST_ASSERT_EQUAL(WEB_PROOF_WRONG, arm(1));
    TEST_ASSERT_EQUAL_UINT64(0, session);
    TEST_ASSERT_EQUAL(WEB_PROOF_FULL, arm(4));
    TEST_ASSERT_EQUAL(WEB_PROOF_FULL, arm(2)); // Overtaken by sequence 4.
    TEST_ASSERT_EQUAL(WEB_PROOF_WRONG, arm(2));
    TEST_ASSERT_EQUAL(WEB_PROOF_WRONG, arm(4));
    TEST_ASSERT_EQUAL(WEB_PROOF_FULL, arm(3));
}

TEST(test_proof_older_than_the_window_is_wrong) {
    TEST_ASSERT_EQUAL(WEB_PROOF_FULL, arm(1));
    proofs.sessions[0].newest = 65;
    proofs.sessions[0].seen = 1;
    TEST_ASSERT_EQUAL(WEB_PROOF_WRONG, arm(1));
    TEST_ASSERT_EQUAL(WEB_PROOF_FULL, arm(2));
}

TEST(test_proof_of_another_request_is_wrong) {
    char text[200];
    (void)snprintf(text, sizeof text, "IWheel aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa %s 1 %s", nonce, macs[1]);
    TEST_ASSERT_EQUAL(WEB_PROOF_WRONG, judge("GET", "/api/arm?t_us=1", text));
    TEST_ASSERT_EQUAL(WEB_PROOF_WRONG, judge("POST", "/api/arm?t_us=2", text));
    TEST_ASSERT_EQUAL(WEB_PROOF_WRONG, judge("POST", "/api/drive?t_us=1", text));
    TEST_ASSERT_EQUAL(WEB_PROOF_WRONG, judge("POST", "", text));
    TEST_ASSERT_EQUAL_UINT64(0, proofs.begun);
    TEST_ASSERT_EQUAL(WEB_PROOF_FULL, judge("POST", "/api/arm?t_us=1", text));
}

TEST(test_proof_in_another_spelling_is_wrong) {
    static const char *const forms[] = {"IWheel %s %s %u %s x",  "IWheel %s %s %u %s ", "IWheel %.31s %s %u %s",
                                        "IWheel %s %.31s %u %s", "IWheel %s %s -%u %s", "IWheel %s %s %u %.63s",
                                        "iwheel %s %s %u %s",    "Bearer %s %s %u %s"};
    for (size_t i = 0; i < sizeof forms / sizeof forms[0]; i++) {
        char text[240];
        (void)snprintf(text, sizeof text, forms[i], "aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa", nonce, 1U, macs[1]);
        TEST_ASSERT_EQUAL_MESSAGE(WEB_PROOF_WRONG, judge("POST", "/api/arm?t_us=1", text), text);
    }
    TEST_ASSERT_EQUAL(WEB_PROOF_NONE, judge("POST", "/api/arm?t_us=1", NULL));
    TEST_ASSERT_EQUAL(WEB_PROOF_WRONG, judge("POST", "/api/arm?t_us=1", ""));
    TEST_ASSERT_EQUAL(WEB_PROOF_WRONG, judge("POST", "/api/arm?t_us=1", "IWheel "));
}

TEST(test_session_begins_only_with_a_valid_nonce) {
    now_us = proofs.renew_us + WEB_NONCE_US - 1U; // The previous nonce.
    TEST_ASSERT_EQUAL(WEB_PROOF_FULL, arm(1));
    setUp();
    now_us = proofs.renew_us + WEB_NONCE_US;
    TEST_ASSERT_EQUAL(WEB_PROOF_OVER, arm(1));
    TEST_ASSERT_EQUAL_UINT64(0, proofs.begun);
}

TEST(test_session_lasts_longer_than_its_nonce) {
    TEST_ASSERT_EQUAL(WEB_PROOF_FULL, arm(1));
    now_us += 100U * WEB_NONCE_US;
    TEST_ASSERT_EQUAL(WEB_PROOF_FULL, arm(2));
    TEST_ASSERT_EQUAL(WEB_PROOF_WRONG, arm(1));
}

TEST(test_full_table_replaces_only_sessions_that_have_expired) {
    TEST_ASSERT_EQUAL(WEB_PROOF_FULL, arm(1));
    for (unsigned i = 1; i < WEB_SESSIONS; i++) {
        (void)snprintf(proofs.sessions[i].id, sizeof proofs.sessions[i].id, "%032x", i);
        proofs.sessions[i].used_us = now_us;
    }
    proofs.sessions[0].id[0] = 'b';
    TEST_ASSERT_EQUAL(WEB_PROOF_OVER, arm(1));
    proofs.sessions[7].used_us = now_us - 2U * WEB_NONCE_US - 1U;
    TEST_ASSERT_EQUAL(WEB_PROOF_FULL, arm(1));
    TEST_ASSERT_EQUAL_UINT64(proofs.begun, proofs.sessions[7].number);
}

TEST(test_nonce_is_renewed_and_the_previous_one_is_retained) {
    char first[BRIDGE_SECRET_SIZE];
    memset(&proofs, 0, sizeof proofs);
    (void)snprintf(first, sizeof first, "%s", web_proofs_nonce(&proofs, now_us));
    TEST_ASSERT_EQUAL_STRING(first, web_proofs_nonce(&proofs, now_us + WEB_NONCE_US - 1U));
    TEST_ASSERT_TRUE(strcmp(first, web_proofs_nonce(&proofs, now_us + WEB_NONCE_US)) != 0);
    TEST_ASSERT_EQUAL_STRING(first, proofs.nonce[1]);
    (void)web_proofs_nonce(&proofs, now_us + 10U * WEB_NONCE_US);
    TEST_ASSERT_EQUAL_STRING("", proofs.nonce[1]);
}

TEST(test_secret_for_reading_is_derived_from_the_token) {
    char text[64];
    char secret[BRIDGE_SECRET_SIZE];
    web_read_secret(token, secret);
    TEST_ASSERT_EQUAL_STRING("f01b90b32663ba4931262456f9d32cb7", secret);
    (void)snprintf(text, sizeof text, "Bearer %s", secret);
    TEST_ASSERT_EQUAL(WEB_PROOF_READ, judge("GET", "/metrics", text));
    (void)snprintf(text, sizeof text, "Bearer %s", token);
    TEST_ASSERT_EQUAL(WEB_PROOF_WRONG, judge("GET", "/metrics", text));
    (void)snprintf(text, sizeof text, "Basic %s", secret);
    TEST_ASSERT_EQUAL(WEB_PROOF_WRONG, judge("GET", "/metrics", text));
}

TEST(test_empty_token_grants_no_access) {
    char text[64];
    char secret[BRIDGE_SECRET_SIZE];
    token = "";
    web_read_secret(token, secret);
    (void)snprintf(text, sizeof text, "Bearer %s", secret);
    TEST_ASSERT_EQUAL(WEB_PROOF_WRONG, judge("GET", "/metrics", text));
    token = "00112233445566778899aabbccddeeff";
}
