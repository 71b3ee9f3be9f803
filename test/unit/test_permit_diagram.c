// SPDX-License-Identifier: MIT
// The diagram in permit.h: every event in every phase follows the drawn arrow. Without an arrow the phase stays.
#include "permit_rig.h"

#include "unit.h"

#include <stdio.h>

/// Events. Where time passes, the holder drives on and the wheels move, unless the event states otherwise.
typedef enum {
    ARM,
    TAKEOVER, ///< Another client requests the lease.
    DRIVE,
    CONFIRMED,     ///< The arming pair was echoed.
    NOT_IN_TIME,   ///< The time for the confirmation is over.
    LEASE_LOST,    ///< The time of the lease is over without a drive command.
    STOP,          ///< Stop of a client, or disarm.
    DISCONNECT,    ///< Disconnect of the holder.
    CAUSE_STOPS,   ///< A cause that only stops.
    CAUSE_LATCHES, ///< A cause that latches while setpoints are sent.
    CAUSE_ALWAYS,  ///< A cause that latches in every state.
    STRANGER,      ///< A foreign setpoint.
    STRANGERS,     ///< More foreign setpoints than a process that died can have left in its controller.
    OUTPUT_ZERO,
    HELD, ///< The time of the hold is over, and the wheels are at standstill.
    RESET,
    EVENTS,
} event_t;

/// Start of a walk: a phase, or REARMING by an arm before the hold has begun.
#define REARMING_EARLY IW_PHASES
#define BEGINNINGS     (IW_PHASES + 1)

static const char *const beginnings[BEGINNINGS] = {
    "LISTENING", "ARMING", "ARMED", "BRAKING", "HOLDING", "REARMING", "RESTARTING", "CUT", "LATCHED", "REARMING, early",
};

static const char *const events[EVENTS] = {
    "arm",         "takeover",      "drive",        "confirmed", "not in time", "lease lost",  "stop", "disconnect",
    "cause stops", "cause latches", "cause always", "stranger",  "strangers",   "output zero", "held", "reset",
};

