// SPDX-License-Identifier: MIT
#include "folder.h"

#include "unity.h"

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
    if (access(folder_in_memory(), F_OK) == 0) {
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
