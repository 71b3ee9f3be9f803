// SPDX-License-Identifier: MIT
/// The timer that ends a wait. It is set anew only if it would wake too late, or has woken: too early costs one look, setting
/// it in every cycle one system call for each frame.
#ifndef GATEWAY_WAKEUP_H
#define GATEWAY_WAKEUP_H

#include "iwheel/types.h"

typedef struct {
    int fd;              ///< To wait for; readable once the time has come.
    iw_time_us_t due_us; ///< What it is set to; IW_NEVER: it has woken, or was never set.
} gw_wakeup_t;

/// 0, or an errno.
int gw_wakeup_open(gw_wakeup_t *self);
void gw_wakeup_close(gw_wakeup_t *self);

/// Wakes no later than at this time of CLOCK_MONOTONIC; one that is past wakes at once. IW_NEVER is allowed. Returns whether it
/// had to be set, which also takes back that it has woken.
bool gw_wakeup_by(gw_wakeup_t *self, iw_time_us_t next_us);

/// The wait has told that it has woken.
void gw_wakeup_came(gw_wakeup_t *self);

#endif
