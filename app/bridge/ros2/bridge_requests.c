// SPDX-License-Identifier: MIT
// Requests through the services and iwheel/ask: arm, stop, estop, reset.
#include "bridge_parts.h"

#define ARM_MS 400 ///< The gateway replies after at most echo_ms, which is at most 200.
/// iwheel/state must have shown a stop for this time before a reset request can refer to it.
#define SHOWN_US 1000000

ros_moment_t bridge_moment(void) {
    return (ros_moment_t){bridge_monotonic_us(), bridge_wall_us()};
}

const char *bridge_why_not_drive(const bridge_t *self) {
    if (!self->facts.drive) {
        return "this bridge only watches: [drive] enabled = no in ros2.conf";
    }
    if (self->facts.link == ROS_LINK_GONE) {
        return "there is no gateway; see /diagnostics";
    }
    if (self->facts.machine.setpoint_current) {
        return "current_role = setpoint: a twist carries no current, so this bridge cannot drive such a machine";
    }
    return "";
}

/// Returns the time `age_us` ago by the gateway's clock. If the last snapshot was late, the result is too old, never
/// too young.
static iwc_value_t since(const bridge_t *self, int64_t age_us) {
    const int64_t gateway_us = self->facts.machine.now.t_us + bridge_monotonic_us() - self->received_us;
    return (iwc_value_t){.known = true, .value = gateway_us - age_us};
}

iwc_result_t bridge_arm(bridge_t *self, int64_t age_us, iwc_terms_t *out_terms) {
    const iwc_arm_t wanted = {.name = self->settings.ros.node, .t_us = since(self, age_us)};
    const iwc_result_t result = iwc_arm_as(self->gateway, &wanted, ARM_MS, out_terms, NULL);
    self->commanded_us = 0;
    self->silenced = false;
    bridge_end_lease(self);
    self->leased_us = (result == IWC_OK) ? bridge_monotonic_us() : 0;
    if (result != IWC_OK && result != IWC_REFUSED && result != IWC_NEWER) {
        bridge_lose(self, iwc_words(result)); // The bridge may hold the lease: closing the connection ends it.
    }
    return result;
}

static void answer_result(bridge_t *self, const ros_request_t *request, iwc_result_t result) {
    const bool success = result == IWC_OK;
    char words[ROS_SENTENCE_SIZE];
    (void)snprintf(words, sizeof words, "%s",
                   success                   ? ""
                   : (result == IWC_REFUSED) ? iwc_reason(self->gateway)
                                             : iwc_words(result));
    ros_answer(self->ros, request, success, words);
    if (iwc_fd(self->gateway) < 0 && self->facts.link != ROS_LINK_GONE) {
        bridge_lose(self, iwc_words(result));
    }
}

/// Returns why the request may not be executed now, with the fix; empty: it may. Writes its age to `*out_age_us`.
static const char *why_not_meant(bridge_t *self, const ros_request_t *request, int64_t *out_age_us) {
    const ros_moment_t now = bridge_moment();
    const int64_t lease_us = self->facts.machine.lease_ms * 1000;
    const int64_t quiet_us = (lease_us > ROS_QUIET_US) ? lease_us : ROS_QUIET_US;
    switch (ros_ages_request(&self->ages, request->sent_us, now, out_age_us)) {
    case ROS_AGE_FRESH:
        break;
    case ROS_AGE_UNKNOWN:
        return "the request may come from another machine, whose clock is not known: send it on the machine itself, or "
               "set [ros] clocks = synchronised in ros2.conf, if NTP or PTP synchronises the clocks";
    case ROS_AGE_AHEAD:
        return "the request was sent in the future: correct the clock of its machine; send it again";
    case ROS_AGE_DOUBTED:
        return "the clock of this machine was set back: wait until it has caught up, or restart iwheel-ros2; then send "
               "the request again";
    default:
        return "the request came too late; send it again";
    }
    if (self->facts.link != ROS_LINK_UP) {
        return "the gateway does not answer; see /diagnostics";
    }
    if (self->moved_us != 0 && now.mono_us - self->moved_us < quiet_us) {
        return "a publisher sends a drive command that is not zero: let go of the stick, wait half a second, send the "
               "request again";
    }
    return "";
}

