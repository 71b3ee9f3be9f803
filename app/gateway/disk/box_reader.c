// SPDX-License-Identifier: MIT
#include "box_files.h"

#include "sockets/owners.h"

#include "iwheel_northbound/json_out.h"
#include "iwheel_northbound/line.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#define IS_ENDING "use a name from the reply to recordings, followed by .log, .jsonl or .conf"

/// A recording of the list.
typedef struct {
    unsigned long number;
    char stem[GW_BOX_STEM_SIZE];
    bool there[GW_BOX_ENDINGS];
    int64_t bytes[GW_BOX_ENDINGS];
    int64_t wall_us; ///< 0 if unknown.
} listed_t;

typedef struct {
    listed_t entry[GW_BOX_LISTED];
    size_t count;
} list_t;

__attribute__((format(printf, 3, 4))) static void refuse(gw_box_answer_t *out, iwn_error_t error, const char *format,
                                                         ...) {
    va_list list;
    va_start(list, format);
    const int length = vsnprintf(out->text, sizeof out->text, format, list);
    va_end(list);
    out->error = error;
    out->length = (length > 0) ? (uint32_t)length : 0U;
}

/// Ends the fields of a reply, without the brackets around them.
static void finish(iwn_out_t *json, gw_box_answer_t *out) {
    iwn_out_close(json, '}');
    const size_t length = iwn_out_finish(json);
    if (length < 3U) {
        refuse(out, IWN_INTERNAL, "the answer does not fit into a line; report this");
        return;
    }
    out->error = IWN_OK;
    out->length = (uint32_t)length - 3U; // Brackets and newline.
    memmove(out->text, out->text + 1, out->length);
}

/// Returns the recording with that name in the list. Adds it if the list is not full or it is newer than the oldest.
/// Returns NULL if it is not in the list.
static listed_t *place(list_t *list, const char *name, size_t stem) {
    const unsigned long number = strtoul(name + sizeof GW_BOX_PREFIX - 1U, NULL, 10);
    listed_t *oldest = &list->entry[0];
    for (size_t i = 0; i < list->count; i++) {
        listed_t *entry = &list->entry[i];
        if (strlen(entry->stem) == stem && memcmp(entry->stem, name, stem) == 0) {
            return entry;
        }
        if (entry->number < oldest->number) {
            oldest = entry;
        }
    }
    if (list->count == GW_BOX_LISTED && number <= oldest->number) {
        return NULL;
    }
    listed_t *entry = (list->count < GW_BOX_LISTED) ? &list->entry[list->count++] : oldest;
    *entry = (listed_t){.number = number};
    memcpy(entry->stem, name, stem);
    return entry;
}

static void list_file(int directory, const char *name, list_t *list) {
    struct stat status;
    const size_t stem = gw_box_files_stem(name);
    if (stem == 0U || fstatat(directory, name, &status, AT_SYMLINK_NOFOLLOW) != 0 || !S_ISREG(status.st_mode)) {
        return;
    }
    listed_t *entry = place(list, name, stem);
    const unsigned ending = gw_box_files_ending(name + stem);
    if (entry == NULL || ending == GW_BOX_ENDINGS) {
        return;
    }
    entry->there[ending] = true;
    entry->bytes[ending] = (int64_t)status.st_size;
    if (strcmp(gw_box_endings[ending], ".conf") == 0) { // The first file to be written, and always complete.
        entry->wall_us = (int64_t)status.st_mtim.tv_sec * 1000000 + status.st_mtim.tv_nsec / 1000;
    }
}

static int older_first(const void *a, const void *b) {
    const unsigned long first = ((const listed_t *)a)->number;
    const unsigned long second = ((const listed_t *)b)->number;
    return (first > second) - (first < second);
}

