// SPDX-License-Identifier: MIT
/// iwheelctl: what its verbs share.
///
/// Every verb is one function that takes the words after its name and returns the exit code of the program. A verb tells its own
/// failure, cause and cure, on stderr; results go to stdout. Reading verbs never send a request that can move a wheel.
#ifndef CTL_H
#define CTL_H

#include "ctl_client.h"

/// Exit codes of all programs (sysexits).
enum {
    CTL_OK = 0,
    CTL_NO = 1, ///< The gateway answered "no", or a drive did not run to its end.
    CTL_USAGE = 64,
    CTL_DATA = 65, ///< A recording that cannot be understood, or not wholly.
    CTL_UNAVAILABLE = 69,
    CTL_INTERNAL = 70,
    CTL_TIMEOUT = 75,
    CTL_PERMISSION = 77,
    CTL_CONFIG = 78,
};

/// What the options say, for every verb.
typedef struct {
    const char *socket; ///< Of --socket; null: look for it.
    bool json;          ///< Objects, one a line, instead of text for humans: the gateway's own replies, or the verb's.
    client_t client;
} ctl_t;

typedef int (*ctl_verb_t)(ctl_t *self, int count, char **words);

int verb_status(ctl_t *self, int count, char **words);
int verb_watch(ctl_t *self, int count, char **words);
int verb_drive(ctl_t *self, int count, char **words);
int verb_stop(ctl_t *self, int count, char **words);
int verb_estop(ctl_t *self, int count, char **words);
int verb_reset(ctl_t *self, int count, char **words);
int verb_release(ctl_t *self, int count, char **words);
int verb_tare(ctl_t *self, int count, char **words);
int verb_why(ctl_t *self, int count, char **words);
int verb_ledger(ctl_t *self, int count, char **words);
int verb_confirm(ctl_t *self, int count, char **words);
int verb_config(ctl_t *self, int count, char **words);
int verb_doctor(ctl_t *self, int count, char **words);
int verb_learn(ctl_t *self, int count, char **words);
int verb_record(ctl_t *self, int count, char **words);
int verb_replay(ctl_t *self, int count, char **words);
int verb_decode(ctl_t *self, int count, char **words);
int verb_bringup(ctl_t *self, int count, char **words);
int verb_top(ctl_t *self, int count, char **words);
int verb_web(ctl_t *self, int count, char **words);
int verb_fleet(ctl_t *self, int count, char **words);
int verb_help(ctl_t *self, int count, char **words);

/// Prints "iwheelctl: ..." on stderr and returns `code`.
__attribute__((format(printf, 2, 3))) int ctl_fail(int code, const char *format, ...);

/// Before the program ends with `code`: results that could not be written are no success, unless their reader went away on purpose.
/// The exit code.
int ctl_finish(int code);

/// Connects if necessary, sends `request` (whose reference it takes) and waits for its reply. 0 with `*out_reply` (a new reference) if
/// the gateway agreed; CTL_NO after telling its refusal; other codes after telling what is wrong. With --json the reply's line is
/// printed, whatever it says.
int ctl_ask(ctl_t *self, json_t *request, json_t **out_reply);

/// What kind of stop is asked for.
typedef struct {
    bool latches;       ///< An e-stop.
    const char *reason; ///< Of an e-stop; NULL: none. One that may not stand in a request is left out.
} ctl_stop_t;

/// As `ctl_ask`, for a stop, through a connection of its own: by the gateway's other socket if the one has no place or does not answer.
int ctl_stop(ctl_t *self, const ctl_stop_t *stop, json_t **out_reply);

/// The first half of `ctl_ask`: 0 with the reply, whatever it says, in `*out_reply`; nothing is printed but what went wrong on the way.
int ctl_exchange(ctl_t *self, json_t *request, json_t **out_reply);

/// The second half, for the reply that came last: tells a refusal, with --json prints the reply's line. A reply that is not agreed to
/// is released and `*reply` null.
int ctl_accept(const ctl_t *self, json_t **reply);

/// Tells that the gateway said no: its error name and message. Returns CTL_NO.
int ctl_refused(const json_t *reply);

/// Fills in the sentences of a status's ledger where the gateway, a board, has told figures only.
void ctl_explain_assumptions(json_t *assumptions);

/// What a result of `client_receive` that brought no line means to the user. Returns the exit code.
int ctl_lost(iwc_result_t result);

// --- a gateway that may be there or not: looked for without a word -----------------------------------------------

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
