// SPDX-License-Identifier: MIT
#include "bridge_parts.h"

#include <string.h>
#include <sysexits.h>

#define SECOND_US 1000000
/// Time without a snapshot after which the gateway counts as silent. Two snapshots may be late, and a silent gateway is
/// still reported within 0.2 s.
#define SILENT_US 150000

/// Result of the judgement of a command.
typedef struct {
    ros_twist_t twist;
    ros_age_t age;
    int64_t age_us;
    bool good;  ///< The command has usable numbers.
    bool moves; ///< The command is not zero, or not readable.
} judged_t;

static judged_t judge_age(bridge_t *self, const ros_command_t *command) {
    const ros_moment_t now = bridge_moment();
    judged_t judged = {.age = ROS_AGE_FRESH};
    int64_t stamp_age_us = 0;
    judged.age = ros_ages_command(&self->ages, command->source, command->sent_us, now, &judged.age_us);
    if (command->stamp_us != 0) {
        const ros_age_t by_stamp =
            ros_ages_command(&self->stamp_ages, command->source, command->stamp_us, now, &stamp_age_us);
        if (judged.age == ROS_AGE_FRESH) {
            judged.age = by_stamp;
        }
        if (stamp_age_us > judged.age_us) {
            judged.age_us = stamp_age_us;
        }
    }
    return judged;
}

/// Judges a command, and counts one that may not be executed.
static judged_t judge_command(bridge_t *self, const ros_command_t *command) {
    judged_t judged = judge_age(self, command);
    judged.good = ros_twist_read(command->linear, command->angular, &judged.twist) == ROS_TWIST_GOOD;
    judged.moves = !judged.good || judged.twist.v_mm_s != 0 || judged.twist.yaw_mrad_s != 0;
    self->coming_us = bridge_monotonic_us();
    if (judged.moves) {
        self->moved_us = self->coming_us;
    }
    ros_commands_t *commands = &self->facts.commands;
    commands->unusable = !judged.good;
    if (!judged.good) {
        commands->bad++;
    } else if (judged.age == ROS_AGE_UNKNOWN) {
        commands->unknown += judged.moves ? 1U : 0U;
    } else if (judged.age != ROS_AGE_FRESH) {
        commands->late++;
    }
    return judged;
}

/// Requests the lease for a command. The command itself moves nothing; the next one drives.
static void arm_for_command(bridge_t *self, int64_t age_us) {
    ros_commands_t *commands = &self->facts.commands;
    iwc_terms_t terms;
    const bool refused = bridge_arm(self, age_us, &terms) == IWC_REFUSED;
    (void)snprintf(commands->refusal, sizeof commands->refusal, "%s", refused ? iwc_reason(self->gateway) : "");
}

/// Returns true if another publisher is the driver, and counts the command unless it is zero.
static bool is_of_another(bridge_t *self, const ros_command_t *command, const judged_t *judged) {
    const bool another = self->driver != 0 && self->driver != command->source;
    self->facts.commands.others += (another && judged->moves) ? 1U : 0U;
    return another;
}

static void pass_on(bridge_t *self, const ros_command_t *command, const judged_t *judged) {
    if (iwc_twist(self->gateway, judged->twist.v_mm_s, judged->twist.yaw_mrad_s, 0, NULL) != IWC_OK) {
        return;
    }
    if (judged->moves && self->leased_us != 0) {
        self->driver = command->source;
    }
    self->facts.commands.unsent--;
    self->facts.commands.passed++;
    self->commanded_us = bridge_monotonic_us();
}

static void take_command(bridge_t *self, const ros_command_t *command) {
    const iwc_state_t *state = &self->facts.machine.now;
    const judged_t judged = judge_command(self, command);
    const bool quiet = ros_auto_command(&self->auto_arm, judged.moves, self->coming_us);
    const bool zero_of_unknown = judged.age == ROS_AGE_UNKNOWN && !judged.moves;
    if (!judged.good || (judged.age != ROS_AGE_FRESH && !zero_of_unknown) || is_of_another(self, command, &judged)) {
        return;
    }
    self->facts.commands.unsent++; // pass_on subtracts it again after sending.
    if (bridge_why_not_drive(self)[0] != '\0') {
        return;
    }
    if (quiet && self->settings.drive.auto_arm && judged.age == ROS_AGE_FRESH && state->machine == IWC_LISTENING &&
        !state->holder.known) {
        arm_for_command(self, judged.age_us);
        return;
    }
    pass_on(self, command, &judged);
}

static void take_commands(bridge_t *self) {
    ros_command_t command;
    for (unsigned reader = 0; reader < ROS_COMMAND_READERS; reader++) {
        if (ros_take_command(self->ros, reader, &command)) {
            take_command(self, &command);
        }
    }
}

static void take_from_ros(bridge_t *self) {
    ros_request_t request;
    ros_woken(self->ros);
    // Commands first: a command then reaches the bus soonest, and a stop that came with it still acts after it.
    take_commands(self);
    while (ros_take_request(self->ros, &request)) {
        bridge_take_request(self, &request);
    }
}

static void judge_silence(bridge_t *self, int64_t now) {
    const int64_t timeout_us = (int64_t)self->settings.drive.timeout_ms * 1000;
    if (self->commanded_us == 0 || now - self->commanded_us <= timeout_us) {
        return;
    }
    self->commanded_us = 0;
    if (self->facts.link != ROS_LINK_GONE && self->facts.machine.now.ours) {
        self->silenced = true;
        bridge_end_lease(self);
        if (iwc_stop(self->gateway, BRIDGE_ASK_MS) != IWC_OK && iwc_fd(self->gateway) < 0) {
            bridge_lose(self, "it did not answer to stop");
        }
    }
}

