// SPDX-License-Identifier: MIT
// The clock of the emulated CPU: Unicorn calls it before each block of code, half a million times per second of virtual
// time. The second hook handles the other reasons that end a run of code: the end of an exception, or an abort. The other
// functions are what the emulator (emulator/machine.py) needs most often: reads that change nothing but the time, and the
// begin and the end of exceptions.
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define CYCLES_PER_HALFWORD 2
#define EXCEPTION_CYCLES    12
#define NS_PER_S            1000000000
#define RAM                 0x20000000
#define BLOCK_SIZE          0x400U
#define EXC_RETURN          0xFFFFFFF9U
#define IT_STATE            0x0600FC00U
#define ALIGNED             0x200U ///< In the saved xPSR: four unused bytes are above it.
#define SYST_RVR            0xE000E014U
#define SYST_CVR            0xE000E018U
#define ICSR                0xE000ED04U

enum { LR = 5, PC, XPSR, SP, PRIMASK, REGISTERS, SAVED = XPSR + 1, INPUTS = 4 };
enum { MASKED, ENTERED, WITHOUT_STACK };

/// The register with the levels of a port's pins.
typedef struct {
    uint32_t address;
    uint32_t value;
    int32_t is_known; ///< The value is valid, and the port has its clock.
} input_t;

typedef struct {
    int64_t left;    ///< Cycles until the emulation must stop.
    int64_t spent;   ///< Cycles since `now_ns`.
    int64_t now_ns;  ///< Virtual time.
    int64_t busy_ns; ///< The part of it in which code ran.
    int64_t core_hz;
    int64_t tick_ns;    ///< The next end of SysTick's period, or -1.
    uint32_t tick_load; ///< SYST_RVR
    uint32_t icsr;
    int32_t is_asked_to_stop;
    int32_t has_stopped;
    int32_t trap;          ///< Unicorn's number of the exception that ended the run, or -1.
    uint32_t begun_at;     ///< PC at the begin of the run.
    int32_t access_cycles; ///< Of one access to a register.
    int32_t ram_size;
    int32_t ids[REGISTERS]; ///< Unicorn's numbers of R0 to R3, R12, LR, PC, xPSR, SP, PRIMASK.
    input_t inputs[INPUTS];
    uint32_t can_blocks[2]; ///< Addresses of the bus controller and of the second part of its registers.
    void *can;              ///< Model of the bus controller, or NULL: it has no clock.
    uint32_t (*read_can)(void *can, uint32_t offset);
    uint32_t (*read)(int64_t now_ns, uint32_t address, uint32_t size);              ///< All other reads.
    void (*write)(int64_t now_ns, uint32_t address, uint32_t size, uint32_t value); ///< All writes.
    void *engine;
    // Functions of Unicorn, with which this library is not linked.
    int (*start)(void *engine, uint64_t begin, uint64_t until, uint64_t timeout, size_t count);
    int (*stop)(void *engine);
    int (*read_registers)(void *engine, const int *ids, void **values, int count);
    int (*write_registers)(void *engine, const int *ids, void **values, int count);
    int (*read_memory)(void *engine, uint64_t address, void *bytes, uint64_t size);
    int (*write_memory)(void *engine, uint64_t address, const void *bytes, uint64_t size);
} block_clock_t;

/// A range of addresses with registers.
typedef struct {
    block_clock_t *clock;
    uint32_t base;
} space_t;

void block_hook(void *engine, uint64_t address, uint32_t size, void *clock);
void trap_hook(void *engine, uint32_t number, void *clock);
void block_clock_spend(block_clock_t *self, int64_t cycles);
int block_clock_execute(block_clock_t *self, int64_t until_ns, uint64_t until, uint32_t icsr);
int block_clock_enter(block_clock_t *self, uint32_t vector, bool is_maskable);
int block_clock_leave(block_clock_t *self);
uint64_t block_clock_read(void *engine, uint64_t offset, unsigned size, void *space);
void block_clock_write(void *engine, uint64_t offset, unsigned size, uint64_t value, void *space);

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

/// Brings `now_ns` up to date with the code that has run, and `cycles` more.
void block_clock_spend(block_clock_t *self, int64_t cycles) {
    const int64_t span_ns = (self->spent + cycles) * NS_PER_S / self->core_hz;
    self->left -= cycles;
    self->spent = 0;
    self->now_ns += span_ns;
    self->busy_ns += span_ns;
}

static void move_registers(void *engine, int (*move)(void *engine, const int *ids, void **values, int count),
                           const int32_t *ids, uint64_t *values, int count) {
    void *pointers[REGISTERS];
    for (int at = 0; at < count; at++) {
        pointers[at] = &values[at];
    }
    (void)move(engine, ids, pointers, count);
}

