// SPDX-License-Identifier: MIT
#include "iwheel_sim/sim_wheel.h"

#define TEMPERATURE_AMBIENT_degC 28
/// With 2000 mA the temperature settles 40 K above ambient, with a time constant of HEAT_RESPONSE_FRAMES.
#define HEAT_PER_mA_mdegC    20
#define HEAT_RESPONSE_FRAMES 5000
#define CPU_PERCENT          22U
#define CPU_NOISE_PERCENT    3
#define CPU_DRIVEN_PERCENT   6U
#define RPM_DITHER           1000U
/// Delay of the right wheel, so that both wheels do not send at the same instant.
#define PHASE_RIGHT_US 1300U

static const uint32_t period_us[SIM_TELEMETRY_KINDS] = {4000U, 40000U, 40000U, 50000U, 1000000U};
static const uint32_t kind_phase_us[SIM_TELEMETRY_KINDS] = {0U, 700U, 900U, 1600U, 2500U};

static void find_next(sim_wheel_t *self) {
    self->next_us = IW_NEVER;
    for (unsigned kind = 0U; kind < SIM_TELEMETRY_KINDS; kind++) {
        if (self->due_us[kind] < self->next_us) {
            self->next_us = self->due_us[kind];
        }
    }
}

static void stop_sending(sim_wheel_t *self) {
    for (unsigned kind = 0U; kind < SIM_TELEMETRY_KINDS; kind++) {
        self->due_us[kind] = IW_NEVER;
    }
    self->next_us = IW_NEVER;
}

void sim_wheel_init(sim_wheel_t *self, const sim_wheel_config_t *config, iw_side_t side, uint64_t seed) {
    *self = (sim_wheel_t){.side = side, .boot_us = config->boot_us, .slow_permille = 1000U};
    self->offset_us = config->offset_us;
    self->ambient_degC = TEMPERATURE_AMBIENT_degC;
    self->phase_us = (side == IW_RIGHT) ? PHASE_RIGHT_US : 0U;
    sim_random_init(&self->random, seed * 2U + (uint64_t)side);
    sim_motion_init(&self->motion, &config->motion, 0U);
    sim_force_init(&self->force, config->sensor_zero_mN, config->unit);
    stop_sending(self);
}

static void boot(sim_wheel_t *self, iw_time_us_t now_us) {
    stop_sending(self);
    self->late_count = 0U;
    sim_motion_release(&self->motion, now_us);
    self->state = SIM_WHEEL_BOOTING;
    self->next_us = now_us + self->boot_us;
}

/// The firmware runs at `now_us` as if it had started `age_us` before. Frames from before `now_us` are not sent.
static void run(sim_wheel_t *self, iw_time_us_t now_us, uint64_t age_us) {
    uint64_t const learn_us = (age_us < SIM_FORCE_LEARN_US) ? SIM_FORCE_LEARN_US - age_us : 0U;
    self->state = SIM_WHEEL_RUNNING;
    self->boots += 1U;
    self->learn_until_us = now_us + learn_us;
    self->offset_until_us = now_us + ((age_us < self->offset_us) ? self->offset_us - age_us : 0U);
    if (self->offset_us == IW_NEVER) {
        self->offset_until_us = IW_NEVER;
    }
    self->motion.ticks = 0U;
    self->motion.tick_rest = 0;
    sim_force_restart(&self->force);
    for (unsigned kind = 0U; kind < SIM_TELEMETRY_KINDS; kind++) {
        self->due_us[kind] = now_us + self->phase_us + kind_phase_us[kind];
    }
    self->due_us[SIM_TELEMETRY_OFFSET] += learn_us;
    if (self->due_us[SIM_TELEMETRY_OFFSET] >= self->offset_until_us) {
        self->due_us[SIM_TELEMETRY_OFFSET] = IW_NEVER;
    }
    if (self->side == IW_LEFT) {
        self->due_us[SIM_TELEMETRY_POSE] = IW_NEVER;
    }
    find_next(self);
}

void sim_wheel_power(sim_wheel_t *self, iw_time_us_t now_us, bool on) {
    if (on == (self->state != SIM_WHEEL_OFF)) {
        return;
    }
    boot(self, now_us);
    if (!on) {
        self->state = SIM_WHEEL_OFF;
        self->next_us = IW_NEVER;
    }
}

void sim_wheel_reboot(sim_wheel_t *self, iw_time_us_t now_us) {
    if (self->state != SIM_WHEEL_OFF) {
        boot(self, now_us);
    }
}

void sim_wheel_age(sim_wheel_t *self, iw_time_us_t now_us, uint64_t age_us) {
    run(self, now_us, age_us);
}

void sim_wheel_slow(sim_wheel_t *self, uint32_t permille) {
    self->slow_permille = permille;
}

static bool lose(sim_wheel_t *self) {
    if (self->loss_permille == 0U || sim_random_below(&self->random, 1000U) >= self->loss_permille) {
        return false;
    }
    self->lost += 1U;
    return true;
}

/// Applies the setpoints of a late wheel that are due by `now_us`, each at its time.
static void obey_late(sim_wheel_t *self, iw_time_us_t now_us) {
    while (self->late_count > 0U && self->late[self->late_first].at_us <= now_us) {
        sim_late_t const *const late = &self->late[self->late_first];
        (void)sim_motion_receive(&self->motion, late->at_us, &late->setpoint);
        self->late_first = (self->late_first + 1U) % SIM_WHEEL_LATE_MAX;
        self->late_count -= 1U;
    }
}

