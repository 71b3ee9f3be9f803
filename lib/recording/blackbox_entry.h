// SPDX-License-Identifier: MIT
/// One input or decision of the core. All entries in order, with their times, suffice to make the same core decide the
/// same again.
///
/// The frames of a step have its time. A step has an entry of its own only if it received no frame: each group of
/// frames with one time and nothing between them is a step. Results of the port are recorded when they change. Once a
/// second results and state are recorded again, so that a recording can begin there.
#ifndef BLACKBOX_ENTRY_H
#define BLACKBOX_ENTRY_H

#include "iwheel/can_frame.h"
#include "iwheel/types.h"

typedef enum {
    BLACKBOX_FRAME = 0,  ///< Frame. number: id with flags; a: dlc; b: iw_can_kind_t; as.data.
    BLACKBOX_STEP,       ///< Step without frames.
    BLACKBOX_START,      ///< Start of the core. a: restarted; b: listen only.
    BLACKBOX_ESTOP,      ///< New result of the e-stop. as.value.
    BLACKBOX_BUS,        ///< New state of the bus. a: iw_bus_state_t.
    BLACKBOX_FACTS,      ///< New facts about the bus. a: timing contradicted; b: echo proven.
    BLACKBOX_SUSPENDED,  ///< Suspend of the machine. as.value: duration in us.
    BLACKBOX_NOT_SENT,   ///< Frame that the port refused in this step. number: id; as.value: result.
    BLACKBOX_PURGE,      ///< Purge in this step. as.value: result.
    BLACKBOX_ARM,        ///< Arm request. number: client; a: takeover; b: iw_refusal_t.
    BLACKBOX_DRIVE,      ///< Drive request. number: client; a: currents are present; b: iw_refusal_t; as.drive.
    BLACKBOX_STOP,       ///< Stop. number: client; a: iw_cause_t.
    BLACKBOX_ESTOPPED,   ///< Software e-stop. number: client.
    BLACKBOX_RESET,      ///< Reset request. b: iw_refusal_t.
    BLACKBOX_RELEASE,    ///< Release request. b: iw_refusal_t.
    BLACKBOX_GONE,       ///< End of a client's connection. number: client.
    BLACKBOX_TARE,       ///< Tare. a: iw_side_t; b: iw_tare_t.
    BLACKBOX_ASSUMPTION, ///< New assumption. a: item; b: iw_assumption_state_t; number: iw_source_t; as.value: figure.
    BLACKBOX_STATE,      ///< Decision: new state. a: state; b: state before. number: lease holder; as.drive: applied.
    BLACKBOX_STOPPED,    ///< Decision: stop. number: number of the stop; a: iw_cause_t; b: sides; as.value: detail.
    BLACKBOX_KINDS,
} blackbox_kind_t;

typedef struct {
    int32_t speed_mm_s[2];
    int16_t current_mA[2]; ///< Clamped to int16: a value beyond it is out of range as well.
    uint32_t age_us;       ///< Time between sending the command and the entry.
} blackbox_drive_t;

typedef struct {
    uint64_t at_us; ///< CLOCK_MONOTONIC in us.
    union {
        uint8_t data[IW_CAN_DATA_MAX];
        int64_t value;
        blackbox_drive_t drive;
    } as;
    uint32_t number;
    uint8_t kind;
    uint8_t a;
    uint8_t b;
} blackbox_entry_t;
IW_STATIC_ASSERT(sizeof(blackbox_entry_t) <= 40U, entries_are_small);

/// Returns the name of the kind in the file of decisions; "unknown" for an invalid one.
const char *blackbox_kind_name(blackbox_kind_t kind);

/// Returns the kind with that name, or BLACKBOX_KINDS.
blackbox_kind_t blackbox_kind_of(const char *name);

#endif
