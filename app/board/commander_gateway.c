// SPDX-License-Identifier: MIT
// The image that a host drives over the serial line: in the place of a command source, and of report and console, for
// the serial port is the host's.
#include "commander.h"

#include "bit_rate.h"
#include "boot.h"
#include "console.h"
#include "cortex_m.h"
#include "host.h"
#include "kept.h"
#include "pins.h"
#include "report.h"
#include "serial.h"

static_assert(IW_BOARD_APB1_HZ >= 16U * IW_SERIAL_BAUD,
              "the USART's clock is 16 times its rate at the least: lower IWHEEL_BAUD");

/// 40 % of the line's bytes, so that replies pass.
#define RATE_MAX_HZ ((IW_SERIAL_BAUD / 25U / IW_HOST_LINE_BYTES > 0U) ? IW_SERIAL_BAUD / 25U / IW_HOST_LINE_BYTES : 1U)

static iw_host_t host;
static iw_kept_t kept;
static bool is_begun;
static bool is_complete; // It is configured well enough to send.

const char *iw_commander_words(void) {
    return "is driven over the serial line";
}

/// An image that cannot send listens without acknowledging.
bool iw_commander_sends(void) {
    return is_complete;
}

/// The counter of the power-ons is behind the name of this start, so that it is written before that name is told. The
/// number of starts since then is kept in RAM.
void iw_commander_open(bool power_on, bool in_motion) {
    iw_kept_open(&kept, power_on, in_motion);
}

void iw_commander_configure(iw_config_t *config) {
    iw_settings_t settings;
    if (iw_kept_settings(&kept, &settings)) {
        iw_settings_to(&settings, config);
    }
    is_complete = config->setpoint_type_set && config->current_role != IW_ROLE_UNSET;
}

bool iw_host_keep(const iw_settings_t *settings) {
    return iw_kept_commit(&kept, settings);
}

bool iw_host_recall(iw_learnt_t *out_learnt) {
    return iw_kept_learnt(&kept, out_learnt);
}

bool iw_host_remember(const iw_learnt_t *learnt) {
    return iw_kept_learn(&kept, learnt);
}

static void begin(iw_gateway_t *gateway, iw_time_us_t now_us) {
    static char estop[] = "PA0";
    estop[1] = (char)('A' + IW_BOARD_ESTOP / 16U);
    iw_gateway_snapshot(gateway, now_us, iw_report_room());
    const iw_host_place_t place = {
        .gateway = gateway,
        .version = IWHEEL_VERSION,
        .bus = "can",
        .estop = estop,
        .bitrate_hz = IW_BOARD_APB1_HZ / IW_BIT_PRESCALER / IW_BIT_QUANTA,
        .sample_point_permille = (1U + IW_BIT_BS1) * 1000U / IW_BIT_QUANTA,
        .settings = iw_settings_from(iw_report_room()->config),
        .rate_max_hz = RATE_MAX_HZ,
        .boot = iw_boot_id(kept.power_ons),
    };
    iw_host_init(&host, &place, now_us);
    is_begun = true;
}

void iw_commander_step(iw_commander_t *self, iw_gateway_t *gateway, iw_time_us_t now_us) {
    (void)self;
    if (!is_begun) {
        begin(gateway, now_us);
    }
    if (iw_host_take(&host, now_us)) {
        iw_wake(); // More lines wait: once round the loop, with its look at the e-stop, and then they.
    }
}

iw_snapshot_t *iw_report_room(void) {
    return &host.server.seen;
}

void iw_report_step(const iw_snapshot_t *seen, bool estop_pressed) {
    (void)iw_host_tell(&host, seen, estop_pressed);
    if (iw_host_wants_restart(&host)) {
        iw_system_reset();
    }
}

/// The host is told by the event `link`, once there is a clock for the serial line.
void iw_report_start(bool restarted) {
    (void)restarted;
}

void iw_report_no_crystal(void) {}

/// The internal oscillator is too slow for fast lines and too inexact for all of them.
void iw_console_start(uint32_t apb1_hz) {
    if (apb1_hz == IW_BOARD_APB1_HZ) {
        iw_serial_start(apb1_hz);
    }
}

bool iw_console_step(void) {
    if (is_begun) {
        iw_serial_step();
    }
    return false; // The DMA's end wakes the loop.
}
