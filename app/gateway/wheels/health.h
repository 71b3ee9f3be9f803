// SPDX-License-Identifier: MIT
/// Compares battery and temperature of each wheel with thresholds of the operator. Faults are reported and never stop
/// the wheels. There are no defaults, because the document states no limits.
///
///     well --beyond the threshold for GW_HEALTH_US--> fault --within it for as long--> well
///     (a value that is not known changes nothing)
#ifndef GATEWAY_HEALTH_H
#define GATEWAY_HEALTH_H

#include "iwheel/snapshot.h"

/// Duration of a value that counts: the voltage of a battery falls with every start.
#define GW_HEALTH_US 5000000U
/// Size of a sentence with its terminator.
#define GW_HEALTH_TEXT_SIZE 128U
/// An older status is unknown.
#define GW_HEALTH_FRESH_US 1000000U

typedef enum { GW_BATTERY_LOW = 0, GW_TEMPERATURE_HIGH, GW_AILMENTS } gw_ailment_t;

/// Thresholds; 0 if there is none.
typedef struct {
    uint16_t battery_low_dV;        ///< Fault below this.
    uint16_t temperature_high_degC; ///< Fault above this.
} gw_health_limits_t;

/// State of the faults. It begins with zeros except for the limits.
typedef struct {
    gw_health_limits_t limits;
    bool present[IW_SIDES][GW_AILMENTS];
    iw_time_us_t since_us[IW_SIDES]
                         [GW_AILMENTS]; ///< Time since which the value contradicts `present`; 0 if it does not.
    uint32_t changes;
} gw_health_t;

/// Judges the last status messages.
void gw_health_check(gw_health_t *self, const iw_snapshot_t *seen);

/// Describes a fault that is present: "the left wheel's battery has 228 dV, below battery_low_dV 230".
void gw_health_sentence(const gw_health_t *self, const iw_snapshot_t *seen, iw_side_t side, gw_ailment_t ailment,
                        char out_text[GW_HEALTH_TEXT_SIZE]);

#endif
