// SPDX-License-Identifier: MIT
#include "iwheel/force_offset.h"

#include "arithmetic.h"

#include <string.h>

/// Number of samples in one half of the window. The means of both halves show drift.
#define HALF (IW_FORCE_WINDOW_SAMPLES / 2U)
/// Limit of the deviation of one sample (raw), so that the sum of squares fits 32 bits. It is far above a quiet sensor
/// in both units.
#define SPREAD_MAX 8191
/// Largest variance (raw) that fits 32 bits after scaling to mN.
#define VARIANCE_FINE 400000U

IW_STATIC_ASSERT(IW_FORCE_WINDOW_SAMPLES <= UINT8_MAX, ring_index_fits);
IW_STATIC_ASSERT((uint64_t)SPREAD_MAX *SPREAD_MAX *IW_FORCE_WINDOW_SAMPLES <= UINT32_MAX, spread_fits);

static int32_t scale_mN(const iw_force_t *self) {
    return (self->unit == IW_FORCE_CN) ? 10 : 100;
}

/// The limits of 16 bits are the sensor's limits, not a force.
static IW_APART bool saturated(int16_t raw) {
    return raw == INT16_MIN || raw == INT16_MAX;
}

static IW_APART bool stale(const iw_force_t *self, iw_time_us_t now_us) {
    return iw_age_us(self->raw_us, now_us) >= IW_FORCE_STALE_US;
}

void iw_force_init(iw_force_t *self, iw_force_unit_t unit) {
    memset(self, 0, sizeof *self);
    self->unit = unit;
    self->raw_us = IW_NEVER;
    self->offset_us = IW_NEVER;
}

void iw_force_reopen(iw_force_t *self, bool boot_seen) {
    self->boot_seen = boot_seen;
    self->count = 0;
    self->wheel_offset_received = false;
    self->observation = IW_UNIT_UNKNOWN;
    self->observed_permille = 0;
    memset(&self->quality, 0, sizeof self->quality);
    // The wheel measures its offset again; until then the old one is only stored. A tare survives a reboot.
    if (self->provenance == IW_OFFSET_WHEEL || self->provenance == IW_OFFSET_ESTIMATED) {
        self->provenance = IW_OFFSET_STORED;
    }
}

static void adopt(iw_force_t *self, iw_time_us_t now_us, iw_offset_provenance_t provenance, int32_t offset_mN) {
    self->provenance = provenance;
    self->offset_mN = offset_mN;
    self->offset_us = now_us;
}

/// Integer square root, bit by bit: the core has neither floating point nor libm.
static uint32_t square_root(uint32_t value) {
    uint32_t root = 0;
    for (uint32_t bit = 1U << 15; bit != 0U; bit >>= 1) {
        if ((root | bit) * (root | bit) <= value) {
            root |= bit;
        }
    }
    return root;
}

static uint32_t deviation_mN(const iw_force_t *self, int32_t mean_raw) {
    const uint32_t scale = (uint32_t)scale_mN(self);
    uint32_t sum = 0;
    for (size_t i = 0; i < IW_FORCE_WINDOW_SAMPLES; i++) {
        const int32_t spread = iw_abs(self->sample[i] - mean_raw);
        const uint32_t capped = (uint32_t)((spread < SPREAD_MAX) ? spread : SPREAD_MAX);
        sum += capped * capped;
    }
    const uint32_t variance = sum / IW_FORCE_WINDOW_SAMPLES;
    // Scales before the root if 32 bits allow it. Otherwise a deviation below one raw unit (0.1 N in dN) would be
    // rounded to 0.
    const bool fine = variance <= VARIANCE_FINE;
    const uint32_t root = square_root(fine ? variance * scale * scale : variance);
    return fine ? root : root * scale;
}

/// Returns the first of the faults moving, noisy and drift, because each causes the following ones.
static iw_window_t judge_quality(const iw_force_t *self, const iw_force_quality_t *quality) {
    if (self->still < IW_FORCE_WINDOW_SAMPLES) {
        return IW_WINDOW_MOVING;
    }
    if (quality->deviation_mN > IW_FORCE_QUIET_mN) {
        return IW_WINDOW_NOISY;
    }
    return (iw_abs(quality->drift_mN) > (int32_t)IW_FORCE_DRIFT_mN) ? IW_WINDOW_DRIFT : IW_WINDOW_GOOD;
}

