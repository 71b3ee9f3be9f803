// SPDX-License-Identifier: MIT
/// A machine on two simulated wheels, and the gateway's core that drives it, in virtual time.
///
/// There is no delay between them: in the step that sends a setpoint, the wheel receives it and the core receives its echo. The core receives
/// telemetry when a wheel sends it.
#ifndef PAIR_TEST_DRIVE_H
#define PAIR_TEST_DRIVE_H

#include "iwheel/gateway.h"
#include "sim_ranges.h"

#define MS 1000U
#define S  1000000U
/// The only client.
#define DRIVER ((iw_client_t)1)
/// Frames that the core has not read yet: two echoes and some telemetry.
#define WAITING_MAX 64U

typedef struct {
    sim_pair_t pair;
    iw_gateway_t gateway;
    iw_time_us_t now_us;
    iw_time_us_t wake_us;
    iw_time_us_t kerb_us;  ///< End of the present kerb; IW_NEVER: none.
    iw_time_us_t even_us;  ///< End of the previous kerb.
    iw_time_us_t drive_us; ///< Next command of the client.
    int32_t left_mm_s;
    int32_t right_mm_s;
    iw_can_frame_t waiting[WAITING_MAX];
    uint32_t first, count;
} machine_t;

/// Starts with wheels that have been on for a while and are at standstill; no client drives them.
void machine_init(machine_t *self, const sim_pair_config_t *pair, const iw_config_t *config, uint64_t seed);

/// The default configuration for this machine; `pair_mm` replaces the default unless it is 0.
void machine_config(iw_config_t *out_config, uint16_t pair_mm);

/// Waits for standstill, resets the gateway if necessary, and arms it. Returns false if it cannot be armed.
bool machine_arm(machine_t *self);

/// Sets the command that the client sends every 50 ms from now on.
void machine_command(machine_t *self, int32_t left_mm_s, int32_t right_mm_s);

void machine_run(machine_t *self, uint32_t for_ms);

/// Heading of the machine in thousandths of a degree, from the distances of its wheels with their real radius.
int64_t machine_heading_mdeg(const machine_t *self);

/// Distance of each wheel in nm if it had the firmware's radius.
typedef struct {
    int64_t way_nm[IW_SIDES];
} machine_way_t;
machine_way_t machine_way(const machine_t *self);

#endif
