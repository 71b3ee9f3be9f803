// SPDX-License-Identifier: MIT
/// @file
/// One line of a client, read and judged: a request that is right in form, or a refusal.
///
/// A pure function of the bytes, so that it can be tested and fuzzed alone: no heap, no stdio. What depends on the state of the
/// wheels is judged later, by the core. Which fields a request has is told by share/northbound.json.
///
/// The line is read once: one pass checks every byte and stores where each name begins; then each value is read where it is. The pass
/// cannot read the values itself, because `cmd`, which decides what they mean, may come last, and a fault of the whole line comes first.
#ifndef IWHEEL_NORTHBOUND_REQUEST_H
#define IWHEEL_NORTHBOUND_REQUEST_H

#include "iwheel_northbound/json_in.h"
#include "iwheel_northbound/words.h"

/// Bytes of a request without its newline.
#define IWN_LINE_MAX        4096U
#define IWN_ID_TEXT_MAX     64U  ///< Bytes of an id that is a text.
#define IWN_NAME_MAX        64U  ///< Bytes of a client's name.
#define IWN_REASON_MAX      200U ///< Bytes of the reason of an estop.
#define IWN_FILE_MAX        63U  ///< Bytes of the name of a recording's file.
#define IWN_KEY_MAX         40U  ///< Bytes of a key of the configuration.
#define IWN_LEASE_KEY_MAX   32U  ///< Hexadecimal digits of the key of a lease.
#define IWN_RATE_MAX_HZ     100  ///< The highest rate of events that is given.
#define IWN_RATE_DEFAULT_HZ 10   ///< The rate where none is asked for.

/// What is asked. Their names: share/northbound.json.
typedef enum {
    IWN_CMD_HELLO = 0,
    IWN_CMD_STATUS,
    IWN_CMD_WATCH,
    IWN_CMD_ARM,
    IWN_CMD_DRIVE,
    IWN_CMD_TWIST,
    IWN_CMD_STOP,
    IWN_CMD_DISARM,
    IWN_CMD_ESTOP,
    IWN_CMD_RESET,
    IWN_CMD_RELEASE,
    IWN_CMD_TARE,
    IWN_CMD_WHY,
    IWN_CMD_CONFIRM,
    IWN_CMD_RECORDINGS,
    IWN_CMD_RECORDING,
    IWN_CMD_CONFIG,
    IWN_CMDS,
} iwn_cmd_t;

/// True for what a client may ask that only watches: it looks, stops and e-stops.
bool iwn_cmd_watches(iwn_cmd_t cmd);

/// True for what stops the wheels: a stop is never refused.
bool iwn_cmd_stops(iwn_cmd_t cmd);

/// Of what type the id of a request is.
typedef enum { IWN_ID_NONE = 0, IWN_ID_NUMBER, IWN_ID_TEXT } iwn_id_kind_t;

/// What a reply must repeat.
typedef struct {
    iwn_id_kind_t kind;              ///< Which of the two below it is, or none.
    int64_t number;                  ///< As sent.
    char text[IWN_ID_TEXT_MAX + 1U]; ///< As sent.
} iwn_id_t;

/// Only the fields of its `cmd` mean anything. Numbers are as sent: any 64-bit integer.
typedef struct {
    iwn_id_t id;                            ///< What the reply repeats.
    iwn_cmd_t cmd;                          ///< Tells which of the others mean anything.
    int64_t left_mm_s;                      ///< Of drive.
    int64_t right_mm_s;                     ///< Of drive.
    int64_t left_mA;                        ///< Of drive, with `has_current`.
    int64_t right_mA;                       ///< Of drive, with `has_current`.
    int64_t v_mm_s;                         ///< Of twist: forward.
    int64_t yaw_mrad_s;                     ///< Of twist: positive to the left.
    int64_t rate_hz;                        ///< At least 1; not limited yet.
    int64_t offset;                         ///< Of recording, in bytes; may be negative.
    int64_t t_us;                           ///< Of arm, reset, release and confirm, with `has_t_us`: since when.
    int64_t stop;                           ///< Of reset, with `has_stop`: the number of the stop that is meant.
    bool has_t_us;                          ///< `t_us` was given.
    bool has_stop;                          ///< `stop` was given.
    bool has_current;                       ///< Both currents were given.
    bool takeover;                          ///< Of arm.
    bool has_commit;                        ///< Of config: `commit` was given.
    bool commit;                            ///< Of config, with `has_commit`.
    uint8_t topics;                         ///< Bit per iwn_topic_t.
    uint8_t sides;                          ///< IW_SIDES_..., of tare.
    iw_assumption_item_t item;              ///< Of confirm.
    char value[IWN_VALUE_SIZE];             ///< Of confirm and config, a number in decimal digits; empty: not given.
    char how[IWN_HOW_SIZE];                 ///< Of confirm; empty: not given.
    char name[IWN_NAME_MAX + 1U];           ///< Empty: not given.
    char reason[IWN_REASON_MAX + 1U];       ///< Empty: not given.
    char file[IWN_FILE_MAX + 1U];           ///< The name that recording asks for.
    char key[IWN_KEY_MAX + 1U];             ///< Of config; empty: not given.
    char lease_key[IWN_LEASE_KEY_MAX + 1U]; ///< Of drive and twist; empty: not given.
} iwn_request_t;

/// Why not: the name, and cause and cure in words.
typedef struct {
    iwn_error_t error; ///< The name.
    char message[512]; ///< The words, terminated.
} iwn_refusal_t;

/// Writes a refusal, whose words are texts one behind the other, the last of which is NULL. False, so that it can be returned.
bool iwn_refuse(iwn_refusal_t *out_refusal, iwn_error_t error, const char *const *texts);
/// The same with the texts as arguments.
#define IWN_REFUSE(out_refusal, error, ...) iwn_refuse((out_refusal), (error), (const char *const[]){__VA_ARGS__, NULL})

/// Reads `length` bytes (no newline among them). True: `*out_request` is complete. False: `*out_refusal` tells why, and
/// `out_request->id` holds the id as far as it could be read. What is wrong with the whole line comes first, then the id, then
/// the command, then its fields in their order, then what is missing.
bool iwn_request_read(const char *line, size_t length, iwn_work_t *work, iwn_request_t *out_request,
                      iwn_refusal_t *out_refusal);

#endif
