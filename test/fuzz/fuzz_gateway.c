// SPDX-License-Identifier: MIT
// A gateway in a world that the bytes control completely: times, frames, false echoes, bus, button, requests, assumptions. In every
// world only setpoints within the limits are sent, and after a cut only zero until arm and a drive were accepted.
#include "fuzz_sequence.h"

#include "../support/message.h"
#include "iwheel/gateway.h"

#define RX_MAX 16U

typedef struct {
    iw_gateway_t gateway;
    iw_config_t config;
    iw_time_us_t now_us;
    iw_can_frame_t rx[RX_MAX];
    uint32_t received;
    iw_bus_state_t bus;
    int estop;
    uint32_t accepts; ///< Accepted frames of one call.
    bool purges;
    bool cut;
    bool arm_after_cut;
    bool moved;
} world_t;

static int32_t word_at(const uint8_t *bytes) {
    return (int16_t)(bytes[0] << 8 | bytes[1]);
}

static bool judge_setpoint(world_t *world, const iw_can_frame_t *frame) {
    const iw_config_t *const config = &world->config;
    const int32_t speed = word_at(&frame->data[1]);
    const int32_t current = word_at(&frame->data[3]);
    const bool zero = speed == 0 && (config->current_role == IW_ROLE_LIMIT || current == 0);
    fuzz_require(frame->id == IW_ID_LEFT_SETPOINT || frame->id == IW_ID_RIGHT_SETPOINT, "only setpoints leave");
    fuzz_require(frame->dlc == config->setpoint_dlc && frame->data[0] == config->setpoint_type, "as configured");
    fuzz_require(abs(speed) <= config->max_speed_mm_s && abs(current) <= config->max_current_mA, "within the limits");
    fuzz_require(zero || !world->cut, "only zero until a new arm and command");
    fuzz_require(world->bus >= IW_BUS_PASSIVE, "nothing leaves while the bus is down");
    fuzz_require(zero || config->track_mm != 0U, "no wheel moves while the track is not set");
    fuzz_require(!config->listen_only, "nothing leaves in listen-only");
    world->moved = world->moved || !zero;
    return zero;
}

/// Motion is sent to both wheels in one call, the left one first. Some worlds have a port that accepts only one of two frames.
static int world_send(void *context, const iw_can_frame_t *frames, uint32_t count) {
    world_t *const world = context;
    const bool pair = count == 2U && frames[0].id == IW_ID_LEFT_SETPOINT && frames[1].id == IW_ID_RIGHT_SETPOINT;
    fuzz_require(pair || count == 1U, "one frame, or the left one and the right one");
    for (uint32_t i = 0; i < count; i++) {
        fuzz_require(judge_setpoint(world, &frames[i]) || pair, "no wheel moves without the other");
    }
    return (int)((count < world->accepts) ? count : world->accepts);
}

static void cut(world_t *world) {
    world->cut = true;
    world->arm_after_cut = false;
}

static int world_receive(void *context, iw_can_frame_t *out_frame) {
    world_t *const world = context;
    if (world->received == 0U) {
        return 0;
    }
    *out_frame = world->rx[0];
    world->received--;
    memmove(&world->rx[0], &world->rx[1], world->received * sizeof world->rx[0]);
    if ((out_frame->id == 266U || out_frame->id == 298U) && out_frame->kind != IW_CAN_ECHO) {
        cut(world);
    }
    return 1;
}

static iw_bus_state_t world_bus(void *context) {
    world_t *const world = context;
    if (world->bus < IW_BUS_PASSIVE) {
        cut(world);
    }
    return world->bus;
}

static int world_purge(void *context) {
    const world_t *const world = context;
    return world->purges ? 1 : 0;
}

static int world_estop(void *context) {
    world_t *const world = context;
    if (world->estop != 0) {
        cut(world);
    }
    return world->estop;
}

static void begin(world_t *world, fuzz_bytes_t *bytes) {
    const iw_hal_t hal = {world_send, world_receive, world_bus, world_purge, world_estop, world};
    const uint8_t flags = fuzz_byte(bytes);
    memset(world, 0, sizeof *world);
    iw_config_default(&world->config);
    world->config.setpoint_type_set = (flags & 1U) == 0U;
    world->config.setpoint_type = fuzz_byte(bytes);
    world->config.current_role = (flags & 2U) ? IW_ROLE_SETPOINT : IW_ROLE_LIMIT;
    world->config.invert[IW_RIGHT] = (flags & 4U) != 0U;
    world->config.track_mm = ((flags & 0x60U) == 0x60U) ? 0U : 540U;
    world->config.listen_only = (flags & 0x18U) == 0x18U;
    world->config.period_ms = (uint16_t)(5U + fuzz_byte(bytes) % 60U);
    world->config.rest_ms = 50;
    world->bus = IW_BUS_ACTIVE;
    world->accepts = IW_SIDES;
    world->cut = true;
    world->now_us = 1000;
    if (iw_gateway_init(&world->gateway, &world->config, &hal, world->now_us, (flags & 0x20U) != 0U) != IW_CONFIG_OK) {
        world->config.period_ms = 20;
        (void)iw_gateway_init(&world->gateway, &world->config, &hal, world->now_us, false);
    }
}

