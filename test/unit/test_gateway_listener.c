// SPDX-License-Identifier: MIT
// Northbound socket: permitted folders, which files it replaces, and which files it does not change.
#include "sockets/listener.h"

#include "config/gateway_config.h"
#include "sockets/log.h"

#include "folder.h"
#include "unit.h"

#include <fcntl.h>
#include <grp.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <sysexits.h>
#include <unistd.h>

#define STRANGER 65534

static gateway_config_t config;
static sock_listener_t listener;
static sock_log_t people; ///< Log for the operator
static char logged[1024];

void setUp(void) {
    gateway_config_default(&config);
    folder_make();
    (void)snprintf(config.northbound.socket, sizeof config.northbound.socket, "%s/gateway.sock", folder);
    (void)snprintf(config.northbound.group, sizeof config.northbound.group, "none");
    listener = (sock_listener_t){.fd = -1, .reserve_fd = -1, .folder = {.fd = -1}};
    memset(logged, 0, sizeof logged);
    sock_log_open(&people, SOCK_LOG_WARNING);
    sock_log_close(&people);
    people.fd = open(in_folder("log.txt"), O_RDWR | O_CREAT | O_CLOEXEC, 0600);
}

void tearDown(void) {
    sock_listener_close(&listener);
    sock_log_close(&people);
    folder_remove();
}

static int prepare(void) {
    FILE *err = fmemopen(logged, sizeof logged, "w");
    const sock_listener_config_t wanted = {"iwheel-gateway", SOCK_DRIVE, config.northbound.socket,
                                           config.northbound.group, config.northbound.mode};
    const int result = sock_listener_prepare(&listener, &wanted, err);
    (void)fclose(err);
    return result;
}

static int make(void) {
    FILE *err = fmemopen(logged, sizeof logged, "w");
    const int result = sock_listener_open(&listener, &people, err);
    (void)fclose(err);
    return result;
}

static void assert_said(const char *words) {
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(logged, words), logged);
}

static void assert_logged(const char *words) {
    char text[512];
    const ssize_t length = pread(people.fd, text, sizeof text - 1U, 0);
    TEST_ASSERT_GREATER_OR_EQUAL_INT(0, (int)length);
    text[length] = '\0';
    TEST_ASSERT_TRUE_MESSAGE((words[0] == '\0') ? length == 0 : strstr(text, words) != NULL, text);
}

static void refused_to_prepare(int code, const char *why, const char *fix) {
    TEST_ASSERT_EQUAL_INT_MESSAGE(code, prepare(), logged);
    assert_said(why);
    assert_said(fix);
    TEST_ASSERT_EQUAL_INT(-1, listener.folder.fd);
}

static bool is_root(void) {
    if (geteuid() != 0) {
        TEST_MESSAGE("SKIPPED: changing the owner of files needs root");
    }
    return geteuid() == 0;
}

TEST(test_socket_own_folder_is_used_without_a_message) {
    TEST_ASSERT_EQUAL_INT(0, chmod(folder, 0755));
    TEST_ASSERT_EQUAL_INT(0, prepare());
    TEST_ASSERT_EQUAL_STRING("", logged);
}

TEST(test_socket_folder_writable_by_others_is_refused_with_fix) {
    static const mode_t modes[] = {0777, 0775, 0757, 0770};
    for (size_t i = 0; i < sizeof modes / sizeof modes[0]; i++) {
        TEST_ASSERT_EQUAL_INT(0, chmod(folder, modes[i]));
        refused_to_prepare(EX_NOPERM, "other users than the directory's owner may write to it", "chmod go-w");
        assert_said(", or choose another with --socket\n");
    }
}

TEST(test_socket_sticky_folder_is_used_with_a_warning) {
    TEST_ASSERT_EQUAL_INT(0, chmod(folder, 01777));
    TEST_ASSERT_EQUAL_INT(0, prepare());
    assert_said("warning");
    assert_said("--socket");
    TEST_ASSERT_EQUAL_INT(0, make());
}

TEST(test_socket_folder_of_another_user_is_refused_with_the_fix) {
    if (!is_root()) {
        return;
    }
    static const mode_t modes[] = {0755, 01777};
    TEST_ASSERT_EQUAL_INT(0, chown(folder, STRANGER, STRANGER));
    for (size_t i = 0; i < sizeof modes / sizeof modes[0]; i++) {
        TEST_ASSERT_EQUAL_INT(0, chmod(folder, modes[i]));
        refused_to_prepare(EX_NOPERM, "belongs to another user", "make the gateway's user its owner");
    }
}

TEST(test_socket_folder_behind_a_symbolic_link_is_refused) {
    TEST_ASSERT_EQUAL_INT(0, symlink(".", in_folder("link")));
    (void)snprintf(config.northbound.socket, sizeof config.northbound.socket, "%s/link/gateway.sock", folder);
    refused_to_prepare(EX_UNAVAILABLE, "symbolic link", "name the directory itself");
    (void)snprintf(config.northbound.socket, sizeof config.northbound.socket, "%s/link//gateway.sock", folder);
    refused_to_prepare(EX_UNAVAILABLE, "symbolic link", "name the directory itself");
}

