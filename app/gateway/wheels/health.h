// SPDX-License-Identifier: MIT
/// Battery and temperature of each wheel against thresholds that the operator has set. They are told, and never stop anything: the
/// wheels' document gives no limits, so there are no defaults.
///
///     well --beyond the threshold for GW_HEALTH_US--> fault --within it for as long--> well
///     (a value that is not known changes nothing)
#ifndef GATEWAY_HEALTH_H
#define GATEWAY_HEALTH_H

#include "iwheel/snapshot.h"

/// A value must last this long: a battery's voltage dips with every start.
#define GW_HEALTH_US 5000000U
/// A sentence about it, with its terminator.
#define GW_HEALTH_TEXT_SIZE 128U
/// A status older than this is not known.
#define GW_HEALTH_FRESH_US 1000000U

typedef enum { GW_BATTERY_LOW = 0, GW_TEMPERATURE_HIGH, GW_AILMENTS } gw_ailment_t;

/// 0: there is no threshold.
typedef struct {
    uint16_t battery_low_dV;        ///< Below this.
    uint16_t temperature_high_degC; ///< Above this.
} gw_health_limits_t;

/// It begins all zero but for the limits.
typedef struct {
    gw_health_limits_t limits;
    bool present[IW_SIDES][GW_AILMENTS];
    iw_time_us_t since_us[IW_SIDES][GW_AILMENTS]; ///< Since when it is otherwise than `present`; 0: it is not.
    uint32_t changes;
} gw_health_t;

/// Judges what was received last.
void gw_health_look(gw_health_t *self, const iw_snapshot_t *seen);

/// "the left wheel's battery has 228 dV, below battery_low_dV 230", of a fault that is present.
void gw_health_sentence(const gw_health_t *self, const iw_snapshot_t *seen, iw_side_t side, gw_ailment_t ailment,
                        char out_text[GW_HEALTH_TEXT_SIZE]);

#endif
