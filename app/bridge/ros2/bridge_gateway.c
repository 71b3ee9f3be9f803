// SPDX-License-Identifier: MIT
// The connection to the gateway: it connects, reads messages, and handles the loss of the connection.
#include "bridge_parts.h"

#define CONNECT_MS     200
#define BACKOFF_MAX_US 2000000
/// The gateway made a snapshot after the grant of the lease if the bridge received it this much later than the grant.
#define GRANTED_US 200000
/// The least rate with which the bridge detects a change within 0.2 s.
#define LEAST_HZ 20U
/// Interval between two checks whether a node uses the bridge, and the time after the last use with the full rate.
#define USED_CHECK_US 100000
#define USED_AFTER_US 1000000

int64_t bridge_monotonic_us(void) {
    return (int64_t)bridge_now_us();
}

void bridge_end_lease(bridge_t *self) {
    self->leased_us = 0;
    self->driver = 0;
}

void bridge_lose(bridge_t *self, const char *why) {
    ros_machine_t *machine = &self->facts.machine;
    if (self->facts.link != ROS_LINK_GONE && machine->now.machine != IWC_LISTENING) {
        ros_auto_stopped(&self->auto_arm, false);
    }
    iwc_close(self->gateway);
    self->facts.link = ROS_LINK_GONE;
    machine->now.ours = false;
    bridge_end_lease(self);
    (void)snprintf(self->facts.trouble, sizeof self->facts.trouble, "%s", why);
    // The share that varies prevents several bridges from connecting to the same gateway at the same moment.
    self->retry_us = bridge_monotonic_us() + self->backoff_us * 3 / 4 + bridge_monotonic_us() % (self->backoff_us / 2);
    self->backoff_us = (self->backoff_us < BACKOFF_MAX_US / 2) ? self->backoff_us * 2 : BACKOFF_MAX_US;
    if (!self->gone_reported) {
        (void)fprintf(stderr, "iwheel-ros2: warning: no gateway at %s: %s; retrying\n", self->settings.gateway.socket,
                      why);
    }
    self->gone_reported = true;
}

/// Reads the last stop that the gateway reports. This bridge did not cause it: it happened before the connection. No
/// reply does not mean that there was none.
static iwc_result_t read_last_stop(bridge_t *self) {
    iwc_message_t why;
    const iwc_result_t result = iwc_ask(self->gateway, "{\"cmd\":\"why\"}", BRIDGE_ASK_MS, &why);
    self->facts.machine.stop[0] = '\0';
    self->facts.machine.stop_number = (iwc_value_t){.known = false};
    if (result == IWC_OK && iwc_integer(&why, "number").value > 0) {
        self->facts.machine.stop_number = iwc_integer(&why, "number");
        (void)iwc_text(&why, "sentence", self->facts.machine.stop, sizeof self->facts.machine.stop);
        ros_auto_stopped(&self->auto_arm, false);
    }
    return result;
}

/// Reads the values that the assumption store of a board does not have. Without them the bridge would compute with the
/// approximate measures of the wheels' document.
static void read_values(bridge_t *self) {
    iwc_message_t config;
    if (iwc_ask(self->gateway, "{\"cmd\":\"config\"}", BRIDGE_ASK_MS, &config) == IWC_OK) {
        ros_facts_read_config(&config, &self->facts.machine);
    }
}

static void take_snapshot(bridge_t *self, const iwc_message_t *message) {
    ros_machine_t *machine = &self->facts.machine;
    if (!ros_facts_read(self->gateway, message, machine)) {
        return;
    }
    self->facts.link = ROS_LINK_UP;
    self->received_us = bridge_monotonic_us();
    if (self->leased_us != 0 && !machine->now.ours && self->received_us - self->leased_us > GRANTED_US) {
        bridge_end_lease(self);
    }
    if (self->assumptions_due) {
        self->assumptions_due = false;
        ros_facts_read_assumptions(message, machine);
    }
    if (machine->now.left.distance_mm.known && machine->now.right.distance_mm.known && machine->track_mm > 0) {
        const ros_ways_t ways = {machine->now.t_us, machine->now.left.distance_mm.value,
                                 machine->now.right.distance_mm.value};
        ros_odometry_step(&self->odometry, &ways, &machine->measures);
        self->facts.odometry_restarts = self->odometry.restarts;
    }
}

/// Returns true while a node uses the bridge and some time after that, as of the last check.
static bool is_used(const bridge_t *self) {
    return self->used_next_us - self->used_us < USED_CHECK_US + USED_AFTER_US;
}

static unsigned full_rate_hz(const bridge_t *self) {
    return (self->settings.odometry.rate_hz < LEAST_HZ) ? LEAST_HZ : self->settings.odometry.rate_hz;
}

