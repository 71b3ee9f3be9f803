// SPDX-License-Identifier: MIT
// What somebody asks for by a service or by iwheel/ask: arm, stop, estop, reset.
#include "bridge_parts.h"

#define ARM_MS 400 ///< echo_ms is 200 at most.
/// A stop was shown for so long before a reset can mean it.
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

/// `age_us` ago by the clock of the gateway's events. A snapshot that came late makes it older, never younger.
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
        bridge_lose(self, iwc_words(result)); // Whether it is armed nobody knows: the end of the connection ends it.
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

/// Empty: somebody wants it now.
static const char *why_not_meant(bridge_t *self, const ros_request_t *request, int64_t *out_age_us) {
    const ros_moment_t now = bridge_moment();
    const int64_t lease_us = self->facts.machine.lease_ms * 1000;
    const int64_t quiet_us = (lease_us > ROS_QUIET_US) ? lease_us : ROS_QUIET_US;
    switch (ros_ages_request(&self->ages, request->sent_us, now, out_age_us)) {
    case ROS_AGE_FRESH:
        break;
    case ROS_AGE_UNKNOWN:
        return "it may come from another machine, whose clock nobody knows: ask on the machine itself, or set [ros] "
               "clocks = "
               "synchronised in ros2.conf, if NTP or PTP keeps the clocks equal";
    case ROS_AGE_AHEAD:
        return "it was sent in the future: set the clock of its machine right; ask again";
    case ROS_AGE_DOUBTED:
        return "the clock of this machine was set back: ask again when it has caught up, or restart iwheel-ros2";
    default:
        return "it came too late to be meant now; ask again";
    }
    if (self->facts.link != ROS_LINK_UP) {
        return "the gateway does not answer; see /diagnostics";
    }
    if (self->moved_us != 0 && now.mono_us - self->moved_us < quiet_us) {
        return "somebody sends a drive command that is not zero: let go of the stick, wait half a second, ask again";
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
    ros_auto_told(&self->auto_arm);
    (void)snprintf(words, sizeof words,
                   "armed: send cmd_vel at %d Hz or more, the first within %d ms; a pause above %d ms stops the wheels",
                   (3000 + terms.lease_ms - 1) / ((terms.lease_ms > 0) ? terms.lease_ms : 1), terms.first_lease_ms,
                   terms.lease_ms);
    ros_answer(self->ros, request, true, words);
}

/// Who asks means the stop that iwheel/state shows, and has had time to see it.
static void take_reset(bridge_t *self, const ros_request_t *request, int64_t age_us) {
    const int64_t asked_us = bridge_monotonic_us() - age_us;
    if (self->shown.known && asked_us - self->shown_us < SHOWN_US) {
        ros_answer(self->ros, request, false,
                   "the last stop is younger than a second: read iwheel/state, then ask again");
        return;
    }
    const iwc_reset_t wanted = {.stop = self->shown, .t_us = since(self, age_us)};
    answer_result(self, request, iwc_reset_as(self->gateway, &wanted, BRIDGE_ASK_MS));
}

static void take_what_permits(bridge_t *self, const ros_request_t *request) {
    int64_t age_us = 0;
    const char *reason = why_not_meant(self, request, &age_us);
    if (!request->by_topic && request->caller.form == ROS_FORM_UNREADABLE) {
        reason = "this is no request of std_srvs/srv/Trigger: call the service with that type";
    } else if (request->verb == ROS_ARM && bridge_why_not_drive(self)[0] != '\0') {
        reason = bridge_why_not_drive(self);
    } else if (request->verb == ROS_ARM && self->driver != 0) {
        reason = "busy: a publisher of cmd_vel has the wheels until they are stopped; call iwheel/stop, then arm again";
    } else if (request->verb == ROS_RESET && !self->settings.drive.allow_reset) {
        reason = "not over the network: look at the machine, then iwheelctl reset; or set [drive] allow_reset = yes in "
                 "ros2.conf";
    }
    if (reason[0] != '\0') {
        ros_answer(self->ros, request, false, reason);
    } else if (request->verb == ROS_ARM) {
        take_arm(self, request, age_us);
    } else {
        take_reset(self, request, age_us);
    }
}

void bridge_take_request(bridge_t *self, const ros_request_t *request) {
    if (request->verb == ROS_STOP || request->verb == ROS_ESTOP) {
        ros_auto_person_stopped(&self->auto_arm);
        bridge_end_lease(self);
    }
    if (self->facts.link == ROS_LINK_GONE) {
        ros_answer(self->ros, request, false, "there is no gateway; see /diagnostics");
    } else if (request->verb == ROS_STOP) {
        answer_result(self, request, iwc_stop(self->gateway, BRIDGE_ASK_MS));
    } else if (request->verb == ROS_ESTOP) {
        answer_result(self, request, iwc_estop(self->gateway, "by ROS, iwheel/estop", BRIDGE_ASK_MS));
    } else {
        take_what_permits(self, request);
    }
}
