// SPDX-License-Identifier: MIT
/// @file
/// The core for C++. Each header of the core also works in C++ alone.
#ifndef IW_IWHEEL_HPP
#define IW_IWHEEL_HPP

#include "iwheel/bit_timing.h"
#include "iwheel/gateway.h"

#endif
