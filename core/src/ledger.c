// SPDX-License-Identifier: MIT
#include "iwheel/private/ledger.h"

#include <string.h>

/// Items for which the document names a value. All others are not even documented.
static const iw_ledger_item_t documented[] = {
    IW_LEDGER_FORCE_UNIT_LEFT,
    IW_LEDGER_FORCE_UNIT_RIGHT,
    IW_LEDGER_OFFSET_INCLUDED,
    IW_LEDGER_WHEEL_RADIUS,
};

void iw_ledger_init(iw_ledger_t *self) {
    memset(self, 0, sizeof *self);
    self->doubt = IW_LEDGER_ITEMS;
    for (size_t i = 0; i < sizeof documented / sizeof documented[0]; i++) {
        self->entry[documented[i]].evidence = IW_EVIDENCE_DOCUMENT;
    }
}

/// Motion would be unpredictable: another motor command than meant, or another direction. A wrong force unit or radius
/// only makes numbers wrong.
bool iw_ledger_guards_motion(iw_ledger_item_t item) {
    switch (item) {
    case IW_LEDGER_SETPOINT_TYPE:
    case IW_LEDGER_CURRENT_ROLE:
    case IW_LEDGER_FEEDBACK_SIGN_LEFT:
    case IW_LEDGER_FEEDBACK_SIGN_RIGHT:
    case IW_LEDGER_MOUNT_SIGN_LEFT:
    case IW_LEDGER_MOUNT_SIGN_RIGHT:
        return true;
    default:
        return false;
    }
}

/// The first contradicted item that guards motion.
static iw_ledger_item_t find_doubt(const iw_ledger_t *self) {
    uint32_t item = 0;
    while (item < IW_LEDGER_ITEMS &&
           (self->entry[item].state != IW_LEDGER_CONTRADICTED || !iw_ledger_guards_motion((iw_ledger_item_t)item))) {
        item++;
    }
    return (iw_ledger_item_t)item;
}

static void change(iw_ledger_t *self, iw_ledger_item_t item, const iw_ledger_entry_t *next) {
    iw_ledger_entry_t *const entry = &self->entry[item];
    if (entry->state != next->state || entry->evidence != next->evidence || entry->figure != next->figure) {
        *entry = *next;
        self->changes++;
        self->doubt = find_doubt(self);
    }
}

void iw_ledger_assume(iw_ledger_t *self, iw_ledger_item_t item, iw_evidence_t evidence) {
    if (self->entry[item].state == IW_LEDGER_ASSUMED) {
        const iw_ledger_entry_t next = {IW_LEDGER_ASSUMED, evidence, 0};
        change(self, item, &next);
    }
}

void iw_ledger_confirm(iw_ledger_t *self, iw_ledger_item_t item, iw_evidence_t evidence, int32_t figure) {
    const iw_ledger_entry_t next = {IW_LEDGER_CONFIRMED, evidence, figure};
    const iw_ledger_entry_t *const entry = &self->entry[item];
    // Evidence of the bus that comes and goes must not hide a contradiction, nor overrule the operator.
    const bool settled = entry->state == IW_LEDGER_CONTRADICTED || entry->evidence == IW_EVIDENCE_OPERATOR;
    if (evidence == IW_EVIDENCE_OPERATOR || !settled) {
        change(self, item, &next);
    }
}

void iw_ledger_contradict(iw_ledger_t *self, iw_ledger_item_t item, iw_evidence_t evidence, int32_t figure) {
    const iw_ledger_entry_t next = {IW_LEDGER_CONTRADICTED, evidence, figure};
    change(self, item, &next);
}

const iw_ledger_entry_t *iw_ledger_entry(const iw_ledger_t *self, iw_ledger_item_t item) {
    return &self->entry[item];
}
