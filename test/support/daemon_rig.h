// SPDX-License-Identifier: MIT
/// The gateway's whole loop and its clients' sockets with the simulated wheels, in virtual time: no call waits or sleeps.
///
/// The rig replaces the clock, the wait and the backends of the Linux port and the C library (`iw_clock_*`, `epoll_wait`); all code
/// between them is that of the daemon. There is one rig, because a clock has no context.
///
///     daemon_rig_begin();                     starts a gateway next to wheels at standstill
///     int client = daemon_rig_connect();
///     daemon_rig_ask(client, "{...}");        returns the reply to one request
///     daemon_rig_run(100);                    runs the loop for 100 ms
///     daemon_rig_crash(); daemon_rig_start(); kills the gateway and starts the next one
///     daemon_rig_end();
#ifndef TEST_DAEMON_RIG_H
#define TEST_DAEMON_RIG_H

#include "daemon.h"
#include "fixture.h"
#include "iwheel_sim/world.h"

#define DAEMON_RX_MAX 256U

typedef struct {
    gw_daemon_t *daemon;
    sim_world_t world;
    iw_time_us_t now_us;
    iw_time_us_t until_us;      ///< End of `daemon_rig_run`.
    iw_time_us_t suspended_us;  ///< Total suspend time that the clocks report.
    iw_time_us_t poll_takes_us; ///< Duration of each read of the clock.
    iw_time_us_t stolen_us;     ///< The next wait is longer by this time: the process does not run.
    iw_bus_state_t bus;         ///< State that the bus reports.
    iwl_bus_link_t link;        ///< Facts that the bus reports about its link.
    int estop;                  ///< State that the button reports: 1 pressed, 0 released, -1 unreadable.
    int estop2;                 ///< The same for its second contact, if wheels.hal has two.
    bool estop_pulse;           ///< Edges of a press and a release wait to be read. They wake the loop.
    bool estop_late;            ///< Such edges come as soon as the next wait has found another event.
    bool estop_silent; ///< The next change of the button does not wake the loop, as when a GPIO chip disappears.
    uint32_t waits;    ///< Waits of the loop.
    iw_time_us_t wait_from_us; ///< Time that the loop passed to the last wait; 0: none, the wait reads the clock.
    uint32_t polls;            ///< Polls of the button.
    iw_time_us_t polled_us;    ///< Time of the last poll of the button.
    iw_time_us_t unpolled_us;  ///< Time without a poll of the button before the poll that belongs to the last setpoint.
    int16_t most_mm_s;         ///< Fastest setpoint sent since a test set this to zero.
    bool ended;                ///< The loop ended on its own.
    bool hold;                 ///< The next start uses after_stop = hold.
    bool full;                 ///< The bus accepts no frame.
    uint32_t unmarked;         ///< Nonzero setpoints sent while there was no crash marker.
    uint32_t sent[IW_SIDES];   ///< Setpoints sent.
    int16_t commanded_mA[IW_SIDES];   ///< Current of the last setpoint.
    int16_t commanded_mm_s[IW_SIDES]; ///< Speed of the last setpoint.
    iw_time_us_t sent_us;             ///< Time of the last setpoint.
    uint32_t sent_waits;              ///< Number of waits before the last setpoint.
    iw_can_frame_t rx[DAEMON_RX_MAX];
    unsigned rx_count;
    unsigned rx_next;
    int estop_reported; ///< State of the button that its descriptor has reported.
    int bus_fd;
    int estop_fd;
    int listen_fd;
    uint8_t port;
    char folder[64];
    char reply[SOCK_REPLY_MAX];
} daemon_rig_t;

extern daemon_rig_t daemon_rig;

/// Begins with wheels that have been running for ten minutes and a gateway that has observed them at standstill for a second.
void daemon_rig_begin(void);
void daemon_rig_end(void);

/// Ends the process without any cleanup.
void daemon_rig_crash(void);

/// Starts the next process next to the same wheels.
void daemon_rig_start(void);

/// Runs the loop for that long.
void daemon_rig_run(unsigned for_ms);

/// Opens a new connection, for driving or with this right.
int daemon_rig_connect(void);
int daemon_rig_connect_with(sock_right_t right);

/// Opens a new connection with this right while nothing of the gateway runs.
int daemon_rig_knock(sock_right_t right);

/// Sends lines that the gateway has not read yet.
void daemon_rig_send(int client, const char *lines);

/// Returns all bytes that the client has received, terminated; "" if there are none. The next call overwrites them.
const char *daemon_rig_receive(int client);

/// Returns how often these words are in the text.
unsigned daemon_rig_count(const char *text, const char *words);

/// Sends a line and runs the loop until its reply has come, for at most 20 ms. Skips events. Returns "" without a reply.
const char *daemon_rig_ask(int client, const char *line);

/// Arms, or drives for that long with a command every 20 ms; fails the test if that is refused.
void daemon_rig_arm(int client);
void daemon_rig_drive(int client, int left_mm_s, int right_mm_s, unsigned for_ms);

/// Stores the gateway's log from now on.
void daemon_rig_keep_log(void);
const char *daemon_rig_log(void);

/// Number of occurrences of these words in the log.
unsigned daemon_rig_logged(const char *words);

/// True if the crash marker exists.
bool daemon_rig_marked(void);

iw_state_t daemon_rig_state(void);

/// Arms, and drives both wheels until they are commanded 500 mm/s.
void daemon_rig_begin_driving(int client);

/// True if the last setpoint of both wheels is zero.
bool daemon_rig_commands_zero(void);

#endif