static void put(world_t *world, const iw_can_frame_t *frame) {
    if (world->received < RX_MAX) {
        world->rx[world->received++] = *frame;
    }
}

/// Speeds of both wheels, as correct wheels send them.
static void put_telemetry(world_t *world, int16_t rpm) {
    for (int side = 0; side < IW_SIDES; side++) {
        const message_t message = {IW_CODEC_SPEED, (iw_side_t)side, {.speed = {rpm, 0}}};
        iw_can_frame_t frame;
        (void)message_encode(&message, &frame);
        put(world, &frame);
    }
}

/// The echo that the gateway waits for, or the same with a wrong byte.
static void put_echo(world_t *world, iw_side_t side, uint8_t wrong) {
    const uint32_t value = world->gateway.sender.confirmation.value[side][0];
    iw_can_frame_t frame = {.id = (side == IW_LEFT) ? 266U : 298U, .dlc = 5, .kind = IW_CAN_ECHO};
    for (unsigned i = 0; i < 4U; i++) {
        frame.data[1U + i] = (uint8_t)(value >> (24U - 8U * i));
    }
    frame.data[4] ^= wrong;
    put(world, &frame);
}

static void put_any(world_t *world, fuzz_bytes_t *bytes) {
    static const uint16_t ids[] = {266, 298, 257, 289, 290, 512, 544, 513, 545, 600, 256, 288};
    iw_can_frame_t frame = {.id = ids[fuzz_byte(bytes) % (sizeof ids / sizeof ids[0])]};
    const uint8_t format = fuzz_byte(bytes);
    frame.id |= ((format & 0xF0U) == 0xF0U) ? (uint32_t)format << 28 : 0U;
    frame.dlc = format % 9U;
    for (size_t i = 0; i < IW_CAN_DATA_MAX; i++) {
        frame.data[i] = fuzz_byte(bytes);
    }
    put(world, &frame);
}

static void drive(world_t *world, fuzz_bytes_t *bytes, iw_client_t client) {
    iw_drive_t request = {.has_current = world->config.current_role == IW_ROLE_SETPOINT};
    iw_applied_t applied;
    const uint8_t scale = fuzz_byte(bytes);
    for (size_t side = 0; side < IW_SIDES; side++) {
        request.speed_mm_s[side] = (int16_t)fuzz_word(bytes) * ((scale > 250U) ? 60000 : 1) / ((scale < 200U) ? 30 : 1);
        request.current_mA[side] = (int8_t)fuzz_byte(bytes) * 16;
    }
    const iw_time_us_t sent_us = world->now_us - ((scale & 1U) ? world->now_us % 1000U : 0U);
    if (iw_gateway_drive(&world->gateway, sent_us, client, &request, &applied) == IW_REFUSE_NONE) {
        fuzz_require(abs(applied.pair.wheel[0].speed_mm_s) <= world->config.max_speed_mm_s,
                     "applied is within the limits");
        world->cut = world->cut && !world->arm_after_cut;
    }
}

static void ask(world_t *world, fuzz_bytes_t *bytes, uint8_t what) {
    const iw_client_t client = 1U + what % 2U;
    const bool latched = iw_gateway_state(&world->gateway) == IW_STATE_LATCHED;
    switch (what / 2U % 7U) {
    case 0:
    case 1:
        drive(world, bytes, client);
        break;
    case 2:
        world->arm_after_cut =
            iw_gateway_arm(&world->gateway, world->now_us, client, (what & 0x80U) != 0U) == IW_REFUSE_NONE ||
            world->arm_after_cut;
        break;
    case 3:
        if (iw_gateway_reset(&world->gateway, world->now_us) == IW_REFUSE_NONE && latched) {
            world->arm_after_cut = false;
        }
        break;
    case 4:
        iw_gateway_stop(&world->gateway, world->now_us, client, IW_CAUSE_CLIENT_STOP);
        break;
    case 5:
        iw_gateway_estop(&world->gateway, world->now_us, client);
        cut(world);
        break;
    default:
        iw_gateway_disconnect(&world->gateway, world->now_us, client);
        break;
    }
}

static void step(world_t *world, uint32_t after_us) {
    world->now_us += after_us;
    const iw_time_us_t next_us = iw_gateway_step(&world->gateway, world->now_us);
    fuzz_require(next_us >= world->now_us && next_us <= world->now_us + 60000U, "it wants to be called in time");
    fuzz_require(world->gateway.sender.envelope.stopped == 0U && world->gateway.sender.sent.clamped == 0U,
                 "the gate has nothing to stop");
}

