// SPDX-License-Identifier: MIT
#include "iwheel_sim/random.h"

void sim_random_init(sim_random_t *self, uint64_t seed) {
    self->state = seed;
}

uint32_t sim_random_next(sim_random_t *self) {
    self->state += 0x9E3779B97F4A7C15U;
    uint64_t mixed = self->state;
    mixed = (mixed ^ (mixed >> 30)) * 0xBF58476D1CE4E5B9U;
    mixed = (mixed ^ (mixed >> 27)) * 0x94D049BB133111EBU;
    return (uint32_t)((mixed ^ (mixed >> 31)) >> 32);
}

uint32_t sim_random_below(sim_random_t *self, uint32_t bound) {
    return (uint32_t)(((uint64_t)sim_random_next(self) * bound) >> 32);
}

int32_t sim_random_noise(sim_random_t *self, int32_t amplitude) {
    uint32_t const span = (uint32_t)amplitude + 1U;
    int32_t const up = (int32_t)sim_random_below(self, span);
    int32_t const down = (int32_t)sim_random_below(self, span);
    return up - down;
}
