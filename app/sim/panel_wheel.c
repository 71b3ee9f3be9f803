// SPDX-License-Identifier: MIT
// Commands that concern the wheels.
#include "command.h"

#include <string.h>

#define RUNAWAY_DEFAULT_MM_S 1000
#define BOTH                 3U

typedef const char *result_t;
typedef struct {
    sim_wheel_t *wheel[IW_SIDES];
    unsigned count;
} chosen_t;

static chosen_t choose(const sim_call_t *call, unsigned mask) {
    chosen_t chosen = {{NULL, NULL}, 0U};
    for (unsigned side = 0U; side < IW_SIDES; side++) {
        if (((mask >> side) & 1U) != 0U) {
            chosen.wheel[chosen.count++] = &call->world->pair.wheel[side];
        }
    }
    return chosen;
}

/// The wheels that the first argument names.
static bool sides(const sim_call_t *call, chosen_t *out_chosen) {
    unsigned mask = 0U;
    if (!sim_words_sides(call->words->word[1], &mask)) {
        return false;
    }
    *out_chosen = choose(call, mask);
    return true;
}

static bool one_of(const sim_call_t *call, unsigned index, sim_choice_t choice, bool *out_one) {
    return sim_words_choice(call->words->word[index], choice, out_one);
}

static const sim_choice_t on_off = {"on", "off"};

static result_t set_power(const sim_call_t *call) {
    bool on = false;
    if (!one_of(call, 1U, on_off, &on)) {
        return SIM_USAGE;
    }
    sim_world_power(call->world, call->now_us, on);
    return NULL;
}

static result_t reboot(const sim_call_t *call) {
    chosen_t chosen;
    if (!sides(call, &chosen)) {
        return SIM_USAGE;
    }
    if (!call->world->pair.power) {
        return "the wheels have no power; first: power on";
    }
    for (unsigned i = 0U; i < chosen.count; i++) {
        sim_world_reboot(call->world, call->now_us, chosen.wheel[i]->side);
    }
    return NULL;
}

static result_t set_muted(const sim_call_t *call) {
    chosen_t chosen;
    if (!sides(call, &chosen)) {
        return SIM_USAGE;
    }
    for (unsigned i = 0U; i < chosen.count; i++) {
        chosen.wheel[i]->muted = call->words->word[0][0] == 'm';
    }
    return NULL;
}

static result_t set_blocked(const sim_call_t *call) {
    chosen_t chosen;
    if (!sides(call, &chosen)) {
        return SIM_USAGE;
    }
    for (unsigned i = 0U; i < chosen.count; i++) {
        sim_motion_advance(&chosen.wheel[i]->motion, call->now_us);
        chosen.wheel[i]->motion.blocked = call->words->word[0][0] == 'b';
    }
    return NULL;
}

static result_t set_load(const sim_call_t *call) {
    chosen_t chosen;
    int64_t load_mN = 0;
    if (!sides(call, &chosen) || !sim_words_milli(call->words->word[2], (sim_range_t){-4000000, 4000000}, &load_mN)) {
        return SIM_USAGE;
    }
    for (unsigned i = 0U; i < chosen.count; i++) {
        chosen.wheel[i]->force.load_mN = (int32_t)load_mN;
    }
    return NULL;
}

static result_t set_unit(const sim_call_t *call) {
    chosen_t chosen;
    bool centi = false;
    if (!sides(call, &chosen) || !one_of(call, 2U, (sim_choice_t){"cN", "dN"}, &centi)) {
        return SIM_USAGE;
    }
    for (unsigned i = 0U; i < chosen.count; i++) {
        chosen.wheel[i]->force.unit = centi ? IW_FORCE_CN : IW_FORCE_DN;
    }
    return NULL;
}

static result_t set_sign(const sim_call_t *call) {
    chosen_t chosen;
    bool swapped = false;
    if (!sides(call, &chosen) || !one_of(call, 2U, (sim_choice_t){"swapped", "normal"}, &swapped)) {
        return SIM_USAGE;
    }
    for (unsigned i = 0U; i < chosen.count; i++) {
        sim_motion_advance(&chosen.wheel[i]->motion, call->now_us);
        chosen.wheel[i]->motion.swapped = swapped;
    }
    return NULL;
}

