// SPDX-License-Identifier: MIT
// A board on this machine: the code of the image `gateway` for its host (app/board), with the same core, this machine's
// clock, the simulator's wheels, and descriptor 0 as its serial line.
//
//     serial_board CONFIGURATION BUS ESTOP [restarted]
//
// SIGHUP resets it: the next start has another boot, as after a press of the reset button of a board that was sending.
#include "box/box.h"
#include "config/gateway_config.h"
#include "wheels/wheels.h"

#include "host.h"
#include "serial.h"

#include "iwheel_linux/clock.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>
#include <unistd.h>

// ---- the serial line ----------------------------------------------------------------------------------------------

#define RING 2048U

static char waiting[RING];
static size_t waits;
static const char *lent;
static size_t lent_left;
static bool line_ended;

/// The image reads byte by byte.
size_t brd_serial_read(char *out, size_t size) {
    static char input[4096];
    static size_t at;
    static size_t end;
    if (at == end) {
        const ssize_t count = read(STDIN_FILENO, input, sizeof input);
        line_ended = line_ended || count == 0;
        at = 0;
        end = (count > 0) ? (size_t)count : 0U;
    }
    const size_t left = (end - at < size) ? end - at : size;
    memcpy(out, &input[at], left);
    at += left;
    return left;
}

bool brd_serial_had_error(void) {
    return false;
}

size_t brd_serial_room(void) {
    return RING - waits;
}

bool brd_serial_write(const char *bytes, size_t length) {
    if (length > brd_serial_room()) {
        return false;
    }
    memcpy(&waiting[waits], bytes, length);
    waits += length;
    return true;
}

bool brd_serial_lend(const char *bytes, size_t length) {
    if (lent_left > 0U) {
        return false;
    }
    lent = bytes;
    lent_left = length;
    return true;
}

bool brd_serial_lends(void) {
    return lent_left > 0U;
}

bool brd_serial_is_idle(void) {
    return waits == 0U && lent_left == 0U;
}

/// Writes bytes. Returns true if all were written.
static bool put(const char *bytes, size_t *left) {
    const ssize_t count = (*left > 0U) ? write(STDIN_FILENO, bytes, *left) : 0;
    *left -= (count > 0) ? (size_t)count : 0U;
    return *left == 0U;
}

/// Writes whole lines: a line is completed before a line of the other source begins.
void brd_serial_step(void) {
    static bool in_lent;
    if (!in_lent) {
        const size_t before = waits;
        const bool all = put(waiting, &waits);
        memmove(waiting, &waiting[before - waits], waits);
        in_lent = all && lent_left > 0U;
    }
    if (in_lent) {
        const size_t before = lent_left;
        in_lent = !put(lent, &lent_left);
        lent += before - lent_left;
    }
}

// ---- the machine --------------------------------------------------------------------------------------------------

static volatile sig_atomic_t reset_pressed;

static void on_hangup(int number) {
    (void)number;
    reset_pressed = 1;
}

static gateway_config_t config;
static gw_box_t box;
static gw_wheels_t wheels;
static brd_host_t host;

/// This board has no flash: a configuration lives as long as the file from which it was read.
bool brd_host_store(const brd_settings_t *settings) {
    (void)settings;
    return false;
}

bool brd_host_read_assumptions(brd_assumptions_t *out_learned) {
    (void)out_learned;
    return false;
}

bool brd_host_write_assumptions(const brd_assumptions_t *learned) {
    (void)learned;
    return false;
}

static void must(bool holds, const char *what) {
    if (!holds) {
        (void)fprintf(stderr, "serial_board: %s\n", what);
        exit(1);
    }
}

static void begin(char **arguments, bool restarted) {
    const iwl_estop_config_t estop = {.name = arguments[3]};
    const char *cause = "";
    uint64_t boot = 0;
    must(gateway_config_load(arguments[1], &config, stderr) == 0, "the configuration");
    must(gw_box_open(&box, &(gw_box_config_t){.blackbox_s = 0}) == 0, "memory");
    must(iwl_hal_open(&wheels.hal, arguments[2], &estop, &cause) == 0, cause);
    must(getrandom(&boot, sizeof boot, 0) == (ssize_t)sizeof boot, "random numbers");
    wheels.now_us = iwl_clock_now_us();
    must(gw_wheels_begin(&wheels, &config.core, box.ring, restarted) == IW_CONFIG_OK, "the configuration is refused");
    const iw_bus_facts_t facts = {.timing_contradicted = false, .echo_proven = true};
    iw_gateway_bus_facts(&wheels.core, &facts);
    const brd_host_place_t place = {.gateway = &wheels.core,
                                    .version = IWHEEL_VERSION,
                                    .bus = "can",
                                    .estop = "PA0",
                                    .bitrate_hz = 500000,
                                    .sample_point_permille = 875,
                                    .settings = brd_settings_from(&config.core),
                                    .rate_max_hz = 10,
                                    .boot = boot};
    brd_host_init(&host, &place, wheels.now_us);
}

/// One cycle, like cycle() of the image's main.c.
static iw_time_us_t cycle(void) {
    wheels.now_us = iwl_clock_now_us();
    iwl_hal_poll(&wheels.hal, wheels.now_us);
    const bool more = brd_host_receive(&host, wheels.now_us);
    static iw_snapshot_t seen;
    seen = gw_wheels_step(&wheels);
    const iw_time_us_t report_us = brd_host_report(&host, &seen, wheels.hal.estop_last != 0);
    brd_serial_step();
    const iw_time_us_t next_us = (report_us < wheels.step_us) ? report_us : wheels.step_us;
    return more ? wheels.now_us : next_us;
}

int main(int argc, char **argv) {
    must(argc >= 4, "usage: serial_board CONFIGURATION BUS ESTOP [restarted]");
    (void)signal(SIGHUP, on_hangup);
    (void)signal(SIGPIPE, SIG_IGN);
    (void)fcntl(STDIN_FILENO, F_SETFL, O_RDWR | O_NONBLOCK);
    begin(argv, argc > 4);
    while (!line_ended) {
        const iw_time_us_t next_us = cycle();
        const iw_time_us_t now_us = iwl_clock_now_us();
        struct pollfd entries[] = {{.fd = STDIN_FILENO, .events = POLLIN},
                                   {.fd = iwl_hal_bus_fd(&wheels.hal), .events = POLLIN},
                                   {.fd = iwl_hal_estop_fd(&wheels.hal), .events = POLLIN}};
        entries[0].events = (short)(POLLIN | (brd_serial_is_idle() ? 0 : POLLOUT));
        // Waits at most 1 ms, because the image wakes for each frame and by its timer.
        (void)poll(entries, 3, (next_us > now_us + 1000U) ? 1 : 0);
        if (reset_pressed != 0) {
            char *again[] = {argv[0], argv[1], argv[2], argv[3], gw_wheels_are_sent_to(&wheels) ? "restarted" : NULL,
                             NULL};
            iwl_hal_close(&wheels.hal);
            (void)execv("/proc/self/exe", again);
        }
    }
    return 0;
}
