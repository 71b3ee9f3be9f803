// SPDX-License-Identifier: MIT
#include "blackbox_entry.h"

#include <string.h>

static const char *const names[BLACKBOX_KINDS] = {
    [BLACKBOX_FRAME] = "frame",
    [BLACKBOX_STEP] = "step",
    [BLACKBOX_START] = "start",
    [BLACKBOX_ESTOP] = "estop_line",
    [BLACKBOX_BUS] = "bus",
    [BLACKBOX_FACTS] = "facts",
    [BLACKBOX_SUSPENDED] = "suspended",
    [BLACKBOX_NOT_SENT] = "not_sent",
    [BLACKBOX_PURGE] = "purge",
    [BLACKBOX_ARM] = "arm",
    [BLACKBOX_DRIVE] = "drive",
    [BLACKBOX_STOP] = "stop",
    [BLACKBOX_ESTOPPED] = "estop",
    [BLACKBOX_RESET] = "reset",
    [BLACKBOX_GONE] = "gone",
    [BLACKBOX_TARE] = "tare",
    [BLACKBOX_LEDGER] = "ledger",
    [BLACKBOX_STATE] = "state",
    [BLACKBOX_STOPPED] = "stopped",
};

const char *blackbox_kind_name(blackbox_kind_t kind) {
    return ((unsigned)kind < BLACKBOX_KINDS) ? names[kind] : "unknown";
}

blackbox_kind_t blackbox_kind_of(const char *name) {
    for (unsigned kind = 0; kind < BLACKBOX_KINDS; kind++) {
        if (strcmp(names[kind], name) == 0) {
            return (blackbox_kind_t)kind;
        }
    }
    return BLACKBOX_KINDS;
}
