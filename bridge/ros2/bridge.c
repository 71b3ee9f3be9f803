// SPDX-License-Identifier: MIT
#include "bridge_parts.h"

#include <string.h>
#include <sysexits.h>

#define ARM_MS    400 ///< echo_ms is 200 at most.
#define SECOND_US 1000000
/// Two snapshots may be late; seen within 0.2 s also at the slowest rates, by status requests of our own.
#define SILENT_US 150000

static int64_t now_us(void) {
    return bridge_clock_us(CLOCK_MONOTONIC);
}

// ---- commands and requests ----------------------------------------------------------------------------------------

/// Empty: may drive.
static const char *why_not_drive(const bridge_t *self) {
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

static iwc_result_t arm(bridge_t *self, iwc_terms_t *out_terms) {
    const iwc_result_t result = iwc_arm(self->gateway, self->settings.ros.node, false, ARM_MS, out_terms);
    self->commanded_us = 0;
    self->silenced = false;
    if (result != IWC_OK && result != IWC_REFUSED && result != IWC_NEWER) {
        bridge_lose(self, iwc_words(result)); // Whether it is armed nobody knows: the end of the connection ends it.
    }
    return result;
}

/// True with the twist, if the command may be carried out: young, and of numbers. Counts what may not, and tells by `*out_may_arm` whether
/// it may ask for the lease.
static bool judge_command(bridge_t *self, const ros_command_t *command, ros_twist_t *out_twist, bool *out_may_arm) {
    const int64_t now = now_us();
    const int64_t stamp_us = command->stamp_us;
    const bool sent_lately = ros_age_pass(&self->ages, command->source, command->sent_us, now);
    const bool made_lately = stamp_us == 0 || ros_age_pass(&self->stamp_ages, command->source, stamp_us, now);
    const bool good = ros_twist_read(command->linear, command->angular, out_twist) == ROS_TWIST_GOOD;
    const bool moves = !good || out_twist->v_mm_s != 0 || out_twist->yaw_mrad_s != 0;
    *out_may_arm = ros_auto_command(&self->auto_arm, moves, now) && self->settings.drive.auto_arm;
    self->coming_us = now;
    self->facts.commands.late += (sent_lately && made_lately) ? 0U : 1U;
    self->facts.commands.bad += good ? 0U : 1U;
    return sent_lately && made_lately && good;
}

/// The command itself moves nothing; the next one drives.
static void arm_for_command(bridge_t *self) {
    ros_commands_t *commands = &self->facts.commands;
    iwc_terms_t terms;
    const bool refused = arm(self, &terms) == IWC_REFUSED;
    (void)snprintf(commands->refusal, sizeof commands->refusal, "%s", refused ? iwc_reason(self->gateway) : "");
}

static void take_command(bridge_t *self, const ros_command_t *command) {
    const iwc_state_t *state = &self->facts.machine.now;
    ros_commands_t *commands = &self->facts.commands;
    ros_twist_t twist = {0, 0};
    bool may_arm = false;
    if (!judge_command(self, command, &twist, &may_arm)) {
        return;
    }
    commands->unsent++; // Until it is.
    if (why_not_drive(self)[0] != '\0') {
        return;
    }
    if (may_arm && state->machine == IWC_LISTENING && !state->holder.known) {
        arm_for_command(self);
        return;
    }
    if (iwc_twist(self->gateway, twist.v_mm_s, twist.yaw_mrad_s, 0, NULL) == IWC_OK) {
        commands->unsent--;
        commands->passed++;
        self->commanded_us = now_us();
    }
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

static void take_arm(bridge_t *self, const ros_request_t *request) {
    iwc_terms_t terms = {.lease_ms = 0};
    const char *reason = why_not_drive(self);
    if (reason[0] != '\0') {
        ros_answer(self->ros, request, false, reason);
        return;
    }
    const iwc_result_t result = arm(self, &terms);
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

static void take_request(bridge_t *self, const ros_request_t *request) {
    const bool young = ros_age_pass(&self->request_ages, request->source, request->sent_us, now_us());
    if (self->facts.link == ROS_LINK_GONE) {
        ros_answer(self->ros, request, false, "there is no gateway; see /diagnostics");
        return;
    }
    switch (request->verb) {
    case ROS_STOP:
        answer_result(self, request, iwc_stop(self->gateway, BRIDGE_ASK_MS));
        return;
    case ROS_ESTOP:
        answer_result(self, request, iwc_estop(self->gateway, "by ROS, iwheel/estop", BRIDGE_ASK_MS));
        return;
    default:
        break;
    }
    if (!young) {
        ros_answer(self->ros, request, false, "it came too late to be meant now; ask again");
    } else if (request->verb == ROS_ARM) {
        take_arm(self, request);
    } else if (!self->settings.drive.allow_reset) {
        ros_answer(self->ros, request, false,
                   "not over the network: look at the machine, then iwheelctl reset; or set [drive] allow_reset = yes "
                   "in ros2.conf");
    } else {
        answer_result(self, request, iwc_reset(self->gateway, BRIDGE_ASK_MS));
    }
}

static void take_from_ros(bridge_t *self) {
    ros_request_t request;
    ros_command_t command;
    ros_woken(self->ros);
    // A command first: it is soonest on the bus so, and a stop that came with it has the last word.
    if (ros_take_command(self->ros, &command)) {
        take_command(self, &command);
    }
    while (ros_take_request(self->ros, &request)) {
        take_request(self, &request);
    }
}

// ---- time ---------------------------------------------------------------------------------------------------------

static void judge_silence(bridge_t *self, int64_t now) {
    const int64_t timeout_us = (int64_t)self->settings.drive.timeout_ms * 1000;
    if (self->commanded_us == 0 || now - self->commanded_us <= timeout_us) {
        return;
    }
    self->commanded_us = 0;
    if (self->facts.link != ROS_LINK_GONE && self->facts.machine.now.ours) {
        self->silenced = true;
        if (iwc_stop(self->gateway, BRIDGE_ASK_MS) != IWC_OK && iwc_fd(self->gateway) < 0) {
            bridge_lose(self, "it did not answer to stop");
        }
    }
}

static void tell(bridge_t *self, int64_t now) {
    char state[sizeof self->state];
    ros_status_t statuses[ROS_TELLS];
    ros_state_json(&self->facts, state, sizeof state);
    const bool changed = strcmp(state, self->state) != 0;
    if (!changed && now < self->second_us) {
        return;
    }
    if (changed) {
        memcpy(self->state, state, sizeof state);
        ros_publish_state(self->ros, state);
    }
    self->facts.commands.publishers = ros_publishers(self->ros);
    self->facts.commands.coming = self->coming_us > 0 && now - self->coming_us < SECOND_US;
    for (unsigned i = 0; i < ROS_TELLS; i++) {
        ros_diagnose(&self->facts, (ros_tells_t)i, &statuses[i]);
    }
    ros_publish_diagnostics(self->ros, statuses, bridge_clock_us(CLOCK_REALTIME));
    if (now >= self->second_us) {
        self->second_us = now + SECOND_US;
        self->ledger_due = true;
        if (self->facts.link == ROS_LINK_UP) {
            ros_publish_battery(self->ros, &self->facts.machine);
        }
    }
}

void bridge_step(bridge_t *self) {
    (void)pthread_mutex_lock(&self->lock);
    take_from_ros(self);
    if (self->facts.link != ROS_LINK_GONE) {
        bridge_listen(self);
    } else if (now_us() >= self->retry_us) {
        (void)bridge_call(self);
    }
    const int64_t now = now_us();
    judge_silence(self, now);
    if (self->facts.link == ROS_LINK_UP && now - self->heard_us > SILENT_US) {
        self->facts.link = ROS_LINK_SILENT;
    }
    tell(self, now);
    (void)pthread_mutex_unlock(&self->lock);
}

static int wait_ms(const bridge_t *self) {
    const int64_t now = now_us();
    const bool here = self->facts.link != ROS_LINK_GONE;
    int64_t next_us = self->second_us;
    if (here && iwc_pending(self->gateway)) {
        return 0;
    }
    const int64_t others[3] = {
        here ? INT64_MAX : self->retry_us, (self->facts.link == ROS_LINK_UP) ? self->heard_us + SILENT_US : INT64_MAX,
        (self->commanded_us > 0) ? self->commanded_us + (int64_t)self->settings.drive.timeout_ms * 1000 : INT64_MAX};
    for (size_t i = 0; i < 3U; i++) {
        next_us = (others[i] < next_us) ? others[i] : next_us;
    }
    return (next_us > now) ? (int)((next_us - now) / 1000) + 1 : 0;
}

int bridge_wait_ms(bridge_t *self, int *out_fd) {
    (void)pthread_mutex_lock(&self->lock);
    const int result = wait_ms(self);
    *out_fd = iwc_fd(self->gateway);
    (void)pthread_mutex_unlock(&self->lock);
    return result;
}

/// In a thread of DDS. With auto_arm a command may have to wait for the gateway, which is the loop's to do.
static bool take_now(void *context) {
    bridge_t *self = context;
    ros_command_t command;
    if (pthread_mutex_trylock(&self->lock) != 0) {
        return false;
    }
    const bool can = self->facts.link == ROS_LINK_UP && !self->settings.drive.auto_arm;
    if (can && ros_take_command(self->ros, &command)) {
        take_command(self, &command);
    }
    (void)pthread_mutex_unlock(&self->lock);
    return can;
}

// ---- begin and end ------------------------------------------------------------------------------------------------

static int open_both(bridge_t *self) {
    self->gateway = iwc_new();
    self->ros = (self->gateway != NULL) ? ros_open(&self->settings, take_now, self, stderr) : NULL;
    if (self->ros == NULL) {
        return EX_UNAVAILABLE;
    }
    if (bridge_call(self) == IWC_DENIED && self->settings.drive.enabled) {
        (void)fprintf(stderr,
                      "iwheel-ros2: %s is not for this user: add it to the group iwheel (to drive), or set [drive] "
                      "enabled = no\n",
                      self->settings.gateway.socket);
        return EX_NOPERM;
    }
    return 0;
}

int bridge_open(bridge_t *self, const ros_settings_t *settings) {
    memset(self, 0, sizeof *self);
    (void)pthread_mutex_init(&self->lock, NULL);
    (void)pthread_mutex_lock(&self->lock);
    self->settings = *settings;
    self->facts.drive = settings->drive.enabled;
    self->backoff_us = BRIDGE_BACKOFF_US;
    ros_auto_init(&self->auto_arm, now_us());
    const int result = open_both(self);
    (void)pthread_mutex_unlock(&self->lock);
    if (result != 0) {
        bridge_close(self);
    }
    return result;
}

void bridge_close(bridge_t *self) {
    (void)pthread_mutex_lock(&self->lock); // For ever: what DDS still receives is nobody's.
    if (self->facts.machine.now.ours && self->facts.link != ROS_LINK_GONE) {
        (void)iwc_stop(self->gateway, BRIDGE_ASK_MS);
    }
    if (self->ros != NULL) {
        ros_close(self->ros);
    }
    iwc_free(self->gateway);
}
