// SPDX-License-Identifier: MIT
/// @file
/// The normal force on one wheel, and where its zero comes from.
///
/// The document: force on the shaft = normal force - offset, where the offset is the mean normal force at start-up
/// and "only has sense if you don't apply any force to the shaft during the first two seconds". The wheel sends its
/// own offset only in its first 60 s. So the offset carries its provenance, and a bad one is not a value.
///
///     OPEN --40 samples without a gap--> judged: GOOD -> its mean becomes ESTIMATED, unless there is something better
///       ^                                  any other (contaminated) -> no value from it
///       +--- wheel rebooted
///
/// Order of trust: OPERATOR (tare) > WHEEL > ESTIMATED > STORED > NONE. A value replaces one that is trusted less;
/// WHEEL also replaces an older WHEEL, a tare an older tare, and anything STORED. After a reboot WHEEL and ESTIMATED
/// become STORED. If we saw the wheel start, its offset is taken only once our window over the same two seconds has
/// been judged GOOD.
///
/// Unit evidence: at rest the raw value divided by the wheel's offset in dN is about 10 (cN), 1 (dN) or 0 (offset
/// already removed). What it does to the force:
///
/// | evidence                   | without a tare             | after a tare               |
/// |----------------------------|----------------------------|----------------------------|
/// | unknown, the unit as set   | IW_FORCE_VALID             | IW_FORCE_VALID             |
/// | the other unit             | IW_FORCE_UNIT_CONTRADICTED | IW_FORCE_UNIT_CONTRADICTED |
/// | offset already removed     | IW_FORCE_OFFSET_REMOVED    | IW_FORCE_VALID             |
/// | unclear                    | IW_FORCE_OFFSET_DOUBTED    | IW_FORCE_VALID             |
///
/// Nothing is ever rescaled. `iw_snapshot_force_validity` adds what the ledger knows: the operator's word, earlier
/// runs.
///
/// Thresholds are ours; the document gives none.
#ifndef IW_FORCE_OFFSET_H
#define IW_FORCE_OFFSET_H

#include "iwheel/types.h"

/// Two seconds of force frames at their documented period of 50 ms.
#define IW_FORCE_WINDOW_SAMPLES 40U
/// A quiet sensor: the standard deviation of the window lies below this.
#define IW_FORCE_QUIET_mN 1000U
#define IW_FORCE_DRIFT_mN 1000U ///< ... and the difference of the means of its halves below this.
/// A mean further than this from an offset that was trusted before is taken for a load: nobody who leans on the machine
/// while it starts moves its zero by more ...
#define IW_FORCE_SHIFT_mN 5000U
/// ... but an operator who tares it may, up to here.
#define IW_FORCE_LOADED_mN 20000U
/// No offset is larger: 16 bits of dN.
#define IW_FORCE_OFFSET_MAX_mN 3276800
/// Unit evidence needs a wheel offset of at least this. A smaller one only becomes IW_UNIT_UNCLEAR, if our own mean is
/// further from it than IW_FORCE_LOADED_mN.
#define IW_FORCE_OBSERVED_MIN_dN 20
/// ... and a mean within this share of the ratio's prediction.
#define IW_FORCE_OBSERVED_PERCENT 15
#define IW_FORCE_REMOVED_PERCENT  30 ///< For a removed offset: a mean below this share of the offset.
/// Older than this (five periods), the force is not valid, and a window with such a gap starts again.
#define IW_FORCE_STALE_US 250000U

/// Where the offset in force comes from, in the order of trust.
typedef enum {
    IW_OFFSET_NONE = 0,
    IW_OFFSET_STORED,    ///< From an earlier run of the gateway or of the wheel.
    IW_OFFSET_ESTIMATED, ///< Our own mean over two quiet seconds.
    IW_OFFSET_WHEEL,     ///< Sent by the wheel.
    IW_OFFSET_OPERATOR,  ///< Tare.
} iw_offset_provenance_t;

/// What the window showed.
typedef enum {
    IW_WINDOW_OPEN = 0, ///< Still collecting.
    IW_WINDOW_GOOD,
    IW_WINDOW_MOVING, ///< Contaminated: the wheel turned.
    IW_WINDOW_NOISY,  ///< Contaminated: somebody pressed and let go.
    IW_WINDOW_DRIFT,  ///< Contaminated: the load changed slowly.
    IW_WINDOW_LOADED, ///< Contaminated: far from the offset that was trusted before.
    IW_WINDOW_SATURATED,
} iw_window_t;

/// What raw force and wheel offset together say of the unit.
typedef enum {
    IW_UNIT_UNKNOWN = 0, ///< No wheel offset, too small a one to tell, or no good window.
    IW_UNIT_CN,
    IW_UNIT_DN,
    IW_UNIT_OFFSET_REMOVED, ///< Raw is about 0 at rest although the offset is not.
    IW_UNIT_UNCLEAR,        ///< None of these: somebody pressed during one of the two measurements.
} iw_unit_observation_t;