static const struct {
    unsigned from;
    event_t event;
    iw_phase_t to;
} arrows[] = {
    {IW_PHASE_LISTENING, ARM, IW_PHASE_ARMING},
    {IW_PHASE_LISTENING, TAKEOVER, IW_PHASE_ARMING},
    {IW_PHASE_LISTENING, CAUSE_ALWAYS, IW_PHASE_LATCHED},

    {IW_PHASE_ARMING, CONFIRMED, IW_PHASE_ARMED},
    {IW_PHASE_ARMING, NOT_IN_TIME, IW_PHASE_LISTENING},
    {IW_PHASE_ARMING, STOP, IW_PHASE_LISTENING},
    {IW_PHASE_ARMING, DISCONNECT, IW_PHASE_LISTENING},
    {IW_PHASE_ARMING, CAUSE_STOPS, IW_PHASE_LISTENING},
    {IW_PHASE_ARMING, CAUSE_LATCHES, IW_PHASE_LISTENING},
    {IW_PHASE_ARMING, STRANGER, IW_PHASE_LISTENING},
    {IW_PHASE_ARMING, STRANGERS, IW_PHASE_LISTENING},
    {IW_PHASE_ARMING, CAUSE_ALWAYS, IW_PHASE_CUT},
    {IW_PHASE_ARMING, HELD, IW_PHASE_LISTENING}, // A hold lasts longer than the limit of the confirmation.

    {IW_PHASE_ARMED, LEASE_LOST, IW_PHASE_BRAKING},
    {IW_PHASE_ARMED, STOP, IW_PHASE_BRAKING},
    {IW_PHASE_ARMED, DISCONNECT, IW_PHASE_BRAKING},
    {IW_PHASE_ARMED, CAUSE_STOPS, IW_PHASE_BRAKING},
    {IW_PHASE_ARMED, CAUSE_LATCHES, IW_PHASE_CUT},
    {IW_PHASE_ARMED, STRANGER, IW_PHASE_CUT},
    {IW_PHASE_ARMED, STRANGERS, IW_PHASE_CUT},
    {IW_PHASE_ARMED, CAUSE_ALWAYS, IW_PHASE_CUT},

    {IW_PHASE_BRAKING, OUTPUT_ZERO, IW_PHASE_HOLDING},
    {IW_PHASE_BRAKING, ARM, IW_PHASE_REARMING}, // The output was zero before the stop.
    {IW_PHASE_BRAKING, TAKEOVER, IW_PHASE_REARMING},
    {IW_PHASE_BRAKING, CAUSE_LATCHES, IW_PHASE_CUT},
    {IW_PHASE_BRAKING, STRANGER, IW_PHASE_CUT},
    {IW_PHASE_BRAKING, STRANGERS, IW_PHASE_CUT},
    {IW_PHASE_BRAKING, CAUSE_ALWAYS, IW_PHASE_CUT},

    {IW_PHASE_HOLDING, HELD, IW_PHASE_LISTENING},
    {IW_PHASE_HOLDING, ARM, IW_PHASE_REARMING},
    {IW_PHASE_HOLDING, TAKEOVER, IW_PHASE_REARMING},
    {IW_PHASE_HOLDING, CAUSE_LATCHES, IW_PHASE_CUT},
    {IW_PHASE_HOLDING, STRANGER, IW_PHASE_CUT},
    {IW_PHASE_HOLDING, STRANGERS, IW_PHASE_CUT},
    {IW_PHASE_HOLDING, CAUSE_ALWAYS, IW_PHASE_CUT},

    {IW_PHASE_REARMING, CONFIRMED, IW_PHASE_ARMED},
    {IW_PHASE_REARMING, NOT_IN_TIME, IW_PHASE_HOLDING},
    {IW_PHASE_REARMING, STOP, IW_PHASE_HOLDING},
    {IW_PHASE_REARMING, DISCONNECT, IW_PHASE_HOLDING},
    {IW_PHASE_REARMING, CAUSE_STOPS, IW_PHASE_HOLDING},
    {IW_PHASE_REARMING, CAUSE_LATCHES, IW_PHASE_CUT},
    {IW_PHASE_REARMING, STRANGER, IW_PHASE_CUT},
    {IW_PHASE_REARMING, STRANGERS, IW_PHASE_CUT},
    {IW_PHASE_REARMING, CAUSE_ALWAYS, IW_PHASE_CUT},
    {IW_PHASE_REARMING, HELD, IW_PHASE_LISTENING}, // Not confirmed in time, and then held.

    {REARMING_EARLY, CONFIRMED, IW_PHASE_ARMED},
    {REARMING_EARLY, NOT_IN_TIME, IW_PHASE_BRAKING},
    {REARMING_EARLY, STOP, IW_PHASE_BRAKING},
    {REARMING_EARLY, DISCONNECT, IW_PHASE_BRAKING},
    {REARMING_EARLY, CAUSE_STOPS, IW_PHASE_BRAKING},
    {REARMING_EARLY, CAUSE_LATCHES, IW_PHASE_CUT},
    {REARMING_EARLY, STRANGER, IW_PHASE_CUT},
    {REARMING_EARLY, STRANGERS, IW_PHASE_CUT},
    {REARMING_EARLY, CAUSE_ALWAYS, IW_PHASE_CUT},
    {REARMING_EARLY, HELD, IW_PHASE_BRAKING}, // Not confirmed in time; the hold has not begun.

    {IW_PHASE_RESTARTING, HELD, IW_PHASE_LISTENING},
    {IW_PHASE_RESTARTING, STRANGERS, IW_PHASE_LISTENING},
    {IW_PHASE_RESTARTING, CAUSE_ALWAYS, IW_PHASE_CUT},

    {IW_PHASE_CUT, HELD, IW_PHASE_LATCHED},
    {IW_PHASE_CUT, RESET, IW_PHASE_LISTENING},
    {IW_PHASE_LATCHED, RESET, IW_PHASE_LISTENING},
};

static permit_rig_t rig;

static void arm_and_confirm(void) {
    (void)permit_rig_arm(&rig, HOLDER);
    permit_rig_prove(&rig);
    (void)permit_rig_drive(&rig, HOLDER, false);
}

/// Latched long enough for a reset, and the cause is gone. The wheels were not settled yet.
static void latch(void) {
    permit_rig_raise(&rig, IW_CAUSE_ESTOP_SOFTWARE);
    rig.view.settled = false;
    permit_rig_wait(&rig, IW_PERMIT_EVENT_US);
}

