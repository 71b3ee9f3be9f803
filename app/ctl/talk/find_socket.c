// SPDX-License-Identifier: MIT
#include "find_socket.h"

#include <dirent.h>
#include <errno.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

static bool is_socket(const char *path) {
    struct stat status;
    return stat(path, &status) == 0 && S_ISSOCK(status.st_mode);
}

static bool has_suffix(const char *name) {
    const size_t length = strlen(name);
    return length > 5U && strcmp(name + length - 5U, ".sock") == 0;
}

find_socket_t find_socket(const char *directory, char *out, size_t size) {
    char path[512];
    unsigned found = 0;
    size_t used = 0;
    DIR *folder = opendir(directory);
    out[0] = '\0';
    if (folder == NULL) {
        return errno == EACCES ? FIND_SOCKET_DENIED : FIND_SOCKET_NONE;
    }
    for (const struct dirent *entry = readdir(folder); entry != NULL; entry = readdir(folder)) {
        const int length = snprintf(path, sizeof(path), "%s/%s", directory, entry->d_name);
        if (length < 0 || (size_t)length >= sizeof(path) || !has_suffix(entry->d_name) || !is_socket(path)) {
            continue;
        }
        found++;
        const int n = snprintf(out + used, size - used, "%s%s", used > 0 ? " " : "", path);
        used += n > 0 && (size_t)n < size - used ? (size_t)n : 0U;
        out[used] = '\0';
    }
    (void)closedir(folder);
    if (found == 0) {
        return FIND_SOCKET_NONE;
    }
    return found == 1 ? FIND_SOCKET_ONE : FIND_SOCKET_SEVERAL;
}
