// SPDX-License-Identifier: MIT
#include "box_files.h"

#include "sockets/owners.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

/// Reserves space on the disk, so that the recording of an accident is written even on a full disk.
#define RESERVE    "reserve"
#define DIGITS_MIN 6U
#define DIGITS_MAX 10U
#define LETTERS    "abcdefghijklmnopqrstuvwxyz_"

const char *const gw_box_endings[GW_BOX_ENDINGS] = {".log", ".jsonl", ".conf"};

/// A file of a recording. After sorting by number, the first file of each recording represents the recording.
typedef struct {
    uint64_t bytes;
    uint32_t number;
    bool removed;                  ///< Selected for removal.
    char cause[GW_BOX_CAUSE_SIZE]; ///< Cause from the name of the event file; empty if there is none.
} found_t;

typedef struct {
    found_t file[GW_BOX_SURVEYED];
    size_t files;
    bool partial;      ///< The directory has more files than that.
    size_t recordings; ///< After sorting: the first entries of `file`.
    size_t left;       ///< Number of recordings that are not selected for removal.
    uint64_t bytes;    ///< Size of these recordings.
} survey_t;

int gw_box_files_open(const char *directory) {
    if (mkdir(directory, 0755) != 0 && errno != EEXIST) {
        return -1;
    }
    return sock_folder_open_own(directory);
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

/// Returns the number in a file name; 0 if the name has another form.
static uint32_t number_of(const char *name) {
    const unsigned long number =
        (gw_box_files_stem(name) > 0U) ? strtoul(name + sizeof GW_BOX_PREFIX - 1U, NULL, 10) : 0U;
    return (number < UINT32_MAX) ? (uint32_t)number : 0U;
}

/// Calls `visitor` for each file. A directory that cannot be read counts as empty.
static void visit(int directory, void (*visitor)(int directory, const char *name, void *context), void *context) {
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
        visitor(directory, entry->d_name, context);
    }
    (void)closedir(list);
}

static void take_newest(int directory, const char *name, void *context) {
    uint32_t *newest = (uint32_t *)context;
    const uint32_t number = number_of(name);
    (void)directory;
    if (number > *newest) {
        *newest = number;
    }
}

uint32_t gw_box_files_next(int directory) {
    uint32_t newest = 0;
    visit(directory, take_newest, &newest);
    return newest + 1U;
}

static void take_remove(int directory, const char *name, void *context) {
    if (number_of(name) == *(const uint32_t *)context) {
        (void)unlinkat(directory, name, 0);
    }
}

void gw_box_files_remove(int directory, uint32_t number) {
    visit(directory, take_remove, &number);
}

static void take_file(int directory, const char *name, void *context) {
    survey_t *survey = (survey_t *)context;
    struct stat status;
    const uint32_t number = number_of(name);
    if (number != 0U && survey->files == GW_BOX_SURVEYED) {
        survey->partial = true;
        return;
    }
    if (number == 0U || fstatat(directory, name, &status, AT_SYMLINK_NOFOLLOW) != 0 || !S_ISREG(status.st_mode)) {
        return;
    }
    found_t *file = &survey->file[survey->files++];
    *file = (found_t){.number = number, .bytes = (uint64_t)status.st_size};
    const char *cause = strchr(name + sizeof GW_BOX_PREFIX - 1U, '-') + 1;
    const size_t letters = strspn(cause, LETTERS);
    if (strcmp(cause + letters, ".jsonl") == 0) {
        memcpy(file->cause, cause, letters); // gw_box_files_stem: shorter than GW_BOX_CAUSE_SIZE.
    }
}

static int lower_first(const void *a, const void *b) {
    const uint32_t first = ((const found_t *)a)->number;
    const uint32_t second = ((const found_t *)b)->number;
    return (first > second) - (first < second);
}

/// Makes one entry of all files of a recording. `last` is the entry of the recording before, or NULL.
static void merge(survey_t *survey, found_t *last, const found_t *file) {
    survey->bytes += file->bytes;
    if (last == NULL || last->number != file->number) {
        survey->file[survey->recordings++] = *file;
        return;
    }
    last->bytes += file->bytes;
    if (file->cause[0] != '\0') {
        memcpy(last->cause, file->cause, sizeof last->cause);
    }
}

/// Reads the directory once. Then `file` has one entry per recording, the oldest first. The result is valid until the
/// next call.
static survey_t *survey_directory(int directory) {
    static survey_t found; // Too large for a stack.
    survey_t *const survey = &found;
    survey->files = survey->recordings = 0;
    survey->bytes = 0;
    survey->partial = false;
    visit(directory, take_file, survey);
    qsort(survey->file, survey->files, sizeof survey->file[0], lower_first);
    for (size_t i = 0; i < survey->files; i++) {
        const found_t file = survey->file[i];
        merge(survey, (survey->recordings > 0U) ? &survey->file[survey->recordings - 1U] : NULL, &file);
    }
    survey->left = survey->recordings;
    return survey;
}

