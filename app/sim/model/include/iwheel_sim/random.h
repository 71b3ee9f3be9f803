// SPDX-License-Identifier: MIT
/// Random numbers for the simulator: a small generator with the same numbers on every machine.
///
/// splitmix64: 64 bits of state, no file-scope state, good enough for noise. It must not be used for secrets.
#ifndef IWHEEL_SIM_RANDOM_H
#define IWHEEL_SIM_RANDOM_H

#include <stdint.h>

typedef struct {
    uint64_t state;
} sim_random_t;

/// Sets the seed. Any seed is good; neighbouring seeds result in unrelated sequences.
void sim_random_init(sim_random_t *self, uint64_t seed);

uint32_t sim_random_next(sim_random_t *self);

/// Returns a uniform number in 0..bound-1; 0 if `bound` is 0.
uint32_t sim_random_below(sim_random_t *self, uint32_t bound);

/// Returns triangular noise around 0, within +/- `amplitude` (at most 2^30). Its standard deviation is amplitude /
/// 2.45.
int32_t sim_random_noise(sim_random_t *self, int32_t amplitude);

#endif
