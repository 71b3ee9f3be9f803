// SPDX-License-Identifier: MIT
/// A motion permission and the input of its owner, at a virtual time.
#ifndef TEST_PERMIT_RIG_H
#define TEST_PERMIT_RIG_H

#include "fixture.h"
#include "iwheel/private/permit.h"

/// The client that holds the lease in every prepared situation, and another one.
#define HOLDER ((iw_client_t)7)
#define OTHER  ((iw_client_t)8)

/// The situations in which a test can begin. ARMING is LISTENING with a zero pair in flight.
typedef enum {
    PERMIT_LISTENING,
    PERMIT_ARMING,
    PERMIT_ARMED,
    PERMIT_STOPPING, ///< Ramping down after a client's stop.
    PERMIT_HOLDING,  ///< As STOPPING, with the output at zero and the hold begun.
    PERMIT_LATCHED,  ///< An internal fault latched it while armed; it sends zeros.
    PERMIT_SITUATIONS,
} permit_situation_t;

typedef struct {
    iw_config_t config;
    iw_permit_view_t view; ///< Input of every step; at first nothing prevents motion.
    iw_permit_t permit;
    iw_time_us_t now_us;
} permit_rig_t;

/// Begins with a new permission in LISTENING that has made its first step.
void permit_rig_init(permit_rig_t *self);

/// The same, after a crash while armed.
void permit_rig_init_restarted(permit_rig_t *self);

/// Begins with a new permission, the rig's configuration and that situation.
void permit_rig_begin(permit_rig_t *self, permit_situation_t situation);

/// Makes one step now.
void permit_rig_step(permit_rig_t *self);

/// Lets time pass, then makes one step.
void permit_rig_wait(permit_rig_t *self, iw_time_us_t for_us);

/// Makes one step in which the arming pair is echoed.
void permit_rig_prove(permit_rig_t *self);

/// Asserts the state and the demand.
void permit_rig_assert(const permit_rig_t *self, iw_state_t state, iw_demand_t demand);

/// Raises a cause now, for both wheels, with detail 42.
void permit_rig_raise(permit_rig_t *self, iw_cause_t cause);

/// Makes the request now.
iw_refusal_t permit_rig_arm(permit_rig_t *self, iw_client_t client);
iw_refusal_t permit_rig_takeover(permit_rig_t *self, iw_client_t client);
iw_refusal_t permit_rig_drive(permit_rig_t *self, iw_client_t client, bool nonzero);
iw_refusal_t permit_rig_reset(permit_rig_t *self);

#endif
