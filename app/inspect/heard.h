// SPDX-License-Identifier: MIT
/// Everything that was heard on a bus while listening for a while: how many frames of each message, how much of the bus
/// they took, and what does not belong there. Nothing is ever sent.
#ifndef INSPECT_HEARD_H
#define INSPECT_HEARD_H

#include "iwheel/codec.h"
#include "iwheel_linux/linux_hal.h"

/// Other ids that are kept by number.
#define INSPECT_STRANGERS 8U

/// Frames in 1000 s, as documented; 0 of a setpoint.
uint32_t inspect_nominal_mHz(const iw_codec_row_t *row);

/// A wheel with power sends it always, not only in its first minute.
bool inspect_always(const iw_codec_row_t *row);

typedef struct {
    uint32_t count[IW_CODEC_ROWS];          ///< Good frames, in the order of `iw_codec_rows`; our own echoes are none.
    uint32_t bad_length;                    ///< Known id, shorter than the table.
    uint32_t bad_format;                    ///< Known id on a remote, extended or FD frame.
    uint32_t strange;                       ///< Frames of any other id.
    uint32_t strange_id[INSPECT_STRANGERS]; ///< Their id words, as in iw_can_frame_t.
    uint32_t strange_ids;                   ///< How many of these.
    uint64_t bits;                          ///< Of all frames, without stuff bits.
    iw_time_us_t span_us;                   ///< How long was listened.
    bool was_up;                            ///< The bus took part in life at least for a moment.
    iw_bus_state_t worst;                   ///< The worst state of the bus seen ...
    iw_bus_state_t last;                    ///< ... and the one at the end.
    int estop;                              ///< The last answer of the e-stop, as in iw_hal_t.
} inspect_heard_t;

void inspect_heard_begin(inspect_heard_t *self);

/// Takes one frame.
void inspect_heard_take(inspect_heard_t *self, const iw_can_frame_t *frame);

/// Listens for so long; blocks. The HAL must be open.
void inspect_listen(iw_linux_hal_t *hal, iw_time_us_t for_us, inspect_heard_t *out_heard);

/// Frames per 1000 s of the message with that index.
uint32_t inspect_rate_mHz(const inspect_heard_t *self, unsigned message);

/// Index of the message with this id; IW_CODEC_ROWS if there is none.
unsigned inspect_message_of(uint32_t id);

/// Share of the bus that all frames took.
uint32_t inspect_load_permille(const inspect_heard_t *self, uint32_t bitrate_hz);

#endif
