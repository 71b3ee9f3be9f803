// SPDX-License-Identifier: MIT
/// Interface between the parts of the rig: the port (port.c), the clients (clients.c) and the run itself (rig.c).
#ifndef SIM_TEST_RIG_PARTS_H
#define SIM_TEST_RIG_PARTS_H

#include "iwheel_sim/world.h"
#include "rig.h"

#define RIG_RX_MAX    2048U
#define RIG_TX_MAX    64U
#define RIG_QUEUE_MAX 64U

typedef struct {
    iw_can_frame_t frame;
    iw_time_us_t at_us; ///< Time of its delivery to the gateway or to the bus.
    iw_time_us_t handed_us;
} held_t;

/// A client's program. Its modes are the kinds of event that start them.
typedef struct {
    iw_client_t id;
    uint8_t mode; ///< EV_KINDS: idle.
    uint8_t style;
    iw_time_us_t until_us;
    iw_time_us_t next_us;
    int32_t a;
    int32_t b;
} client_t;

/// A request that waits for a stopped process.
typedef struct {
    uint8_t kind;
    iw_client_t id;
    int32_t a;
    int32_t b;
} request_t;

typedef struct {
    const scenario_t *scenario;
    sim_world_t world;
    iw_gateway_t gateway;
    oracle_t oracle;
    rig_result_t *result;
    sim_random_t random;
    iw_time_us_t trace_from_us;
    iw_time_us_t now_us;
    iw_time_us_t wake_us;
    iw_time_us_t promised_us;
    iw_time_us_t fault_until_us[EV_KINDS]; ///< 0: not active.
    event_t fault[EV_KINDS];
    iw_time_us_t fault_end_us; ///< The earliest end.
    held_t rx[RIG_RX_MAX];
    held_t tx[RIG_TX_MAX];         ///< Frames that the adapter delays.
    iw_time_us_t sent[RIG_TX_MAX]; ///< Times when the frames in the controller's queue were passed to it.
    uint32_t rx_first, rx_count, tx_first, tx_count, sent_first, sent_count;
    client_t client[SCENARIO_CLIENTS];
    iw_client_t next_client;
    request_t queue[RIG_QUEUE_MAX];
    uint32_t queued;
    uint32_t tx_lost;
    uint32_t echo_lost;
    uint8_t port;
    bool alive;
    bool edge;
    iw_estop_pair_t pair;    ///< The port's logic for two contacts.
    iw_time_us_t contact_us; ///< Time of the last change of the first contact.
    bool contact_was;
    bool second_contact;
    bool clearing;
    bool bus_lost;
    uint32_t stops_seen;
    iw_state_t state_seen;
} rig_t;

bool rig_traces(const rig_t *rig);
void rig_wake(rig_t *rig, iw_time_us_t at_us);
bool rig_active(const rig_t *rig, unsigned kind);
void rig_hash(rig_t *rig, uint64_t value);

/// port.c
iw_hal_t port_hal(rig_t *rig);
void port_deliver(rig_t *rig, const sim_delivery_t *delivery);
void port_release(rig_t *rig);
void port_lose_bus(rig_t *rig);
void port_restart(rig_t *rig);
iw_time_us_t port_next_us(const rig_t *rig);

/// clients.c
void clients_init(rig_t *rig);
void clients_start(rig_t *rig, const event_t *event);
void clients_step(rig_t *rig);
void clients_all_gone(rig_t *rig);
void clients_run_queue(rig_t *rig);
void client_request(rig_t *rig, const request_t *request);
iw_time_us_t clients_next_us(const rig_t *rig);

#endif
