// SPDX-License-Identifier: MIT
/// The assumption ledger: what the document leaves open, what we assume, and what was found out.
///
///     ASSUMED --confirm--> CONFIRMED --contradict--> CONTRADICTED --confirm by the operator--> CONFIRMED
///        \--------------- contradict ----------------^
///
/// A contradiction found on the bus stays until the operator settles it: evidence that comes and goes must not hide it.
#ifndef IW_LEDGER_H
#define IW_LEDGER_H

#include "iwheel/types.h"

typedef enum {
    IW_LEDGER_SETPOINT_TYPE,      ///< Byte 0 of a setpoint.
    IW_LEDGER_CURRENT_ROLE,       ///< Limit or setpoint.
    IW_LEDGER_FORCE_UNIT_LEFT,    ///< cN, as documented.
    IW_LEDGER_FORCE_UNIT_RIGHT,   ///< dN, as documented.
    IW_LEDGER_OFFSET_INCLUDED,    ///< The raw force still contains the offset, as documented.
    IW_LEDGER_FEEDBACK_SIGN_LEFT, ///< A positive command is measured as a positive speed.
    IW_LEDGER_FEEDBACK_SIGN_RIGHT,
    IW_LEDGER_MOUNT_SIGN_LEFT, ///< A positive command moves the machine forward. Only the operator can know.
    IW_LEDGER_MOUNT_SIGN_RIGHT,
    IW_LEDGER_WHEEL_RADIUS, ///< "Approximately 192 mm".
    IW_LEDGER_TRACK,      ///< Distance between the wheels. The core needs none: whoever turns twists into speeds does.
    IW_LEDGER_GEAR_RATIO, ///< Rotor turns per wheel turn, and which of them the rpm count.
    IW_LEDGER_POSE_BYTE_ORDER, ///< Most significant byte first: the table does not say it for the pose.
    IW_LEDGER_DLC,             ///< Frames are as long as the table: the document does not state it.
    IW_LEDGER_ITEMS,
} iw_ledger_item_t;

typedef enum { IW_LEDGER_ASSUMED = 0, IW_LEDGER_CONFIRMED, IW_LEDGER_CONTRADICTED } iw_ledger_state_t;

typedef enum {
    IW_EVIDENCE_NONE = 0,      ///< Nothing: not configured and not documented.
    IW_EVIDENCE_DOCUMENT,      ///< The document says so.
    IW_EVIDENCE_CONFIGURATION, ///< The operator configured it, nothing confirmed it.
    IW_EVIDENCE_BUS,           ///< Measured; `figure` tells what.
    IW_EVIDENCE_OPERATOR,      ///< The operator looked at the machine.
} iw_evidence_t;

typedef struct {
    iw_ledger_state_t state;
    iw_evidence_t evidence;
    int32_t figure; ///< Of IW_EVIDENCE_BUS: force unit and offset: 1000 x raw / offset in dN; sign: measured mm/s at a
                    ///< positive command; DLC: the length received.
} iw_ledger_entry_t;

typedef struct {
    iw_ledger_entry_t entry[IW_LEDGER_ITEMS];
    uint32_t changes; ///< Grows with every change: for whoever wants to tell or to store it.
} iw_ledger_t;

/// Every item ASSUMED: documented ones with IW_EVIDENCE_DOCUMENT, the others with IW_EVIDENCE_NONE.
void iw_ledger_init(iw_ledger_t *self);

/// States where an ASSUMED item comes from. Changes nothing if it is no longer ASSUMED.
void iw_ledger_assume(iw_ledger_t *self, iw_ledger_item_t item, iw_evidence_t evidence);

/// Evidence for it. From the bus it does not lift a contradiction, and does not replace the operator's word.
void iw_ledger_confirm(iw_ledger_t *self, iw_ledger_item_t item, iw_evidence_t evidence, int32_t figure);

/// Evidence against it.
void iw_ledger_contradict(iw_ledger_t *self, iw_ledger_item_t item, iw_evidence_t evidence, int32_t figure);

/// The item of a wheel's force unit.
iw_ledger_item_t iw_ledger_force_unit(iw_side_t side);

/// True if the wheels must not be moved while this item is contradicted: type, role and the signs.
bool iw_ledger_guards_motion(iw_ledger_item_t item);

/// The first contradicted item that guards motion; IW_LEDGER_ITEMS if there is none.
iw_ledger_item_t iw_ledger_doubt(const iw_ledger_t *self);

/// The item's present entry.
const iw_ledger_entry_t *iw_ledger_entry(const iw_ledger_t *self, iw_ledger_item_t item);

#endif
