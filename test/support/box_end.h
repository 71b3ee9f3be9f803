// SPDX-License-Identifier: MIT
#ifndef IW_BOX_END_H
#define IW_BOX_END_H

#include "box/box.h"

#include <sys/wait.h>

/// Closes the recordings, and waits until their processes have written the last files and ended: only then can a test
/// remove the folder.
static inline void box_end(gw_box_t *self) {
    gw_box_close(self);
    while (wait(NULL) > 0) {
    }
}

#endif
