// SPDX-License-Identifier: MIT
/// A recorder around any HAL: everything that goes into the core passes here and is noted in the black box on its way, and
/// requests are noted beside it by the caller. Costs a copy of a dozen bytes each; never waits, never fails.
///
///     core --(hal.h)--> tape --(hal.h)--> port
#ifndef GATEWAY_TAPE_H
#define GATEWAY_TAPE_H

#include "blackbox_ring.h"

#include "iwheel/gateway.h"
#include "iwheel_linux/backend.h"

/// Frames kept on either side of the last stop, for `why`.
#define GW_AROUND 40U
/// Frames of one step, for the watchers of the topic `frame`.
#define GW_FRAMES IW_GATEWAY_DRAIN_MAX

typedef struct {
    iw_time_us_t at_us;
    iw_can_frame_t frame;
} gw_tapped_t;

typedef struct {
    blackbox_ring_t *ring; ///< NULL: nothing is noted.
    iw_hal_t port;
    iw_time_us_t step_us; ///< Of the present step.
    uint32_t step_frames; ///< Taken in it.
    int estop;            ///< Last answers.
    iw_bus_state_t bus;
    uint8_t facts;         ///< 0xFF: not told yet.
    bool answered;         ///< There are last answers.
    iw_time_us_t again_us; ///< When answers were last written down whether they had changed or not.
    uint32_t tapped; ///< Frames in `tap`, until somebody sets it to 0. A step takes no more than there is room for.
    gw_tapped_t tap[GW_FRAMES];
    uint32_t before_count;
    uint32_t after_count;
    blackbox_entry_t before[GW_AROUND]; ///< The frames before the last stop, the oldest first.
    blackbox_entry_t after[GW_AROUND];
} gw_tape_t;

/// Begins. `ring` may be NULL.
void gw_tape_init(gw_tape_t *self, blackbox_ring_t *ring);

/// The HAL to hand to the core: around this port, of which it keeps a copy. `self` and the port's context must outlive it and
/// must not move.
iw_hal_t gw_tape_hal(gw_tape_t *self, const iw_hal_t *port);

void gw_tape_put(gw_tape_t *self, const blackbox_entry_t *entry);

/// Around each step of the core.
void gw_tape_step_begin(gw_tape_t *self, iw_time_us_t now_us);
void gw_tape_step_end(gw_tape_t *self);

void gw_tape_facts(gw_tape_t *self, iw_time_us_t now_us, const iw_bus_facts_t *facts);

/// True once a second, after the port's answers have been noted again.
bool gw_tape_again(gw_tape_t *self, iw_time_us_t now_us);

/// A drive request, sent at `sent_us`. `entry` has client and refusal.
void gw_tape_drive(gw_tape_t *self, const blackbox_entry_t *entry, const iw_drive_t *request, iw_time_us_t sent_us);

/// A stop has just happened: the last frames are kept, and the next ones will be.
void gw_tape_mark(gw_tape_t *self);

#endif