TEST(test_socket_folder_replaced_after_the_check_is_not_used) {
    char aside[80];
    struct stat status;
    (void)snprintf(aside, sizeof aside, "%s/moved", folder);
    TEST_ASSERT_EQUAL_INT(0, mkdir(in_folder("a"), 0755));
    TEST_ASSERT_EQUAL_INT(0, mkdir(in_folder("b"), 0755));
    (void)snprintf(config.northbound.socket, sizeof config.northbound.socket, "%s/a/gateway.sock", folder);
    TEST_ASSERT_EQUAL_INT(0, prepare());
    TEST_ASSERT_EQUAL_INT(0, rename(in_folder("a"), aside));
    TEST_ASSERT_EQUAL_INT(0, symlink("b", in_folder("a")));
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, make(), logged);
    TEST_ASSERT_EQUAL_INT(-1, lstat(in_folder("b/gateway.sock"), &status));
    TEST_ASSERT_EQUAL_INT(0, lstat(in_folder("moved/gateway.sock"), &status));
    sock_listener_close(&listener);
    TEST_ASSERT_EQUAL_INT(-1, lstat(in_folder("moved/gateway.sock"), &status));
}

TEST(test_socket_has_its_mode_and_group_same_working_directory) {
    char before[256];
    char after[256];
    struct stat status;
    config.northbound.mode = 0640;
    if (geteuid() == 0 && getgrgid(1) != NULL) {
        (void)snprintf(config.northbound.group, sizeof config.northbound.group, "%s", getgrgid(1)->gr_name);
    }
    const mode_t mask = umask(0027);
    TEST_ASSERT_NOT_NULL(getcwd(before, sizeof before));
    TEST_ASSERT_EQUAL_INT(0, prepare());
    TEST_ASSERT_EQUAL_INT(0, make());
    TEST_ASSERT_NOT_NULL(getcwd(after, sizeof after));
    TEST_ASSERT_EQUAL_STRING(before, after);
    TEST_ASSERT_EQUAL_UINT32(0027, umask(mask));
    TEST_ASSERT_EQUAL_INT(0, lstat(in_folder("gateway.sock"), &status));
    TEST_ASSERT_EQUAL_UINT32(0640, status.st_mode & 07777U);
    TEST_ASSERT_EQUAL_UINT32((geteuid() == 0) ? 1 : getegid(), status.st_gid);
    assert_logged("");
}

TEST(test_socket_unknown_group_is_logged_with_the_reason) {
    (void)snprintf(config.northbound.group, sizeof config.northbound.group, "no-such-group");
    TEST_ASSERT_EQUAL_INT(0, prepare());
    TEST_ASSERT_EQUAL_INT(0, make());
    assert_logged("there is no group no-such-group;");
}

/// Creates a socket of another program at the path. Returns -1 if no program answers on it.
static int put_socket(bool answers) {
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    const int fd = socket(AF_UNIX, SOCK_STREAM, 0);
    (void)snprintf(address.sun_path, sizeof address.sun_path, "%s", in_folder("gateway.sock"));
    TEST_ASSERT_EQUAL_INT(0, bind(fd, (const struct sockaddr *)&address, sizeof address));
    TEST_ASSERT_EQUAL_INT(0, answers ? listen(fd, 1) : close(fd));
    return answers ? fd : -1;
}

TEST(test_socket_is_replaced_only_if_no_program_answers) {
    (void)put_socket(false);
    TEST_ASSERT_EQUAL_INT(0, prepare());
    TEST_ASSERT_EQUAL_INT(0, make());
    sock_listener_close(&listener);
    const int fd = put_socket(true);
    TEST_ASSERT_EQUAL_INT(0, prepare());
    TEST_ASSERT_EQUAL_INT(EX_UNAVAILABLE, make());
    assert_said("another program answers on it");
    (void)close(fd);
}

TEST(test_socket_of_another_user_does_not_prevent_start_of_root) {
    if (!is_root()) {
        return;
    }
    const int fd = put_socket(true);
    TEST_ASSERT_EQUAL_INT(0, chown(in_folder("gateway.sock"), STRANGER, STRANGER));
    TEST_ASSERT_EQUAL_INT(0, chmod(folder, 01777));
    TEST_ASSERT_EQUAL_INT(0, prepare());
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, make(), logged);
    (void)close(fd);
}

TEST(test_socket_link_or_plain_file_at_its_path_is_refused) {
    TEST_ASSERT_EQUAL_INT(0, prepare());
    TEST_ASSERT_EQUAL_INT(0, symlink("elsewhere", in_folder("gateway.sock")));
    TEST_ASSERT_EQUAL_INT(EX_UNAVAILABLE, make());
    assert_said("is a symbolic link, which is not followed");
    assert_said("; remove it, or name the real path");
    TEST_ASSERT_EQUAL_INT(0, strncmp(logged, "iwheel-gateway: socket /", 24));
    TEST_ASSERT_EQUAL_INT(0, unlink(in_folder("gateway.sock")));
    (void)close(open(in_folder("gateway.sock"), O_WRONLY | O_CREAT, 0600));
    TEST_ASSERT_EQUAL_INT(0, prepare());
    TEST_ASSERT_EQUAL_INT(EX_UNAVAILABLE, make());
    assert_said("is not a socket");
    TEST_ASSERT_EQUAL_INT(0, access(in_folder("gateway.sock"), F_OK));
}

TEST(test_socket_of_another_program_is_not_removed_at_close) {
    TEST_ASSERT_EQUAL_INT(0, prepare());
    TEST_ASSERT_EQUAL_INT(0, make());
    TEST_ASSERT_EQUAL_INT(0, rename(in_folder("gateway.sock"), strcat(strcpy(logged, folder), "/moved")));
    (void)put_socket(false);
    sock_listener_close(&listener);
    TEST_ASSERT_EQUAL_INT(0, access(in_folder("gateway.sock"), F_OK));
}
