// SPDX-License-Identifier: MIT
#include "rig_parts.h"

#include <stdlib.h>
#include <string.h>

#define MS 1000U
/// A rule of this file: a refused request changes nothing that it must not change.
#define RULE_REFUSED 901U
/// A rule of this file: no arm while an assumption that motion depends on is contradicted.
#define RULE_CONTRADICTED 324U
#define POISON            0x5A

static bool can_run(const rig_t *rig) {
    return rig->alive && !rig_active(rig, EV_LOOP_STALL);
}

/// A refused request may change only the record of refusals.
static void judge_refused(rig_t *rig, const iw_gateway_t *before) {
    iw_gateway_t after = rig->gateway;
    after.permit.stale_us = before->permit.stale_us;
    after.permit.stale_client = before->permit.stale_client;
    after.counters.out_of_range = before->counters.out_of_range;
    if (memcmp(&after, before, sizeof after) != 0) {
        oracle_fail(&rig->oracle, rig->now_us, RULE_REFUSED, "a refused request changed something");
    }
}

static void note_result(rig_t *rig, const request_t *request, iw_refusal_t result) {
    rig->result->stats.requests++;
    rig->result->stats.refused[result]++;
    rig_hash(rig, ((uint64_t)request->kind << 32) ^ ((uint64_t)request->id << 8) ^ (uint64_t)result);
    if (rig_traces(rig)) {
        printf("  %11.6f s    client %u: %s (%d, %d): %s\n", (double)rig->now_us / 1e6, request->id,
               scenario_kind_name(request->kind), request->a, request->b, rig_refusal_name(result));
    }
}

static int32_t current_for(const rig_t *rig, int32_t speed) {
    const int32_t full = rig->scenario->config.max_current_mA;
    return (speed == 0) ? 0 : ((speed > 0) ? full : -full);
}

static iw_drive_t drive_of(const rig_t *rig, const request_t *request) {
    iw_drive_t drive = {{request->a, request->b}, {0, 0}, false};
    // Every third command of 400 ms has its own limits, every second of those unequal ones: from zero to the maximum.
    const uint32_t turn = (uint32_t)(rig->now_us / (400U * MS)) + request->id;
    if (rig->scenario->config.current_role == IW_ROLE_LIMIT) {
        drive.has_current = turn % 3U == 0U;
        drive.current_mA[IW_LEFT] = (int32_t)(turn * 523U % 2001U);
        drive.current_mA[IW_RIGHT] = (turn % 2U == 0U) ? drive.current_mA[IW_LEFT] : (int32_t)(turn * 787U % 2001U);
    }
    if (rig->scenario->config.current_role == IW_ROLE_SETPOINT) {
        drive.has_current = true;
        drive.current_mA[IW_LEFT] = current_for(rig, request->a);
        drive.current_mA[IW_RIGHT] = current_for(rig, request->b);
    }
    return drive;
}

static void request_drive(rig_t *rig, const request_t *request, const iw_gateway_t *before) {
    const iw_drive_t drive = drive_of(rig, request);
    iw_applied_t applied;
    iw_applied_t untouched;
    memset(&applied, POISON, sizeof applied);
    untouched = applied;
    const iw_refusal_t result = iw_gateway_drive(&rig->gateway, rig->now_us, request->id, &drive, &applied);
    note_result(rig, request, result);
    if (result != IW_REFUSE_NONE) {
        judge_refused(rig, before);
        if (memcmp(&applied, &untouched, sizeof applied) != 0) {
            oracle_fail(&rig->oracle, rig->now_us, RULE_REFUSED, "a refused drive wrote its answer");
        }
    } else {
        rig->result->stats.drives++;
    }
    const oracle_asked_t asked = {rig->now_us, rig->now_us, request->id};
    oracle_drive(&rig->oracle, &asked, &drive, result, &applied);
}

/// True if an assumption that motion depends on is contradicted: type, role or a sign.
static bool is_contradicted(const iw_gateway_t *gateway) {
    static const iw_assumption_item_t guards[] = {IW_ASSUMPTION_SETPOINT_TYPE,      IW_ASSUMPTION_CURRENT_ROLE,
                                                  IW_ASSUMPTION_FEEDBACK_SIGN_LEFT, IW_ASSUMPTION_FEEDBACK_SIGN_RIGHT,
                                                  IW_ASSUMPTION_MOUNT_SIGN_LEFT,    IW_ASSUMPTION_MOUNT_SIGN_RIGHT};
    for (size_t i = 0; i < sizeof guards / sizeof guards[0]; i++) {
        if (gateway->assumptions.entry[guards[i]].state == IW_CONTRADICTED) {
            return true;
        }
    }
    return false;
}

