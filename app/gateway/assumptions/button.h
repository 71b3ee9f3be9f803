// SPDX-License-Identifier: MIT
/// Was the e-stop's button ever seen to work? Only a press and its release show that: a line that is shorted reads released for ever.
///
///     UNKNOWN --released--> RELEASED --pressed--> PRESSED --no longer, after GW_BUTTON_PRESS_US or more--> SHOWN --released--> RELEASED: it was tried
///     (unreadable: UNKNOWN; a line that is pressed at the start shows nothing; nor does a shorter pulse, which may be noise: RELEASED)
///
/// Of two contacts both must be seen pressed at once for so long, and then both released; one that opens sooner ends the press. What was tried is a line of a chip, by the kernel's names, with its polarity: with another wiring it counts no more; nor once its contacts have disagreed, until both were tried again.
#ifndef GATEWAY_BUTTON_H
#define GATEWAY_BUTTON_H

#include "iwheel_linux/linux_hal.h"
#include "iwheel_northbound/json_in.h"
#include "iwheel_northbound/json_out.h"

/// A press by hand lasts at least this long.
#define GW_BUTTON_PRESS_US 50000U
/// Of a line's name in the configuration.
#define GW_BUTTON_LINE_SIZE 113U

/// The wiring on which a button was seen to work, and when. All of it is zero if it never was.
typedef struct {
    int64_t wall_us; ///< Of the release; 0: never.
    struct {
        bool active_high;
        char line[GW_BUTTON_LINE_SIZE]; ///< As configured; of the second: "none" if there is none, or empty.
        iwl_estop_seen_t seen;          ///< As the kernel calls it.
    } contact[IWL_ESTOP_CONTACTS];
} gw_tried_t;

typedef enum { GW_BUTTON_UNKNOWN = 0, GW_BUTTON_RELEASED, GW_BUTTON_PRESSED, GW_BUTTON_SHOWN } gw_button_state_t;

/// The button that is watched. It begins all zero but for its contacts and their debounce time.
typedef struct {
    struct {
        const char *line; ///< As configured.
        bool active_high; ///< The same.
    } contact[IWL_ESTOP_CONTACTS];
    uint32_t debounce_us; ///< So much later than it is a release is told; a press is not.
    bool looked;          ///< At these answers:
    int last[IWL_ESTOP_CONTACTS];
    bool disagreed; ///< The contacts did then, for too long.
    gw_button_state_t state;
    iw_time_us_t pressed_us;
} gw_button_t;

/// What a look has shown.
typedef enum {
    GW_BUTTON_NO_NEWS = 0,
    GW_BUTTON_TRIED,  ///< It was pressed and released: `tried` has the wiring and the time.
    GW_BUTTON_VOID,   ///< `tried` was for another wiring, and is forgotten.
    GW_BUTTON_BROKEN, ///< Its contacts disagree: `tried` is forgotten.
} gw_button_news_t;

/// What the last look at the e-stop has shown. A simulated button, or none, is no news; nor is a look like the one before it:
/// a line is never called otherwise without having been unreadable in between.
gw_button_news_t gw_button_look(gw_button_t *self, const iwl_hal_t *hal, iw_time_us_t now_us, gw_tried_t *tried);

/// Members of an object that is open.
void gw_tried_write(const gw_tried_t *tried, iwn_out_t *json);
/// False if that is none.
bool gw_tried_read(iwn_json_t object, gw_tried_t *out_tried);

#endif
