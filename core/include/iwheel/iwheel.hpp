// SPDX-License-Identifier: MIT
/// @file
/// The core for C++: include this one instead of gateway.h.
#ifndef IW_IWHEEL_HPP
#define IW_IWHEEL_HPP

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

extern "C" {
#include "iwheel/bit_timing.h"
#include "iwheel/gateway.h"
}

#endif