void bridge_choose_rate(bridge_t *self, int64_t now) {
    char request[128];
    if (self->facts.link == ROS_LINK_GONE || now < self->used_next_us) {
        return;
    }
    self->used_next_us = now + USED_CHECK_US;
    if (self->leased_us != 0 || ros_is_used(self->ros)) {
        self->used_us = now;
    }
    const unsigned rate_hz = is_used(self) ? full_rate_hz(self) : LEAST_HZ;
    if (rate_hz == self->rate_hz) {
        return;
    }
    (void)snprintf(request, sizeof request,
                   "{\"cmd\":\"watch\",\"topics\":[\"state\",\"bus\",\"estop\",\"lease\",\"stop\"],\"rate_hz\":%u}",
                   rate_hz);
    if (iwc_send(self->gateway, request, 0, &self->rate_id) == IWC_OK) { // Otherwise the next check tries again.
        self->rate_hz = rate_hz;
    }
}

iwc_result_t bridge_call(bridge_t *self) {
    const unsigned topics = IWC_WATCH_STATE | IWC_WATCH_BUS | IWC_WATCH_ESTOP | IWC_WATCH_LEASE | IWC_WATCH_STOP;
    iwc_message_t status;
    iwc_result_t result = iwc_connect(self->gateway, self->settings.gateway.socket, CONNECT_MS);
    const bool newer = result == IWC_NEWER;
    if (newer) {
        result = IWC_OK;
    }
    if (result == IWC_OK) {
        result = read_last_stop(self);
    }
    if (result == IWC_OK) {
        result = iwc_ask(self->gateway, "{\"cmd\":\"status\"}", BRIDGE_ASK_MS, &status);
    }
    if (result == IWC_OK && ros_facts_lack_values(&status)) {
        read_values(self);
        result = iwc_ask(self->gateway, "{\"cmd\":\"status\"}", BRIDGE_ASK_MS, &status);
    }
    if (result == IWC_OK) {
        self->assumptions_due = true;
        take_snapshot(self, &status);
        self->rate_hz = full_rate_hz(self);
        self->rate_id = 0;
        self->used_us = bridge_monotonic_us();
        self->used_next_us = self->used_us;
        result = iwc_watch(self->gateway, topics, (int)self->rate_hz, BRIDGE_ASK_MS);
    }
    if (result != IWC_OK) {
        bridge_lose(self, (result == IWC_REFUSED) ? iwc_reason(self->gateway) : iwc_words(result));
        return result;
    }
    self->backoff_us = BRIDGE_BACKOFF_US;
    self->gone_reported = false;
    (void)fprintf(
        stderr, "iwheel-ros2: info: connected to %s%s\n", self->settings.gateway.socket,
        newer ? ", whose protocol is newer: this bridge only watches and stops; install the iwheel-ros2 of its version"
              : "");
    if (self->facts.drive && self->facts.machine.setpoint_current) {
        (void)fputs("iwheel-ros2: warning: current_role = setpoint: a twist carries no current, so driving is refused; "
                    "watching works\n",
                    stderr);
    }
    return IWC_OK;
}

static void take_stop(bridge_t *self, const iwc_message_t *event) {
    const bool ours = iwc_integer(event, "client").value == iwc_number(self->gateway);
    const bool was_silent =
        iwc_is(event, "cause", "lease_lost") || (self->silenced && iwc_is(event, "cause", "client_stop"));
    (void)iwc_text(event, "sentence", self->facts.machine.stop, sizeof self->facts.machine.stop);
    self->facts.machine.stop_number = iwc_integer(event, "number");
    ros_auto_stopped(&self->auto_arm, ours && was_silent && event->skipped == 0);
    self->silenced = false;
    self->commanded_us = 0;
    bridge_end_lease(self);
}

/// Handles a reply to a drive command or to the request for another rate. The replies to all other requests are read
/// where the request is sent.
static void take_reply(bridge_t *self, const iwc_message_t *reply) {
    ros_commands_t *commands = &self->facts.commands;
    if (reply->id == self->rate_id) {
        self->rate_hz = (iwc_truth(reply, "ok").value == 0) ? 0U : self->rate_hz;
        return;
    }
    commands->refusal[0] = '\0';
    if (iwc_truth(reply, "ok").value == 0) {
        commands->refused++;
        (void)iwc_text(reply, "message", commands->refusal, sizeof commands->refusal);
    }
}

void bridge_listen(bridge_t *self) {
    iwc_message_t message;
    bool fresh = false;
    iwc_result_t result = iwc_next(self->gateway, 0, &message);
    // iwc_next reads the descriptor once only; the descriptor stays readable if there is more.
    for (; result == IWC_OK; result = iwc_pending(self->gateway) ? iwc_next(self->gateway, 0, &message) : IWC_TIMEOUT) {
        if (!message.is_event) {
            take_reply(self, &message);
        } else if (iwc_is(&message, "event", "state")) {
            take_snapshot(self, &message);
            fresh = true;
        } else if (iwc_is(&message, "event", "stop")) {
            take_stop(self, &message);
        } else if (iwc_is(&message, "event", "ledger")) {
            self->assumptions_due = true;
        }
    }
    if (result != IWC_TIMEOUT && result != IWC_INTERRUPTED) {
        bridge_lose(self, "it has ended, or closed the connection");
    } else if (fresh && is_used(self)) {
        ros_publish_motion(self->ros, &self->facts.machine, &self->odometry);
        ros_publish_wrench(self->ros, &self->facts.machine);
    }
}
