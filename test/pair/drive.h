// SPDX-License-Identifier: MIT
/// A machine on two simulated wheels, and the gateway's core that drives it, in virtual time.
///
/// Nothing lies between them: a setpoint reaches its wheel, and its echo the core, in the step that sends it; telemetry reaches the core when
/// it is sent.
#ifndef PAIR_TEST_DRIVE_H
#define PAIR_TEST_DRIVE_H

#include "iwheel/gateway.h"
#include "sim_ranges.h"

#define MS 1000U
#define S  1000000U
/// The only client.
#define DRIVER ((iw_client_t)1)
/// Frames on their way to the core: a pair of echoes and a few of telemetry.
#define WAITING_MAX 64U

typedef struct {
    sim_pair_t pair;
    iw_gateway_t gateway;
    iw_time_us_t now_us;
    iw_time_us_t wake_us;
    iw_time_us_t kerb_us;  ///< A kerb ends then; IW_NEVER: there is none.
    iw_time_us_t even_us;  ///< When the last one ended.
    iw_time_us_t drive_us; ///< When the client sends next.
    int32_t left_mm_s;
    int32_t right_mm_s;
    iw_can_frame_t waiting[WAITING_MAX];
    uint32_t first, count;
} machine_t;

/// Wheels that have been running for a while, at standstill, nobody drives.
void machine_init(machine_t *self, const sim_pair_config_t *pair, const iw_config_t *config, uint64_t seed);

/// A configuration with which it drives: the defaults, with `pair_mm` that high if not 0.
void machine_config(iw_config_t *out_config, uint16_t pair_mm);

/// Waits for standstill, resets if need be, and arms. False: it could not be armed.
bool machine_arm(machine_t *self);

/// The client commands this every 50 ms, until it commands something else.
void machine_command(machine_t *self, int32_t left_mm_s, int32_t right_mm_s);

void machine_run(machine_t *self, uint32_t for_ms);

/// Which way the machine looks, in thousandths of a degree, from the ways of its wheels at their real radius.
int64_t machine_heading_mdeg(const machine_t *self);

/// Where each wheel would be if it had done as it was commanded: nm at the firmware's radius.
typedef struct {
    int64_t way_nm[IW_SIDES];
} machine_way_t;
machine_way_t machine_way(const machine_t *self);

#endif
