// SPDX-License-Identifier: MIT
/// Records whether the e-stop button was tested. Only a press and its release show that it works, because a shorted
/// line always reads released.
///
///     UNKNOWN --released--> RELEASED --pressed--> PRESSED --GW_BUTTON_PRESS_US--> SHOWN --released--> RELEASED: tested
///     (unreadable: UNKNOWN; shorter press, which may be noise: RELEASED; pressed at the start: no test)
///
/// Two contacts must both be pressed together for that time and then both be released. A contact that opens earlier
/// ends the press. A test applies to a line of a chip, by the names in the kernel, with its polarity. With another
/// wiring it is void, and also after the contacts have disagreed, until both are tested again.
#ifndef GATEWAY_BUTTON_H
#define GATEWAY_BUTTON_H

#include "iwheel_linux/linux_hal.h"
#include "iwheel_northbound/json_in.h"
#include "iwheel_northbound/json_out.h"

/// Shortest press by hand.
#define GW_BUTTON_PRESS_US 50000U
/// Size of a line's name in the configuration.
#define GW_BUTTON_LINE_SIZE 113U

/// Wiring on which the button was tested, and the time. All zero if it never was.
typedef struct {
    int64_t wall_us; ///< Time of the release; 0 if never.
    struct {
        bool active_high;
        char line[GW_BUTTON_LINE_SIZE]; ///< As configured; "none" or empty if there is no second contact.
        iwl_estop_seen_t seen;          ///< Identity in the kernel.
    } contact[IWL_ESTOP_CONTACTS];
} gw_tried_t;

typedef enum { GW_BUTTON_UNKNOWN = 0, GW_BUTTON_RELEASED, GW_BUTTON_PRESSED, GW_BUTTON_SHOWN } gw_button_state_t;

/// Observed button. The owner sets the contacts and their debounce time; the rest begins with zeros.
typedef struct {
    struct {
        const char *line; ///< As configured.
        bool active_high; ///< As configured.
    } contact[IWL_ESTOP_CONTACTS];
    uint32_t debounce_us; ///< Delay of a reported release. A press has no delay.
    bool polled;          ///< State at the last reading:
    int last[IWL_ESTOP_CONTACTS];
    bool disagreed; ///< The contacts had disagreed for too long.
    gw_button_state_t state;
    iw_time_us_t pressed_us;
} gw_button_t;

/// Result of a reading.
typedef enum {
    GW_BUTTON_NO_NEWS = 0,
    GW_BUTTON_TRIED,  ///< The button was pressed and released: `tried` has wiring and time.
    GW_BUTTON_VOID,   ///< `tried` was for another wiring and is cleared.
    GW_BUTTON_BROKEN, ///< The contacts disagree: `tried` is cleared.
} gw_button_news_t;

/// Evaluates the last reading of the e-stop. A simulated or absent button has no result. A reading that is equal to the
/// one before has no result either, because the identity of a line changes only after it was unreadable.
gw_button_news_t gw_button_poll(gw_button_t *self, const iwl_hal_t *hal, iw_time_us_t now_us, gw_tried_t *tried);

/// Writes the members into an open object.
void gw_tried_write(const gw_tried_t *tried, iwn_out_t *json);
/// Reads the members. Returns false if they are not valid.
bool gw_tried_read(iwn_json_t object, gw_tried_t *out_tried);

#endif
