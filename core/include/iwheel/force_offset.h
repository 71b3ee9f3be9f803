// SPDX-License-Identifier: MIT
/// @file
/// Normal force on one wheel, its offset, and the source of the offset.
///
/// The document: force on the shaft = normal force - offset, where the offset is the mean normal force at start-up
/// and "only has sense if you don't apply any force to the shaft during the first two seconds". The wheel sends its
/// own offset only in its first 60 s. The offset therefore has a provenance, and a bad offset is not used.
///
///     OPEN --40 samples without a gap--> judged: GOOD -> its mean becomes ESTIMATED, unless a more trusted one exists
///       ^                                  any other (contaminated) -> no value from it
///       +--- wheel rebooted
///
/// Order of trust: OPERATOR (tare) > WHEEL > ESTIMATED > STORED > NONE. An offset replaces a less trusted one. In
/// addition WHEEL replaces an older WHEEL, and a tare replaces an older tare. After a reboot WHEEL and ESTIMATED become
/// STORED. If the start of the wheel was observed, the core uses the wheel's offset only after its own window over the
/// same two seconds was judged GOOD. If it was not, a STORED offset is replaced only by a tare, or by an offset of the
/// wheel within IW_FORCE_SHIFT_mN of it.
///
/// Observation of the unit: at standstill, raw value by the wheel's offset in dN is about 10 (cN), 1 (dN) or 0
/// (offset already removed). Its effect on the force:
///
/// | observation                | without a tare             | after a tare               |
/// |----------------------------|----------------------------|----------------------------|
/// | unknown, the unit as set   | IW_FORCE_VALID             | IW_FORCE_VALID             |
/// | the other unit             | IW_FORCE_UNIT_CONTRADICTED | IW_FORCE_UNIT_CONTRADICTED |
/// | offset already removed     | IW_FORCE_OFFSET_REMOVED    | IW_FORCE_VALID             |
/// | unclear                    | IW_FORCE_OFFSET_DOUBTED    | IW_FORCE_VALID             |
///
/// The core never rescales a force. `iw_snapshot_force_validity` also considers the assumption store: the operator and
/// earlier runs.
///
/// The document has no thresholds; we chose them.
#ifndef IW_FORCE_OFFSET_H
#define IW_FORCE_OFFSET_H

#include "iwheel/types.h"

