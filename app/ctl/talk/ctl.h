// SPDX-License-Identifier: MIT
/// iwheelctl: declarations shared by its verbs.
///
/// Each verb is one function that receives the words after its name and returns the exit code of the program. A verb
/// reports its own failure, with cause and fix, on stderr; results go to stdout. Reading verbs never send a request
/// that can move a wheel.
#ifndef CTL_H
#define CTL_H

#include "ctl_client.h"

/// Exit codes of all programs (sysexits).
enum {
    CTL_OK = 0,
    CTL_NO = 1, ///< The gateway refused, or a drive did not run to its end.
    CTL_USAGE = 64,
    CTL_DATA = 65, ///< A recording that cannot be parsed completely.
    CTL_UNAVAILABLE = 69,
    CTL_INTERNAL = 70,
    CTL_TIMEOUT = 75,
    CTL_PERMISSION = 77,
    CTL_CONFIG = 78,
};

/// Options of all verbs.
typedef struct {
    const char *socket; ///< Value of --socket; NULL: the program searches for the socket.
    bool json;          ///< Print objects, one per line, instead of text: replies of the gateway, or of the verb.
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
int verb_export(ctl_t *self, int count, char **words);
int verb_help(ctl_t *self, int count, char **words);

/// Prints "iwheelctl: ..." on stderr and returns `code`.
__attribute__((format(printf, 2, 3))) int ctl_fail(int code, const char *format, ...);

/// Called before the program ends with `code`. If results could not be written, this is a failure, unless their reader
/// closed the pipe. Returns the exit code.
int ctl_finish(int code);

/// Connects if necessary, sends `request` (releases its reference) and waits for its reply. Returns 0 with `*out_reply`
/// (a new reference) if the gateway agreed; CTL_NO after it has reported the refusal; another code after it has reported
/// an error. With --json the line of the reply is always printed.
int ctl_ask(ctl_t *self, json_t *request, json_t **out_reply);

/// Kind of the requested stop.
typedef struct {
    bool latches;       ///< True: an e-stop.
    const char *reason; ///< Reason of an e-stop; NULL: none. A reason that is not valid in a request is left out.
} ctl_stop_t;

/// Sends a stop as `ctl_ask` does, through a connection of its own: through the gateway's other socket if the first one
/// has no place or does not answer.
int ctl_stop(ctl_t *self, const ctl_stop_t *stop, json_t **out_reply);

/// First half of `ctl_ask`: returns 0 with any reply in `*out_reply`. Prints only errors of the connection.
int ctl_exchange(ctl_t *self, json_t *request, json_t **out_reply);

/// Second half of `ctl_ask`, for the last reply: reports a refusal, and with --json prints the line of the reply. A
/// reply that is a refusal is released, and `*reply` is NULL.
int ctl_accept(const ctl_t *self, json_t **reply);

/// Reports that the gateway refused, with its error name and message. Returns CTL_NO.
int ctl_refused(const json_t *reply);

/// Adds the sentences to the assumptions of a status if the gateway, a board, sent only figures.
void ctl_explain_assumptions(json_t *assumptions);

/// Reports a result of `client_receive` without a line. Returns the exit code.
int ctl_lost(iwc_result_t result);

// --- a gateway that may be absent: found without messages ----------------------------------------------------------

typedef enum {
    NEAR_NONE = 0, ///< There is no gateway.
    NEAR_FOUND,    ///< Connected, with the reply of status.
    NEAR_OTHER,    ///< There is a gateway, but for another bus: not connected.
    NEAR_SEVERAL,  ///< More than one, and none was chosen.
    NEAR_DENIED,   ///< This user may not use its socket.
    NEAR_MUTE,     ///< The socket exists, but there is no valid answer in time.
} near_t;

typedef struct {
    near_t result;
    char path[512]; ///< Path of the socket (or of the sockets).
    json_t *status; ///< With NEAR_FOUND: owned by the caller.
    char bus[128];  ///< Its bus, with NEAR_FOUND and NEAR_OTHER.
} near_gateway_t;

/// Finds the gateway of `bus`, or, with a null pointer, the only one.
void near_look(ctl_t *ctl, const char *bus, near_gateway_t *out_gateway);

/// Asks the connected gateway without printing. Returns a new reference, or NULL.
json_t *near_ask(ctl_t *ctl, json_t *request);

#endif