/// The operator checks the machine and confirms the configuration.
static void settle_assumption(rig_t *rig) {
    const iw_assumption_entry_t word = {IW_CONFIRMED, IW_SOURCE_OPERATOR, 0};
    iw_gateway_set_assumption(&rig->gateway, rig->gateway.assumptions.doubt, &word);
}

static void request_arm(rig_t *rig, const request_t *request, const iw_gateway_t *before) {
    const iw_refusal_t result = iw_gateway_arm(&rig->gateway, rig->now_us, request->id, request->a != 0);
    note_result(rig, request, result);
    if (result != IW_REFUSE_NONE) {
        judge_refused(rig, before);
    } else if (is_contradicted(before)) {
        oracle_fail(&rig->oracle, rig->now_us, RULE_CONTRADICTED, "armed although an assumption is contradicted");
    }
    if (result == IW_REFUSE_CONTRADICTED) {
        settle_assumption(rig);
    }
    oracle_arm(&rig->oracle, rig->now_us, request->id, request->a != 0, result);
}

static void request_reset(rig_t *rig, const request_t *request, const iw_gateway_t *before) {
    const iw_refusal_t result = iw_gateway_reset(&rig->gateway, rig->now_us);
    note_result(rig, request, result);
    if (result != IW_REFUSE_NONE) {
        judge_refused(rig, before);
    }
    oracle_reset(&rig->oracle, rig->now_us, iw_permit_state(&before->permit), &before->permit.stop);
}

static void request_release(rig_t *rig, const request_t *request, const iw_gateway_t *before) {
    const iw_refusal_t result = iw_gateway_release(&rig->gateway);
    note_result(rig, request, result);
    if (result != IW_REFUSE_NONE) {
        judge_refused(rig, before);
    }
    oracle_release(&rig->oracle, rig->now_us, result);
}

static void run_request(rig_t *rig, const request_t *request) {
    iw_side_t refused;
    const iw_gateway_t before = rig->gateway;
    switch (request->kind) {
    case EV_ONE_DRIVE:
        request_drive(rig, request, &before);
        break;
    case EV_ONE_ARM:
        request_arm(rig, request, &before);
        break;
    case EV_ONE_RESET:
        request_reset(rig, request, &before);
        break;
    case EV_ONE_RELEASE:
        request_release(rig, request, &before);
        break;
    case EV_ONE_STOP:
        note_result(rig, request, IW_REFUSE_NONE);
        if (request->b != 0) {
            oracle_shutdown(&rig->oracle, rig->now_us);
        }
        iw_gateway_stop(&rig->gateway, rig->now_us, request->id,
                        (request->b != 0) ? IW_CAUSE_SHUTDOWN : IW_CAUSE_CLIENT_STOP);
        oracle_stop(&rig->oracle, rig->now_us, true);
        break;
    case EV_ONE_ESTOP:
        note_result(rig, request, IW_REFUSE_NONE);
        iw_gateway_estop(&rig->gateway, rig->now_us, request->id);
        oracle_soft_estop(&rig->oracle, rig->now_us);
        break;
    case EV_DISCONNECT:
        note_result(rig, request, IW_REFUSE_NONE);
        iw_gateway_disconnect(&rig->gateway, rig->now_us, request->id);
        oracle_stop(&rig->oracle, rig->now_us,
                    request->id == rig->oracle.holder || request->id == rig->oracle.pending_arm);
        break;
    default:
        (void)iw_gateway_tare(&rig->gateway, rig->now_us, (request->a != 0) ? IW_SIDES_RIGHT : IW_SIDES_LEFT, &refused);
        break;
    }
    rig_wake(rig, rig->now_us);
}

/// Makes the request immediately, or when the process runs again.
void client_request(rig_t *rig, const request_t *request) {
    if (can_run(rig)) {
        run_request(rig, request);
    } else if (rig->alive && rig->queued < RIG_QUEUE_MAX) {
        rig->queue[rig->queued++] = *request;
    }
}

void clients_run_queue(rig_t *rig) {
    for (uint32_t i = 0; i < rig->queued; i++) {
        run_request(rig, &rig->queue[i]);
    }
    rig->queued = 0;
}

void clients_init(rig_t *rig) {
    for (size_t i = 0; i < SCENARIO_CLIENTS; i++) {
        rig->client[i] = (client_t){.id = ++rig->next_client, .mode = EV_KINDS, .next_us = IW_NEVER};
    }
}