static result_t set_runaway(const sim_call_t *call) {
    chosen_t chosen;
    bool on = false;
    int64_t more = RUNAWAY_DEFAULT_MM_S;
    if (!sides(call, &chosen) || !one_of(call, 2U, on_off, &on)) {
        return SIM_USAGE;
    }
    if (call->words->count == 4U && !(on && sim_words_integer(call->words->word[3], (sim_range_t){1, 3000}, &more))) {
        return SIM_USAGE;
    }
    for (unsigned i = 0U; i < chosen.count; i++) {
        sim_motion_advance(&chosen.wheel[i]->motion, call->now_us);
        chosen.wheel[i]->motion.runaway_mm_s = on ? (int16_t)more : 0;
    }
    return NULL;
}

static result_t set_removed(const sim_call_t *call) {
    chosen_t chosen;
    bool on = false;
    if (!sides(call, &chosen) || !one_of(call, 2U, on_off, &on)) {
        return SIM_USAGE;
    }
    for (unsigned i = 0U; i < chosen.count; i++) {
        chosen.wheel[i]->force.zero_removed = on;
    }
    return NULL;
}

static result_t set_raw(const sim_call_t *call) {
    chosen_t chosen;
    int64_t raw = SIM_FORCE_AUTO;
    bool const automatic = strcmp(call->words->word[2], "auto") == 0;
    if (!sides(call, &chosen) ||
        !(automatic || sim_words_integer(call->words->word[2], (sim_range_t){INT16_MIN, INT16_MAX}, &raw))) {
        return SIM_USAGE;
    }
    for (unsigned i = 0U; i < chosen.count; i++) {
        chosen.wheel[i]->force.forced_raw = (int32_t)raw;
    }
    return NULL;
}

static result_t set_zero(const sim_call_t *call) {
    chosen_t chosen;
    int64_t zero_mN = 0;
    if (!sides(call, &chosen) || !sim_words_milli(call->words->word[2], (sim_range_t){-4000000, 4000000}, &zero_mN)) {
        return SIM_USAGE;
    }
    for (unsigned i = 0U; i < chosen.count; i++) {
        chosen.wheel[i]->force.sensor_zero_mN = (int32_t)zero_mN;
    }
    return NULL;
}

static result_t set_ticks(const sim_call_t *call) {
    chosen_t chosen;
    int64_t ticks = 0;
    if (!sides(call, &chosen) ||
        !sim_words_integer(call->words->word[2], (sim_range_t){INT32_MIN, INT32_MAX}, &ticks)) {
        return SIM_USAGE;
    }
    for (unsigned i = 0U; i < chosen.count; i++) {
        chosen.wheel[i]->motion.ticks = (uint32_t)(uint64_t)ticks;
    }
    return NULL;
}

static result_t push(const sim_call_t *call) {
    chosen_t chosen;
    int64_t way_mm = 0;
    if (!sides(call, &chosen) || !sim_words_milli(call->words->word[2], (sim_range_t){-100000, 100000}, &way_mm)) {
        return SIM_USAGE;
    }
    for (unsigned i = 0U; i < chosen.count; i++) {
        sim_motion_push(&chosen.wheel[i]->motion, call->now_us, (int32_t)way_mm);
    }
    return NULL;
}

static result_t turn(const sim_call_t *call) {
    int64_t milli_turns = 0;
    sim_pair_t *pair = &call->world->pair;
    if (!sim_words_milli(call->words->word[1], (sim_range_t){-20000, 20000}, &milli_turns)) {
        return SIM_USAGE;
    }
    // On the spot: each wheel rolls along a circle as wide as the track; 355 / 113 is pi.
    const int32_t way_mm = (int32_t)(milli_turns * 355 * pair->pose.track_mm / 113000);
    for (unsigned side = 0U; side < IW_SIDES; side++) {
        const int32_t sign = ((side == IW_LEFT) != pair->pose.mirrored[side]) ? -1 : 1;
        sim_motion_push(&pair->wheel[side].motion, call->now_us, sign * way_mm);
    }
    return NULL;
}

static result_t set_track(const sim_call_t *call) {
    int64_t track_mm = 0;
    if (!sim_words_integer(call->words->word[1], (sim_range_t){50, 5000}, &track_mm)) {
        return SIM_USAGE;
    }
    call->world->pair.pose.track_mm = (uint16_t)track_mm;
    return NULL;
}

static result_t set_radius(const sim_call_t *call) {
    chosen_t chosen;
    int64_t radius_mm = 0;
    if (!sides(call, &chosen) || !sim_words_integer(call->words->word[2], (sim_range_t){20, 500}, &radius_mm)) {
        return SIM_USAGE;
    }
    for (unsigned i = 0U; i < chosen.count; i++) {
        chosen.wheel[i]->motion.config.radius_mm = (uint16_t)radius_mm;
    }
    return NULL;
}

