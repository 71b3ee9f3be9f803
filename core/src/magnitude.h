// SPDX-License-Identifier: MIT
/// |value| for values whose negation fits: everything here is far from INT32_MIN.
#ifndef IW_MAGNITUDE_H
#define IW_MAGNITUDE_H

#include <stdint.h>

static inline int32_t iw_magnitude(int32_t value) {
    return (value < 0) ? -value : value;
}

#endif