/// Runs some milliseconds with correct wheels, so that a few bytes lead to motion.
static void calm(world_t *world, uint8_t steps) {
    for (unsigned i = 0; i < steps % 64U; i++) {
        put_telemetry(world, 0);
        for (int side = 0; side < IW_SIDES; side++) {
            for (uint8_t pending = world->gateway.sender.confirmation.pending[side]; pending > 0U; pending--) {
                put_echo(world, (iw_side_t)side, 0);
            }
        }
        step(world, 5000);
    }
}

/// Wheels at standstill for a while with a load on them, so that a window of forces ends.
static void weigh(world_t *world, int8_t load) {
    for (unsigned i = 0; i < 45U; i++) {
        for (int side = 0; side < IW_SIDES; side++) {
            const message_t message = {IW_CODEC_FORCE, (iw_side_t)side, {.force = {.force_raw = (int16_t)(load * 16)}}};
            iw_can_frame_t frame;
            (void)message_encode(&message, &frame);
            put(world, &frame);
        }
        calm(world, 10);
    }
}

/// Input of the port and the operator, and a snapshot.
static void learn(world_t *world, fuzz_bytes_t *bytes, uint8_t what) {
    const uint8_t value = fuzz_byte(bytes);
    const iw_bus_facts_t facts = {(value & 1U) != 0U, (value & 2U) != 0U};
    const iw_assumption_entry_t entry = {(iw_assumption_state_t)(what / 8U % 3U), (iw_source_t)(what % 4U),
                                         (int8_t)value * 99};
    iw_snapshot_t seen;
    iw_side_t side;
    switch (what % 5U) {
    case 0:
        weigh(world, (int8_t)value);
        break;
    case 1:
        (void)iw_gateway_tare(&world->gateway, world->now_us, value % 4U, &side);
        break;
    case 2:
        iw_gateway_restore_offset(&world->gateway, (iw_side_t)(value & 1U), (iw_offset_provenance_t)(value / 2U % 5U),
                                  (int8_t)value * 3000);
        break;
    case 3:
        iw_gateway_set_assumption(&world->gateway, (iw_assumption_item_t)(value % IW_ASSUMPTION_ITEMS), &entry);
        break;
    default:
        iw_gateway_bus_facts(&world->gateway, &facts);
        break;
    }
    iw_gateway_snapshot(&world->gateway, world->now_us, &seen);
    fuzz_require(seen.state == iw_gateway_state(&world->gateway), "the snapshot has the state of the gateway");
}

static void act(world_t *world, fuzz_bytes_t *bytes) {
    const uint8_t what = fuzz_byte(bytes);
    const uint8_t value = fuzz_byte(bytes);
    switch (what % 12U) {
    case 0:
    case 1:
        calm(world, value);
        break;
    case 2:
        step(world, value * 100U);
        break;
    case 3:
        step(world, (uint32_t)value * value * 20U);
        break;
    case 4:
        put_telemetry(world, (int16_t)((int8_t)value));
        break;
    case 5:
        put_echo(world, (iw_side_t)(value & 1U), value & 0x10U);
        break;
    case 6:
        put_any(world, bytes);
        break;
    case 7:
        world->bus = (value > 200U) ? (iw_bus_state_t)(value % 4U) : IW_BUS_ACTIVE;
        world->accepts = ((value & 7U) >= 6U) ? 7U - (value & 7U) : IW_SIDES;
        world->purges = (value & 8U) != 0U;
        break;
    case 8:
        world->estop = (value > 128U) ? 0 : (int)(value % 3U) - 1;
        break;
    case 9:
        if (value < 200U) {
            iw_gateway_suspended(&world->gateway, value * 10000U);
        } else {
            learn(world, bytes, value);
        }
        break;
    default:
        ask(world, bytes, value);
        break;
    }
}

/// The units of `act`; the first three bytes are those of `begin`, and as a unit they are harmless.
static size_t fuzz_unit(const uint8_t *data, size_t size) {
    size_t length = 2;
    if (data[0] % 12U == 6U) {
        length += 2U + IW_CAN_DATA_MAX;
    } else if (data[0] % 12U == 9U && size > 1U && data[1] >= 200U) {
        length++;
    } else if (data[0] % 12U > 9U && size > 1U && data[1] / 2U % 7U < 2U) {
        length += 1U + 3U * IW_SIDES;
    }
    return (length < size) ? length : size;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    static world_t world;
    fuzz_bytes_t bytes = {data, size, 0};
    begin(&world, &bytes);
    while (bytes.at < bytes.size) {
        act(&world, &bytes);
    }
    calm(&world, 20);
    fuzz_position(world.moved ? "accepted" : "refused");
    return 0;
}
