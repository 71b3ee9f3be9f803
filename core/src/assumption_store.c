// SPDX-License-Identifier: MIT
#include "iwheel/private/assumption_store.h"

#include <string.h>

/// The document names a value for these items. It does not mention the others.
static const iw_assumption_item_t documented[] = {
    IW_ASSUMPTION_FORCE_UNIT_LEFT,
    IW_ASSUMPTION_FORCE_UNIT_RIGHT,
    IW_ASSUMPTION_OFFSET_INCLUDED,
    IW_ASSUMPTION_WHEEL_RADIUS,
};

void iw_assumption_init(iw_assumption_store_t *self) {
    memset(self, 0, sizeof *self);
    self->doubt = IW_ASSUMPTION_ITEMS;
    for (size_t i = 0; i < sizeof documented / sizeof documented[0]; i++) {
        self->entry[documented[i]].source = IW_SOURCE_DOCUMENT;
    }
}

/// A contradiction of these items makes motion unpredictable: another motor command than intended, or another
/// direction. A wrong force unit or radius only makes displayed values wrong.
bool iw_assumption_guards_motion(iw_assumption_item_t item) {
    switch (item) {
    case IW_ASSUMPTION_SETPOINT_TYPE:
    case IW_ASSUMPTION_CURRENT_ROLE:
    case IW_ASSUMPTION_FEEDBACK_SIGN_LEFT:
    case IW_ASSUMPTION_FEEDBACK_SIGN_RIGHT:
    case IW_ASSUMPTION_MOUNT_SIGN_LEFT:
    case IW_ASSUMPTION_MOUNT_SIGN_RIGHT:
        return true;
    default:
        return false;
    }
}

/// Returns the first contradicted item that prevents motion.
static iw_assumption_item_t find_doubt(const iw_assumption_store_t *self) {
    uint32_t item = 0;
    while (item < IW_ASSUMPTION_ITEMS &&
           (self->entry[item].state != IW_CONTRADICTED || !iw_assumption_guards_motion((iw_assumption_item_t)item))) {
        item++;
    }
    return (iw_assumption_item_t)item;
}

static void change(iw_assumption_store_t *self, iw_assumption_item_t item, const iw_assumption_entry_t *next) {
    iw_assumption_entry_t *const entry = &self->entry[item];
    if (entry->state != next->state || entry->source != next->source || entry->figure != next->figure) {
        *entry = *next;
        self->changes++;
        self->doubt = find_doubt(self);
    }
}

void iw_assumption_assume(iw_assumption_store_t *self, iw_assumption_item_t item, iw_source_t source) {
    if (self->entry[item].state == IW_ASSUMED) {
        const iw_assumption_entry_t next = {IW_ASSUMED, source, 0};
        change(self, item, &next);
    }
}

void iw_assumption_confirm(iw_assumption_store_t *self, iw_assumption_item_t item, iw_source_t source, int32_t figure) {
    const iw_assumption_entry_t next = {IW_CONFIRMED, source, figure};
    const iw_assumption_entry_t *const entry = &self->entry[item];
    // An intermittent observation must neither hide a contradiction nor overrule the operator.
    const bool settled = entry->state == IW_CONTRADICTED || entry->source == IW_SOURCE_OPERATOR;
    if (source == IW_SOURCE_OPERATOR || !settled) {
        change(self, item, &next);
    }
}

void iw_assumption_contradict(iw_assumption_store_t *self, iw_assumption_item_t item, iw_source_t source,
                              int32_t figure) {
    const iw_assumption_entry_t next = {IW_CONTRADICTED, source, figure};
    change(self, item, &next);
}
