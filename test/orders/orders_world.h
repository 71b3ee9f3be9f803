// SPDX-License-Identifier: MIT
/// A gateway with two obedient wheels, a client, a button and a bus, small enough to be copied and restored: the world of
/// the enumeration of all orders of events. The oracle of the simulation judges it, and so does a second, simpler rule:
/// after a cut only zero is sent until an arm and then a drive were accepted.
#ifndef ORDERS_WORLD_H
#define ORDERS_WORLD_H

#include "../sim/oracle.h"

#define WORLD_FLIGHT 8U
#define WORLD_RX     64U

/// The letters of a sequence.
typedef enum {
    STEP_PRESS = 0,
    STEP_RELEASE, ///< Releases the button; if it is not pressed, the hold.
    STEP_RESET,
    STEP_ARM,
    STEP_COMMAND,
    STEP_KILL,    ///< The client's connection ends and another client connects.
    STEP_RESTART, ///< The gateway's process is killed and runs again.
    STEP_BUS,     ///< The bus goes down, or up again.
    STEP_KINDS,
} world_step_t;

/// The client's reaction after a command.
typedef enum {
    MODE_ONCE = 0, ///< One drive.
    MODE_STREAM,   ///< A drive every 50 ms until one is refused.
    MODE_BLIND,    ///< A drive every 50 ms, whatever the replies, until the client is killed.
    MODES,
} world_mode_t;

/// Sums over all sequences; not restored.
typedef struct {
    uint64_t steps, frames, nonzero, armed, drives, resets, latched, restarts, stops;
    uint64_t aged, stale; ///< Drives that had waited: accepted; refused because they were sent before the arm.
} world_stats_t;

typedef struct {
    iw_can_frame_t frame;
    iw_time_us_t handed_us;
    iw_time_us_t done_us;
    bool own; ///< Sent by the current process.
} world_flight_t;

typedef struct {
    iw_time_us_t received_us;
    iw_time_us_t moved_us;
    int32_t commanded_mm_s;
    int32_t speed_um_s;
} world_wheel_t;

typedef struct {
    iw_gateway_t gateway;
    oracle_t oracle;
    world_stats_t *stats;
    iw_time_us_t now_us, wake_us, promised_us, telemetry_us, drive_us;
    world_wheel_t wheel[IW_SIDES];
    world_flight_t flight[WORLD_FLIGHT];
    iw_can_frame_t rx[WORLD_RX];
    uint32_t flights, received;
    iw_client_t client;
    world_mode_t mode;
    bool pressed, edge, down, lost, traces;
    bool hold;               ///< after_stop = hold.
    bool late;               ///< Drives were delayed on their way, each by another time.
    bool cut, arm_after_cut; ///< State of the simpler rule; `arm_us` is the time of the arm.
    iw_time_us_t arm_us;
    iw_state_t state;
} world_t;

/// Starts a gateway with wheels at standstill, with after_stop = hold or without. There is one world at a time: it must not be moved.
void world_init(world_t *self, world_mode_t mode, bool hold, world_stats_t *stats);

/// Executes the letter now.
void world_do(world_t *self, world_step_t step);

/// Lets time pass.
void world_run(world_t *self, iw_time_us_t for_us);

/// Returns true if a rule is broken.
bool world_broken(const world_t *self);

const char *world_step_name(unsigned step);

#endif
