// SPDX-License-Identifier: MIT
/// A number that names this start of the board: no other start, of this board or of another, has the same.
#ifndef IW_STM32_BOOT_H
#define IW_STM32_BOOT_H

#include "iwheel/types.h"

/// The same for the whole run.
uint64_t iw_boot_id(void);

#endif