#ifdef __cplusplus
extern "C" {
#endif

/// Two seconds of force frames at their documented period of 50 ms.
#define IW_FORCE_WINDOW_SAMPLES 40U
/// A quiet sensor has a standard deviation below this in the window ...
#define IW_FORCE_QUIET_mN 1000U
#define IW_FORCE_DRIFT_mN 1000U ///< ... and a difference between the means of its halves below this.
/// A start-up mean that differs by more than this from a trusted offset counts as a load: a person who leans on the
/// machine while it starts must not move its zero further.
#define IW_FORCE_SHIFT_mN 5000U
/// The same limit for a tare by the operator.
#define IW_FORCE_LOADED_mN 20000U
/// Largest offset: 16 bits of dN.
#define IW_FORCE_OFFSET_MAX_mN 3276800
/// The unit is judged with a wheel offset of at least this. With a smaller one the only result is IW_UNIT_UNCLEAR, if
/// the core's own mean differs from it by more than IW_FORCE_LOADED_mN.
#define IW_FORCE_OBSERVED_MIN_dN 20
/// The mean must be within this share of the value that the ratio predicts.
#define IW_FORCE_OBSERVED_PERCENT 15
#define IW_FORCE_REMOVED_PERCENT  30 ///< With a removed offset the mean must be below this share of the offset.
/// The force is not valid if it is older than this (five periods). A window with such a gap starts again.
#define IW_FORCE_STALE_US 250000U

/// Source of the offset, in the order of trust.
typedef enum {
    IW_OFFSET_NONE = 0,
    IW_OFFSET_STORED,    ///< An earlier run of the gateway or of the wheel.
    IW_OFFSET_ESTIMATED, ///< The core's mean over two quiet seconds.
    IW_OFFSET_WHEEL,     ///< An offset message of the wheel.
    IW_OFFSET_OPERATOR,  ///< A tare.
} iw_offset_provenance_t;

/// Judgement of a window.
typedef enum {
    IW_WINDOW_OPEN = 0, ///< Still collecting.
    IW_WINDOW_GOOD,
    IW_WINDOW_MOVING, ///< Contaminated: the wheel turned.
    IW_WINDOW_NOISY,  ///< Contaminated: the load changed quickly.
    IW_WINDOW_DRIFT,  ///< Contaminated: the load changed slowly.
    IW_WINDOW_LOADED, ///< Contaminated: far from the trusted offset.
    IW_WINDOW_SATURATED,
} iw_window_t;

/// Unit of the raw force, judged by raw force and wheel offset.
typedef enum {
    IW_UNIT_UNKNOWN = 0, ///< No wheel offset, a wheel offset that is too small, or no good window.
    IW_UNIT_CN,
    IW_UNIT_DN,
    IW_UNIT_OFFSET_REMOVED, ///< Raw is about 0 at standstill although the offset is not.
    IW_UNIT_UNCLEAR,        ///< None of these: there was a load during one of the two measurements.
} iw_unit_observation_t;

/// Result of a tare.
typedef enum {
    IW_TARE_OK = 0,
    IW_TARE_NO_FORCE, ///< No window of recent samples without a gap.
    IW_TARE_MOVING,
    IW_TARE_NOISY, ///< Noise or drift.
    IW_TARE_LOADED,
    IW_TARE_SATURATED,
} iw_tare_t;

/// Validity of the net force.
typedef enum {
    IW_FORCE_VALID = 0,
    IW_FORCE_NO_TELEMETRY,
    IW_FORCE_SATURATED, ///< Raw is -32768 or 32767.
    IW_FORCE_NO_OFFSET,
    IW_FORCE_UNIT_CONTRADICTED,
    IW_FORCE_OFFSET_REMOVED, ///< The wheel seems to subtract the offset itself.
    /// The wheel's offset disagrees with the core's mean or with the stored offset: one was measured under load.
    IW_FORCE_OFFSET_DOUBTED,
} iw_force_validity_t;

/// Statistics of a window of samples.
typedef struct {
    uint32_t deviation_mN; ///< Standard deviation of the window.
    int32_t drift_mN;      ///< Mean of its second half minus mean of its first half.
    int32_t mean_mN;       ///< Mean of the raw force.
    uint8_t samples;       ///< Number of samples.
    iw_window_t window;    ///< Judgement.
} iw_force_quality_t;

/// State of the force on one wheel. Read it through the functions below. Short members come first, because a Cortex-M
/// addresses them with shorter instructions.
typedef struct {
    uint8_t count;                           ///< Number of samples in the ring.
    uint8_t still;                           ///< Number of newest samples in a row from a wheel at standstill.
    uint8_t next;                            ///< Index of the next sample.
    bool wheel_offset_received;              ///< The wheel has sent its offset in this run.
    bool boot_seen;                          ///< The start of this run was observed.
    iw_force_unit_t unit;                    ///< Configured unit of `raw`.
    iw_offset_provenance_t provenance;       ///< Source of the offset in use.
    iw_unit_observation_t observation;       ///< Observed unit.
    iw_force_quality_t quality;              ///< Statistics of the start-up window.
    iw_time_us_t raw_us;                     ///< Reception time of `raw`; IW_NEVER if there is none.
    iw_time_us_t offset_us;                  ///< Time of the offset; IW_NEVER if there is none or it was restored.
    int32_t offset_mN;                       ///< Offset in use; 0 with IW_OFFSET_NONE.
    int32_t observed_permille;               ///< 1000 x raw mean / wheel offset in dN when the unit was judged.
    int16_t wheel_offset_dN;                 ///< Last offset that the wheel sent.
    int16_t raw;                             ///< Last force as on the bus.
    int16_t sample[IW_FORCE_WINDOW_SAMPLES]; ///< Ring of raw values: the last two seconds.
} iw_force_t;

/// Initializes `self`. `unit`: the configured unit.
void iw_force_init(iw_force_t *self, iw_force_unit_t unit);

/// Opens the start-up window: the wheel has restarted, or its first telemetry has arrived. `boot_seen`: its start was
/// observed, so that the window covers the wheel's own first two seconds.
void iw_force_reopen(iw_force_t *self, bool boot_seen);

/// Restores an offset of an earlier run, unless this run has a better one. `provenance` IW_OFFSET_OPERATOR restores a
/// tare, which only the next tare replaces; any other value restores IW_OFFSET_STORED.
/// Sets `offset_us` to IW_NEVER. `offset_mN` is within +/- IW_FORCE_OFFSET_MAX_mN.
void iw_force_restore(iw_force_t *self, iw_offset_provenance_t provenance, int32_t offset_mN);

/// Receives a force message. `still`: the wheel is at standstill.
void iw_force_receive(iw_force_t *self, iw_time_us_t now_us, int16_t raw, bool still);

/// Receives an offset message.
void iw_force_receive_offset(iw_force_t *self, iw_time_us_t now_us, int16_t offset_dN);

/// Makes the mean of the last two seconds the offset, with IW_OFFSET_OPERATOR. If it returns another result than
/// IW_TARE_OK, it changes nothing. It does not check for a load if the offset in use is itself in doubt.
iw_tare_t iw_force_tare(iw_force_t *self, iw_time_us_t now_us);

/// Returns the result that a tare would have now, and changes nothing.
iw_tare_t iw_force_may_tare(const iw_force_t *self, iw_time_us_t now_us);

/// Returns the statistics of the last two seconds, which a tare would use. They are valid only with a full ring
/// (`count` is IW_FORCE_WINDOW_SAMPLES).
iw_force_quality_t iw_force_measure(const iw_force_t *self);

/// Returns whether the net force is valid now, or the reason why not.
iw_force_validity_t iw_force_validity(const iw_force_t *self, iw_time_us_t now_us);

/// Returns the raw force in mN, by the configured unit.
int32_t iw_force_raw_mN(const iw_force_t *self);

/// Returns raw force minus offset in mN. It is meaningful only with IW_FORCE_VALID.
int32_t iw_force_net_mN(const iw_force_t *self);

#ifdef __cplusplus
}
#endif
#endif
