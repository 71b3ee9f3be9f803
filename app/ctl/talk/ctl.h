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

/// The verbs in the order of the help: name, function, why it has no --json (NULL: it has), and the words that may
/// follow it (a function of help.c, or NULL).
#define CTL_VERBS(VERB)                                                                                                \
    VERB(status, verb_status, NULL, NULL)                                                                              \
    VERB(top, verb_top, "top draws a screen; for JSON lines: iwheelctl watch state", NULL)                             \
    VERB(web, verb_web, "web prints an address; it has no --json", NULL)                                               \
    VERB(fleet, verb_fleet, NULL, fleet_choice)                                                                        \
    VERB(watch, verb_watch, NULL, topic_choice)                                                                        \
    VERB(drive, verb_drive, NULL, NULL)                                                                                \
    VERB(stop, verb_stop, NULL, NULL)                                                                                  \
    VERB(disarm, verb_disarm, NULL, NULL)                                                                              \
    VERB(estop, verb_estop, NULL, NULL)                                                                                \
    VERB(reset, verb_reset, NULL, NULL)                                                                                \
    VERB(release, verb_release, NULL, NULL)                                                                            \
    VERB(tare, verb_tare, NULL, side_choice)                                                                           \
    VERB(ledger, verb_ledger, NULL, NULL)                                                                              \
    VERB(confirm, verb_confirm, NULL, item_choice)                                                                     \
    VERB(config, verb_config, NULL, config_choice)                                                                     \
    VERB(doctor, verb_doctor, NULL, NULL)                                                                              \
    VERB(bringup, verb_bringup, "bringup is interactive; it has no --json (doctor has)", NULL)                         \
    VERB(why, verb_why, NULL, NULL)                                                                                    \
    VERB(record, verb_record, NULL, NULL)                                                                              \
    VERB(decode, verb_decode, NULL, NULL)                                                                              \
    VERB(learn, verb_learn, NULL, NULL)                                                                                \
    VERB(replay, verb_replay, NULL, NULL)                                                                              \
    VERB(export, verb_export, "export writes a file; for JSON lines: iwheelctl --json decode FILE", NULL)              \
    VERB(help, verb_help, "help is text for people; it has no --json", verb_choice)

#define CTL_DECLARE(name, run, no_json, choice) int run(ctl_t *self, int count, char **words);
CTL_VERBS(CTL_DECLARE)

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

/// Receives the reply of a gateway that executed a stop; `path` is its socket, NULL if no other gateway was asked.
typedef void (*ctl_stopped_t)(const ctl_t *self, const char *path, const json_t *reply);

/// Sends a stop through a connection of its own: through the gateway's other socket if the first one has no place or
/// does not answer. Without --socket it sends the stop to every gateway. Reports errors as `ctl_ask` does. Returns 0 if
/// at least one gateway executed it.
int ctl_stop(ctl_t *self, const ctl_stop_t *stop, ctl_stopped_t stopped);

/// Sets the time of an arm request to that of the snapshot `status` (NULL: no change). The gateway then refuses it after
/// a later stop. Before a repeated arm, use the snapshot that preceded the last attempt refused as not_at_rest: the
/// gateway judges the time first, so that refusal shows that there was no stop until then.
void ctl_set_time(json_t *request, const json_t *status);

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
void near_find(ctl_t *ctl, const char *bus, near_gateway_t *out_gateway);

/// Sends a stop as `ctl_stop` does, without printing. It closes the connection of the client.
iwc_result_t near_stop(ctl_t *ctl, const ctl_stop_t *stop);

/// Asks the connected gateway without printing. Returns a new reference, or NULL.
json_t *near_ask(ctl_t *ctl, json_t *request);

#endif
