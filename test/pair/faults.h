// SPDX-License-Identifier: MIT
#ifndef PAIR_TEST_FAULTS_H
#define PAIR_TEST_FAULTS_H

#include "drive.h"

/// Plays each fault of one wheel at each speed: straight ahead, in a curve, in a ramp and in a stop. Prints the angles as a table. Returns an
/// exit status.
int faults_play(uint16_t pair_mm);

#endif