/// The ring is full, so `next` is the index of the oldest sample and the first half is the older one. A saturated
/// sample precedes every other fault.
static void measure(const iw_force_t *self, iw_force_quality_t *out_quality) {
    const int32_t scale = scale_mN(self);
    bool any_saturated = false;
    int32_t sum = 0;
    int32_t older = 0;
    size_t at = self->next;
    for (size_t i = 0; i < IW_FORCE_WINDOW_SAMPLES; i++) {
        const int16_t raw = self->sample[at];
        at = (at + 1U < IW_FORCE_WINDOW_SAMPLES) ? at + 1U : 0U;
        if (i == HALF) {
            older = sum;
        }
        sum += raw;
        any_saturated = saturated(raw) || any_saturated;
    }
    out_quality->samples = IW_FORCE_WINDOW_SAMPLES;
    out_quality->mean_mN = sum * scale / (int32_t)IW_FORCE_WINDOW_SAMPLES;
    out_quality->drift_mN = (sum - older - older) * scale / (int32_t)HALF;
    out_quality->deviation_mN = deviation_mN(self, sum / (int32_t)IW_FORCE_WINDOW_SAMPLES);
    out_quality->window = any_saturated ? IW_WINDOW_SATURATED : judge_quality(self, out_quality);
}

iw_force_quality_t iw_force_measure(const iw_force_t *self) {
    iw_force_quality_t quality;
    measure(self, &quality);
    return quality;
}

static IW_APART bool far_from_offset(const iw_force_t *self, int32_t mean_mN, uint32_t limit_mN) {
    return iw_abs(mean_mN - self->offset_mN) > (int32_t)limit_mN;
}

static bool within(int32_t difference, int32_t whole, int32_t percent) {
    return iw_abs(difference) * 100 <= whole * percent;
}

/// At standstill, raw by offset is about 10 (cN), 1 (dN) or 0 (offset already removed). The ranges do not overlap,
/// since each is narrower than the gap to the next. A ratio outside all of them is unclear.
static iw_unit_observation_t weigh(int32_t mean_raw, int32_t offset_dN) {
    const int32_t offset = iw_abs(offset_dN);
    if (within(mean_raw - 10 * offset_dN, 10 * offset, IW_FORCE_OBSERVED_PERCENT)) {
        return IW_UNIT_CN;
    }
    if (within(mean_raw - offset_dN, offset, IW_FORCE_OBSERVED_PERCENT)) {
        return IW_UNIT_DN;
    }
    return within(mean_raw, offset, IW_FORCE_REMOVED_PERCENT) ? IW_UNIT_OFFSET_REMOVED : IW_UNIT_UNCLEAR;
}

/// Compares the mean of a good window with the wheel's offset. A small offset cannot decide the unit (0 in cN is 0 in
/// dN), but a mean far from it still shows a load in one of the two measurements.
static IW_APART void judge_unit(iw_force_t *self) {
    const int32_t offset_dN = self->wheel_offset_dN;
    const int32_t mean_raw = self->quality.mean_mN / scale_mN(self);
    if (!self->wheel_offset_received || self->quality.window != IW_WINDOW_GOOD) {
        return;
    }
    if (iw_abs(offset_dN) >= IW_FORCE_OBSERVED_MIN_dN) {
        self->observation = weigh(mean_raw, offset_dN);
        self->observed_permille = mean_raw * 1000 / offset_dN;
    } else if (iw_abs(self->quality.mean_mN - offset_dN * 100) > (int32_t)IW_FORCE_LOADED_mN) {
        self->observation = IW_UNIT_UNCLEAR;
    }
}

static bool unit_contradicted(const iw_force_t *self) {
    const iw_unit_observation_t other = (self->unit == IW_FORCE_CN) ? IW_UNIT_DN : IW_UNIT_CN;
    return self->observation == other;
}

/// Returns true if a wheel whose start was not seen may have measured a person who leaned on it: its offset differs
/// from the stored one as by a load. (After a good window of an observed start, the offset is no longer
/// IW_OFFSET_STORED.)
static bool may_be_load(const iw_force_t *self) {
    return self->provenance == IW_OFFSET_STORED &&
           far_from_offset(self, self->wheel_offset_dN * 100, IW_FORCE_SHIFT_mN);
}

/// Uses the wheel's offset, unless the window shows a load during its measurement ("only has sense if you don't apply
/// any force to the shaft during the first two seconds"). If the start was not observed, a stored offset far from it
/// stays in use, and the force is doubtful until a tare.
static IW_APART void settle(iw_force_t *self, iw_time_us_t now_us) {
    const bool trusted = !self->boot_seen || self->quality.window == IW_WINDOW_GOOD;
    judge_unit(self);
    if (!self->wheel_offset_received || !trusted || self->provenance == IW_OFFSET_OPERATOR) {
        return;
    }
    if (!may_be_load(self) || unit_contradicted(self)) {
        adopt(self, now_us, IW_OFFSET_WHEEL, self->wheel_offset_dN * 100);
    } else {
        self->observation = IW_UNIT_UNCLEAR;
    }
}

void iw_force_restore(iw_force_t *self, iw_offset_provenance_t provenance, int32_t offset_mN) {
    // The wheel's offset may have come before the answer of the store: then settle compares the two now.
    if (self->provenance == IW_OFFSET_WHEEL && !self->boot_seen) {
        self->provenance = IW_OFFSET_STORED;
    }
    if (self->provenance < provenance || self->provenance == IW_OFFSET_STORED) {
        adopt(self, IW_NEVER, provenance, offset_mN);
        settle(self, IW_NEVER);
    }
}