/// What a tare came to.
typedef enum {
    IW_TARE_OK = 0,
    IW_TARE_NO_FORCE, ///< No unbroken window of recent samples.
    IW_TARE_MOVING,
    IW_TARE_NOISY, ///< Noise or drift.
    IW_TARE_LOADED,
    IW_TARE_SATURATED,
} iw_tare_t;

/// Whether the net force means anything.
typedef enum {
    IW_FORCE_VALID = 0,
    IW_FORCE_NO_TELEMETRY,
    IW_FORCE_SATURATED, ///< Raw is -32768 or 32767.
    IW_FORCE_NO_OFFSET,
    IW_FORCE_UNIT_CONTRADICTED,
    IW_FORCE_OFFSET_REMOVED, ///< The wheel seems to subtract the offset itself.
    IW_FORCE_OFFSET_DOUBTED, ///< Our own mean and the wheel's offset disagree: one of them was taken under load.
} iw_force_validity_t;

/// What a window of samples shows.
typedef struct {
    uint32_t deviation_mN; ///< Standard deviation of the window.
    int32_t drift_mN;      ///< Mean of its second half minus mean of its first half.
    int32_t mean_mN;       ///< Of the raw force.
    uint8_t samples;       ///< In it.
    iw_window_t window;    ///< The judgement.
} iw_force_quality_t;

/// The force on one wheel. Read it through the functions below. What is short stands first: a Cortex-M reaches it by
/// shorter instructions.
typedef struct {
    uint8_t count;                           ///< Samples in the ring.
    uint8_t still;                           ///< Of the newest samples, how many in a row came from a wheel at rest.
    uint8_t next;                            ///< Where the next sample goes.
    bool wheel_offset_heard;                 ///< In this run of the wheel.
    bool boot_seen;                          ///< The start of this run was observed.
    iw_force_unit_t unit;                    ///< Of `raw`.
    iw_offset_provenance_t provenance;       ///< Of the offset in force.
    iw_unit_observation_t observation;       ///< Of the unit.
    iw_force_quality_t quality;              ///< Of the start-up window.
    iw_time_us_t raw_us;                     ///< When `raw` came; IW_NEVER: not yet.
    iw_time_us_t offset_us;                  ///< When that offset was taken; IW_NEVER: none, or by an earlier run.
    int32_t offset_mN;                       ///< The offset in force; 0 with IW_OFFSET_NONE.
    int32_t observed_permille;               ///< 1000 x raw mean / wheel offset in dN, when evidence was judged.
    int16_t wheel_offset_dN;                 ///< The wheel's own, as sent.
    int16_t raw;                             ///< The last one, as on the bus.
    int16_t sample[IW_FORCE_WINDOW_SAMPLES]; ///< Ring of raw values, the last two seconds.
} iw_force_t;

/// `unit`: as configured.
void iw_force_init(iw_force_t *self, iw_force_unit_t unit);

/// The wheel (re)started or was heard for the first time: the window opens. `boot_seen`: its start was observed, so
/// that our window covers the wheel's own first two seconds.
void iw_force_reopen(iw_force_t *self, bool boot_seen);

/// Puts an offset of an earlier run in force, unless this run has a better one: as IW_OFFSET_STORED, which anything
/// replaces, or, if it was tared, as IW_OFFSET_OPERATOR, which only the next tare does. `offset_us` is IW_NEVER then.
/// `offset_mN` lies within +/- IW_FORCE_OFFSET_MAX_mN.
void iw_force_restore(iw_force_t *self, iw_offset_provenance_t provenance, int32_t offset_mN);

/// Takes a force frame. `still`: the wheel is at rest.
void iw_force_receive(iw_force_t *self, iw_time_us_t now_us, int16_t raw, bool still);

/// Takes an offset frame.
void iw_force_receive_offset(iw_force_t *self, iw_time_us_t now_us, int16_t offset_dN);

/// Makes the mean of the last two seconds the offset, as OPERATOR. Refused, changing nothing, with the reason. LOADED
/// is not judged where the offset in force is itself in doubt.
iw_tare_t iw_force_tare(iw_force_t *self, iw_time_us_t now_us);

/// What a tare would come to now; changes nothing.
iw_tare_t iw_force_may_tare(const iw_force_t *self, iw_time_us_t now_us);

/// What the last two seconds show: the window that a tare would take. Means something only with a full ring
/// (`count` is IW_FORCE_WINDOW_SAMPLES).
iw_force_quality_t iw_force_measure(const iw_force_t *self);

/// Whether the net force means anything now, and if not, why.
iw_force_validity_t iw_force_validity(const iw_force_t *self, iw_time_us_t now_us);

/// Raw force in mN in the configured unit.
int32_t iw_force_raw_mN(const iw_force_t *self);

/// Raw minus offset. Only with IW_FORCE_VALID does it mean anything.
int32_t iw_force_net_mN(const iw_force_t *self);

#endif
