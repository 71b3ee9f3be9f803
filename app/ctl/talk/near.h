// SPDX-License-Identifier: MIT
/// A gateway that may be there or not: looked for without a word, for verbs that also work without one.
#ifndef NEAR_H
#define NEAR_H

#include "ctl.h"

typedef enum {
    NEAR_NONE = 0, ///< Nobody there.
    NEAR_FOUND,    ///< Connected; the reply of status is there.
    NEAR_OTHER,    ///< There is one, but it serves another bus: not connected.
    NEAR_SEVERAL,  ///< More than one, and nobody said which.
    NEAR_DENIED,   ///< Its socket may not be used by us.
    NEAR_MUTE,     ///< Its socket is there and nobody answers in time or in its language.
} near_t;

typedef struct {
    near_t result;
    char path[512]; ///< The socket (or the sockets).
    json_t *status; ///< With NEAR_FOUND: owned by the caller.
    char bus[128];  ///< The bus that it serves, with NEAR_FOUND and NEAR_OTHER.
} near_gateway_t;

/// Looks for the gateway of `bus`, or, with a null pointer, for the only one.
void near_look(ctl_t *ctl, const char *bus, near_gateway_t *out_gateway);

/// Asks the connected gateway without printing anything. A new reference, or null.
json_t *near_ask(ctl_t *ctl, json_t *request);

#endif
