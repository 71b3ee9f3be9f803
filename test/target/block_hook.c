// SPDX-License-Identifier: MIT
// The clock of the emulated CPU: Unicorn calls it before each block of code, half a million times per second of virtual
// time. The second hook handles the other reasons that end a run of code: the end of an exception, or an abort.
#include <stdbool.h>
#include <stdint.h>

#define CYCLES_PER_HALFWORD 2

typedef struct {
    int64_t left;  ///< Cycles until the emulation must stop.
    int64_t spent; ///< Cycles since the user set it to 0.
    int32_t is_asked_to_stop;
    int32_t has_stopped;
    int32_t trap;              ///< Unicorn's number of the exception that ended the run, or -1.
    int (*stop)(void *engine); ///< uc_emu_stop.
} block_clock_t;

void block_hook(void *engine, uint64_t address, uint32_t size, void *clock);
void trap_hook(void *engine, uint32_t number, void *clock);

void block_hook(void *engine, uint64_t address, uint32_t size, void *clock) {
    block_clock_t *const self = clock;
    const int64_t cycles = (int64_t)(size / 2U) * CYCLES_PER_HALFWORD;
    (void)address;
    if (self->left <= 0 || self->is_asked_to_stop != 0) {
        self->has_stopped = 1;
        (void)self->stop(engine);
        return;
    }
    self->left -= cycles;
    self->spent += cycles;
}

void trap_hook(void *engine, uint32_t number, void *clock) {
    block_clock_t *const self = clock;
    self->trap = (int32_t)number;
    (void)self->stop(engine);
}
