// SPDX-License-Identifier: MIT
/// The gateway's whole loop and its clients' sockets, with the simulated wheels, in virtual time: nothing waits, nothing sleeps.
///
/// Its own clock, wait and backends stand in for those of the Linux port and the C library (`iw_clock_*`, `epoll_wait`); everything
/// between is what the daemon runs. There is one rig, because a clock has no context.
///
///     daemon_rig_begin();                     a gateway that starts beside wheels that stand
///     int client = daemon_rig_connect();
///     daemon_rig_ask(client, "{...}");        the reply to one request
///     daemon_rig_run(100);                    100 ms of the loop
///     daemon_rig_crash(); daemon_rig_start(); a kill -9, and the next start
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
    iw_time_us_t until_us;            ///< Where `daemon_rig_run` ends.
    iw_time_us_t suspended_us;        ///< The machine's sleep so far, as the clocks tell it.
    iw_time_us_t look_takes_us;       ///< Each look at the clock takes that long.
    iw_time_us_t stolen_us;           ///< The next wait takes that much longer: the process stands still.
    iw_bus_state_t bus;               ///< What the bus answers.
    iwl_bus_link_t link;              ///< What is known of its link.
    int estop;                        ///< What the button answers: 1 pressed, 0, -1 unreadable.
    int estop2;                       ///< The same of its second contact, if wheels.hal has two.
    bool estop_pulse;                 ///< Edges wait to be read: pressed and released again. They wake.
    bool estop_late;                  ///< Such edges come as soon as the next wait has found something else.
    bool estop_silent;                ///< The next change of it wakes nobody, as when a GPIO chip goes.
    uint32_t waits;                   ///< Of the loop.
    iw_time_us_t wait_from_us;        ///< What the last of them was told that it is; 0: nothing, it reads the clock.
    uint32_t looks;                   ///< At the button.
    iw_time_us_t looked_us;           ///< When last.
    iw_time_us_t unlooked_us;         ///< For how long nobody had looked before the last setpoint's own look.
    int16_t most_mm_s;                ///< The fastest setpoint handed over since this was zero.
    bool ended;                       ///< The loop has come to its end by itself.
    bool hold;                        ///< The next start is with after_stop = hold.
    bool full;                        ///< The bus takes no frame.
    uint32_t unmarked;                ///< Nonzero setpoints handed over while there was no crash marker.
    uint32_t sent[IW_SIDES];          ///< Setpoints handed over.
    int16_t told_mA[IW_SIDES];        ///< Of the last of them.
    int16_t commanded_mm_s[IW_SIDES]; ///< The last of them.
    iw_time_us_t sent_us;             ///< When.
    uint32_t sent_waits;              ///< After how many waits.
    iw_can_frame_t rx[DAEMON_RX_MAX];
    unsigned rx_count;
    unsigned rx_next;
    int estop_told; ///< What the button's descriptor has told.
    int bus_fd;
    int estop_fd;
    int listen_fd;
    uint8_t port;
    char folder[64];
    char reply[SOCK_REPLY_MAX];
} daemon_rig_t;

extern daemon_rig_t daemon_rig;

/// Wheels that have been running for ten minutes, and a gateway that has seen them at rest for a second.
void daemon_rig_begin(void);
void daemon_rig_end(void);

/// The process is gone, with nothing put in order.
void daemon_rig_crash(void);

/// The next start, beside the same wheels.
void daemon_rig_start(void);

/// The loop for that long.
void daemon_rig_run(unsigned for_ms);

/// A new connection, to drive or to watch.
int daemon_rig_connect(void);
int daemon_rig_connect_with(sock_right_t right);

/// Sends a line; the loop runs until its reply has come (20 ms at the most). Events are passed over. Empty: no reply.
const char *daemon_rig_ask(int client, const char *line);

/// Arms, or drives for that long with a command every 20 ms; fails the test if that is refused.
void daemon_rig_arm(int client);
void daemon_rig_drive(int client, int left_mm_s, int right_mm_s, unsigned for_ms);

/// From now on, what the gateway writes for people is kept.
void daemon_rig_keep_log(void);
const char *daemon_rig_log(void);

/// How often the log has these words.
unsigned daemon_rig_logged(const char *words);

/// True if the crash marker is there.
bool daemon_rig_marked(void);

iw_state_t daemon_rig_state(void);

/// Arms, and drives both wheels at 500 mm/s until they are told so.
void daemon_rig_begin_driving(int client);

/// Both were told zero last.
bool daemon_rig_is_told_zero(void);

#endif