static void stop_and_hold(void) {
    iw_permit_stop(&rig.permit, rig.now_us, HOLDER, IW_CAUSE_CLIENT_STOP);
    permit_rig_step(&rig);
}

static void begin(unsigned beginning) {
    permit_rig_init(&rig);
    rig.config.lease_ms = 20;
    switch (beginning) {
    case IW_PHASE_ARMING:
        (void)permit_rig_arm(&rig, HOLDER);
        break;
    case IW_PHASE_ARMED:
        arm_and_confirm();
        break;
    case IW_PHASE_BRAKING:
    case REARMING_EARLY:
        arm_and_confirm();
        iw_permit_stop(&rig.permit, rig.now_us, HOLDER, IW_CAUSE_CLIENT_STOP);
        break;
    case IW_PHASE_HOLDING:
    case IW_PHASE_REARMING:
        arm_and_confirm();
        stop_and_hold();
        break;
    case IW_PHASE_RESTARTING:
        permit_rig_init_restarted(&rig);
        break;
    case IW_PHASE_CUT:
        arm_and_confirm();
        latch();
        break;
    case IW_PHASE_LATCHED:
        latch();
        break;
    default:
        break;
    }
    if (beginning == IW_PHASE_REARMING || beginning == REARMING_EARLY) {
        (void)permit_rig_arm(&rig, HOLDER);
    }
    TEST_ASSERT_EQUAL_INT_MESSAGE((beginning == REARMING_EARLY) ? IW_PHASE_REARMING : beginning, rig.permit.phase,
                                  beginnings[beginning]);
}

static void pass(uint32_t for_ms) {
    for (uint32_t ms = 0; ms < for_ms; ms += 10) {
        (void)permit_rig_drive(&rig, HOLDER, false);
        permit_rig_wait(&rig, MS(10));
    }
}

static void set_view(bool proven, bool output_zero) {
    rig.view.proven = proven;
    rig.view.output_zero = output_zero;
    permit_rig_step(&rig);
}

static void let_time_pass(event_t event) {
    rig.view.output_zero = false;
    rig.view.settled = event == HELD;
    if (event == LEASE_LOST) {
        permit_rig_wait(&rig, MS(rig.config.lease_ms));
    } else {
        pass((event == HELD) ? rig.config.zero_hold_ms : rig.config.echo_ms);
    }
}

static void raise_so_often(iw_cause_t cause, unsigned times) {
    for (unsigned i = 0; i < times; i++) {
        permit_rig_raise(&rig, cause);
    }
}

static void ask(event_t event) {
    switch (event) {
    case ARM:
        (void)permit_rig_arm(&rig, HOLDER);
        break;
    case TAKEOVER:
        (void)permit_rig_takeover(&rig, OTHER);
        break;
    case DRIVE:
        (void)permit_rig_drive(&rig, HOLDER, true);
        break;
    case STOP:
        iw_permit_stop(&rig.permit, rig.now_us, OTHER, IW_CAUSE_CLIENT_STOP);
        break;
    case DISCONNECT:
        iw_permit_disconnect(&rig.permit, rig.now_us, HOLDER);
        break;
    default:
        (void)permit_rig_reset(&rig);
        break;
    }
}

static void happen(event_t event) {
    switch (event) {
    case CONFIRMED:
    case OUTPUT_ZERO:
        set_view(event == CONFIRMED, event == OUTPUT_ZERO);
        break;
    case NOT_IN_TIME:
    case LEASE_LOST:
    case HELD:
        let_time_pass(event);
        break;
    case CAUSE_STOPS:
        permit_rig_raise(&rig, IW_CAUSE_LOOP_LATE);
        break;
    case CAUSE_LATCHES:
        permit_rig_raise(&rig, IW_CAUSE_WHEEL_REBOOTED);
        break;
    case CAUSE_ALWAYS:
        permit_rig_raise(&rig, IW_CAUSE_ESTOP_LINE);
        break;
    case STRANGER:
    case STRANGERS:
        raise_so_often(IW_CAUSE_SECOND_MASTER, (event == STRANGER) ? 1 : 5);
        break;
    default:
        ask(event);
        break;
    }
}

