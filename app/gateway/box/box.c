// SPDX-License-Identifier: MIT
#include "box.h"

#include "disk/box_files.h"

#include <errno.h>
#include <stddef.h>
#include <sys/mman.h>

/// The motors come before the diary.
#define NICE 10

static void write_recordings(int fd, const void *context) {
    const gw_box_t *self = (const gw_box_t *)context;
    gw_box_writer_run(fd, self->ring, &self->wish);
}

static void read_recordings(int fd, const void *context) {
    const gw_box_t *self = (const gw_box_t *)context;
    gw_box_reader_run(fd, self->wish.directory);
}

int gw_box_open(gw_box_t *self, const gw_box_wish_t *wish) {
    *self = (gw_box_t){
        .writer = {.fd = -1}, .reader = {.fd = -1}, .wish = *wish, .ring_size = blackbox_ring_size(wish->blackbox_s)};
    self->ring = (blackbox_ring_t *)mmap(NULL, self->ring_size, PROT_READ | PROT_WRITE,
                                         MAP_SHARED | MAP_ANONYMOUS | MAP_POPULATE, -1, 0);
    if (self->ring == MAP_FAILED) {
        self->ring = NULL;
        return errno;
    }
    blackbox_ring_init(self->ring, wish->blackbox_s);
    if (wish->blackbox_s > 0U) {
        (void)gw_child_start(&self->writer, &(gw_child_work_t){"iwheel-blackbox", NICE, write_recordings, self});
        (void)gw_child_start(&self->reader, &(gw_child_work_t){"iwheel-records", NICE, read_recordings, self});
    }
    return 0;
}

void gw_box_close(gw_box_t *self) {
    const gw_box_order_t bye = {.last = true};
    (void)gw_child_say(&self->writer, &bye, sizeof bye);
    gw_child_close(&self->writer);
    gw_child_close(&self->reader);
    if (self->ring != NULL) {
        (void)munmap(self->ring, self->ring_size);
        self->ring = NULL;
    }
}

bool gw_box_write(gw_box_t *self, const gw_box_order_t *order) {
    return gw_child_revive(&self->writer) && gw_child_say(&self->writer, order, sizeof *order);
}

static gw_child_news_t not_understood(gw_child_t *child) {
    gw_child_close(child);
    return GW_CHILD_ENDED;
}

gw_child_news_t gw_box_take(gw_box_t *self) {
    gw_box_result_t result;
    size_t length;
    const gw_child_news_t news = gw_child_hear(&self->writer, &result, sizeof result, &length);
    if (news == GW_CHILD_SAID && length != sizeof result) {
        return not_understood(&self->writer);
    }
    self->last = (news == GW_CHILD_SAID) ? result : self->last;
    return news;
}

bool gw_box_ask(gw_box_t *self, const gw_box_question_t *question) {
    return gw_child_revive(&self->reader) && gw_child_say(&self->reader, question, sizeof *question);
}

gw_child_news_t gw_box_hear(gw_box_t *self) {
    const size_t head = offsetof(gw_box_answer_t, text);
    size_t length;
    const gw_child_news_t news = gw_child_hear(&self->reader, &self->answer, sizeof self->answer, &length);
    if (news == GW_CHILD_SAID && (length < head || length - head != self->answer.length)) {
        return not_understood(&self->reader);
    }
    return news;
}
