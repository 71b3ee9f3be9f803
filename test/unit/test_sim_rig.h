// SPDX-License-Identifier: MIT
/// A pair of simulated wheels with a driver, and a summary of the frames that it sent.
#ifndef TEST_SIM_RIG_H
#define TEST_SIM_RIG_H

#include "iwheel_sim/pair.h"
#include "message.h"

#define START_US UINT64_C(1000000)
#define MS       UINT64_C(1000)
#define SECOND   UINT64_C(1000000)
/// Both wheels have booted.
#define BOOTED (START_US + 500U * MS)

/// Frames of one id.
typedef struct {
    uint32_t count;
    iw_time_us_t first_us;
    iw_time_us_t last_us;
    uint32_t shortest_us; ///< Shortest gap between two frames.
    uint32_t longest_us;
    iw_can_frame_t frame; ///< Last frame.
} seen_t;

extern sim_pair_config_t config;
extern sim_pair_t pair;
extern seen_t seen[2048]; ///< Indexed by id.

/// Starts a default pair that boots at START_US, without a driver.
void rig_init(void);

/// Clears the summary.
void rig_forget(void);

/// Runs the pair; a driver commands both wheels every 20 ms.
void rig_run(iw_time_us_t from_us, iw_time_us_t until_us);

/// Commands both wheels from now on, with 2000 mA, until `rig_let_go`.
void rig_drive(int16_t left_mm_s, int16_t right_mm_s);
void rig_let_go(void);

/// Returns the last frame of this id, decoded. Fails the test if there was none.
message_t rig_last(uint32_t id);

#endif
