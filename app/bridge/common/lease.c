// SPDX-License-Identifier: MIT
#include "lease.h"

#include <stdio.h>
#include <string.h>

#define PLACES 2U

bool bridge_lease_open(bridge_lease_t *self, const char *socket, int epoll_fd) {
    bool good = true;
    memset(self, 0, sizeof *self);
    for (size_t i = 0; i < PLACES; i++) {
        self->place[i].lease = self;
        good = bridge_line_open(&self->place[i].line, socket, epoll_fd) && good;
    }
    return good;
}

/// Ends the connection of a place, and the lease of the gateway if it was held there. A pending arm is answered with
/// `reply`.
static void set_free(bridge_place_t *place, const iwc_message_t *reply) {
    const bool asked = place->state == BRIDGE_ASKING;
    const bridge_asker_t asker = place->asker;
    if (place->lease->holder == place) {
        place->lease->holder = NULL;
    }
    place->state = BRIDGE_FREE;
    place->asker.answer = NULL;
    place->key[0] = '\0';
    if (asked && asker.answer != NULL) {
        asker.answer(asker.context, reply); // Before the line is dropped, because it contains the reply.
    }
    bridge_line_drop(&place->line, IWC_CLOSED);
}

void bridge_lease_close(bridge_lease_t *self) {
    for (size_t i = 0; i < PLACES; i++) {
        if (self->place[i].line.gateway != NULL) {
            set_free(&self->place[i], NULL);
        }
        bridge_line_close(&self->place[i].line);
    }
}

static void hold(bridge_place_t *place, const iwc_message_t *reply) {
    bridge_lease_t *self = place->lease;
    const bridge_asker_t asker = place->asker;
    place->key_is_gateways =
        iwc_text(reply, "key", place->key, sizeof place->key) && strlen(place->key) == BRIDGE_SECRET_SIZE - 1U;
    if (!place->key_is_gateways && !bridge_secret_draw(place->key)) {
        set_free(place, NULL);
        return;
    }
    if (self->holder != NULL) {
        set_free(self->holder, NULL); // The gateway moved the lease: `takeover` at standstill.
    }
    self->holder = place;
    place->state = BRIDGE_HELD;
    place->asker.answer = NULL;
    if (asker.answer != NULL) {
        asker.answer(asker.context, reply);
    }
}

static void take_armed(void *context, const iwc_message_t *reply) {
    bridge_place_t *place = context;
    if (place->state != BRIDGE_ASKING) {
        return;
    }
    if (reply != NULL && iwc_truth(reply, "ok").value == 1) {
        hold(place, reply);
    } else {
        set_free(place, reply);
    }
}

static bridge_place_t *find_place(bridge_lease_t *self) {
    bridge_place_t *ending = NULL;
    for (size_t i = 0; i < PLACES; i++) {
        if (self->place[i].state == BRIDGE_FREE) {
            return &self->place[i];
        }
        if (self->place[i].state == BRIDGE_ENDING) {
            ending = &self->place[i];
        }
    }
    if (ending != NULL) {
        set_free(ending, NULL);
    }
    return ending;
}

bridge_lease_result_t bridge_lease_arm(bridge_lease_t *self, const char *name, const char *request,
                                       bridge_asker_t asker, uint64_t now_us) {
    for (size_t i = 0; i < PLACES; i++) {
        if (self->place[i].state == BRIDGE_ASKING) {
            return BRIDGE_LEASE_BUSY;
        }
    }
    bridge_place_t *place = find_place(self);
    if (place == NULL) {
        return BRIDGE_LEASE_BUSY;
    }
    if (strlen(request) >= sizeof place->request || !bridge_line_connect(&place->line, now_us)) {
        return BRIDGE_LEASE_AWAY;
    }
    place->state = BRIDGE_ASKING;
    place->asker = asker;
    place->until_us = now_us + BRIDGE_ARM_US;
    (void)snprintf(place->name, sizeof place->name, "%s", name);
    (void)snprintf(place->request, sizeof place->request, "%s", request);
    return BRIDGE_LEASE_OK;
}

/// Sends the arm after the greeting of the gateway.
static void go_on_asking(bridge_place_t *place, uint64_t now_us) {
    (void)bridge_line_greet(&place->line, now_us);
    if (place->line.state == BRIDGE_HERE && place->request[0] != '\0') {
        const bridge_sent_t sent = {0, place->until_us, take_armed, place};
        if (bridge_line_send(&place->line, place->request, &sent) != IWC_OK) {
            set_free(place, NULL);
            return;
        }
        place->request[0] = '\0';
    }
}

const char *bridge_lease_key(const bridge_lease_t *self) {
    return (self->holder != NULL) ? self->holder->key : NULL;
}

const char *bridge_lease_name(const bridge_lease_t *self) {
    return (self->holder != NULL) ? self->holder->name : NULL;
}

bool bridge_lease_is_holder(const bridge_lease_t *self, const char *key) {
    return self->holder != NULL && key != NULL && bridge_secret_is(self->holder->key, key);
}

static void take_driven(void *context, const iwc_message_t *reply) {
    bridge_driven_t *driven = context;
    const bridge_driven_t asked = *driven;
    driven->place = NULL; // Before the call, because the answer may drive again.
    if (asked.asker.answer != NULL) {
        asked.asker.answer(asked.asker.context, reply);
    }
    if (reply != NULL && iwc_is(reply, "error", "not_holder") && asked.place->state == BRIDGE_HELD) {
        set_free(asked.place, NULL);
    }
}