static void answer_list(int directory, gw_box_answer_t *out) {
    static list_t list;
    iwn_out_t json;
    DIR *folder = fdopendir(fcntl(directory, F_DUPFD_CLOEXEC, 0));
    const struct dirent *found;
    list.count = 0;
    while (folder != NULL && (found = readdir(folder)) != NULL) {
        list_file(directory, found->d_name, &list);
    }
    if (folder != NULL) {
        (void)closedir(folder);
    }
    qsort(list.entry, list.count, sizeof list.entry[0], older_first);
    iwn_out_init(&json, out->text, sizeof out->text);
    iwn_out_open(&json, NULL, '{');
    iwn_out_open(&json, "recordings", '[');
    for (size_t i = 0; i < list.count; i++) {
        const listed_t *entry = &list.entry[i];
        iwn_out_open(&json, NULL, '{');
        iwn_out_text(&json, "name", entry->stem);
        iwn_out_text(&json, "cause", strchr(entry->stem + sizeof GW_BOX_PREFIX - 1U, '-') + 1);
        iwn_out_known(&json, "wall_us", entry->wall_us > 0, entry->wall_us);
        iwn_out_known(&json, "log_bytes", entry->there[0], entry->bytes[0]);
        iwn_out_known(&json, "jsonl_bytes", entry->there[1], entry->bytes[1]);
        iwn_out_known(&json, "conf_bytes", entry->there[2], entry->bytes[2]);
        iwn_out_close(&json, '}');
    }
    iwn_out_close(&json, ']');
    finish(&json, out);
}

/// Reads up to `size` bytes; fewer at the end of the file only. Returns -1 and errno on an error.
static ssize_t read_at(int fd, int64_t offset, uint8_t *out, size_t size) {
    size_t got = 0;
    while (got < size) {
        const ssize_t n = pread(fd, out + got, size - got, (off_t)offset + (off_t)got);
        if (n < 0 && errno != EINTR) {
            return -1;
        }
        if (n == 0) {
            break;
        }
        got += (n > 0) ? (size_t)n : 0U;
    }
    return (ssize_t)got;
}

/// Computes the checksum of the first `size` bytes. Returns false if they cannot be read.
static bool whole_crc(int fd, int64_t size, uint32_t *out_crc) {
    static uint8_t bytes[GW_BOX_PIECE];
    int64_t at = 0;
    *out_crc = 0;
    while (at < size) {
        const int64_t left = size - at;
        const size_t most = (left < (int64_t)sizeof bytes) ? (size_t)left : sizeof bytes;
        const ssize_t got = read_at(fd, at, bytes, most);
        if (got != (ssize_t)most) {
            return false;
        }
        *out_crc = iwn_line_crc(*out_crc, bytes, most);
        at += (int64_t)most;
    }
    return true;
}

static size_t base64(const uint8_t *bytes, size_t length, char *out) {
    static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    size_t used = 0;
    for (size_t i = 0; i < length; i += 3U) {
        const size_t left = length - i;
        const uint32_t three = (uint32_t)bytes[i] << 16U | ((left > 1U) ? (uint32_t)bytes[i + 1U] << 8U : 0U) |
                               ((left > 2U) ? bytes[i + 2U] : 0U);
        out[used] = digits[three >> 18U];
        out[used + 1U] = digits[three >> 12U & 63U];
        out[used + 2U] = (left > 1U) ? digits[three >> 6U & 63U] : '=';
        out[used + 3U] = (left > 2U) ? digits[three & 63U] : '=';
        used += 4U;
    }
    out[used] = '\0';
    return used;
}