/// Returns the phase after the event: the end of its arrow, or the same phase.
static iw_phase_t led_to(unsigned beginning, event_t event) {
    for (size_t i = 0; i < sizeof arrows / sizeof arrows[0]; i++) {
        if (arrows[i].from == beginning && arrows[i].event == event) {
            return arrows[i].to;
        }
    }
    return (beginning == REARMING_EARLY) ? IW_PHASE_REARMING : (iw_phase_t)beginning;
}

TEST(test_permit_each_event_in_each_phase_follows_the_diagram) {
    unsigned moved = 0;
    for (unsigned beginning = 0; beginning < BEGINNINGS; beginning++) {
        for (unsigned event = 0; event < EVENTS; event++) {
            char what[64];
            (void)snprintf(what, sizeof what, "%s: %s", beginnings[beginning], events[event]);
            begin(beginning);
            const iw_phase_t before = rig.permit.phase;
            happen((event_t)event);
            TEST_ASSERT_EQUAL_INT_MESSAGE(led_to(beginning, (event_t)event), rig.permit.phase, what);
            moved += (rig.permit.phase != before) ? 1U : 0U;
        }
    }
    TEST_ASSERT_EQUAL_UINT_MESSAGE(sizeof arrows / sizeof arrows[0], moved,
                                   "an arrow is there twice, or leads nowhere");
}

TEST(test_permit_each_phase_has_its_state_and_its_demand) {
    static const struct {
        iw_state_t state;
        iw_demand_t demand;
        bool arming;
    } public_state[IW_PHASES] = {
        [IW_PHASE_LISTENING] = {IW_STATE_LISTENING, IW_DEMAND_SILENCE, false},
        [IW_PHASE_ARMING] = {IW_STATE_LISTENING, IW_DEMAND_ZERO, true},
        [IW_PHASE_ARMED] = {IW_STATE_ARMED, IW_DEMAND_FOLLOW, false},
        [IW_PHASE_BRAKING] = {IW_STATE_STOPPING, IW_DEMAND_BRAKE, false},
        [IW_PHASE_HOLDING] = {IW_STATE_STOPPING, IW_DEMAND_BRAKE, false},
        [IW_PHASE_REARMING] = {IW_STATE_STOPPING, IW_DEMAND_BRAKE, true},
        [IW_PHASE_RESTARTING] = {IW_STATE_STOPPING, IW_DEMAND_ZERO, false},
        [IW_PHASE_CUT] = {IW_STATE_LATCHED, IW_DEMAND_ZERO, false},
        [IW_PHASE_LATCHED] = {IW_STATE_LATCHED, IW_DEMAND_SILENCE, false},
    };
    for (unsigned phase = 0; phase < IW_PHASES; phase++) {
        begin(phase);
        TEST_ASSERT_EQUAL_INT_MESSAGE(public_state[phase].state, iw_permit_state(&rig.permit), beginnings[phase]);
        TEST_ASSERT_EQUAL_INT_MESSAGE(public_state[phase].demand, iw_permit_demand(&rig.permit), beginnings[phase]);
        TEST_ASSERT_EQUAL_INT_MESSAGE(public_state[phase].arming, iw_permit_arming(&rig.permit), beginnings[phase]);
    }
}

TEST(test_permit_cause_latches_when_armed_if_iw_cause_latches) {
    unsigned latching = 0;
    for (unsigned cause = IW_CAUSE_NONE + 1U; cause < IW_CAUSES; cause++) {
        char what[32];
        (void)snprintf(what, sizeof what, "cause %u", cause);
        begin(IW_PHASE_ARMED);
        permit_rig_raise(&rig, (iw_cause_t)cause);
        const bool latched = iw_permit_state(&rig.permit) == IW_STATE_LATCHED;
        TEST_ASSERT_EQUAL_INT_MESSAGE(iw_cause_latches((iw_cause_t)cause), latched, what);
        // The causes that latch are first in the list.
        TEST_ASSERT_EQUAL_INT_MESSAGE(cause <= IW_CAUSE_INTERNAL, latched, what);
        TEST_ASSERT_EQUAL_INT_MESSAGE(latched ? IW_PHASE_CUT : IW_PHASE_BRAKING, rig.permit.phase, what);
        latching += latched ? 1U : 0U;
    }
    TEST_ASSERT_EQUAL_UINT(12, latching);
    TEST_ASSERT_FALSE(iw_cause_latches(IW_CAUSE_NONE));
}
