// SPDX-License-Identifier: MIT
#include "folder.h"

#include "unity.h"

#include <dirent.h>
#include <ftw.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define FOLDER "/tmp/iwheel-test-XXXXXX"

char folder[] = FOLDER;

void folder_make(void) {
    memcpy(folder, FOLDER, sizeof FOLDER);
    TEST_ASSERT_NOT_NULL(mkdtemp(folder));
}

static int remove_one(const char *path, const struct stat *status, int kind, struct FTW *place) {
    (void)status;
    (void)kind;
    (void)place;
    return remove(path);
}

static void remove_all(const char *path) {
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, nftw(path, remove_one, 8, FTW_DEPTH | FTW_PHYS), path);
}

void folder_remove(void) {
    remove_all(folder);
    if (file_exists(folder_in_memory())) {
        remove_all(folder_in_memory());
    }
}

char *in_folder(const char *name) {
    static char path[256];
    (void)snprintf(path, sizeof path, "%s/%s", folder, name);
    return path;
}

const char *folder_in_memory(void) {
    static char path[64];
    (void)snprintf(path, sizeof path, "/dev/shm%s", strrchr(folder, '/'));
    return path;
}

void file_put(const char *path, const void *bytes, size_t length) {
    FILE *file = fopen(path, "we");
    TEST_ASSERT_NOT_NULL_MESSAGE(file, path);
    TEST_ASSERT_EQUAL_size_t(length, fwrite(bytes, 1, length, file));
    TEST_ASSERT_EQUAL_INT(0, fclose(file));
}

const char *file_text(const char *path) {
    static char text[65536];
    FILE *file = fopen(path, "re");
    TEST_ASSERT_NOT_NULL_MESSAGE(file, path);
    text[fread(text, 1, sizeof text - 1U, file)] = '\0';
    (void)fclose(file);
    return text;
}

bool file_exists(const char *path) {
    return access(path, F_OK) == 0;
}

unsigned files_in(const char *directory, const char *prefix) {
    unsigned files = 0;
    DIR *list = opendir(directory);
    TEST_ASSERT_NOT_NULL_MESSAGE(list, directory);
    for (const struct dirent *entry = readdir(list); entry != NULL; entry = readdir(list)) {
        files += (entry->d_name[0] != '.' && strncmp(entry->d_name, prefix, strlen(prefix)) == 0) ? 1U : 0U;
    }
    (void)closedir(list);
    return files;
}
