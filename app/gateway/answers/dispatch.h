// SPDX-License-Identifier: MIT
/// Carries out a client's requests and answers them.
#ifndef GATEWAY_DISPATCH_H
#define GATEWAY_DISPATCH_H

#include "sockets/client.h"

#include "iwheel/snapshot.h"
#include "iwheel_northbound/request.h"

struct gw_box;
struct gw_clients;
struct gw_knowledge;
struct gw_servant;
struct gw_status;
struct gw_wheels;

/// An e-stop that is asked for again this soon while its latch holds changes nothing.
#define GW_ESTOP_AGAIN_US 100000U

/// What requests act upon.
typedef struct {
    struct gw_wheels *wheels;
    struct gw_knowledge *knowledge;
    struct gw_box *box;
    struct gw_status *status;
    struct gw_clients *clients;
    const char *socket; ///< By which one may drive, and its group, for messages.
    const char *group;
    uint32_t max_age_ms; ///< Of arm, reset and confirm.
    iwn_work_t work;     ///< For reading requests.
} gw_answers_t;

/// One request being carried out.
typedef struct {
    gw_answers_t *answers;
    gw_client_t *client;
    const iwn_request_t *request;
} gw_call_t;

/// What `clients` is to be served by: welcomes with `hello`, carries out each line whole or not at all, and answers it (the reply to
/// `arm` may come later). `self` must outlive it.
struct gw_servant gw_dispatch_servant(gw_answers_t *self);

/// Answers the arms that have been decided by the last step.
void gw_dispatch_arming(gw_answers_t *self, const iw_snapshot_t *seen);

/// A refusal of the core in words: cause and cure, with the numbers of this moment.
///
/// `request` is the one refused.
void gw_refuse_describe(const gw_answers_t *answers, const iwn_request_t *request, iw_refusal_t refusal,
                        iwn_refusal_t *out_refusal);

/// True, with which right it needs and how to have it in `out_refusal`, if a client with that right may not ask for it. Who may only
/// watch may ask for what moves nothing and for what stops.
bool gw_refuse_by_right(const gw_answers_t *answers, gw_right_t right, iwn_cmd_t cmd, iwn_refusal_t *out_refusal);

/// A new key for a lease, of the kernel's random numbers. False: it has none yet, as in the first seconds of some machines.
bool gw_grant_draw_key(char out_key[IWN_LEASE_KEY_MAX + 1U]);

/// Takes the same time wherever they differ.
bool gw_grant_is_same_key(const char a[IWN_LEASE_KEY_MAX + 1U], const char b[IWN_LEASE_KEY_MAX + 1U]);

/// True, with the refusal, if what the request says of its time and its stop keeps it from being carried out.
bool gw_grant_is_late(const gw_answers_t *self, const iwn_request_t *request, iwn_refusal_t *out_refusal);

/// Recordings for clients: passed on to the process that reads them (disk/box_files.h), answered when it answers.
///
/// Nothing waits for it, not even later requests of the same client: a stop behind a slow disk is carried out at once. So a client has
/// one question at a time, and a cycle takes one answer.
///
/// Carries out `recordings` or `recording`: refuses it, or leaves its reply to `gw_recordings_take`.
void gw_recordings_ask(const gw_call_t *call);

/// Passes on what has been read, if anything has. False: the process that reads has ended; who waited for it is told.
bool gw_recordings_take(struct gw_box *box, struct gw_clients *clients);

#endif