void sim_wheel_receive(sim_wheel_t *self, iw_time_us_t now_us, const iw_codec_setpoint_t *setpoint) {
    if (self->state != SIM_WHEEL_RUNNING || lose(self)) {
        return;
    }
    obey_late(self, now_us);
    if (self->late_us == 0U && self->late_count == 0U) {
        (void)sim_motion_receive(&self->motion, now_us, setpoint);
    } else if (self->late_count < SIM_WHEEL_LATE_MAX) {
        uint32_t const place = (self->late_first + self->late_count) % SIM_WHEEL_LATE_MAX;
        self->late[place] = (sim_late_t){now_us + self->late_us, *setpoint};
        self->late_count += 1U;
    }
}

static int16_t saturate(int64_t value) {
    if (value > INT16_MAX) {
        return INT16_MAX;
    }
    return (value < INT16_MIN) ? INT16_MIN : (int16_t)value;
}

/// Returns whole rpm: rounded up or down at random, so that the mean over many frames is exact, or truncated. At
/// standstill the result is not used.
static int64_t whole_rpm(sim_wheel_t *self) {
    int64_t const milli_rpm = sim_motion_milli_rpm(&self->motion);
    if (self->truncates) {
        return milli_rpm / 1000;
    }
    int64_t const dithered = milli_rpm + sim_random_below(&self->random, RPM_DITHER);
    return (dithered >= 0) ? dithered / 1000 : -((-dithered + 999) / 1000);
}

static void fill_speed(sim_wheel_t *self, iw_codec_speed_t *out_speed) {
    int64_t const rpm = whole_rpm(self);
    bool const at_rest = self->motion.speed_um_s == 0;
    int32_t const accel = self->motion.swapped ? -self->motion.accel_mm_s2 : self->motion.accel_mm_s2;
    out_speed->speed_rpm = at_rest ? 0 : saturate(rpm);
    out_speed->acceleration_raw = saturate((int64_t)accel * 49736 / 1000000);
}

static int32_t wrapped(uint32_t ticks) {
    return (ticks <= (uint32_t)INT32_MAX) ? (int32_t)ticks : -(int32_t)(UINT32_MAX - ticks) - 1;
}

static void fill_status(sim_wheel_t *self, uint8_t battery_dV, iw_codec_status_t *out_status) {
    int32_t const target = (int32_t)sim_motion_draw_mA(&self->motion) * HEAT_PER_mA_mdegC;
    self->heat_mdegC += (target - self->heat_mdegC) / HEAT_RESPONSE_FRAMES;
    int32_t const temperature = self->ambient_degC + self->heat_mdegC / 1000;
    uint32_t const driven = self->motion.driven ? CPU_DRIVEN_PERCENT : 0U;
    out_status->battery_dV = battery_dV;
    out_status->temperature_degC = (uint8_t)((temperature < 0) ? 0 : (temperature > 255) ? 255 : temperature);
    out_status->odometry_ticks = wrapped(self->motion.ticks);
    out_status->cpu_percent =
        (uint8_t)((int32_t)(CPU_PERCENT + driven) + sim_random_noise(&self->random, CPU_NOISE_PERCENT));
}

static sim_telemetry_t take_due(sim_wheel_t *self) {
    sim_telemetry_t kind = SIM_TELEMETRY_SPEED;
    while (self->due_us[kind] != self->next_us) {
        kind++;
    }
    bool const offset = kind == SIM_TELEMETRY_OFFSET;
    uint64_t const permille = offset ? 1000U : self->slow_permille;
    iw_time_us_t const following = self->due_us[kind] + period_us[kind] * permille / 1000U;
    bool const over = offset && following >= self->offset_until_us;
    self->due_us[kind] = over ? IW_NEVER : following;
    find_next(self);
    return kind;
}

static void fill(sim_wheel_t *self, iw_time_us_t now_us, sim_telemetry_t kind, sim_message_t *out) {
    static const iw_codec_kind_t proto_kind[SIM_TELEMETRY_KINDS] = {IW_CODEC_SPEED, IW_CODEC_STATUS, IW_CODEC_POSE,
                                                                    IW_CODEC_FORCE, IW_CODEC_OFFSET};
    out->kind = proto_kind[kind];
    if (kind == SIM_TELEMETRY_SPEED) {
        fill_speed(self, &out->values.speed);
    } else if (kind == SIM_TELEMETRY_FORCE) {
        bool const learning = now_us < self->learn_until_us;
        out->values.force.force_raw = sim_force_sample(&self->force, now_us, learning, &self->random);
        out->values.force.debug_raw = (int16_t)(self->sent[kind] & 0x7FFFU);
    } else if (kind == SIM_TELEMETRY_OFFSET) {
        out->values.offset.offset_dN = self->force.learned_dN;
    }
}

bool sim_wheel_step(sim_wheel_t *self, uint8_t battery_dV, sim_pose_t *pose, sim_message_t *out_message) {
    iw_time_us_t const now_us = self->next_us;
    obey_late(self, now_us);
    sim_motion_advance(&self->motion, now_us);
    if (self->state == SIM_WHEEL_BOOTING) {
        if (self->side == IW_RIGHT) {
            sim_pose_restart(pose, now_us, self->motion.position_nm);
        }
        run(self, now_us, 0U);
        return false;
    }
    sim_telemetry_t const kind = take_due(self);
    fill(self, now_us, kind, out_message);
    if (kind == SIM_TELEMETRY_STATUS) {
        fill_status(self, battery_dV, &out_message->values.status);
    } else if (kind == SIM_TELEMETRY_POSE) {
        out_message->values.pose = sim_pose_step(pose, now_us, self->motion.position_nm);
    }
    if (self->muted || lose(self)) {
        return false;
    }
    self->sent[kind] += 1U;
    return true;
}