static result_t set_gear(const sim_call_t *call) {
    chosen_t chosen;
    int64_t turns = 0;
    int64_t per = 1;
    sim_range_t const range = {1, 1000};
    if (!sides(call, &chosen) || !sim_words_integer(call->words->word[2], range, &turns)) {
        return SIM_USAGE;
    }
    if (call->words->count == 4U && !sim_words_integer(call->words->word[3], range, &per)) {
        return SIM_USAGE;
    }
    for (unsigned i = 0U; i < chosen.count; i++) {
        sim_motion_advance(&chosen.wheel[i]->motion, call->now_us);
        chosen.wheel[i]->motion.tick_rest = 0;
        chosen.wheel[i]->motion.config.gear_turns = (uint16_t)turns;
        chosen.wheel[i]->motion.config.gear_per = (uint16_t)per;
    }
    return NULL;
}

static result_t set_rpm(const sim_call_t *call) {
    chosen_t chosen;
    bool rotor = false;
    if (!sides(call, &chosen) || !one_of(call, 2U, (sim_choice_t){"rotor", "wheel"}, &rotor)) {
        return SIM_USAGE;
    }
    for (unsigned i = 0U; i < chosen.count; i++) {
        chosen.wheel[i]->motion.config.rpm_of_rotor = rotor;
    }
    return NULL;
}

static result_t set_mirror(const sim_call_t *call) {
    chosen_t chosen;
    bool on = false;
    if (!sides(call, &chosen) || !one_of(call, 2U, on_off, &on)) {
        return SIM_USAGE;
    }
    for (unsigned i = 0U; i < chosen.count; i++) {
        call->world->pair.pose.mirrored[chosen.wheel[i]->side] = on;
    }
    return NULL;
}

static result_t set_role(const sim_call_t *call) {
    bool setpoint = false;
    if (!one_of(call, 1U, (sim_choice_t){"setpoint", "limit"}, &setpoint)) {
        return SIM_USAGE;
    }
    chosen_t const chosen = choose(call, BOTH);
    for (unsigned i = 0U; i < chosen.count; i++) {
        sim_motion_advance(&chosen.wheel[i]->motion, call->now_us);
        chosen.wheel[i]->motion.config.current_is_setpoint = setpoint;
    }
    return NULL;
}

static result_t set_pose(const sim_call_t *call) {
    return one_of(call, 1U, (sim_choice_t){"reversed", "normal"}, &call->world->pair.pose_reversed) ? NULL : SIM_USAGE;
}

static result_t set_padding(const sim_call_t *call) {
    return one_of(call, 1U, on_off, &call->world->pair.padded) ? NULL : SIM_USAGE;
}

static result_t set_type(const sim_call_t *call) {
    int64_t type = SIM_TYPE_ANY;
    bool const any = strcmp(call->words->word[1], "any") == 0;
    if (!any && !sim_words_integer(call->words->word[1], (sim_range_t){0, 255}, &type)) {
        return SIM_USAGE;
    }
    chosen_t const chosen = choose(call, BOTH);
    for (unsigned i = 0U; i < chosen.count; i++) {
        chosen.wheel[i]->motion.config.accepted_type = (int16_t)type;
    }
    if (!any) {
        call->world->foreign.setpoint.type = (uint8_t)type;
    }
    return NULL;
}

static result_t set_loss(const sim_call_t *call) {
    int64_t milli_percent = 0;
    if (!sim_words_milli(call->words->word[1], (sim_range_t){0, 100000}, &milli_percent)) {
        return SIM_USAGE;
    }
    chosen_t const chosen = choose(call, BOTH);
    for (unsigned i = 0U; i < chosen.count; i++) {
        chosen.wheel[i]->loss_permille = (uint16_t)(milli_percent / 100);
    }
    return NULL;
}

static result_t set_slow(const sim_call_t *call) {
    int64_t permille = 0;
    if (!sim_words_milli(call->words->word[1], (sim_range_t){100, 1000000}, &permille)) {
        return SIM_USAGE;
    }
    chosen_t const chosen = choose(call, BOTH);
    for (unsigned i = 0U; i < chosen.count; i++) {
        sim_wheel_slow(chosen.wheel[i], (uint32_t)permille);
    }
    return NULL;
}

static result_t set_battery(const sim_call_t *call) {
    int64_t battery_dV = 0;
    if (!sim_words_integer(call->words->word[1], (sim_range_t){0, 255}, &battery_dV)) {
        return SIM_USAGE;
    }
    call->world->pair.battery_dV = (uint8_t)battery_dV;
    return NULL;
}