static void write_piece(int fd, const gw_box_question_t *question, int64_t size, gw_box_answer_t *out) {
    static uint8_t bytes[GW_BOX_PIECE];
    static char text[GW_BOX_PIECE / 3U * 4U + 1U];
    const int64_t left = size - question->offset;
    const size_t most = (left < (int64_t)GW_BOX_PIECE) ? (size_t)left : GW_BOX_PIECE;
    const ssize_t got = read_at(fd, question->offset, bytes, most);
    const bool last = left <= (int64_t)GW_BOX_PIECE;
    uint32_t whole = 0;
    if (got != (ssize_t)most || (last && !whole_crc(fd, size, &whole))) {
        refuse(out, IWN_DENIED, "%s cannot be read: %s; see the machine's log (dmesg)", question->name,
               (got < 0) ? strerror(errno) : "it has become shorter");
        return;
    }
    iwn_out_t json;
    iwn_out_init(&json, out->text, sizeof out->text);
    iwn_out_open(&json, NULL, '{');
    iwn_out_text(&json, "name", question->name);
    iwn_out_int(&json, "offset", question->offset);
    iwn_out_int(&json, "size", size);
    (void)base64(bytes, most, text);
    iwn_out_text(&json, "data", text);
    iwn_out_int(&json, "crc32", iwn_line_crc(0, bytes, most));
    iwn_out_known(&json, "file_crc32", last, whole);
    finish(&json, out);
}

/// The name has the right form, so it is not a path.
static int open_file(int directory, const char *name, int64_t *out_size) {
    struct stat status;
    const sock_owners_t owners = sock_owners_of(SOCK_RUNTIME_DIRECTORY);
    // Non-blocking, because the file could be a pipe.
    const int fd = openat(directory, name, O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_NOCTTY | O_CLOEXEC);
    if (fd < 0) {
        return -1;
    }
    const int error = (fstat(fd, &status) != 0) ? errno : sock_owners_wrote(&owners, &status) ? 0 : SOCK_FOLDER_FILE;
    if (error != 0) {
        (void)close(fd);
        errno = error;
        return -1;
    }
    *out_size = (int64_t)status.st_size;
    return fd;
}

static void answer_piece(int directory, const gw_box_question_t *question, gw_box_answer_t *out) {
    int64_t size = 0;
    if (gw_box_files_stem(question->name) == 0U) {
        refuse(out, IWN_BAD_VALUE, "name does not name a file of a recording; " IS_ENDING);
        return;
    }
    if (question->offset < 0) {
        refuse(out, IWN_OUT_OF_RANGE, "offset must be 0 to the size of the file");
        return;
    }
    const int fd = open_file(directory, question->name, &size);
    if (fd < 0 && errno == ENOENT) {
        refuse(out, IWN_DENIED,
               "%s does not exist (the oldest recordings are removed); request the list with recordings",
               question->name);
    } else if (fd < 0) {
        refuse(out, IWN_DENIED, "%s is not read: %s", question->name,
               (errno == ELOOP) ? "it is a symbolic link, which is not followed" : sock_folder_fault(errno));
    } else if (question->offset > size) {
        refuse(out, IWN_OUT_OF_RANGE, "offset must be 0 to %" PRId64 ", the size of %s", size, question->name);
    } else {
        write_piece(fd, question, size, out);
    }
    if (fd >= 0) {
        (void)close(fd);
    }
}

void gw_box_reader_answer(const char *path, const gw_box_question_t *question, gw_box_answer_t *out) {
    const int directory = sock_folder_open_own(path);
    out->client = question->client;
    out->list = question->list;
    if (directory < 0) {
        refuse(out, IWN_DENIED, "the directory of the recordings cannot be read: %s; %s", sock_folder_fault(errno),
               sock_folder_fix(errno));
        return;
    }
    if (question->list) {
        answer_list(directory, out);
    } else {
        answer_piece(directory, question, out);
    }
    (void)close(directory);
}

void gw_box_reader_run(int fd, const char *directory) {
    static gw_box_answer_t answer;
    gw_box_question_t question;
    ssize_t got;
    while ((got = recv(fd, &question, sizeof question, 0)) == (ssize_t)sizeof question || (got < 0 && errno == EINTR)) {
        if (got > 0) {
            gw_box_reader_answer(directory, &question, &answer);
            (void)send(fd, &answer, offsetof(gw_box_answer_t, text) + answer.length, MSG_NOSIGNAL);
        }
    }
}
