// SPDX-License-Identifier: MIT
/// Recorder around a HAL: it records all inputs of the core in the black box, and the caller records the requests. Each
/// entry costs a copy of about twelve bytes. It never waits and never fails.
///
///     core --(hal.h)--> tape --(hal.h)--> port
#ifndef GATEWAY_TAPE_H
#define GATEWAY_TAPE_H

#include "blackbox_ring.h"

#include "iwheel/gateway.h"
#include "iwheel_linux/backend.h"

/// Number of frames before and after the last stop, for `why`.
#define GW_AROUND 40U
/// Number of frames of one step, for the watchers of the topic `frame`.
#define GW_FRAMES IW_GATEWAY_DRAIN_MAX

typedef struct {
    iw_time_us_t at_us;
    iw_can_frame_t frame;
} gw_tapped_t;

typedef struct {
    blackbox_ring_t *ring; ///< NULL: nothing is recorded.
    iw_hal_t port;
    iw_time_us_t step_us; ///< Time of the present step.
    uint32_t step_frames; ///< Frames received in this step.
    int estop;            ///< Last results of the port.
    iw_bus_state_t bus;
    uint8_t facts;         ///< 0xFF until the first facts.
    bool answered;         ///< The last results are valid.
    iw_time_us_t again_us; ///< Last time at which unchanged results were recorded.
    uint32_t
        tapped; ///< Number of frames in `tap`, until the reader sets it to 0. A step receives no more frames than fit.
    gw_tapped_t tap[GW_FRAMES];
    uint32_t before_count;
    uint32_t after_count;
    blackbox_entry_t before[GW_AROUND]; ///< Frames before the last stop, the oldest first.
    blackbox_entry_t after[GW_AROUND];
} gw_tape_t;

/// Initializes the tape. `ring` may be NULL.
void gw_tape_init(gw_tape_t *self, blackbox_ring_t *ring);

/// Returns the HAL for the core, which calls `port`; the tape copies `port`. `self` and the context of the port must
/// exist as long as the HAL and must not move.
iw_hal_t gw_tape_hal(gw_tape_t *self, const iw_hal_t *port);

void gw_tape_put(gw_tape_t *self, const blackbox_entry_t *entry);

/// Call these before and after each step of the core.
void gw_tape_step_begin(gw_tape_t *self, iw_time_us_t now_us);
void gw_tape_step_end(gw_tape_t *self);

void gw_tape_facts(gw_tape_t *self, iw_time_us_t now_us, const iw_bus_facts_t *facts);

/// Returns true once a second, after it has recorded the results of the port again.
bool gw_tape_again(gw_tape_t *self, iw_time_us_t now_us);

/// Records a drive request that was sent at `sent_us`. `entry` has client and refusal.
void gw_tape_drive(gw_tape_t *self, const blackbox_entry_t *entry, const iw_drive_t *request, iw_time_us_t sent_us);

/// Marks a stop: the frames before it are retained, and the next ones will be.
void gw_tape_mark(gw_tape_t *self);

#endif
