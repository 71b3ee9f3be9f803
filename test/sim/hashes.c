// SPDX-License-Identifier: MIT
// The swarm on an emulated Cortex-M, which has no command line: prints what `test_sim --hashes` prints, for the seeds compiled in.
#include "rig.h"

int main(void) {
    static scenario_t scenario;
    static rig_result_t result;
    for (uint32_t seed = SEED_FIRST; seed < SEED_FIRST + SEED_COUNT; seed++) {
        scenario_draw(&scenario, seed);
        rig_play(&scenario, IW_NEVER, &result);
        printf("seed %lu hash %08lx%08lx\n", (unsigned long)seed, (unsigned long)(result.hash >> 32),
               (unsigned long)(result.hash & 0xFFFFFFFFU));
    }
    return 0;
}
