// SPDX-License-Identifier: MIT
// Sends a stop through a connection of its own, to whichever of the gateway's two sockets accepts it.
#include "connection.h"

#include <limits.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>

/// Longest time of one attempt, if there is another socket.
#define ATTEMPT_US 300000
/// Interval between two rounds of attempts.
#define AGAIN_US 5000
/// Longest time for each of several gateways in the first round. A working gateway replies within milliseconds.
#define ROUND_US 60000
/// Most gateways of a machine.
#define GATEWAYS_MAX 64U

/// Writes the path of the gateway's other socket: watch/NAME.sock for NAME.sock, and the reverse. Returns false if it
/// is too long.
static bool find_other(const char *path, char *out, size_t size) {
    const char *slash = strrchr(path, '/');
    const char *name = (slash != NULL) ? slash + 1 : path;
    const size_t folder = (size_t)(name - path); // With the slash.
    const size_t watch = strlen(IWC_WATCH_DIRECTORY "/");
    const bool watches = folder >= watch && strncmp(name - watch, IWC_WATCH_DIRECTORY "/", watch) == 0 &&
                         (folder == watch || name[-(ptrdiff_t)watch - 1] == '/');
    const int length = watches ? snprintf(out, size, "%.*s%s", (int)(folder - watch), path, name)
                               : snprintf(out, size, "%.*s" IWC_WATCH_DIRECTORY "/%s", (int)folder, path, name);
    return length > 0 && (size_t)length < size;
}

/// Returns true for a result that another attempt cannot change.
static bool is_settled(const iwc_t *self, iwc_result_t result) {
    const bool crowded = result == IWC_REFUSED && strcmp(self->error, "too_many_clients") == 0;
    return result == IWC_OK || result == IWC_INTERRUPTED || (result == IWC_REFUSED && !crowded);
}

/// Returns true if another attempt with the same socket will fail for the same reason.
static bool is_closed_to_us(iwc_result_t result) {
    return result == IWC_NOT_THERE || result == IWC_DENIED || result == IWC_INVALID;
}

static iwc_result_t attempt(iwc_t *self, const char *path, const char *request, int64_t deadline_us) {
    const iwc_result_t result = iwc_dial(self, path, deadline_us);
    const int64_t left_us = deadline_us - iwc_now_us();
    const int64_t left_ms = (left_us > 0) ? left_us / 1000 + 1 : 0;
    return (result == IWC_OK) ? iwc_ask(self, request, (left_ms < INT_MAX) ? (int)left_ms : IWC_FOREVER, NULL) : result;
}

/// Outcome of the first socket. It is the result of the call if no socket accepts the stop.
typedef struct {
    iwc_result_t result;
    int error_number;
    char error[sizeof(((iwc_t *)NULL)->error)];
    char reason[sizeof(((iwc_t *)NULL)->reason)];
} outcome_t;

static void note_outcome(outcome_t *outcome, const iwc_t *self, iwc_result_t result) {
    outcome->result = result;
    outcome->error_number = self->error_number;
    memcpy(outcome->error, self->error, sizeof outcome->error);
    memcpy(outcome->reason, self->reason, sizeof outcome->reason);
}

static iwc_result_t restore(const outcome_t *outcome, iwc_t *self) {
    self->error_number = outcome->error_number;
    memcpy(self->error, outcome->error, sizeof self->error);
    memcpy(self->reason, outcome->reason, sizeof self->reason);
    return outcome->result;
}

static iwc_result_t stop_by_either(iwc_t *self, const char *const paths[2], const char *request, int64_t deadline_us) {
    outcome_t first = {.result = IWC_CLOSED};
    for (bool again = true; again;) {
        again = false;
        for (size_t i = 0; i < 2 && paths[i] != NULL; i++) {
            const int64_t now_us = iwc_now_us();
            const bool limited = paths[1] != NULL && deadline_us - now_us > ATTEMPT_US;
            const iwc_result_t result = attempt(self, paths[i], request, limited ? now_us + ATTEMPT_US : deadline_us);
            if (is_settled(self, result)) {
                return result;
            }
            if (i == 0 &&
                (first.result == IWC_CLOSED || result != IWC_TIMEOUT)) { // Not the timeout of the last attempt.
                note_outcome(&first, self, result);
            }
            again = again || !is_closed_to_us(result);
        }
        again = again && iwc_now_us() < deadline_us;
        if (again && iwc_await(self, 0, iwc_now_us() + AGAIN_US) == IWC_INTERRUPTED) {
            return IWC_INTERRUPTED;
        }
    }
    return restore(&first, self);
}

static iwc_result_t stop_one(iwc_t *self, const char *path, const char *request, int64_t deadline_us) {
    char other[PATH_MAX];
    const char *const paths[2] = {path, find_other(path, other, sizeof other) ? other : NULL};
    return stop_by_either(self, paths, request, deadline_us);
}

/// Sends the request to each gateway, in rounds, so that a gateway that hangs delays the others little. `paths` are
/// `length` bytes, each path with a terminator. Returns IWC_OK if one gateway executed it.
static iwc_result_t stop_each(iwc_t *self, const char *paths, size_t length, const char *request, int64_t deadline_us) {
    bool done[GATEWAYS_MAX] = {false};
    outcome_t failure = {.result = IWC_NOT_THERE};
    bool executed = false;
    bool again = true;
    for (int64_t round_us = ROUND_US; again; round_us *= 2) {
        unsigned gateway = 0;
        again = false;
        for (size_t at = 0; at < length && gateway < GATEWAYS_MAX; at += strlen(paths + at) + 1U, gateway++) {
            const int64_t end_us = iwc_now_us() + round_us;
            if (done[gateway]) {
                continue;
            }
            const iwc_result_t result =
                stop_one(self, paths + at, request, (end_us < deadline_us) ? end_us : deadline_us);
            done[gateway] = is_settled(self, result) || is_closed_to_us(result);
            executed = executed || result == IWC_OK;
            again = again || !done[gateway];
            if (result != IWC_OK && failure.result == IWC_NOT_THERE) {
                note_outcome(&failure, self, result);
            }
            if (result == IWC_INTERRUPTED) {
                return result;
            }
        }
        again = again && iwc_now_us() < deadline_us;
    }
    return executed ? IWC_OK : restore(&failure, self);
}

iwc_result_t iwc_stop_by(iwc_t *self, const char *path, const char *request, int timeout_ms) {
    const int64_t deadline_us = iwc_deadline_us(timeout_ms);
    char found[GATEWAYS_MAX * sizeof self->path];
    size_t length = 0;
    iwc_result_t result = (path == NULL) ? iwc_find_paths(found, sizeof found, &length) : IWC_OK;
    if (result == IWC_OK) {
        result = stop_one(self, (path != NULL) ? path : found, request, deadline_us);
    } else if (result == IWC_SEVERAL) {
        result = stop_each(self, found, length, request, deadline_us);
    }
    iwc_close(self);
    return iwc_note(self, result);
}
