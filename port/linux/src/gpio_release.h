// SPDX-License-Identifier: MIT
/// Release delay (debounce) of a button: a press counts at once, a release only when it has lasted.
///
///     RELEASED --edge or active--> PRESSED --inactive, no edge for the debounce time--> RELEASED
///
/// An edge counts as pressed whatever the level: a pulse can be shorter than the time between two looks. Pure state
/// machine; begins RELEASED, so that the first look decides.
#ifndef IW_GPIO_RELEASE_H
#define IW_GPIO_RELEASE_H

#include "iwheel/types.h"

typedef struct {
    uint32_t debounce_us;
    iw_time_us_t released_us; ///< Released from then on, if nothing happens.
    bool active;
    bool edge; ///< Seen and not yet reported by `iw_gpio_release_take_pressed`.
} iw_gpio_release_t;

void iw_gpio_release_init(iw_gpio_release_t *self, uint32_t debounce_us);

/// What a look at the line has shown: its level, and whether there were edges since the last look.
void iw_gpio_release_see(iw_gpio_release_t *self, iw_time_us_t now_us, bool active, bool edge);

/// True if pressed. An edge is reported once.
bool iw_gpio_release_take_pressed(iw_gpio_release_t *self, iw_time_us_t now_us);

/// When the answer will change by time alone; IW_NEVER if it will not.
iw_time_us_t iw_gpio_release_next_us(const iw_gpio_release_t *self, iw_time_us_t now_us);

#endif