/// Stores the number of the last stop and the time since which iwheel/state shows it.
static void show_stop(bridge_t *self, int64_t now) {
    const iwc_value_t stop =
        (self->facts.link == ROS_LINK_UP) ? self->facts.machine.stop_number : (iwc_value_t){.known = false};
    if (stop.known && (!self->shown.known || self->shown.value != stop.value)) {
        self->shown_us = now;
    }
    self->shown = stop;
}

/// Publishes the e-stop on a change. A line that was published before and is gone now counts as one that cannot be
/// read.
static void show_estop(bridge_t *self) {
    ros_estop_t estop = ros_facts_estop(&self->facts);
    if (estop == ROS_ESTOP_NO_LINE && self->estop != ROS_ESTOP_NO_LINE) {
        estop = ROS_ESTOP_PRESSED;
    }
    if (estop != self->estop) {
        self->estop = estop;
        ros_publish_estop(self->ros, estop == ROS_ESTOP_PRESSED);
    }
}

static void publish_facts(bridge_t *self, int64_t now) {
    char state[sizeof self->state];
    ros_status_t statuses[ROS_REPORTS];
    ros_state_json(&self->facts, state, sizeof state);
    const bool changed = strcmp(state, self->state) != 0;
    if (!changed && now < self->second_us) {
        return;
    }
    if (changed) {
        memcpy(self->state, state, sizeof state);
        ros_publish_state(self->ros, state);
        show_stop(self, now);
        show_estop(self);
    }
    if (now >= self->second_us) {
        ros_find_unmatched(self->ros, &self->facts.commands.unmatched);
    }
    self->facts.commands.publishers = ros_publishers(self->ros);
    self->facts.commands.coming = self->coming_us > 0 && now - self->coming_us < SECOND_US;
    for (unsigned i = 0; i < ROS_REPORTS; i++) {
        ros_diagnose(&self->facts, (ros_report_t)i, &statuses[i]);
    }
    ros_publish_diagnostics(self->ros, statuses, bridge_wall_us());
    if (now >= self->second_us) {
        self->second_us = now + SECOND_US;
        self->assumptions_due = true;
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
    } else if (bridge_monotonic_us() >= self->retry_us) {
        (void)bridge_call(self);
    }
    const int64_t now = bridge_monotonic_us();
    judge_silence(self, now);
    bridge_choose_rate(self, now);
    if (self->facts.link == ROS_LINK_UP && now - self->received_us > SILENT_US) {
        self->facts.link = ROS_LINK_SILENT;
    }
    publish_facts(self, now);
    (void)pthread_mutex_unlock(&self->lock);
}

static int wait_ms(const bridge_t *self) {
    const int64_t now = bridge_monotonic_us();
    const bool here = self->facts.link != ROS_LINK_GONE;
    int64_t next_us = self->second_us;
    if (here && iwc_pending(self->gateway)) {
        return 0;
    }
    const int64_t others[3] = {
        here ? INT64_MAX : self->retry_us,
        (self->facts.link == ROS_LINK_UP) ? self->received_us + SILENT_US : INT64_MAX,
        (self->commanded_us > 0) ? self->commanded_us + (int64_t)self->settings.drive.timeout_ms * 1000 : INT64_MAX};
    for (size_t i = 0; i < 3U; i++) {
        if (others[i] < next_us) {
            next_us = others[i];
        }
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

/// Forwards the commands in a thread of DDS. Not with auto_arm: such a command may have to wait for the gateway, and
/// only the loop may wait.
static bool take_now(void *context) {
    bridge_t *self = context;
    if (pthread_mutex_trylock(&self->lock) != 0) {
        return false;
    }
    const bool can = self->facts.link == ROS_LINK_UP && !self->settings.drive.auto_arm;
    if (can) {
        take_commands(self);
    }
    (void)pthread_mutex_unlock(&self->lock);
    return can;
}

static int open_both(bridge_t *self) {
    self->gateway = iwc_new();
    self->ros = (self->gateway != NULL) ? ros_open(&self->settings, take_now, self, stderr) : NULL;
    if (self->ros == NULL) {
        return EX_UNAVAILABLE;
    }
    if (bridge_call(self) == IWC_DENIED && self->settings.drive.enabled) {
        (void)fprintf(stderr,
                      "iwheel-ros2: this user may not use %s: add the user to the group iwheel (to drive), or set "
                      "[drive] enabled = no\n",
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
    ros_auto_init(&self->auto_arm, bridge_monotonic_us());
    ros_ages_init(&self->ages, settings->ros.loopback, settings->ros.synchronised, bridge_moment());
    self->stamp_ages = self->ages;
    const int result = open_both(self);
    (void)pthread_mutex_unlock(&self->lock);
    if (result != 0) {
        bridge_close(self);
    }
    return result;
}

void bridge_close(bridge_t *self) {
    (void)pthread_mutex_lock(&self->lock); // Never unlocked: commands that DDS still receives must not be forwarded.
    if (self->facts.machine.now.ours && self->facts.link != ROS_LINK_GONE) {
        (void)iwc_stop(self->gateway, BRIDGE_ASK_MS);
    }
    if (self->ros != NULL) {
        ros_close(self->ros);
    }
    iwc_free(self->gateway);
}
