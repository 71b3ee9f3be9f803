// SPDX-License-Identifier: MIT
/// What every unit test of the core needs: a usable configuration, milliseconds, and chance that repeats.
#ifndef TEST_FIXTURE_H
#define TEST_FIXTURE_H

#include "iwheel/config.h"

/// Milliseconds as the core's time.
#define MS(n) ((iw_time_us_t)(n)*1000U)

/// Where virtual time begins: neither 0 nor round, and beyond 32 bits of microseconds.
#define FIXTURE_START_US 5000000123ULL

/// The byte that structures are filled with before `init`, so that a forgotten field shows.
#define FIXTURE_POISON 0xA5

/// The documented defaults with what has no default: setpoint type 1, current is a limit.
void fixture_config(iw_config_t *out_config);

/// Pseudo-random numbers: the same seed gives the same test on every machine.
typedef struct {
    uint32_t state; ///< Never 0.
} fixture_random_t;

/// Any seed will do.
void fixture_random_init(fixture_random_t *self, uint32_t seed);

/// 32 random bits.
uint32_t fixture_random(fixture_random_t *self);

/// Evenly from `low` to `high`, both included.
int32_t fixture_random_in(fixture_random_t *self, int32_t low, int32_t high);

#endif
