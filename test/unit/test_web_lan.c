// SPDX-License-Identifier: MIT
// `--lan`: each failure has its own message, with the file, the cause and the fix.
#include "lan.h"

#include "folder.h"
#include "unit.h"

#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sysexits.h>
#include <unistd.h>

static web_settings_t settings;
static char printed[2048];

static void reset_settings(void) {
    settings = web_settings_standard;
    (void)snprintf(settings.web.token_file, sizeof settings.web.token_file, "%s/token", folder);
}

void setUp(void) {
    folder_make();
    reset_settings();
}

void tearDown(void) {
    folder_remove();
}

/// Prepares with stderr in a pipe: a limit of the size of files does not apply to it.
static int prepare(void) {
    int ends[2];
    const int before = dup(STDERR_FILENO);
    TEST_ASSERT_EQUAL_INT(0, pipe(ends));
    TEST_ASSERT_EQUAL_INT(STDERR_FILENO, dup2(ends[1], STDERR_FILENO));
    const int code = web_lan_prepare(&settings);
    TEST_ASSERT_EQUAL_INT(STDERR_FILENO, dup2(before, STDERR_FILENO));
    (void)close(before);
    (void)close(ends[1]);
    const ssize_t length = read(ends[0], printed, sizeof printed - 1U);
    (void)close(ends[0]);
    printed[(length > 0) ? length : 0] = '\0';
    return code;
}

static void assert_printed(const char *text) {
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(printed, text), printed);
}

TEST(test_lan_makes_key_and_certificate_once_without_a_message) {
    struct stat made;
    struct stat found;
    TEST_ASSERT_EQUAL_INT(0, prepare());
    TEST_ASSERT_EQUAL_STRING("", printed);
    TEST_ASSERT_EQUAL_INT(0, stat(in_folder("lan-certificate.pem"), &made));
    reset_settings();
    TEST_ASSERT_EQUAL_INT(0, prepare());
    TEST_ASSERT_EQUAL_STRING("", printed);
    TEST_ASSERT_EQUAL_INT(0, stat(in_folder("lan-certificate.pem"), &found));
    TEST_ASSERT_TRUE(made.st_ino == found.st_ino);
}

TEST(test_lan_in_missing_folder_names_the_key_and_the_fix) {
    (void)snprintf(settings.web.token_file, sizeof settings.web.token_file, "%s/none/token", folder);
    TEST_ASSERT_EQUAL_INT(EX_CANTCREAT, prepare());
    assert_printed("/none/lan-key.pem.new: No such file or directory; set token_file to a file in a folder");
}

TEST(test_lan_in_folder_with_too_long_name_asks_for_shorter_name) {
    memset(settings.web.token_file, 'x', sizeof settings.web.token_file - 1U);
    settings.web.token_file[sizeof settings.web.token_file - 3U] = '/';
    TEST_ASSERT_EQUAL_INT(EX_CANTCREAT, prepare());
    assert_printed("its folder's name is too long; set token_file to a shorter path");
}

TEST(test_lan_on_full_disk_asks_for_room) {
    struct rlimit before;
    TEST_ASSERT_EQUAL_INT(0, getrlimit(RLIMIT_FSIZE, &before));
    const struct rlimit none = {.rlim_cur = 0, .rlim_max = before.rlim_max};
    (void)signal(SIGXFSZ, SIG_IGN);
    TEST_ASSERT_EQUAL_INT(0, setrlimit(RLIMIT_FSIZE, &none));
    const int code = prepare();
    TEST_ASSERT_EQUAL_INT(0, setrlimit(RLIMIT_FSIZE, &before));
    TEST_ASSERT_EQUAL_INT(EX_CANTCREAT, code);
    assert_printed("/lan-key.pem.new: File too large; delete files on this disk");
}

TEST(test_lan_key_that_cannot_be_replaced_is_named_with_its_fix) {
    TEST_ASSERT_EQUAL_INT(0, mkdir(in_folder("lan-key.pem"), 0700));
    TEST_ASSERT_EQUAL_INT(EX_CANTCREAT, prepare());
    assert_printed("/lan-key.pem: Is a directory; remove it, and start the bridge again");
}

TEST(test_lan_bad_certificate_is_replaced_with_a_message) {
    TEST_ASSERT_EQUAL_INT(0, prepare());
    file_put(in_folder("lan-certificate.pem"), "no certificate", strlen("no certificate"));
    reset_settings();
    TEST_ASSERT_EQUAL_INT(0, prepare());
    assert_printed("/lan-certificate.pem: ");
    assert_printed("the bridge makes a new certificate");
}

TEST(test_lan_hosts_without_room_for_own_name_are_reported) {
    memset(settings.web.hosts, 'x', sizeof settings.web.hosts - 1U);
    TEST_ASSERT_EQUAL_INT(0, prepare());
    assert_printed("the name of this machine does not fit into the list; shorten hosts in the configuration");
}
