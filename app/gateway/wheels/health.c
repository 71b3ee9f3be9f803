// SPDX-License-Identifier: MIT
#include "health.h"

#include "iwheel/codec.h"

#include <stdio.h>

/// Reads the last battery voltage or temperature of a wheel. Returns false if it is not known.
static bool find_value(const iw_snapshot_t *seen, iw_side_t side, gw_ailment_t ailment, unsigned *out_value) {
    const iw_snapshot_wheel_t *wheel = &seen->wheel[side];
    const iw_codec_status_t *status = &wheel->telemetry->status;
    const bool warm = ailment == GW_TEMPERATURE_HIGH;
    if (wheel->status_us == IW_NEVER || seen->at_us - wheel->status_us > GW_HEALTH_FRESH_US ||
        (warm && status->temperature_degC > IW_TEMPERATURE_MAX_degC)) {
        return false;
    }
    *out_value = warm ? status->temperature_degC : status->battery_dV;
    return true;
}

static void judge(gw_health_t *self, const iw_snapshot_t *seen, iw_side_t side, gw_ailment_t ailment) {
    const unsigned low = self->limits.battery_low_dV;
    const unsigned high = self->limits.temperature_high_degC;
    iw_time_us_t *since_us = &self->since_us[side][ailment];
    unsigned value = 0;
    if (!find_value(seen, side, ailment, &value)) {
        *since_us = 0;
        return;
    }
    const bool beyond = (ailment == GW_BATTERY_LOW) ? value < low : high != 0U && value > high;
    if (beyond == self->present[side][ailment]) {
        *since_us = 0;
    } else if (*since_us == 0) {
        *since_us = seen->at_us;
    } else if (seen->at_us - *since_us >= GW_HEALTH_US) {
        self->present[side][ailment] = beyond;
        self->changes++;
        *since_us = 0;
    }
}

void gw_health_check(gw_health_t *self, const iw_snapshot_t *seen) {
    for (unsigned side = 0; side < IW_SIDES; side++) {
        judge(self, seen, (iw_side_t)side, GW_BATTERY_LOW);
        judge(self, seen, (iw_side_t)side, GW_TEMPERATURE_HIGH);
    }
}

void gw_health_sentence(const gw_health_t *self, const iw_snapshot_t *seen, iw_side_t side, gw_ailment_t ailment,
                        char out_text[GW_HEALTH_TEXT_SIZE]) {
    const char *name = (side == IW_LEFT) ? "left" : "right";
    unsigned value = 0;
    (void)find_value(seen, side, ailment, &value);
    if (ailment == GW_BATTERY_LOW) {
        (void)snprintf(out_text, GW_HEALTH_TEXT_SIZE,
                       "the %s wheel's battery has %u dV, below battery_low_dV %u; charge it", name, value,
                       self->limits.battery_low_dV);
    } else {
        (void)snprintf(out_text, GW_HEALTH_TEXT_SIZE,
                       "the %s wheel has %u degC, above temperature_high_degC %u; let it cool", name, value,
                       self->limits.temperature_high_degC);
    }
}
