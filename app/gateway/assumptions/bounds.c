// SPDX-License-Identifier: MIT
#include "assumptions_file.h"

#include "iwheel/codec.h"
#include "iwheel/observation.h"

#include <stdlib.h>
#include <string.h>

/// End of the year 9999: no valid clock writes a later time.
#define WALL_US_MAX INT64_C(253402300799000000)
/// A possible track: values are compared with it only to check their form.
#define ANY_TRACK_MM 600U

static bool within(int64_t value, int64_t low, int64_t high) {
    return value >= low && value <= high;
}

/// Compares 1000 x raw / offset in dN with the `ratio` of a unit.
static bool near_ratio(int32_t figure, int32_t ratio) {
    const int32_t share = ratio * 10 * IW_FORCE_OBSERVED_PERCENT;
    return within(figure, ratio * 1000 - share, ratio * 1000 + share);
}

static bool fits_unit(const gw_stored_item_t *known, bool confirmed) {
    const bool is_cn = strcmp(known->value, "cN") == 0;
    return near_ratio(known->entry.figure, (is_cn == confirmed) ? 10 : 1);
}

/// Returns the speed of the largest wheel at one rpm, in mm/s, rounded up.
static int32_t largest_rpm(void) {
    return (int32_t)iw_config_range(IW_CONFIG_RADIUS).max * 105 / 1000 + 1;
}

static bool fits_sign(int32_t figure, bool confirmed) {
    const int32_t along = confirmed ? figure : -figure;
    return along > IW_SIGN_MM_S && along <= -INT16_MIN * largest_rpm();
}

/// Returns true within 15 % of the commanded speed, and 1 rpm.
static bool fits_type(int32_t figure) {
    const int32_t share = 150 + largest_rpm() * 1000 / IW_OBSERVATION_TYPE_MM_S;
    return within(figure, 1000 - share, 1000 + share);
}

static bool fits_pose(int32_t figure, bool confirmed) {
    const int32_t step = IW_OBSERVATION_POSE_FACTOR * 1000;
    return confirmed ? within(figure, step, INT64_C(3000) * -INT16_MIN)
                     : within(figure, 0, 1000 / IW_OBSERVATION_POSE_FACTOR);
}

static bool fits_included(int32_t figure, bool confirmed) {
    const int32_t removed = 10 * IW_FORCE_REMOVED_PERCENT;
    return confirmed ? near_ratio(figure, 10) || near_ratio(figure, 1) : within(figure, -removed, removed);
}

static bool fits_gear(int32_t figure, bool confirmed) {
    const int32_t share = confirmed ? IW_OBSERVATION_FITS_PERMILLE : IW_OBSERVATION_FAILS_PERMILLE;
    return within(figure, 1000 - share, 1000 + share) == confirmed;
}

/// Returns true if this measurement can have this result.
static bool fits_bus(iw_assumption_item_t item, const gw_stored_item_t *known) {
    const bool confirmed = known->entry.state == IW_CONFIRMED;
    const int32_t figure = known->entry.figure;
    switch (item) {
    case IW_ASSUMPTION_FORCE_UNIT_LEFT:
    case IW_ASSUMPTION_FORCE_UNIT_RIGHT:
        return fits_unit(known, confirmed);
    case IW_ASSUMPTION_OFFSET_INCLUDED:
        return fits_included(figure, confirmed);
    case IW_ASSUMPTION_FEEDBACK_SIGN_LEFT:
    case IW_ASSUMPTION_FEEDBACK_SIGN_RIGHT:
        return figure != INT32_MIN && fits_sign(figure, confirmed);
    case IW_ASSUMPTION_SETPOINT_TYPE:
        return confirmed && fits_type(figure);
    case IW_ASSUMPTION_GEAR_RATIO:
        return fits_gear(figure, confirmed);
    case IW_ASSUMPTION_POSE_BYTE_ORDER:
        return fits_pose(figure, confirmed);
    case IW_ASSUMPTION_DLC:
        return confirmed ? figure == IW_DLC_STATUS : within(figure, 0, IW_CAN_DATA_MAX);
    default:
        return false; // Only the operator can see it.
    }
}

/// Returns true for a value that can be configured, or that an operator may find.
static bool can_be(iw_assumption_item_t item, const char *value) {
    char bare[IWN_VALUE_SIZE];
    iw_config_t config;
    iw_config_default(&config);
    config.setpoint_type_set = true;
    config.current_role = IW_ROLE_LIMIT;
    const inspect_configured_t any = {&config, ANY_TRACK_MM};
    memcpy(bare, value, sizeof bare);
    char *rest = (item == IW_ASSUMPTION_GEAR_RATIO) ? strstr(bare, ", rpm of the ") : NULL;
    if (rest != NULL && (strcmp(rest, ", rpm of the wheel") == 0 || strcmp(rest, ", rpm of the rotor") == 0)) {
        *rest = '\0';
    }
    return inspect_assumption_compare(&any, item, bare) != INSPECT_FOUND_IMPOSSIBLE;
}

bool gw_bounds_item(iw_assumption_item_t item, const gw_stored_item_t *known) {
    const bool by_bus = known->entry.source == IW_SOURCE_BUS;
    const bool fits = by_bus ? fits_bus(item, known) && known->word.found[0] == '\0' : known->entry.figure == 0;
    return fits && can_be(item, known->value) && can_be(item, known->word.found) &&
           within(known->since_wall_us, 0, WALL_US_MAX);
}

bool gw_bounds_offset(const gw_stored_offset_t *known) {
    const bool sent = known->from == IW_OFFSET_WHEEL;
    const bool sent_whole =
        known->offset_mN % 100 == 0 && known->drift_mN == 0 && known->deviation_mN == 0U && known->samples == 0U;
    const bool quiet = within(known->drift_mN, -(int32_t)IW_FORCE_DRIFT_mN, (int32_t)IW_FORCE_DRIFT_mN) &&
                       known->deviation_mN <= IW_FORCE_QUIET_mN && known->samples == IW_FORCE_WINDOW_SAMPLES;
    return within(known->offset_mN, -GW_BOUNDS_ZERO_mN, GW_BOUNDS_ZERO_mN) && (sent ? sent_whole : quiet) &&
           within(known->wall_us, 0, WALL_US_MAX);
}
