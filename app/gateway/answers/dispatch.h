// SPDX-License-Identifier: MIT
/// Carries out a client's requests and answers them.
#ifndef GATEWAY_DISPATCH_H
#define GATEWAY_DISPATCH_H

#include "iwheel/snapshot.h"
#include "iwheel_northbound/request.h"

struct gw_box;
struct gw_client;
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
    iwn_work_t work; ///< For reading requests.
} gw_answers_t;

/// One request being carried out.
typedef struct {
    gw_answers_t *answers;
    struct gw_client *client;
    const iwn_request_t *request;
} gw_call_t;

/// What `clients` is to be served by: welcomes with `hello`, carries out each line whole or not at all, and answers it (the reply to
/// `arm` may come later). `self` must outlive it.
struct gw_servant gw_dispatch_servant(gw_answers_t *self);

/// Answers the arms that have been decided by the last step.
void gw_dispatch_arming(gw_answers_t *self, const iw_snapshot_t *seen);

#endif
