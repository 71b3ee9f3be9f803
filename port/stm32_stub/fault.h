// SPDX-License-Identifier: MIT
/// Record of the fault that ended the previous run. It is in RAM, which a reset does not clear and power-off does.
///
/// Section numbers refer to PM0056 (Cortex-M3) and PM0214 (Cortex-M4): 2.4.7 exception entry, 4.4 system control.
#ifndef BRD_FAULT_H
#define BRD_FAULT_H

#include "iwheel/types.h"

typedef struct {
    uint32_t cause; ///< CFSR, with the number of the exception in bits 26 to 31, which CFSR does not use; 0: no fault.
    uint32_t pc;    ///< Address of the interrupted instruction; 0: there was no stack to store it.
} brd_fault_t;

/// Stores the fault and resets the chip. `frame`: the stack pointer at the entry of the exception.
_Noreturn void brd_fault_store(const uint32_t *frame);

/// Returns the fault that ended the previous run. It returns each fault once.
brd_fault_t brd_fault_take(void);

#endif