/// Runs code until that time, or until the address. Returns Unicorn's status.
int block_clock_execute(block_clock_t *self, int64_t until_ns, uint64_t until, uint32_t icsr) {
    const int64_t span_ns = until_ns - self->now_ns;
    const int64_t left = span_ns / NS_PER_S * self->core_hz + span_ns % NS_PER_S * self->core_hz / NS_PER_S;
    uint64_t pc = 0;
    self->left = (left > 1) ? left : 1;
    self->is_asked_to_stop = self->has_stopped = 0;
    self->trap = -1;
    self->icsr = icsr;
    move_registers(self->engine, self->read_registers, &self->ids[PC], &pc, 1);
    self->begun_at = (uint32_t)pc;
    const int status = self->start(self->engine, pc | 1U, until, 0, 0);
    block_clock_spend(self, 0);
    return status;
}

/// Begins an exception, unless PRIMASK is set and has an effect on it.
int block_clock_enter(block_clock_t *self, uint32_t vector, bool is_maskable) {
    static const int order[] = {SP, XPSR, LR, PC};
    uint64_t values[REGISTERS] = {0};
    uint32_t saved[SAVED];
    move_registers(self->engine, self->read_registers, self->ids, values, REGISTERS);
    if (values[PRIMASK] != 0 && is_maskable) {
        return MASKED;
    }
    const uint32_t above = (uint32_t)values[SP] & 4U;
    const int64_t stack = (int64_t)values[SP] - (int64_t)sizeof saved - above;
    values[XPSR] = (values[XPSR] & ~(uint64_t)ALIGNED) | ((above != 0) ? ALIGNED : 0U);
    if (stack < RAM || stack - RAM > self->ram_size - (int64_t)sizeof saved) {
        return WITHOUT_STACK;
    }
    for (int at = 0; at < SAVED; at++) {
        saved[at] = (uint32_t)values[at];
    }
    (void)self->write_memory(self->engine, (uint64_t)stack, saved, sizeof saved);
    uint64_t after[] = {(uint64_t)stack, values[XPSR] & ~(uint64_t)IT_STATE, EXC_RETURN,
                        vector}; // A handler does not begin within an IT block.
    int32_t ids[sizeof after / sizeof *after];
    for (int at = 0; at < (int)(sizeof ids / sizeof *ids); at++) {
        ids[at] = self->ids[order[at]];
    }
    move_registers(self->engine, self->write_registers, ids, after, (int)(sizeof ids / sizeof *ids));
    block_clock_spend(self, EXCEPTION_CYCLES);
    return ENTERED;
}

/// Ends an exception. Returns Unicorn's status.
int block_clock_leave(block_clock_t *self) {
    uint32_t saved[SAVED];
    uint64_t values[SAVED + 1] = {0}; // First SP.
    int32_t ids[SAVED + 1] = {self->ids[SP]};
    move_registers(self->engine, self->read_registers, ids, values, 1);
    const int status = self->read_memory(self->engine, values[0], saved, sizeof saved);
    if (status != 0) {
        return status;
    }
    values[0] += sizeof saved + (((saved[XPSR] & ALIGNED) != 0) ? 4U : 0U);
    saved[XPSR] &= ~ALIGNED;
    for (int at = 0; at < SAVED; at++) {
        ids[at + 1] = self->ids[at];
        values[at + 1] = saved[at];
    }
    move_registers(self->engine, self->write_registers, ids, values, SAVED + 1);
    block_clock_spend(self, EXCEPTION_CYCLES);
    return 0;
}

/// True and the value, if the read has no effect on the state of the chip.
static bool is_simple(block_clock_t *self, uint32_t address, uint32_t *out_value) {
    if (address == SYST_RVR || address == SYST_CVR || address == ICSR) {
        if (self->tick_ns < 0 || self->now_ns >= self->tick_ns) {
            return false;
        }
        const int64_t count = (self->tick_ns - self->now_ns) * self->core_hz / NS_PER_S;
        const uint32_t current = (count < self->tick_load) ? (uint32_t)count : self->tick_load;
        *out_value = (address == ICSR) ? self->icsr : (address == SYST_RVR) ? self->tick_load : current;
        return true;
    }
    for (uint32_t part = 0; part < 2 && self->can != NULL; part++) {
        const uint32_t offset = address - self->can_blocks[part];
        if (offset < BLOCK_SIZE) {
            *out_value = self->read_can(self->can, part * BLOCK_SIZE + offset);
            return true;
        }
    }
    for (int at = 0; at < INPUTS; at++) {
        if (self->inputs[at].is_known != 0 && self->inputs[at].address == address) {
            *out_value = self->inputs[at].value;
            return true;
        }
    }
    return false;
}

uint64_t block_clock_read(void *engine, uint64_t offset, unsigned size, void *space) {
    const space_t *const place = space;
    block_clock_t *const self = place->clock;
    const uint32_t address = place->base + (uint32_t)offset;
    uint32_t value = 0;
    (void)engine;
    block_clock_spend(self, self->access_cycles);
    return (size == sizeof value && is_simple(self, address, &value)) ? value : self->read(self->now_ns, address, size);
}

void block_clock_write(void *engine, uint64_t offset, unsigned size, uint64_t value, void *space) {
    const space_t *const place = space;
    block_clock_t *const self = place->clock;
    (void)engine;
    block_clock_spend(self, self->access_cycles);
    self->write(self->now_ns, place->base + (uint32_t)offset, size, (uint32_t)value);
}
