// SPDX-License-Identifier: MIT
#include "observe.h"

#include "box/record.h"
#include "clients/event.h"
#include "inspect.h"
#include "snapshot.h"

#include "iwheel_linux/clock.h"
#include "iwheel_northbound/json_out.h"

#include <stdio.h>
#include <string.h>

#define API_VERSION 1

static void tell_state(gw_daemon_t *daemon) {
    iwn_out_t json = gw_event_begin(daemon, "state");
    gw_snapshot_write(daemon, &json);
    gw_event_send(daemon, &json, IWN_TOPIC_STATE);
}

static void observe_state(gw_daemon_t *daemon, bool first) {
    const iw_state_t state = iw_gateway_state(&daemon->gateway);
    if (state == daemon->observed.state && !first) {
        return;
    }
    gw_log(&daemon->log, GW_LOG_INFO, "state: %s", iwn_state_name(state));
    gw_record_state(daemon, first ? state : daemon->observed.state);
    daemon->observed.state = state;
    tell_state(daemon);
}

/// Who asked for it or held the lease, while that is still known.
static void note_client(gw_daemon_t *daemon, iwn_stop_note_t *note, char *out_text, size_t size) {
    const gw_observed_t *observed = &daemon->observed;
    if (note->stop.cause == IW_CAUSE_ESTOP_SOFTWARE) {
        note->stop.client = note->stop.detail;
    }
    const gw_client_t *client = gw_daemon_client(daemon, note->stop.client);
    if (client != NULL) {
        gw_client_describe(client, out_text, size);
        memcpy(note->client_name, client->name, sizeof client->name);
    } else if (note->stop.client == observed->holder && observed->holder != IW_CLIENT_NONE) {
        (void)snprintf(out_text, size, "%s", observed->holder_text);
        memcpy(note->client_name, observed->holder_name, sizeof observed->holder_name);
    } else {
        (void)snprintf(out_text, size, "a client");
    }
}

static void observe_stop(gw_daemon_t *daemon, const iw_stop_t *stop) {
    if (stop->number == daemon->observed.stop_number) {
        return;
    }
    daemon->observed.stop_number = stop->number;
    char who[GW_CLIENT_TEXT_SIZE];
    iwn_stop_note_t *note = &daemon->last_stop;
    *note = (iwn_stop_note_t){.stop = *stop, .wall_us = iw_clock_wall_us()};
    note_client(daemon, note, who, sizeof who);
    const iwn_why_context_t context = {.client = who,
                                       .reason = daemon->estop_reason,
                                       .estop = daemon->config.estop.line,
                                       .bus = daemon->config.bus.interface};
    iwn_why_sentence(&note->stop, &context, note->sentence, sizeof note->sentence);
    gw_log(&daemon->log, GW_LOG_WARNING, "stop %u: %s", (unsigned)stop->number, note->sentence);
    gw_record_stop(daemon);
    iwn_out_t json = gw_event_begin(daemon, "stop");
    iwn_out_int(&json, "t_us", (int64_t)daemon->now_us);
    gw_snapshot_write_stop(daemon, &json);
    gw_event_send(daemon, &json, IWN_TOPIC_STOP);
}

static void observe_lease(gw_daemon_t *daemon, const iw_snapshot_t *seen) {
    gw_observed_t *observed = &daemon->observed;
    const iw_client_t holder = (seen->state == IW_STATE_ARMED) ? seen->holder : IW_CLIENT_NONE;
    if (holder == observed->holder) {
        return;
    }
    const iw_client_t former = observed->holder;
    const gw_client_t *client = gw_daemon_client(daemon, holder);
    const char *change = (holder == IW_CLIENT_NONE) ? "lost" : (former == IW_CLIENT_NONE) ? "gained" : "moved";
    observed->holder = holder;
    if (client != NULL) {
        gw_client_describe(client, observed->holder_text, sizeof observed->holder_text);
        memcpy(observed->holder_name, client->name, sizeof client->name);
    }
    gw_log(&daemon->log, GW_LOG_INFO, "lease %s: %s", change,
           (holder == IW_CLIENT_NONE) ? "nobody" : observed->holder_text);
    iwn_out_t json = gw_event_begin(daemon, "lease");
    iwn_out_int(&json, "t_us", (int64_t)daemon->now_us);
    iwn_out_text(&json, "change", change);
    iwn_out_known(&json, "holder", holder != IW_CLIENT_NONE, holder);
    iwn_out_text(&json, "name", (client != NULL && client->name[0] != '\0') ? client->name : NULL);
    iwn_out_known(&json, "former", former != IW_CLIENT_NONE, former);
    gw_event_send(daemon, &json, IWN_TOPIC_LEASE);
}

