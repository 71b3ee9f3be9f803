// SPDX-License-Identifier: MIT
#include "wrapped.h"

#include "daemon_world.h"
#include "kernel.h"

#include <errno.h>
#include <string.h>
#include <sys/socket.h>

static iw_can_frame_t frame_in(const struct mmsghdr *message) {
    struct can_frame raw;
    memcpy(&raw, message->msg_hdr.msg_iov->iov_base, sizeof raw);
    iw_can_frame_t frame = {.id = raw.can_id, .dlc = raw.len};
    memcpy(frame.data, raw.data, sizeof frame.data);
    return frame;
}

/// The interface's queue accepts one frame and refuses the next.
static bool is_full_behind(unsigned sent) {
    const bool full = sent > 0U && vk.fail_permille > 0U && sim_random_below(&vk.random, 1000U) < vk.fail_permille;
    vk.failed += full ? 1U : 0U;
    if (full) {
        vk_note_failure();
    }
    return full;
}

/// The kernel delivers no signal between two frames, so the process does not die there. The error of a frame after the first
/// is dropped, as in the kernel.
int __wrap_sendmmsg(int fd, struct mmsghdr *messages, unsigned count, int flags) {
    static const int errors[] = {ENOBUFS, EAGAIN, EINTR, 0};
    const iw_can_frame_t first = frame_in(&messages[0]);
    unsigned sent = 0;
    (void)flags;
    world_call(&first, count);
    int error = vk_call("sendmmsg", errors) ? vk_take_can_error(fd) : errno;
    for (; sent < count; sent++) {
        const iw_can_frame_t frame = frame_in(&messages[sent]);
        error = (error == 0 && is_full_behind(sent)) ? ENOBUFS : error;
        if (error != 0) {
            world_sent(&frame, false);
            break;
        }
        error = world_send(&frame);
        if (error != 0) {
            break;
        }
        messages[sent].msg_len = sizeof(struct can_frame);
    }
    errno = error; // The judge has accessed files since.
    return (int)vk_done((sent > 0U) ? (long)sent : -1);
}
