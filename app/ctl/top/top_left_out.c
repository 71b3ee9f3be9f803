// SPDX-License-Identifier: MIT
// Replaces `top` in a build without ncurses.
#include "talk/ctl.h"

int verb_top(ctl_t *self, int count, char **words) {
    (void)self;
    (void)count;
    (void)words;
    return ctl_fail(CTL_UNAVAILABLE, "this build has no top, because ncurses was missing; apt-get install "
                                     "libncurses-dev, configure and build again; until then: iwheelctl status");
}
