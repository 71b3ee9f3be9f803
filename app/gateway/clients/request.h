// SPDX-License-Identifier: MIT
/// One line of a client, read and judged: a request that is right in form, or a refusal.
///
/// A pure function of the bytes, so that it can be tested and fuzzed alone. What depends on the state of the wheels
/// is judged later, by the core.
#ifndef GATEWAY_REQUEST_H
#define GATEWAY_REQUEST_H

#include "assumption.h"
#include "names.h"

/// Bytes of a request without its newline.
#define GW_LINE_MAX 4096U
/// Deepest nesting that is parsed at all; requests need 2.
#define GW_DEPTH_MAX       8U
#define GW_ID_TEXT_MAX     64U
#define GW_NAME_MAX        64U
#define GW_REASON_MAX      200U
#define GW_RATE_MAX_HZ     100
#define GW_RATE_DEFAULT_HZ 10

typedef enum {
    GW_CMD_HELLO = 0,
    GW_CMD_STATUS,
    GW_CMD_WATCH,
    GW_CMD_ARM,
    GW_CMD_DRIVE,
    GW_CMD_TWIST,
    GW_CMD_STOP,
    GW_CMD_DISARM,
    GW_CMD_ESTOP,
    GW_CMD_RESET,
    GW_CMD_TARE,
    GW_CMD_WHY,
    GW_CMD_CONFIRM,
    GW_CMDS,
} gw_cmd_t;

typedef enum { GW_ID_NONE = 0, GW_ID_NUMBER, GW_ID_TEXT } gw_id_kind_t;

/// What a reply must repeat.
typedef struct {
    gw_id_kind_t kind;
    int64_t number;
    char text[GW_ID_TEXT_MAX + 1U];
} gw_id_t;

/// Only the fields of its `cmd` mean anything. Numbers are as sent: any 64-bit integer.
typedef struct {
    gw_id_t id;
    gw_cmd_t cmd;
    int64_t left_mm_s;
    int64_t right_mm_s;
    int64_t left_mA;
    int64_t right_mA;
    int64_t v_mm_s;
    int64_t yaw_mrad_s;
    int64_t rate_hz;  ///< At least 1; not limited yet.
    bool has_current; ///< Both currents were given.
    bool takeover;
    uint8_t topics;                  ///< Bit per gw_topic_t.
    uint8_t sides;                   ///< IW_SIDES_..., of tare.
    iw_ledger_item_t item;           ///< Of confirm.
    char value[GW_VALUE_SIZE];       ///< Of confirm, a number in decimal digits; empty: not given.
    char how[GW_HOW_SIZE];           ///< Of confirm; empty: not given.
    char name[GW_NAME_MAX + 1U];     ///< Empty: not given.
    char reason[GW_REASON_MAX + 1U]; ///< Empty: not given.
} gw_request_t;

/// Why not: the name, and cause and cure in words.
typedef struct {
    gw_error_t error;
    char message[512];
} gw_refusal_t;

/// Reads `length` bytes (no newline among them). True: `*out_request` is complete. False: `*out_refusal` tells why, and
/// `out_request->id` holds the id as far as it could be read. Uses the arena of json_arena.h, which it resets.
bool gw_request_parse(const char *line, size_t length, gw_request_t *out_request, gw_refusal_t *out_refusal);

#endif
