// SPDX-License-Identifier: MIT
// Built in place of the GPIO e-stop where libgpiod is missing.
#include "iwheel_linux/backend.h"

const iw_estop_ops_t *const iw_gpio_estop_ops = NULL;
