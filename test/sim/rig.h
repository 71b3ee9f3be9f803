// SPDX-License-Identifier: MIT
/// Plays a scenario: the real core on a simulated bus with simulated wheels, ports, clients and button, in virtual
/// time, judged by the oracle. The result depends only on the scenario.
#ifndef SIM_TEST_RIG_H
#define SIM_TEST_RIG_H

#include "oracle.h"
#include "scenario.h"

#define RIG_REFUSALS ((unsigned)IW_REFUSALS)

/// Contents of a run, or of a campaign of runs.
typedef struct {
    uint64_t simulated_us;
    uint64_t steps;
    uint64_t frames;  ///< Setpoints passed to the port.
    uint64_t nonzero; ///< Nonzero ones of these.
    uint64_t requests;
    uint64_t armed;
    uint64_t drives; ///< Accepted.
    uint64_t events[EV_KINDS];
    uint64_t stops[IW_CAUSES];
    uint64_t refused[RIG_REFUSALS];
} rig_stats_t;

typedef struct {
    uint32_t rule; ///< ORACLE_NO_RULE: passed.
    iw_time_us_t broken_us;
    char text[200];
    uint64_t hash; ///< Hash of all that was sent and replied.
    rig_stats_t stats;
} rig_result_t;

/// `trace_from_us`: prints a timeline on stdout from then on; IW_NEVER: none.
void rig_play(const scenario_t *scenario, iw_time_us_t trace_from_us, rig_result_t *out_result);

void rig_stats_add(rig_stats_t *sum, const rig_stats_t *stats);

const char *rig_cause_name(unsigned cause);
const char *rig_refusal_name(unsigned refusal);

#endif