static void take_arm(bridge_t *self, const ros_request_t *request, int64_t age_us) {
    iwc_terms_t terms = {.lease_ms = 0};
    const iwc_result_t result = bridge_arm(self, age_us, &terms);
    if (result != IWC_OK) {
        answer_result(self, request, result);
        return;
    }
    char words[160];
    ros_auto_reported(&self->auto_arm);
    (void)snprintf(words, sizeof words,
                   "armed: send cmd_vel at %d Hz or more, the first within %d ms; a pause above %d ms stops the wheels",
                   (3000 + terms.lease_ms - 1) / ((terms.lease_ms > 0) ? terms.lease_ms : 1), terms.first_lease_ms,
                   terms.lease_ms);
    ros_answer(self->ros, request, true, words);
}

/// Resets the stop that iwheel/state shows. The caller must have had time to read it there.
static void take_reset(bridge_t *self, const ros_request_t *request, int64_t age_us) {
    const int64_t asked_us = bridge_monotonic_us() - age_us;
    if (self->shown.known && asked_us - self->shown_us < SHOWN_US) {
        ros_answer(self->ros, request, false,
                   "the last stop is younger than a second: read iwheel/state, then send the request again");
        return;
    }
    const iwc_reset_t wanted = {.stop = self->shown, .t_us = since(self, age_us)};
    answer_result(self, request, iwc_reset_as(self->gateway, &wanted, BRIDGE_ASK_MS));
}

static void take_what_permits(bridge_t *self, const ros_request_t *request) {
    int64_t age_us = 0;
    const char *reason = why_not_meant(self, request, &age_us);
    if (!request->by_topic && request->caller.form == ROS_FORM_UNREADABLE) {
        reason = "this is not a request of std_srvs/srv/Trigger: call the service with that type";
    } else if (request->verb == ROS_ARM && bridge_why_not_drive(self)[0] != '\0') {
        reason = bridge_why_not_drive(self);
    } else if (request->verb == ROS_ARM && self->driver != 0) {
        reason = "busy: a publisher of cmd_vel has the wheels until they are stopped; call iwheel/stop, then arm again";
    } else if (request->verb == ROS_RESET && !self->settings.drive.allow_reset) {
        reason = "reset is not permitted over the network: go to the machine, check it, then call iwheelctl reset; or "
                 "set [drive] allow_reset = yes in ros2.conf";
    }
    if (reason[0] != '\0') {
        ros_answer(self->ros, request, false, reason);
    } else if (request->verb == ROS_ARM) {
        take_arm(self, request, age_us);
    } else {
        take_reset(self, request, age_us);
    }
}

/// Sends a stop. A bridge that has no connection, because all places of the gateway are in use, sends it to the places
/// that the gateway keeps for stops.
static iwc_result_t stop(bridge_t *self, bool estop) {
    static const char reason[] = "by ROS, iwheel/estop";
    iwc_result_t result = IWC_CLOSED;
    if (self->facts.link != ROS_LINK_GONE) {
        result = estop ? iwc_estop(self->gateway, reason, BRIDGE_ASK_MS) : iwc_stop(self->gateway, BRIDGE_ASK_MS);
    }
    if (result == IWC_CLOSED) {
        const char *socket = self->settings.gateway.socket;
        result = estop ? iwc_estop_at(self->gateway, socket, reason, BRIDGE_ASK_MS)
                       : iwc_stop_at(self->gateway, socket, BRIDGE_ASK_MS);
    }
    return result;
}

void bridge_take_request(bridge_t *self, const ros_request_t *request) {
    if (request->verb == ROS_STOP || request->verb == ROS_ESTOP) {
        ros_auto_person_stopped(&self->auto_arm);
        bridge_end_lease(self);
        answer_result(self, request, stop(self, request->verb == ROS_ESTOP));
    } else if (self->facts.link == ROS_LINK_GONE) {
        ros_answer(self->ros, request, false, "there is no gateway; see /diagnostics");
    } else {
        take_what_permits(self, request);
    }
}
