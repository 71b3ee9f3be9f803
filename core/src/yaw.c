// SPDX-License-Identifier: MIT
#include "iwheel/private/yaw.h"

#include "arithmetic.h"
#include "iwheel/diverge.h"

/// Rounding of each wheel's part to whole um/s can exceed the limit by less than this for both together.
#define ROUNDING_UM_S 2

/// Converts a yaw angle in mrad to the difference of setpoints in mm, and their rates.
static IW_APART uint32_t difference_of(uint32_t mrad, const iw_yaw_machine_t *machine) {
    return mrad * machine->track_mm * IW_SETPOINT_RADIUS_MM / (machine->radius_mm * 1000U);
}

void iw_yaw_init(iw_yaw_t *self, const iw_yaw_machine_t *machine) {
    self->most_mm_s = (int32_t)difference_of(machine->max_yaw_mrad_s, machine);
    self->growth_mm_s2 = difference_of(machine->yaw_accel_mrad_s2, machine);
}

bool iw_yaw_limit(const iw_yaw_t *self, int32_t speed_mm_s[IW_SIDES]) {
    const int32_t turn_mm_s = iw_abs(speed_mm_s[IW_RIGHT] - speed_mm_s[IW_LEFT]);
    if (turn_mm_s <= self->most_mm_s) {
        return false;
    }
    speed_mm_s[IW_LEFT] = (int16_t)(speed_mm_s[IW_LEFT] * self->most_mm_s / turn_mm_s);
    speed_mm_s[IW_RIGHT] = (int16_t)(speed_mm_s[IW_RIGHT] * self->most_mm_s / turn_mm_s);
    return true;
}

int32_t iw_yaw_bound(const iw_yaw_t *self, int32_t from_um_s, uint32_t growth_um_s) {
    const int32_t now_um_s = iw_abs(from_um_s);
    const int32_t most_um_s = self->most_mm_s * 1000;
    const int32_t grown_um_s = now_um_s + (int32_t)growth_um_s;
    const int32_t bound_um_s = (grown_um_s < most_um_s) ? grown_um_s : most_um_s;
    return (bound_um_s > now_um_s) ? bound_um_s : now_um_s;
}

uint32_t iw_yaw_margin(int32_t bound_um_s, int32_t from_um_s, int32_t change_um_s) {
    const int32_t from = (change_um_s < 0) ? -from_um_s : from_um_s;
    const int32_t margin = bound_um_s - from - ROUNDING_UM_S;
    return (margin > 0) ? (uint32_t)margin : 0U;
}