static void ask(rig_t *rig, const client_t *client, uint8_t kind, int32_t a, int32_t b) {
    const request_t request = {kind, client->id, a, b};
    client_request(rig, &request);
}

static void disconnect(rig_t *rig, client_t *client) {
    ask(rig, client, EV_DISCONNECT, 0, 0);
    client->id = ++rig->next_client;
    client->mode = EV_KINDS;
    client->next_us = IW_NEVER;
}

void clients_all_gone(rig_t *rig) {
    for (size_t i = 0; i < SCENARIO_CLIENTS; i++) {
        disconnect(rig, &rig->client[i]);
    }
}

void clients_start(rig_t *rig, const event_t *event) {
    client_t *const client = &rig->client[event->who % SCENARIO_CLIENTS];
    switch (event->kind) {
    case EV_DISCONNECT:
        disconnect(rig, client);
        break;
    case EV_GOOD_CLIENT:
    case EV_BLIND:
    case EV_FIGHT:
    case EV_RESETS:
        client->mode = event->kind;
        client->style = event->style;
        client->a = event->a;
        client->b = event->b;
        client->until_us = rig->now_us + event->span_us;
        client->next_us = rig->now_us;
        break;
    case EV_TARE:
        ask(rig, client, EV_TARE, event->who, 0);
        break;
    default:
        ask(rig, client, event->kind, event->a, event->b);
        break;
    }
}

/// The current command: it changes at times by reversing, halving, stopping or holding.
static void config(const rig_t *rig, const client_t *client, int32_t *out_a, int32_t *out_b) {
    static const int8_t quarters[8] = {4, 4, -4, 2, 0, 4, -2, 4};
    const uint64_t turn = rig->now_us / (700U * MS);
    const int8_t share = (client->style & 4U) ? quarters[(turn + client->style) % 8U] : 4;
    *out_a = client->a * share / 4;
    *out_b = (client->style & 8U) ? client->a * share / 4 : client->b * share / 4;
}

/// A client that knows the state and the holder from its replies and events.
static void drive_well(rig_t *rig, const client_t *client) {
    const iw_state_t state = iw_gateway_state(&rig->gateway);
    int32_t a;
    int32_t b;
    if (state == IW_STATE_LATCHED) {
        ask(rig, client, EV_ONE_RESET, 0, 0);
    } else if (state == IW_STATE_ARMED && rig->gateway.permit.holder == client->id) {
        config(rig, client, &a, &b);
        ask(rig, client, EV_ONE_DRIVE, a, b);
    } else if (!iw_gateway_arming(&rig->gateway)) {
        ask(rig, client, EV_ONE_ARM, (client->style & 16U) != 0U, 0);
    }
}

static void end_program(rig_t *rig, client_t *client) {
    const bool drives = client->mode == EV_GOOD_CLIENT;
    client->mode = EV_KINDS;
    client->next_us = IW_NEVER;
    if (drives && (client->style & 3U) == 0U) {
        disconnect(rig, client);
    } else if (drives && (client->style & 3U) == 1U) {
        ask(rig, client, EV_ONE_STOP, 0, 0);
    }
}

static void step_client(rig_t *rig, client_t *client) {
    const uint32_t period_us = (10U + client->style % 60U) * MS;
    if (rig->now_us >= client->until_us) {
        end_program(rig, client);
        return;
    }
    client->next_us = rig->now_us + period_us;
    switch (client->mode) {
    case EV_GOOD_CLIENT:
        drive_well(rig, client);
        break;
    case EV_BLIND:
        ask(rig, client, EV_ONE_DRIVE, client->a, client->b);
        break;
    case EV_FIGHT:
        ask(rig, client, EV_ONE_ARM, 1, 0);
        break;
    default:
        ask(rig, client, EV_ONE_RESET, 0, 0);
        break;
    }
}

void clients_step(rig_t *rig) {
    for (size_t i = 0; i < SCENARIO_CLIENTS; i++) {
        if (rig->client[i].next_us <= rig->now_us) {
            step_client(rig, &rig->client[i]);
        }
    }
}

iw_time_us_t clients_next_us(const rig_t *rig) {
    iw_time_us_t next_us = IW_NEVER;
    for (size_t i = 0; i < SCENARIO_CLIENTS; i++) {
        next_us = (rig->client[i].next_us < next_us) ? rig->client[i].next_us : next_us;
    }
    return next_us;
}