static void judge_window(iw_force_t *self, iw_time_us_t now_us) {
    measure(self, &self->quality);
    // A steady load appears as a quiet sensor; only a trusted offset reveals it.
    const bool known = self->provenance == IW_OFFSET_STORED || self->provenance == IW_OFFSET_OPERATOR;
    if (self->quality.window == IW_WINDOW_GOOD && known &&
        far_from_offset(self, self->quality.mean_mN, IW_FORCE_SHIFT_mN)) {
        self->quality.window = IW_WINDOW_LOADED;
    }
    // Without its start in sight, a light load would move the stored offset a little each time.
    const bool kept = known && !self->boot_seen;
    if (self->quality.window == IW_WINDOW_GOOD && self->provenance < IW_OFFSET_ESTIMATED && !kept) {
        adopt(self, now_us, IW_OFFSET_ESTIMATED, self->quality.mean_mN);
    }
    settle(self, now_us);
}

/// Counts up to a full ring.
static uint8_t one_more(uint8_t samples) {
    return (samples < IW_FORCE_WINDOW_SAMPLES) ? (uint8_t)(samples + 1U) : samples;
}

void iw_force_receive(iw_force_t *self, iw_time_us_t now_us, int16_t raw, bool still) {
    if (stale(self, now_us)) {
        self->count = 0;
    }
    self->raw = raw;
    self->raw_us = now_us;
    self->sample[self->next] = raw;
    self->next = (uint8_t)((self->next + 1U) % IW_FORCE_WINDOW_SAMPLES);
    self->count = one_more(self->count);
    self->still = still ? one_more(self->still) : 0U;
    if (self->quality.window == IW_WINDOW_OPEN && self->count == IW_FORCE_WINDOW_SAMPLES) {
        judge_window(self, now_us);
    }
}

void iw_force_receive_offset(iw_force_t *self, iw_time_us_t now_us, int16_t offset_dN) {
    self->wheel_offset_dN = offset_dN;
    self->wheel_offset_received = true;
    settle(self, now_us);
}

iw_tare_t iw_force_may_tare(const iw_force_t *self, iw_time_us_t now_us) {
    if (self->count < IW_FORCE_WINDOW_SAMPLES || stale(self, now_us)) {
        return IW_TARE_NO_FORCE;
    }
    iw_force_quality_t quality;
    measure(self, &quality);
    // An offset in doubt must not refuse the tare that would replace it.
    const bool doubted = self->observation == IW_UNIT_UNCLEAR || self->observation == IW_UNIT_OFFSET_REMOVED;
    const bool known = self->provenance != IW_OFFSET_NONE && !doubted;
    if (quality.window == IW_WINDOW_SATURATED) {
        return IW_TARE_SATURATED;
    }
    if (quality.window != IW_WINDOW_GOOD) {
        return (quality.window == IW_WINDOW_MOVING) ? IW_TARE_MOVING : IW_TARE_NOISY;
    }
    return (known && far_from_offset(self, quality.mean_mN, IW_FORCE_LOADED_mN)) ? IW_TARE_LOADED : IW_TARE_OK;
}

iw_tare_t iw_force_tare(iw_force_t *self, iw_time_us_t now_us) {
    const iw_tare_t result = iw_force_may_tare(self, now_us);
    if (result == IW_TARE_OK) {
        iw_force_quality_t quality;
        measure(self, &quality);
        adopt(self, now_us, IW_OFFSET_OPERATOR, quality.mean_mN);
    }
    return result;
}

iw_force_validity_t iw_force_validity(const iw_force_t *self, iw_time_us_t now_us) {
    if (stale(self, now_us)) {
        return IW_FORCE_NO_TELEMETRY;
    }
    if (saturated(self->raw)) {
        return IW_FORCE_SATURATED;
    }
    if (self->provenance == IW_OFFSET_NONE) {
        return IW_FORCE_NO_OFFSET;
    }
    // The tare comes after this check: no offset corrects a wrong unit.
    if (unit_contradicted(self)) {
        return IW_FORCE_UNIT_CONTRADICTED;
    }
    if (self->provenance == IW_OFFSET_OPERATOR) {
        return IW_FORCE_VALID; // The tare includes what the wheel subtracts.
    }
    if (self->observation == IW_UNIT_OFFSET_REMOVED) {
        return IW_FORCE_OFFSET_REMOVED;
    }
    return (self->observation == IW_UNIT_UNCLEAR) ? IW_FORCE_OFFSET_DOUBTED : IW_FORCE_VALID;
}

int32_t iw_force_raw_mN(const iw_force_t *self) {
    return self->raw * scale_mN(self);
}

int32_t iw_force_net_mN(const iw_force_t *self) {
    return iw_force_raw_mN(self) - self->offset_mN;
}
