// SPDX-License-Identifier: MIT
#include "iwheel_linux/bus_link.h"

iwl_timing_t iwl_timing_judge(const iwl_bus_link_t *link, uint32_t bitrate_hz, uint16_t sample_point_permille) {
    const uint16_t actual = link->sample_point_permille;
    const uint16_t off =
        (uint16_t)((actual > sample_point_permille) ? actual - sample_point_permille : sample_point_permille - actual);
    // Ordered by consequence: a value that is known to be wrong refuses arm even if another one is not reported.
    if (link->is_virtual) {
        return IWL_TIMING_VIRTUAL;
    }
    if (link->bitrate_hz != 0U && link->bitrate_hz != bitrate_hz) {
        return IWL_TIMING_WRONG;
    }
    if (actual != 0U && off > IWL_TIMING_WRONG_PERMILLE) {
        return IWL_TIMING_WRONG;
    }
    if (link->bitrate_hz == 0U || actual == 0U) {
        return IWL_TIMING_UNKNOWN;
    }
    return (off > IWL_TIMING_NEAR_PERMILLE) ? IWL_TIMING_NEAR : IWL_TIMING_RIGHT;
}

bool iwl_bus_link_is_same(const iwl_bus_link_t *one, const iwl_bus_link_t *other) {
    return one->presence == other->presence && one->is_virtual == other->is_virtual &&
           one->echo_proven == other->echo_proven && one->is_mute == other->is_mute &&
           one->bitrate_hz == other->bitrate_hz && one->sample_point_permille == other->sample_point_permille &&
           one->restart_ms == other->restart_ms && one->queue_length == other->queue_length;
}