static void observe_bus(gw_daemon_t *daemon, iw_bus_state_t bus, bool first) {
    if (bus == daemon->observed.bus && !first) {
        return;
    }
    daemon->observed.bus = bus;
    gw_log(&daemon->log, (bus == IW_BUS_ACTIVE) ? GW_LOG_INFO : GW_LOG_WARNING, "bus %s: %s",
           daemon->config.bus.interface, iwn_bus_state_name(bus));
    iwn_out_t json = gw_event_begin(daemon, "bus");
    iwn_out_int(&json, "t_us", (int64_t)daemon->now_us);
    iwn_out_text(&json, "state", iwn_bus_state_name(bus));
    gw_event_send(daemon, &json, IWN_TOPIC_BUS);
}

static void observe_estop(gw_daemon_t *daemon, bool first) {
    const int answer = daemon->hal.estop_last;
    if (answer == daemon->observed.estop && !first) {
        return;
    }
    daemon->observed.estop = answer;
    const char *name = iwn_estop_name(answer, daemon->hal.estop_ops->present);
    const char *trouble = inspect_estop_trouble(&daemon->hal);
    gw_log(&daemon->log, (answer == 0) ? GW_LOG_INFO : GW_LOG_WARNING, "e-stop %s: %s%s%s", daemon->config.estop.line,
           name, (trouble[0] == '\0') ? "" : ": ", trouble);
    iwn_out_t json = gw_event_begin(daemon, "estop");
    iwn_out_int(&json, "t_us", (int64_t)daemon->now_us);
    iwn_out_text(&json, "state", name);
    gw_event_send(daemon, &json, IWN_TOPIC_ESTOP);
}

static void tell_fault(gw_daemon_t *daemon, const char *cause, bool present) {
    gw_log(&daemon->log, present ? GW_LOG_WARNING : GW_LOG_INFO, "%s: %s", present ? "fault" : "fault gone", cause);
    iwn_out_t json = gw_event_begin(daemon, "fault");
    iwn_out_int(&json, "t_us", (int64_t)daemon->now_us);
    iwn_out_text(&json, "cause", cause);
    iwn_out_bool(&json, "present", present);
    gw_event_send(daemon, &json, IWN_TOPIC_STOP);
}

/// While armed or stopping a cause makes a stop, which is told as such; here are the others.
static void observe_faults(gw_daemon_t *daemon, const iw_snapshot_t *seen) {
    gw_observed_t *observed = &daemon->observed;
    const uint32_t present = seen->present;
    const uint32_t changed = present ^ observed->present;
    for (unsigned cause = 0; cause < IW_CAUSES && changed != 0U; cause++) {
        if ((changed & (1U << cause)) != 0U) {
            tell_fault(daemon, iwn_cause_name((iw_cause_t)cause), (present & (1U << cause)) != 0U);
        }
    }
    observed->present = present;
    if (seen->still_moving != observed->still_moving) {
        observed->still_moving = seen->still_moving;
        tell_fault(daemon, "still_moving", true);
    }
    if (seen->left_behind != observed->left_behind) {
        observed->left_behind = seen->left_behind;
        tell_fault(daemon, "setpoint_left", observed->left_behind);
    }
}

void gw_observe(gw_daemon_t *daemon) {
    const iw_snapshot_t seen = gw_daemon_look(daemon);
    const bool first = !daemon->observed.started;
    daemon->observed.started = true;
    observe_bus(daemon, seen.bus, first);
    observe_estop(daemon, first);
    observe_faults(daemon, &seen);
    observe_stop(daemon, seen.stop);
    observe_lease(daemon, &seen);
    observe_state(daemon, first);
    gw_knowledge_observe(daemon);
    gw_record_again(daemon);
    atomic_store(&daemon->box.ring->sending, gw_daemon_is_sending(daemon));
}

