// SPDX-License-Identifier: MIT
/// One thing that went into the core, or that it decided. All of them in order, with their times, are enough to let the
/// same core decide the same again.
///
/// Frames of one step have its time. A step is written down only if it took no frame: each group of frames with one time and
/// nothing between them is a step. What the port answered is written down when it changes; once a second answers and state are
/// written down again, so that a recording can begin there.
#ifndef BLACKBOX_ENTRY_H
#define BLACKBOX_ENTRY_H

#include "iwheel/can_frame.h"
#include "iwheel/types.h"

typedef enum {
    BLACKBOX_FRAME = 0, ///< number: id with flags; a: dlc; b: iw_can_kind_t; as.data.
    BLACKBOX_STEP,      ///< A step without frames.
    BLACKBOX_START,     ///< The core began. a: restarted; b: listen only.
    BLACKBOX_ESTOP,     ///< The e-stop's answer from now on. as.value.
    BLACKBOX_BUS,       ///< The bus's state from now on. a: iw_bus_state_t.
    BLACKBOX_FACTS,     ///< a: timing contradicted; b: echo proven.
    BLACKBOX_SUSPENDED, ///< The machine slept. as.value: for how many us.
    BLACKBOX_NOT_SENT,  ///< The port did not take a frame in this step. number: id; as.value: its answer.
    BLACKBOX_PURGE,     ///< The port was asked to purge in this step. as.value: its answer.
    BLACKBOX_ARM,       ///< number: client; a: takeover; b: iw_refusal_t.
    BLACKBOX_DRIVE,     ///< number: client; a: currents are given; b: iw_refusal_t; as.drive.
    BLACKBOX_STOP,      ///< number: client; a: iw_cause_t.
    BLACKBOX_ESTOPPED,  ///< Software e-stop. number: client.
    BLACKBOX_RESET,     ///< b: iw_refusal_t.
    BLACKBOX_RELEASE,   ///< b: iw_refusal_t.
    BLACKBOX_GONE,      ///< A client's connection ended. number: client.
    BLACKBOX_TARE,      ///< a: iw_side_t; b: iw_tare_t.
    BLACKBOX_ASSUMPTION, ///< Told of an assumption. a: item; b: iw_assumption_state_t; number: iw_source_t; as.value: figure.
    BLACKBOX_STATE,   ///< Decided: a: state now; b: before. number: who holds the lease; as.drive: applied.
    BLACKBOX_STOPPED, ///< Decided: number: of the stop; a: iw_cause_t; b: sides; as.value: detail.
    BLACKBOX_KINDS,
} blackbox_kind_t;

typedef struct {
    int32_t speed_mm_s[2];
    int16_t current_mA[2]; ///< What does not fit is out of range as well at the end of int16.
    uint32_t age_us;       ///< How long before its time the command was sent.
} blackbox_drive_t;

typedef struct {
    uint64_t at_us; ///< CLOCK_MONOTONIC.
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

/// The kind's name in the file beside the frames; "unknown" for what is none.
const char *blackbox_kind_name(blackbox_kind_t kind);

/// BLACKBOX_KINDS if no kind has that name.
blackbox_kind_t blackbox_kind_of(const char *name);

#endif
