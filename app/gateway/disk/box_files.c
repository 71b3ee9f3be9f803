// SPDX-License-Identifier: MIT
#include "box_files.h"

#include "process/owners.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define DIGITS_MIN 6U
#define DIGITS_MAX 10U
#define LETTERS    "abcdefghijklmnopqrstuvwxyz_"

const char *const gw_box_endings[GW_BOX_ENDINGS] = {".log", ".jsonl", ".conf"};

typedef struct {
    uint32_t oldest; ///< 0: there is none.
    uint32_t newest;
    uint32_t recordings; ///< Counted by their .jsonl files and, lacking one, not at all.
    uint64_t bytes;
} survey_t;

int gw_box_files_open(const char *directory) {
    if (mkdir(directory, 0755) != 0 && errno != EEXIST) {
        return -1;
    }
    return gw_folder_open_own(directory);
}

unsigned gw_box_files_ending(const char *text) {
    unsigned i = 0;
    while (i < GW_BOX_ENDINGS && strcmp(text, gw_box_endings[i]) != 0) {
        i++;
    }
    return i;
}

size_t gw_box_files_stem(const char *name) {
    const size_t prefix = sizeof GW_BOX_PREFIX - 1U;
    if (strlen(name) >= GW_BOX_STEM_SIZE || strncmp(name, GW_BOX_PREFIX, prefix) != 0) {
        return 0;
    }
    const size_t digits = strspn(name + prefix, "0123456789");
    const char *cause = name + prefix + digits + 1U;
    if (digits < DIGITS_MIN || digits > DIGITS_MAX || cause[-1] != '-') {
        return 0;
    }
    const size_t letters = strspn(cause, LETTERS);
    const bool good =
        letters > 0U && letters < GW_BOX_CAUSE_SIZE && gw_box_files_ending(cause + letters) < GW_BOX_ENDINGS;
    return good ? (size_t)(cause - name) + letters : 0U;
}

/// The number in a file's name; 0 if it is none of ours.
static uint32_t number_of(const char *name) {
    const unsigned long number =
        (gw_box_files_stem(name) > 0U) ? strtoul(name + sizeof GW_BOX_PREFIX - 1U, NULL, 10) : 0U;
    return (number < UINT32_MAX) ? (uint32_t)number : 0U;
}

static bool is_event_file(const char *name) {
    const char *ending = strrchr(name, '.');
    return ending != NULL && strcmp(ending, ".jsonl") == 0;
}

static void count_file(int directory, const char *name, survey_t *survey) {
    struct stat status;
    const uint32_t number = number_of(name);
    if (number == 0U || fstatat(directory, name, &status, AT_SYMLINK_NOFOLLOW) != 0 || !S_ISREG(status.st_mode)) {
        return;
    }
    survey->oldest = (survey->oldest == 0U || number < survey->oldest) ? number : survey->oldest;
    survey->newest = (number > survey->newest) ? number : survey->newest;
    survey->recordings += is_event_file(name) ? 1U : 0U;
    survey->bytes += (uint64_t)status.st_size;
}

/// Calls for each file; a directory that cannot be read has none.
static void visit(int directory, void (*take)(int directory, const char *name, void *context), void *context) {
    const int fd = openat(directory, ".", O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    DIR *list = (fd >= 0) ? fdopendir(fd) : NULL;
    if (list == NULL) {
        if (fd >= 0) {
            (void)close(fd);
        }
        return;
    }
    const struct dirent *entry;
    while ((entry = readdir(list)) != NULL) {
        take(directory, entry->d_name, context);
    }
    (void)closedir(list);
}

static void take_count(int directory, const char *name, void *context) {
    count_file(directory, name, (survey_t *)context);
}

static survey_t look(int directory) {
    survey_t survey = {0};
    visit(directory, take_count, &survey);
    return survey;
}

uint32_t gw_box_files_next(int directory) {
    return look(directory).newest + 1U;
}

static void take_remove(int directory, const char *name, void *context) {
    if (number_of(name) == *(const uint32_t *)context) {
        (void)unlinkat(directory, name, 0);
    }
}

void gw_box_files_remove(int directory, uint32_t number) {
    visit(directory, take_remove, &number);
}

void gw_box_files_rotate(int directory, uint32_t most, uint64_t bytes) {
    survey_t survey = look(directory);
    while ((survey.recordings > most || survey.bytes > bytes) && survey.oldest < survey.newest) {
        const uint32_t removed = survey.oldest;
        gw_box_files_remove(directory, removed);
        survey = look(directory);
        if (survey.oldest == removed) {
            return; // It cannot be removed: never try for ever.
        }
    }
}

bool gw_box_files_drop_oldest(int directory, uint32_t number) {
    const uint32_t oldest = look(directory).oldest;
    if (oldest == 0U || oldest >= number) {
        return false;
    }
    gw_box_files_remove(directory, oldest);
    return look(directory).oldest != oldest;
}

FILE *gw_box_files_create(int directory, const char *stem, const char *ending) {
    char name[GW_BOX_STEM_SIZE + 8U];
    (void)snprintf(name, sizeof name, "%s%s", stem, ending);
    const int fd = openat(directory, name, O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0644);
    if (fd >= 0) {
        (void)fchmod(fd, 0644); // Whoever may enter the directory may read it, whatever the service's umask.
    }
    return (fd >= 0) ? fdopen(fd, "w") : NULL;
}