static bool wants_periodic(const gw_client_t *client) {
    return client->id != IW_CLIENT_NONE && !client->closing && !client->ended &&
           (client->topics & ((1U << IWN_TOPIC_STATE) | (1U << IWN_TOPIC_FORCE))) != 0U;
}

/// Written once, for all who are due and watch the topic.
static void send_periodic(gw_daemon_t *daemon, iwn_topic_t topic) {
    size_t length = 0;
    for (uint32_t i = 0; i < GW_CLIENTS_MAX; i++) {
        if (!daemon->client[i].due || (daemon->client[i].topics & (1U << topic)) == 0U) {
            continue;
        }
        if (length == 0U) {
            iwn_out_t json = gw_event_begin(daemon, iwn_topic_name(topic));
            if (topic == IWN_TOPIC_STATE) {
                gw_snapshot_write(daemon, &json);
            } else {
                gw_snapshot_write_force(daemon, &json);
            }
            iwn_out_close(&json, '}');
            length = iwn_out_finish(&json);
        }
        gw_client_event(&daemon->client[i], daemon->line, length);
    }
}

void gw_observe_periodic(gw_daemon_t *daemon) {
    bool any = false;
    for (uint32_t i = 0; i < GW_CLIENTS_MAX; i++) {
        gw_client_t *client = &daemon->client[i];
        client->due = wants_periodic(client) && daemon->now_us >= client->next_us;
        if (client->due) {
            const iw_time_us_t period_us = 1000000U / client->rate_hz;
            client->next_us += period_us;
            if (client->next_us <= daemon->now_us) {
                client->next_us = daemon->now_us + period_us; // After a stall: no burst.
            }
            any = true;
        }
    }
    if (any) {
        send_periodic(daemon, IWN_TOPIC_STATE);
        send_periodic(daemon, IWN_TOPIC_FORCE);
    }
}

iw_time_us_t gw_observe_next_us(const gw_daemon_t *daemon) {
    iw_time_us_t next_us = IW_NEVER;
    for (uint32_t i = 0; i < GW_CLIENTS_MAX; i++) {
        const gw_client_t *client = &daemon->client[i];
        if (wants_periodic(client) && client->next_us < next_us) {
            next_us = client->next_us;
        }
    }
    return next_us;
}

static bool anybody_watches(const gw_daemon_t *daemon, iwn_topic_t topic) {
    for (uint32_t i = 0; i < GW_CLIENTS_MAX; i++) {
        if (daemon->client[i].id != IW_CLIENT_NONE && (daemon->client[i].topics & (1U << topic)) != 0U) {
            return true;
        }
    }
    return false;
}

static void tell_frame(gw_daemon_t *daemon, const gw_tapped_t *tapped) {
    iwn_out_t json = gw_event_begin(daemon, "frame");
    iwn_out_frame(&tapped->frame, tapped->at_us, &json);
    gw_event_send(daemon, &json, IWN_TOPIC_FRAME);
}

void gw_observe_frames(gw_daemon_t *daemon) {
    if (anybody_watches(daemon, IWN_TOPIC_FRAME)) {
        for (uint32_t i = 0; i < daemon->tape.tapped; i++) {
            tell_frame(daemon, &daemon->tape.tap[i]);
        }
    }
    daemon->tape.tapped = 0;
}

void gw_observe_write_hello(const gw_daemon_t *daemon, const gw_client_t *client, iwn_out_t *json) {
    iwn_out_text(json, "name", "iwheel-gateway");
    iwn_out_text(json, "version", IWHEEL_VERSION);
    iwn_out_int(json, "api", API_VERSION);
    iwn_out_text(json, "bus", daemon->config.bus.interface);
    iwn_out_text(json, "state", iwn_state_name(iw_gateway_state(&daemon->gateway)));
    iwn_out_int(json, "client", client->id);
    iwn_out_text(json, "rights", (client->right == GW_DRIVE) ? "drive" : "watch");
}

void gw_observe_hello(gw_daemon_t *daemon, gw_client_t *client) {
    iwn_out_t json = gw_event_begin(daemon, "hello");
    gw_observe_write_hello(daemon, client, &json);
    iwn_out_int(&json, "t_us", (int64_t)daemon->now_us);
    iwn_out_close(&json, '}');
    gw_client_event(client, daemon->line, iwn_out_finish(&json));
}