/// Returns true if the recording is of a stop in motion, by the first lines of its event file. A file that cannot be
/// read counts as in motion, so that it is not removed first.
static bool was_in_motion(int directory, const found_t *recording) {
    char name[GW_BOX_STEM_SIZE + 8U];
    static char text[2U * GW_BOX_LINE_SIZE]; // Too large for a stack.
    (void)snprintf(name, sizeof name, GW_BOX_PREFIX "%06u-%s.jsonl", (unsigned)recording->number, recording->cause);
    const int fd = openat(directory, name, O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);
    const ssize_t got = (fd >= 0) ? read(fd, text, sizeof text - 1U) : -1;
    text[(got > 0) ? (size_t)got : 0U] = '\0';
    if (fd >= 0) {
        (void)close(fd);
    }
    return !gw_box_line_is_harmless(text);
}

/// Selects recordings for removal, the oldest first, until the rest fits `limits`.
static void choose(survey_t *survey, int directory, const gw_box_limits_t *limits, bool harmless_only) {
    for (size_t i = 0; i < survey->recordings && (survey->left > limits->recordings || survey->bytes > limits->bytes);
         i++) {
        found_t *recording = &survey->file[i];
        const bool stays =
            recording->removed || recording->number >= limits->below || recording->number == limits->running;
        if (!stays && !(harmless_only && was_in_motion(directory, recording))) {
            recording->removed = true;
            survey->bytes -= recording->bytes;
            survey->left--;
        }
    }
}

static void take_chosen(int directory, const char *name, void *context) {
    survey_t *survey = (survey_t *)context;
    const found_t key = {.number = number_of(name)};
    const found_t *recording =
        (const found_t *)bsearch(&key, survey->file, survey->recordings, sizeof key, lower_first);
    if (recording != NULL && recording->removed && unlinkat(directory, name, 0) == 0) {
        survey->files--;
    }
}

/// Makes one pass over the directory and returns the number of removed files.
static size_t thin_out(survey_t *survey, int directory, const gw_box_limits_t *limits) {
    choose(survey, directory, limits, true);
    if (limits->in_motion) {
        choose(survey, directory, limits, false);
    }
    const size_t before = survey->files;
    if (survey->left < survey->recordings) {
        visit(directory, take_chosen, survey);
    }
    return before - survey->files;
}

void gw_box_files_rotate(int directory, const gw_box_limits_t *limits) {
    survey_t *survey;
    do {
        survey = survey_directory(directory);
    } while (thin_out(survey, directory, limits) > 0U && survey->partial);
}

bool gw_box_files_drop_oldest(int directory, const gw_box_limits_t *limits) {
    survey_t *const survey = survey_directory(directory);
    if (survey->recordings == 0U) {
        return false;
    }
    const gw_box_limits_t but_one = {survey->recordings - 1U, UINT64_MAX, limits->below, limits->in_motion,
                                     limits->running};
    return thin_out(survey, directory, &but_one) > 0U;
}

void gw_box_files_limit_requested(int directory, size_t most) {
    survey_t *const survey = survey_directory(directory);
    size_t left = most;
    for (size_t i = survey->recordings; i > 0U; i--) { // The newest first.
        found_t *recording = &survey->file[i - 1U];
        if (strcmp(recording->cause, GW_BOX_REQUESTED) == 0) {
            recording->removed = left == 0U;
            left -= (left > 0U) ? 1U : 0U;
        }
    }
    visit(directory, take_chosen, survey);
}

void gw_box_files_reserve(int directory, uint64_t bytes) {
    const int fd = openat(directory, RESERVE, O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0600);
    if (fd < 0) {
        return; // The file exists, or cannot be created.
    }
    if (fallocate(fd, 0, 0, (off_t)bytes) != 0) {
        (void)unlinkat(directory, RESERVE, 0);
    }
    (void)close(fd);
}

bool gw_box_files_release(int directory) {
    return unlinkat(directory, RESERVE, 0) == 0;
}

FILE *gw_box_files_create(int directory, const char *stem, const char *ending) {
    char name[GW_BOX_STEM_SIZE + 8U];
    (void)snprintf(name, sizeof name, "%s%s", stem, ending);
    const int fd = openat(directory, name, O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0644);
    if (fd >= 0) {
        (void)fchmod(fd, 0644); // Users who may enter the directory may read it, independent of the umask.
    }
    return (fd >= 0) ? fdopen(fd, "w") : NULL;
}