static result_t set_ambient(const sim_call_t *call) {
    int64_t ambient = 0;
    if (!sim_words_integer(call->words->word[1], (sim_range_t){-40, 255}, &ambient)) {
        return SIM_USAGE;
    }
    chosen_t const chosen = choose(call, BOTH);
    for (unsigned i = 0U; i < chosen.count; i++) {
        chosen.wheel[i]->ambient_degC = (int32_t)ambient;
    }
    return NULL;
}

#define SIDE "left|right|both"

const sim_command_t sim_wheel_commands[] = {
    {"power", "on|off", "both wheels; off: silent, nobody acknowledges, they coast", set_power, 2U, 2U, SIM_CHANGED},
    {"reboot", SIDE, "firmware starts anew: silent 0.4 s, ticks 0, offsets again", reboot, 2U, 2U, SIM_CHANGED},
    {"mute", SIDE, "no telemetry; setpoints are still followed", set_muted, 2U, 2U, SIM_CHANGED},
    {"unmute", SIDE, "telemetry again", set_muted, 2U, 2U, SIM_CHANGED},
    {"block", SIDE, "the wheel cannot turn", set_blocked, 2U, 2U, SIM_CHANGED},
    {"unblock", SIDE, "it can again", set_blocked, 2U, 2U, SIM_CHANGED},
    {"runaway", SIDE " on|off [MM_S]", "faster than told by MM_S (1000)", set_runaway, 3U, 4U, SIM_CHANGED},
    {"sign", SIDE " normal|swapped", "sign of rpm and ticks", set_sign, 3U, 3U, SIM_CHANGED},
    {"load", SIDE " NEWTON", "force on the shaft, sways 5 %; -4000..4000", set_load, 3U, 3U, SIM_CHANGED},
    {"unit", SIDE " cN|dN", "unit of the force frame; document: left cN, right dN", set_unit, 3U, 3U, SIM_CHANGED},
    {"removed", SIDE " on|off", "the force frame has the sensor's zero taken out", set_removed, 3U, 3U, SIM_CHANGED},
    {"zero", SIDE " NEWTON", "the sensor's zero; learnt at the next reboot", set_zero, 3U, 3U, SIM_CHANGED},
    {"raw", SIDE " VALUE|auto", "the force frame carries this; -32768..32767", set_raw, 3U, 3U, SIM_CHANGED},
    {"ticks", SIDE " N", "odometry jumps to N", set_ticks, 3U, 3U, SIM_CHANGED},
    {"gear", SIDE " TURNS [PER]", "rotor turns in PER (1) wheel turns", set_gear, 3U, 4U, SIM_CHANGED},
    {"rpm", SIDE " wheel|rotor", "whose rpm telemetry tells", set_rpm, 3U, 3U, SIM_CHANGED},
    {"radius", SIDE " MM", "the real one; the firmware believes 192", set_radius, 3U, 3U, SIM_CHANGED},
    {"push", SIDE " METRES", "a hand turns the wheel that far, in its own sense; -100..100", push, 3U, 3U, SIM_CHANGED},
    {"turn", "TURNS", "hands turn the machine on the spot, to the left; -20..20", turn, 2U, 2U, SIM_CHANGED},
    {"track", "MM", "the real distance between the wheels, 50..5000 (540)", set_track, 2U, 2U, SIM_CHANGED},
    {"mirror", SIDE " on|off", "mounted mirrored; matters to pose and turn only", set_mirror, 3U, 3U, SIM_CHANGED},
    {"pose", "normal|reversed", "the pose comes least significant byte first", set_pose, 2U, 2U, SIM_CHANGED},
    {"padding", "on|off", "all telemetry is 8 bytes long", set_padding, 2U, 2U, SIM_CHANGED},
    {"role", "limit|setpoint", "what the current beside the speed means", set_role, 2U, 2U, SIM_CHANGED},
    {"type", "any|N", "setpoints of other types are ignored", set_type, 2U, 2U, SIM_CHANGED},
    {"battery", "DECIVOLT", "supply without load, 0..255 (248)", set_battery, 2U, 2U, SIM_CHANGED},
    {"ambient", "DEGC", "temperature around, -40..255 (28)", set_ambient, 2U, 2U, SIM_CHANGED},
    {"loss", "PERCENT", "of telemetry and setpoints is lost", set_loss, 2U, 2U, SIM_CHANGED},
    {"slow", "FACTOR", "telemetry periods (not offset frames) times 0.1..1000", set_slow, 2U, 2U, SIM_CHANGED},
};
const unsigned sim_wheel_command_count = sizeof sim_wheel_commands / sizeof sim_wheel_commands[0];
