// SPDX-License-Identifier: MIT
/// A usable configuration, milliseconds and repeatable random numbers for every unit test of the core.
#ifndef TEST_FIXTURE_H
#define TEST_FIXTURE_H

#include "iwheel/config.h"

/// Milliseconds as the core's time.
#define MS(n) ((iw_time_us_t)(n)*1000U)

/// Begin of virtual time: neither 0 nor round, and beyond 32 bits of microseconds.
#define FIXTURE_START_US 5000000123ULL

/// Structures are filled with this byte before `init`, so that a field which `init` omits is found.
#define FIXTURE_POISON 0xA5

/// The documented defaults, and for the values without a default: setpoint type 1, current is a limit.
void fixture_config(iw_config_t *out_config);

/// Pseudo-random numbers: the same seed makes the same test on every machine.
typedef struct {
    uint32_t state; ///< Never 0.
} fixture_random_t;

/// Accepts any seed.
void fixture_random_init(fixture_random_t *self, uint32_t seed);

/// Returns 32 random bits.
uint32_t fixture_random(fixture_random_t *self);

/// Returns a number from `low` to `high`, both included, evenly distributed.
int32_t fixture_random_in(fixture_random_t *self, int32_t low, int32_t high);

#endif
