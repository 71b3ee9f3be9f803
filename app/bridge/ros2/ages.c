// SPDX-License-Identifier: MIT
#include "ages.h"

#include <stdlib.h>
#include <string.h>

#define PER_MILLION 1000000
#define TENTH       10

void ros_ages_init(ros_ages_t *self, bool local, bool synchronised, ros_moment_t now) {
    memset(self, 0, sizeof *self);
    self->local = local;
    self->synchronised = synchronised;
    self->offset_us = now.wall_us - now.mono_us;
}

/// True if the wall clock was not set back since the oldest sample that could pass now.
static bool may_trust_wall(ros_ages_t *self, ros_moment_t now) {
    const int64_t offset_us = now.wall_us - now.mono_us;
    const int64_t back_us = self->offset_us - offset_us;
    self->offset_us = offset_us;
    if (back_us > ROS_STEP_US) {
        const int64_t until_us = now.wall_us + back_us + ROS_OLD_US;
        if (until_us > self->doubted_until_us) {
            self->doubted_until_us = until_us;
        }
    }
    return now.wall_us >= self->doubted_until_us;
}

static ros_age_t judge_absolutely(int64_t sent_us, ros_moment_t now, int64_t *out_age_us) {
    *out_age_us = now.wall_us - sent_us;
    if (*out_age_us < -ROS_AHEAD_US) {
        return ROS_AGE_AHEAD;
    }
    return (*out_age_us > ROS_OLD_US) ? ROS_AGE_LATE : ROS_AGE_FRESH;
}

static void begin_again(ros_source_t *entry, int64_t sent_us, int64_t now_us) {
    entry->known = false;
    entry->first_sent_us = sent_us;
    entry->first_received_us = now_us;
    entry->least_us = now_us - sent_us;
}

static ros_source_t *source_of(ros_ages_t *self, uint64_t source, int64_t sent_us, int64_t now_us) {
    ros_source_t *oldest = &self->sources[0];
    for (size_t i = 0; i < ROS_SOURCES; i++) {
        ros_source_t *entry = &self->sources[i];
        if (entry->source == source) {
            return entry;
        }
        if (oldest->source != 0 && (entry->source == 0 || entry->received_us < oldest->received_us)) {
            oldest = entry;
        }
    }
    *oldest = (ros_source_t){.source = source, .received_us = now_us, .sent_us = sent_us};
    begin_again(oldest, sent_us, now_us);
    return oldest;
}

static bool has_gap(const ros_source_t *entry, int64_t sent_us, int64_t now_us) {
    return now_us - entry->received_us > ROS_GAP_US || llabs(sent_us - entry->sent_us) > ROS_GAP_US;
}

/// Learns from one sample of a writer that is not known.
static void learn(ros_source_t *entry, int64_t sent_us, int64_t now_us) {
    const int64_t received_span_us = now_us - entry->first_received_us;
    const int64_t sent_span_us = sent_us - entry->first_sent_us;
    if (sent_span_us - received_span_us > ROS_LEARN_US / TENTH) {
        begin_again(entry, sent_us, now_us); // The network held the first sample back for longer than this one.
        return;
    }
    entry->known = received_span_us >= ROS_LEARN_US && sent_span_us >= ROS_LEARN_US &&
                   llabs(received_span_us - sent_span_us) <= received_span_us / TENTH;
}

static ros_age_t judge_by_writer(ros_ages_t *self, uint64_t source, int64_t sent_us, int64_t now_us,
                                 int64_t *out_age_us) {
    ros_source_t *entry = source_of(self, source, sent_us, now_us);
    const int64_t way_us = now_us - sent_us;
    if (has_gap(entry, sent_us, now_us)) {
        begin_again(entry, sent_us, now_us);
    } else if (sent_us < entry->sent_us) {
        *out_age_us = way_us - entry->least_us;
        return ROS_AGE_OVERTAKEN;
    }
    entry->least_us += (now_us - entry->received_us) / (PER_MILLION / ROS_DRIFT_PPM);
    if (way_us < entry->least_us) {
        entry->least_us = way_us;
    }
    entry->received_us = now_us;
    entry->sent_us = sent_us;
    if (!entry->known) {
        learn(entry, sent_us, now_us);
    }
    *out_age_us = way_us - entry->least_us;
    if (!entry->known) {
        return ROS_AGE_UNKNOWN;
    }
    return (*out_age_us > ROS_LATE_US) ? ROS_AGE_LATE : ROS_AGE_FRESH;
}

ros_age_t ros_ages_command(ros_ages_t *self, uint64_t source, int64_t sent_us, ros_moment_t now, int64_t *out_age_us) {
    const bool trusted = may_trust_wall(self, now);
    const ros_age_t learned = judge_by_writer(self, source, sent_us, now.mono_us, out_age_us);
    if (!self->local && !self->synchronised) {
        return learned;
    }
    const ros_age_t absolute = judge_absolutely(sent_us, now, out_age_us);
    if (absolute != ROS_AGE_FRESH) {
        return absolute;
    }
    return (self->local && trusted && learned != ROS_AGE_OVERTAKEN) ? ROS_AGE_FRESH : learned;
}

ros_age_t ros_ages_request(ros_ages_t *self, int64_t sent_us, ros_moment_t now, int64_t *out_age_us) {
    const bool trusted = may_trust_wall(self, now);
    const ros_age_t absolute = judge_absolutely(sent_us, now, out_age_us);
    if (!self->local && !self->synchronised) {
        return ROS_AGE_UNKNOWN;
    }
    return trusted ? absolute : ROS_AGE_DOUBTED;
}
