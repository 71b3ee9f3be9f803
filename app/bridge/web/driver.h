// SPDX-License-Identifier: MIT
/// Decides which page drives, and whether a drive command of it is valid.
///
/// Pure: time is an argument. The lease and the key of its holder are in common/lease.h. A command quotes the newest
/// `t_us` that the page received from this machine, and a sequence number that increases. A command that is too old,
/// duplicated, out of order or of another page is dropped and counted. No command is executed late or repeated.
///
///     IDLE --begin--> DRIVEN --end--> IDLE
///     silent (only in DRIVEN): the page has sent nothing for too long, so the bridge ends the drive
#ifndef WEB_DRIVER_H
#define WEB_DRIVER_H

#include "web_judge.h"

/// Longest time from `arm` to the first command of a page, and between two commands.
#define WEB_FIRST_US  1000000U
#define WEB_SILENT_US 500000U
/// Largest age of arm and reset.
#define WEB_AGE_US 1000000U
/// A time of this machine cannot be in the future; this tolerance is for rounding.
#define WEB_AHEAD_US 100000U

typedef struct {
    bool is_driven;
    int64_t sequence;   ///< Sequence of the last accepted command.
    uint64_t silent_us; ///< End of the drive, unless the page sends a command before.
    uint64_t dropped;   ///< Dropped commands since the start of the bridge.
} web_driver_t;

/// Arguments of the request address; NULL: absent.
typedef struct {
    bool is_holders; ///< The sender holds the lease.
    const char *t_us;
    const char *sequence;
    const char *v_mm_s;
    const char *yaw_mrad_s;
} web_command_t;

typedef struct {
    uint32_t max_speed_mm_s;
    uint32_t ttl_us;
    int64_t ahead_us; ///< The gateway's clock is ahead of `now_us` by this time.
} web_limits_t;

typedef struct {
    int32_t v_mm_s;
    int32_t yaw_mrad_s;
} web_twist_t;

void web_driver_begin(web_driver_t *self, uint64_t now_us);
void web_driver_end(web_driver_t *self);

/// Judges a command. Returns NULL and sets `*out_twist`: pass it to the gateway once. Otherwise returns the reason why
/// it is dropped and leaves `*out_twist` unchanged.
const char *web_driver_take(web_driver_t *self, const web_command_t *command, const web_limits_t *limits,
                            uint64_t now_us, web_twist_t *out_twist);

/// Returns true for a well-formed command that would turn a wheel, accepted or not.
bool web_command_moves(const web_command_t *command);

/// Judges the age of a request that permits motion or clears a latch. `t_us` is the time of a message of this run of
/// the machine, at which the person wanted it; `gateway_us` is the time of the gateway. Returns NULL and sets
/// `*out_t_us` if it is valid; otherwise the reason: absent, too old, or in the future.
const char *web_age_wrong(const char *t_us, uint64_t gateway_us, int64_t *out_t_us);

/// Returns true if the person who drives has sent nothing for too long.
bool web_driver_silent(const web_driver_t *self, uint64_t now_us);

#endif
