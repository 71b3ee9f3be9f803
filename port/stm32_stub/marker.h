// SPDX-License-Identifier: MIT
/// Were we sending when the last run ended? A word that survives a reset, but not a power-off.
#ifndef IW_STM32_MARKER_H
#define IW_STM32_MARKER_H

#include "iwheel/types.h"

/// True if the run before this start was sending setpoints: the wheels would keep its last command for their full second. Ask once,
/// before `iw_marker_set`. `power_on`: RAM holds nothing of that run.
bool iw_marker_take(bool power_on);

/// Whether setpoints are being sent now.
void iw_marker_set(bool sending);

#endif
