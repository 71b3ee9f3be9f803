// SPDX-License-Identifier: MIT
// Image that a host drives over the serial line. It replaces the command source, and also report and console, because
// the host uses the serial port.
#include "commander.h"

#include "bit_rate.h"
#include "board_records.h"
#include "boot.h"
#include "console.h"
#include "cortex_m.h"
#include "host.h"
#include "report.h"
#include "serial.h"

static_assert(BRD_APB1_HZ >= 16U * BRD_SERIAL_BAUD,
              "the USART's clock is 16 times its rate at the least: lower IWHEEL_BAUD");

/// 40 % of the bytes of the line, so that replies fit too.
#define RATE_MAX_HZ                                                                                                    \
    ((BRD_SERIAL_BAUD / 25U / BRD_HOST_LINE_BYTES > 0U) ? BRD_SERIAL_BAUD / 25U / BRD_HOST_LINE_BYTES : 1U)

static brd_host_t host;
static brd_records_t records;
static brd_settings_t settings; // Stored, or those of the image.
static bool is_begun;
static bool is_complete; // The configuration is complete enough to send.

const char *brd_commander_name(void) {
    return "is driven over the serial line";
}

/// An image that cannot send listens without acknowledging.
bool brd_commander_sends(void) {
    return is_complete;
}

/// The identifier of this start depends on the counter of power-ons, so the counter is written before the identifier is
/// sent. RAM stores the number of starts since then.
void brd_commander_open(bool power_on, bool in_motion) {
    brd_records_open(&records, power_on, in_motion, brd_fault_take());
}

void brd_commander_configure(iw_config_t *config) {
    settings = brd_settings_from(config);
    (void)brd_records_settings(&records, &settings);
    brd_settings_apply(&settings, config);
    is_complete = config->setpoint_type_set && config->current_role != IW_ROLE_UNSET;
}

bool brd_host_store(const brd_settings_t *staged) {
    return brd_records_commit(&records, staged);
}

bool brd_host_read_assumptions(brd_assumptions_t *out_learned) {
    return brd_records_assumptions(&records, out_learned);
}

bool brd_host_write_assumptions(const brd_assumptions_t *learned) {
    return brd_records_write_assumptions(&records, learned);
}

static void begin(iw_gateway_t *gateway, iw_time_us_t now_us) {
    static char estop[] = "PA0";
    estop[1] = (char)('A' + BRD_ESTOP / 16U);
    iw_gateway_snapshot(gateway, now_us, brd_report_room());
    const brd_host_place_t place = {
        .gateway = gateway,
        .version = IWHEEL_VERSION,
        .bus = "can",
        .estop = estop,
        .bitrate_hz = BRD_APB1_HZ / BRD_BIT_PRESCALER / BRD_BIT_QUANTA,
        .sample_point_permille = (1U + BRD_BIT_BS1) * 1000U / BRD_BIT_QUANTA,
        .settings = settings,
        .rate_max_hz = RATE_MAX_HZ,
        .boot = brd_boot_id(records.power_ons),
        .last_fault = records.fault,
    };
    brd_host_init(&host, &place, now_us);
    is_begun = true;
}

void brd_commander_step(brd_commander_t *self, iw_gateway_t *gateway, iw_time_us_t now_us) {
    (void)self;
    if (!is_begun) {
        begin(gateway, now_us);
    }
    if (brd_host_receive(&host, now_us)) {
        brd_wake(); // More lines wait. The loop reads the e-stop before the next one.
    }
}

iw_snapshot_t *brd_report_room(void) {
    return &host.server.seen;
}

void brd_report_step(const iw_snapshot_t *seen, bool estop_pressed) {
    (void)brd_host_report(&host, seen, estop_pressed);
    if (brd_host_wants_restart(&host)) {
        brd_system_reset();
    }
}

/// The event `link` informs the host as soon as the serial line has a clock.
void brd_report_start(bool restarted) {
    (void)restarted;
}

void brd_report_no_crystal(void) {}

/// The internal oscillator is too slow for fast lines and too inaccurate for all of them.
void brd_console_start(uint32_t apb1_hz) {
    if (apb1_hz == BRD_APB1_HZ) {
        brd_serial_start(apb1_hz);
    }
}

bool brd_console_step(void) {
    if (is_begun) {
        brd_serial_step();
    }
    return false; // The end of the DMA transfer wakes the loop.
}
