// SPDX-License-Identifier: MIT
/// @file
/// The requests and their fields, except cmd and id. Written by scripts/northbound.py from share/northbound.json.
#ifndef IWHEEL_NORTHBOUND_REQUEST_FIELDS_H
#define IWHEEL_NORTHBOUND_REQUEST_FIELDS_H

/// Each request as in iwn_cmd_t, and its name.
#define IWN_REQUEST_NAMES(NAME)                                                                                        \
    NAME(HELLO, hello)                                                                                                 \
    NAME(STATUS, status)                                                                                               \
    NAME(WATCH, watch)                                                                                                 \
    NAME(ARM, arm)                                                                                                     \
    NAME(DRIVE, drive)                                                                                                 \
    NAME(TWIST, twist)                                                                                                 \
    NAME(STOP, stop)                                                                                                   \
    NAME(DISARM, disarm)                                                                                               \
    NAME(ESTOP, estop)                                                                                                 \
    NAME(RESET, reset)                                                                                                 \
    NAME(RELEASE, release)                                                                                             \
    NAME(TARE, tare)                                                                                                   \
    NAME(WHY, why)                                                                                                     \
    NAME(CONFIRM, confirm)                                                                                             \
    NAME(RECORDINGS, recordings)                                                                                       \
    NAME(RECORDING, recording)                                                                                         \
    NAME(RECORD, record)                                                                                               \
    NAME(CONFIG, config)

/// Name, member of iwn_request_t, kind, largest size of a text in bytes, required, requests with this field.
#define IWN_REQUEST_FIELDS(ROW)                                                                                        \
    ROW(topics, topics, TOPICS, 0, true, BIT(WATCH))                                                                   \
    ROW(rate_hz, rate_hz, RATE, 0, false, BIT(WATCH))                                                                  \
    ROW(name, name, TEXT, 64, false, BIT(ARM))                                                                         \
    ROW(takeover, takeover, FLAG, 0, false, BIT(ARM))                                                                  \
    ROW(t_us, t_us, INTEGER, 0, false, BIT(ARM) | BIT(RESET) | BIT(RELEASE) | BIT(CONFIRM))                            \
    ROW(left_mm_s, left_mm_s, INTEGER, 0, true, BIT(DRIVE))                                                            \
    ROW(right_mm_s, right_mm_s, INTEGER, 0, true, BIT(DRIVE))                                                          \
    ROW(left_mA, left_mA, INTEGER, 0, false, BIT(DRIVE))                                                               \
    ROW(right_mA, right_mA, INTEGER, 0, false, BIT(DRIVE))                                                             \
    ROW(key, lease_key, TEXT, 32, false, BIT(DRIVE) | BIT(TWIST))                                                      \
    ROW(v_mm_s, v_mm_s, INTEGER, 0, true, BIT(TWIST))                                                                  \
    ROW(yaw_mrad_s, yaw_mrad_s, INTEGER, 0, true, BIT(TWIST))                                                          \
    ROW(reason, reason, TEXT, 200, false, BIT(ESTOP))                                                                  \
    ROW(stop, stop, INTEGER, 0, false, BIT(RESET))                                                                     \
    ROW(side, sides, SIDE, 0, false, BIT(TARE))                                                                        \
    ROW(item, item, ITEM, 0, true, BIT(CONFIRM))                                                                       \
    ROW(value, value, VALUE, 39, false, BIT(CONFIRM) | BIT(CONFIG))                                                    \
    ROW(how, how, TEXT, 127, false, BIT(CONFIRM))                                                                      \
    ROW(name, file, TEXT, 63, true, BIT(RECORDING))                                                                    \
    ROW(offset, offset, INTEGER, 0, false, BIT(RECORDING))                                                             \
    ROW(on, on, FLAG, 0, true, BIT(RECORD))                                                                            \
    ROW(key, key, TEXT, 40, false, BIT(CONFIG))                                                                        \
    ROW(commit, commit, FLAG, 0, false, BIT(CONFIG))

#endif
