// SPDX-License-Identifier: MIT
/// Which page drives, and whether a drive command from it still counts.
///
/// Pure: the time is an argument. The lease itself, and the key that its person has, are in common/lease.h. A command quotes the newest `t_us`
/// that the page received from this machine, and a number that grows. What is older than its time to live, doubled, out of order or of another page is dropped and counted,
/// never carried out late; nothing is repeated.
///
///     NOBODY --begin--> DRIVEN --end--> NOBODY
///     silent (only from DRIVEN): the page has said nothing for so long that the bridge lets go
#ifndef WEB_DRIVER_H
#define WEB_DRIVER_H

#include "web_judge.h"

/// How long a page that has armed may take for its first command, and a driving one between two.
#define WEB_FIRST_US  1000000U
#define WEB_SILENT_US 500000U
/// Oldest arm and reset.
#define WEB_AGE_US 1000000U
/// A time of this machine cannot be in the future; so much is rounding.
#define WEB_AHEAD_US 100000U

typedef struct {
    bool is_driven;
    int64_t sequence;   ///< Of the last command taken.
    uint64_t silent_us; ///< When the page counts as silent.
    uint64_t dropped;   ///< Commands since the start of the bridge.
} web_driver_t;

/// As the request's address has them; NULL: not given.
typedef struct {
    bool is_holders; ///< From the person who holds the lease.
    const char *t_us;
    const char *sequence;
    const char *v_mm_s;
    const char *yaw_mrad_s;
} web_command_t;

typedef struct {
    uint32_t max_speed_mm_s;
    uint32_t ttl_us;
} web_limits_t;

typedef struct {
    int32_t v_mm_s;
    int32_t yaw_mrad_s;
} web_twist_t;

void web_driver_begin(web_driver_t *self, uint64_t now_us);
void web_driver_end(web_driver_t *self);

/// NULL with `*out_twist`: hand it to the gateway once. Else why it is dropped, in words, and `*out_twist` is left alone.
const char *web_driver_take(web_driver_t *self, const web_command_t *command, const web_limits_t *limits,
                            uint64_t now_us, web_twist_t *out_twist);

/// True for a well-formed command that would turn a wheel, accepted or not.
bool web_command_moves(const web_command_t *command);

/// Why a request that permits motion or clears a latch does not count: since when the person wants it (`t_us`, of a message of this machine's
/// present run) is not given, too long ago, or in the future. NULL: it counts, with `*out_t_us`.
const char *web_age_wrong(const char *t_us, uint64_t now_us, int64_t *out_t_us);

/// True if the person who drives sent nothing for too long.
bool web_driver_silent(const web_driver_t *self, uint64_t now_us);

#endif
