// SPDX-License-Identifier: MIT
/// Words that every module shares: time, sides, status codes, a command for a pair of wheels.
///
/// Units stand at the end of a name: `_mm_s _mm_s2 _mA _mN _rpm _dV _degC _ms _us _permille`. Everything is an
/// integer. Programmer errors (a null pointer, an enumerator that does not exist) are not reported: they are the
/// caller's contract. Bad arguments come back as a status; trouble on the wire is counted.
#ifndef IW_TYPES_H
#define IW_TYPES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/// A relation between constants that must hold, or the file does not compile. `name` must be unique in its file.
#define IW_STATIC_ASSERT(condition, name) typedef char iw_static_assert_##name[(condition) ? 1 : -1]

/// Monotonic time in microseconds since any fixed instant. 64 bits do not wrap in the life of a device.
typedef uint64_t iw_time_us_t;

/// Later than every time; "no wake-up wanted" and "never happened".
#define IW_NEVER UINT64_MAX

#define IW_US_PER_MS 1000U

/// The two wheels. Usable as an array index.
typedef enum { IW_LEFT = 0, IW_RIGHT = 1 } iw_side_t;
#define IW_SIDES 2

/// What a function made of its arguments. Outputs are untouched unless the status is IW_OK.
typedef enum {
    IW_OK = 0,
    IW_ERR_RANGE, ///< A value is outside its documented range.
    IW_ERR_ID,    ///< There is no such message.
} iw_status_t;

/// What one wheel is told: bytes 1-4 of its setpoint frame.
typedef struct {
    int16_t speed_mm_s;
    int16_t current_mA; ///< A limit or a setpoint: the document does not say, `iw_config_t::current_role` does.
} iw_command_t;

/// What both wheels are told, indexed by `iw_side_t`. They leave together or not at all.
typedef struct {
    iw_command_t wheel[IW_SIDES];
} iw_pair_t;

#endif