static bridge_driven_t *find_driven(bridge_place_t *place) {
    for (size_t i = 0; i < BRIDGE_LINE_MAX; i++) {
        if (place->driven[i].place == NULL) {
            return &place->driven[i];
        }
    }
    return NULL;
}

bridge_lease_result_t bridge_lease_drive(bridge_lease_t *self, const char *key, const char *request,
                                         bridge_asker_t asker, uint64_t now_us) {
    char with_key[BRIDGE_REQUEST_SIZE];
    bridge_place_t *place = self->holder;
    if (!bridge_lease_is_holder(self, key)) {
        return BRIDGE_LEASE_WRONG;
    }
    const size_t length = strlen(request);
    const int written = place->key_is_gateways ? snprintf(with_key, sizeof with_key, "%.*s,\"key\":\"%s\"}",
                                                          (int)(length - 1U), request, place->key)
                                               : snprintf(with_key, sizeof with_key, "%s", request);
    bridge_driven_t *driven = find_driven(place);
    if (written < 0 || (size_t)written >= sizeof with_key || driven == NULL) {
        return BRIDGE_LEASE_FULL;
    }
    const bridge_sent_t sent = {0, now_us + BRIDGE_DRIVE_US, take_driven, driven};
    const iwc_result_t result = bridge_line_send(&place->line, with_key, &sent);
    if (result == IWC_OK) {
        *driven = (bridge_driven_t){place, asker};
    } else if (result == IWC_CLOSED) {
        set_free(place, NULL);
        return BRIDGE_LEASE_AWAY;
    }
    return (result == IWC_OK) ? BRIDGE_LEASE_OK : BRIDGE_LEASE_FULL;
}

void bridge_lease_end(bridge_lease_t *self, uint64_t now_us) {
    for (size_t i = 0; i < PLACES; i++) {
        bridge_place_t *place = &self->place[i];
        if (place->state == BRIDGE_ASKING) {
            set_free(place, NULL);
        } else if (place->state == BRIDGE_HELD) {
            self->holder = NULL;
            place->state = BRIDGE_ENDING;
            place->until_us = now_us + BRIDGE_ENDING_US;
            place->key[0] = '\0';
        }
    }
}

void bridge_lease_forget(bridge_lease_t *self, const void *context) {
    for (size_t i = 0; i < PLACES; i++) {
        bridge_place_t *place = &self->place[i];
        for (size_t j = 0; j < BRIDGE_LINE_MAX; j++) {
            if (place->driven[j].asker.context == context) {
                place->driven[j].asker.answer = NULL;
            }
        }
        if (place->state == BRIDGE_ASKING && place->asker.context == context) {
            place->asker.answer = NULL;
            set_free(place, NULL);
        }
    }
}

static void step_place(bridge_place_t *place, uint64_t now_us) {
    iwc_message_t event;
    if (place->state == BRIDGE_ASKING) {
        go_on_asking(place, now_us);
    }
    while (bridge_line_next(&place->line, &event)) {
        // This connection watches nothing.
    }
    (void)bridge_line_expire(&place->line, now_us);
    const bool over = (place->state == BRIDGE_ASKING || place->state == BRIDGE_ENDING) && now_us >= place->until_us;
    if (place->state != BRIDGE_FREE && (over || place->line.state == BRIDGE_AWAY)) {
        set_free(place, NULL);
    }
}

void bridge_lease_step(bridge_lease_t *self, uint64_t now_us) {
    for (size_t i = 0; i < PLACES; i++) {
        step_place(&self->place[i], now_us);
    }
}

uint64_t bridge_lease_next_us(const bridge_lease_t *self, uint64_t now_us) {
    uint64_t next_us = UINT64_MAX;
    for (size_t i = 0; i < PLACES; i++) {
        const bridge_place_t *place = &self->place[i];
        if (place->state == BRIDGE_FREE) {
            continue;
        }
        const uint64_t line_us = bridge_line_next_us(&place->line, now_us);
        if (line_us < next_us) {
            next_us = line_us;
        }
        if (place->state != BRIDGE_HELD && place->until_us < next_us) {
            next_us = place->until_us;
        }
    }
    return next_us;
}

void bridge_movers_note(bridge_movers_t *self, const char *name, uint64_t now_us) {
    size_t at = 0;
    for (size_t i = 0; i < BRIDGE_MOVERS_MAX; i++) {
        if (self->source[i].us != 0U && strncmp(self->source[i].name, name, BRIDGE_NAME_SIZE - 1U) == 0) {
            at = i;
            break;
        }
        if (self->source[i].us < self->source[at].us) {
            at = i; // The oldest entry.
        }
    }
    (void)snprintf(self->source[at].name, sizeof self->source[at].name, "%s", name);
    self->source[at].us = now_us;
}

const char *bridge_movers_who(const bridge_movers_t *self, const char *except, uint32_t lease_ms, uint64_t now_us) {
    const uint64_t lease_us = (uint64_t)lease_ms * 1000U;
    const uint64_t quiet_us = (lease_us > BRIDGE_MOVER_US) ? lease_us : BRIDGE_MOVER_US;
    for (size_t i = 0; i < BRIDGE_MOVERS_MAX; i++) {
        if (self->source[i].us != 0U && now_us - self->source[i].us < quiet_us &&
            (except == NULL || strcmp(self->source[i].name, except) != 0)) {
            return self->source[i].name;
        }
    }
    return NULL;
}
