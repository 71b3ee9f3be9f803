// SPDX-License-Identifier: MIT
#include "candump_reader.h"

#include "candump_form.h"

#include <errno.h>
#include <string.h>
#include <unistd.h>

IW_STATIC_ASSERT(sizeof(((candump_reader_t *)0)->buffer) > CANDUMP_READ_MAX, a_line_fits);

void candump_reader_init(candump_reader_t *self, int fd) {
    self->fd = fd;
    self->line = 0;
    self->why = "";
    self->begin = 0;
    self->end = 0;
    self->source = CANDUMP_NEW;
}

static void fill(candump_reader_t *self) {
    memmove(self->buffer, &self->buffer[self->begin], self->end - self->begin);
    self->end -= self->begin;
    self->begin = 0;
    ssize_t got;
    do {
        got = read(self->fd, &self->buffer[self->end], sizeof self->buffer - self->end);
    } while (got < 0 && errno == EINTR);
    self->end += (got > 0) ? (size_t)got : 0U;
    if (got <= 0) {
        self->source = (got < 0) ? CANDUMP_BROKEN : CANDUMP_ENDED;
    }
}

static bool has_ended(const candump_reader_t *self) {
    return self->source >= CANDUMP_ENDED;
}

/// Returns the newline of the next line, at most CANDUMP_READ_MAX ahead, or NULL if there is none yet.
static const char *find_newline(candump_reader_t *self) {
    for (;;) {
        const size_t there = self->end - self->begin;
        const size_t searched = (there < CANDUMP_READ_MAX) ? there : CANDUMP_READ_MAX;
        const char *newline = memchr(&self->buffer[self->begin], '\n', searched);
        if (newline != NULL || has_ended(self) || searched == CANDUMP_READ_MAX) {
            return newline;
        }
        fill(self);
    }
}

static void skip_line(candump_reader_t *self) {
    const char *newline = NULL;
    while (newline == NULL && (self->begin < self->end || !has_ended(self))) {
        newline = memchr(&self->buffer[self->begin], '\n', self->end - self->begin);
        self->begin = (newline != NULL) ? (size_t)(newline - self->buffer) + 1U : self->end;
        if (newline == NULL) {
            fill(self);
        }
    }
}

static candump_read_t report_bad(candump_reader_t *self, const char *why) {
    self->why = why;
    return CANDUMP_READ_BAD;
}

/// Handles a rest without newline: too long, cut, or the end.
static candump_read_t read_rest(candump_reader_t *self, candump_t *frame) {
    const size_t there = self->end - self->begin;
    if (self->source == CANDUMP_BROKEN) {
        return CANDUMP_READ_FAILED;
    }
    if (there == 0U) {
        return CANDUMP_READ_END;
    }
    self->line++;
    if (there >= CANDUMP_READ_MAX) {
        skip_line(self);
        return report_bad(self, "longer than any frame; is this a recording in candump's log form?");
    }
    const char *why = "";
    const candump_result_t result = candump_parse(&self->buffer[self->begin], there, frame, &why);
    self->begin = self->end;
    return (result == CANDUMP_EMPTY)
               ? CANDUMP_READ_END
               : report_bad(self, "the last line has no line end, so it may be cut and is left out; "
                                  "if it is whole, add the line end");
}

/// Skips a byte order mark. Returns false and sets `why` if the first line is in another form.
static bool begin(candump_reader_t *self) {
    self->source = CANDUMP_OPEN;
    (void)find_newline(self);
    self->begin += candump_form_mark(&self->buffer[self->begin], self->end - self->begin);
    const char *why = candump_form_foreign(&self->buffer[self->begin], self->end - self->begin);
    if (why != NULL) {
        self->why = why;
        self->line = 1;
        self->begin = self->end;
        self->source = CANDUMP_ENDED;
    }
    return why == NULL;
}

candump_read_t candump_reader_next(candump_reader_t *self, candump_t *out_frame) {
    if (self->source == CANDUMP_NEW && !begin(self)) {
        return CANDUMP_READ_FOREIGN;
    }
    for (;;) {
        const char *newline = find_newline(self);
        if (newline == NULL) {
            return read_rest(self, out_frame);
        }
        const char *line = &self->buffer[self->begin];
        const size_t length = (size_t)(newline - line);
        self->begin += length + 1U;
        self->line++;
        const candump_result_t result = candump_parse(line, length, out_frame, &self->why);
        if (result != CANDUMP_EMPTY) {
            return (result == CANDUMP_FRAME) ? CANDUMP_READ_FRAME : CANDUMP_READ_BAD;
        }
    }
}
