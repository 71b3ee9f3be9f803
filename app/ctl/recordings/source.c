// SPDX-License-Identifier: MIT
#include "source.h"

#include "talk/ctl.h"

#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#define PREFIX "stop-"
/// A gateway whose disk is slow.
#define PIECE_MS 20000
/// The gateway keeps no more than 128 MiB of recordings together.
#define BYTES_MAX ((int64_t)160 * 1024 * 1024)

static const char *last_part(const char *path) {
    const char *slash = strrchr(path, '/');
    return (slash != NULL) ? slash + 1 : path;
}

bool source_is_ours(const char *path) {
    const char *name = last_part(path);
    const char *ending = strrchr(name, '.');
    return strncmp(name, PREFIX, sizeof PREFIX - 1U) == 0 && ending != NULL &&
           (strcmp(ending, ".log") == 0 || strcmp(ending, ".jsonl") == 0 || strcmp(ending, ".conf") == 0);
}

/// Looked for without a word: a file that is not there is told as such.
static bool connected(ctl_t *ctl) {
    if (!ctl->client.open) {
        near_gateway_t gateway = {0};
        near_look(ctl, NULL, &gateway);
        json_decref(gateway.status);
    }
    return ctl->client.open;
}

static bool write_all(int fd, const char *bytes, size_t length) {
    while (length > 0U) {
        const ssize_t now = write(fd, bytes, length);
        if (now <= 0) {
            return false;
        }
        bytes += now;
        length -= (size_t)now;
    }
    return true;
}

/// Piece after piece, the whole compared with its checksum.
static bool fetch(ctl_t *ctl, const char *name, int64_t most, int fd) {
    static char bytes[IWC_PIECE_MAX];
    iwc_piece_t piece = {.size = 1};
    while (piece.next < piece.size && piece.next < most) {
        iwc_let_in(ctl->client.gateway, signals_let_in());
        const iwc_result_t result = iwc_recording(ctl->client.gateway, name, PIECE_MS, bytes, &piece);
        if (result != IWC_OK || piece.size > BYTES_MAX || !write_all(fd, bytes, piece.length)) {
            if (result != IWC_REFUSED) {
                client_close(&ctl->client); // A late reply would be taken for another's.
            }
            return false;
        }
    }
    return lseek(fd, 0, SEEK_SET) == 0;
}

int source_open(ctl_t *ctl, const char *path, int64_t most) {
    const int fd = open(path, O_RDONLY | O_CLOEXEC | O_NOCTTY);
    const int error = errno;
    const bool absent = error == ENOENT || error == ENOTDIR || error == EACCES || error == EPERM;
    if (fd >= 0 || ctl == NULL || !absent || !source_is_ours(path) || !connected(ctl)) {
        return fd;
    }
    const int memory = memfd_create("recording", MFD_CLOEXEC);
    if (memory >= 0 && fetch(ctl, last_part(path), most, memory)) {
        return memory;
    }
    if (memory >= 0) {
        (void)close(memory);
    }
    errno = error;
    return -1;
}

FILE *source_stream(ctl_t *ctl, const char *path, int64_t most) {
    const int fd = source_open(ctl, path, most);
    return (fd >= 0) ? fdopen(fd, "r") : NULL;
}

json_t *source_list(ctl_t *ctl) {
    json_t *reply = connected(ctl) ? near_ask(ctl, json_pack("{s:s}", "cmd", "recordings")) : NULL;
    if (!json_is_array(json_object_get(reply, "recordings"))) {
        json_decref(reply);
        return NULL;
    }
    return reply;
}
