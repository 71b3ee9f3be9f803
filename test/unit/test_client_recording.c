// SPDX-License-Identifier: MIT
// iwc_recording against a gateway that the test plays: a piece is accepted only if it is the requested one and
// complete.
#include "iwheel_client/client.h"

#include "unit.h"

#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#define NAME "stop-000001-estop_line.log"
#define SOON 20

static iwc_t *gateway;
static int server;
static char out[IWC_PIECE_MAX];
static iwc_piece_t piece;

static void reply(const char *text) {
    TEST_ASSERT_EQUAL((ssize_t)strlen(text), send(server, text, strlen(text), MSG_NOSIGNAL));
}

void setUp(void) {
    piece = (iwc_piece_t){0};
    int pair[2];
    TEST_ASSERT_EQUAL_INT(0, socketpair(AF_UNIX, SOCK_STREAM, 0, pair));
    server = pair[1];
    gateway = iwc_new();
    reply("{\"event\":\"hello\",\"name\":\"iwheel-gateway\",\"api\":1,\"state\":\"listening\",\"client\":7}\n");
    TEST_ASSERT_EQUAL(IWC_OK, iwc_adopt(gateway, pair[0], SOON));
}

void tearDown(void) {
    iwc_free(gateway);
    (void)close(server);
}

/// Sends the reply before the first question of a new connection, which has the id 2.
static iwc_result_t ask(int64_t next, uint32_t crc32, const char *fields) {
    char line[512];
    (void)snprintf(line, sizeof line, "{\"id\":2,\"ok\":true,\"name\":\"" NAME "\",%s}\n", fields);
    reply(line);
    piece = (iwc_piece_t){.next = next, .crc32 = crc32};
    return iwc_recording(gateway, NAME, SOON, out, &piece);
}

/// "123456789" and its parts, with the checksums of zlib.crc32.
#define WHOLE "\"data\":\"MTIzNDU2Nzg5\",\"crc32\":3421780262"

TEST(test_recording_last_piece_has_both_checksums) {
    char request[256] = "";
    TEST_ASSERT_EQUAL(IWC_OK, ask(0, 0, "\"offset\":0,\"size\":9," WHOLE ",\"file_crc32\":3421780262"));
    TEST_ASSERT_EQUAL_STRING_LEN("123456789", out, 9);
    TEST_ASSERT_EQUAL(9, piece.length);
    TEST_ASSERT_EQUAL_INT64(9, piece.size);
    TEST_ASSERT_EQUAL_HEX32(0xCBF43926U, piece.crc32);
    TEST_ASSERT_GREATER_THAN(0, recv(server, request, sizeof request - 1U, 0));
    TEST_ASSERT_EQUAL_STRING("{\"id\":2,\"cmd\":\"recording\",\"name\":\"" NAME "\",\"offset\":0}\n", request);
}

TEST(test_recording_second_piece_continues_the_checksum) {
    TEST_ASSERT_EQUAL(IWC_OK, ask(4, 0x9BE3E0A3U,
                                  "\"offset\":4,\"size\":9,\"data\":\"NTY3ODk=\",\"crc32\":320708720,\"file_crc32\":"
                                  "3421780262")); // crc32 of 1234
    TEST_ASSERT_EQUAL(5, piece.length);
    TEST_ASSERT_EQUAL_HEX32(0xCBF43926U, piece.crc32);
}

TEST(test_recording_end_of_file_is_an_empty_piece) {
    TEST_ASSERT_EQUAL(
        IWC_OK, ask(9, 0xCBF43926U, "\"offset\":9,\"size\":9,\"data\":\"\",\"crc32\":0,\"file_crc32\":3421780262"));
    TEST_ASSERT_EQUAL(0, piece.length);
}

TEST(test_recording_wrong_piece_ends_the_connection) {
    static const char *const bad[] = {
        "\"offset\":0,\"size\":9,\"data\":\"MTIzNDU2Nzg5\",\"crc32\":3421780263,\"file_crc32\":null",
        "\"offset\":3,\"size\":9," WHOLE ",\"file_crc32\":null",
        "\"offset\":0,\"size\":8," WHOLE ",\"file_crc32\":null",
        "\"offset\":0,\"size\":9," WHOLE ",\"file_crc32\":1",
        "\"offset\":0,\"size\":9,\"data\":\"MTIzNDU2Nzg\",\"crc32\":3421780262,\"file_crc32\":null",
        "\"offset\":0,\"size\":9,\"data\":\"MTIzNDU2Nzg*\",\"crc32\":3421780262,\"file_crc32\":null",
        "\"offset\":0,\"size\":9,\"data\":\"MTIz=DU2Nzg5\",\"crc32\":3421780262,\"file_crc32\":null",
        "\"offset\":0,\"size\":9,\"data\":\"\",\"crc32\":0,\"file_crc32\":null",
        "\"offset\":0,\"size\":9,\"crc32\":0,\"file_crc32\":null",
        "\"offset\":0,\"size\":-1,\"data\":7,\"crc32\":0,\"file_crc32\":null",
    };
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        TEST_ASSERT_EQUAL_MESSAGE(IWC_GARBLED, ask(0, 0, bad[i]), bad[i]);
        TEST_ASSERT_EQUAL_INT(-1, iwc_fd(gateway));
        tearDown();
        setUp();
    }
}

TEST(test_recording_overlong_piece_is_not_written) {
    static char line[50000];
    int n = snprintf(line, sizeof line,
                     "{\"id\":2,\"ok\":true,\"name\":\"" NAME "\",\"offset\":0,\"size\":99999,\"data\":\"");
    memset(line + n, 'A', 32772);
    (void)snprintf(line + n + 32772, sizeof line - 40000U, "\",\"crc32\":0,\"file_crc32\":null}\n");
    reply(line);
    static char guarded[IWC_PIECE_MAX + 1U];
    guarded[IWC_PIECE_MAX] = 'X';
    TEST_ASSERT_EQUAL(IWC_GARBLED, iwc_recording(gateway, NAME, SOON, guarded, &piece));
    TEST_ASSERT_EQUAL('X', guarded[IWC_PIECE_MAX]);
}

TEST(test_recording_invalid_name_is_not_sent) {
    char byte;
    static const char *const bad[] = {
        "", "a\"b", "../a", "a\\b", "a b", "a\nb", "0123456789012345678901234567890123456789012345678901234567890123"};
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        TEST_ASSERT_EQUAL_MESSAGE(IWC_INVALID, iwc_recording(gateway, bad[i], SOON, out, &piece), bad[i]);
    }
    TEST_ASSERT_EQUAL(IWC_INVALID, iwc_recording(gateway, NAME, SOON, out, &(iwc_piece_t){.next = -1}));
    TEST_ASSERT_EQUAL(-1, recv(server, &byte, 1, MSG_DONTWAIT));
}

TEST(test_recording_refusal_does_not_end_the_connection) {
    reply("{\"id\":2,\"ok\":false,\"error\":\"bad_value\",\"message\":\"gone\"}\n");
    TEST_ASSERT_EQUAL(IWC_REFUSED, iwc_recording(gateway, NAME, SOON, out, &piece));
    TEST_ASSERT_EQUAL_STRING("gone", iwc_reason(gateway));
    TEST_ASSERT_NOT_EQUAL(-1, iwc_fd(gateway));
}
