// SPDX-License-Identifier: MIT

#include "answers/answers.h"
#include "box/box.h"
#include "daemon.h"
#include "sockets/sock_clients.h"

#include "iwheel_linux/clock.h"

#include <errno.h>
#include <signal.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/signalfd.h>
#include <unistd.h>

/// One event per descriptor, so that a descriptor without an event has nothing to read.
#define EVENTS_PER_WAIT (SOCK_CLIENTS_MAX + 7)

/// While setpoints are sent, bus and e-stop are read at this interval even without a wake-up, because a GPIO chip that
/// disappears causes none. While a setpoint waits for its echo, the interval is shorter.
#define POLL_US      3000U
#define ECHO_POLL_US 1000U
/// The same interval while nothing is sent, if frames wait.
#define REST_POLL_US 6000U
/// After this time without frames the bus wakes the loop again, so that the loop does not poll without need.
#define FRAMES_GONE_US 20000U
#define BOX_POLL_US    100000U
/// After a lateness of this size the machine may have been suspended.
#define ASLEEP_US 500U
/// Interval of reading both clocks in any case.
#define CLOCKS_US 1000000U
/// Interval of attempts to set or remove a crash marker.
#define MARK_AGAIN_US 100000U

static int watch(const gw_daemon_t *daemon, int fd, uint64_t tag) {
    struct epoll_event interest = {.events = EPOLLIN, .data = {.u64 = tag}};
    return (fd < 0 || epoll_ctl(daemon->clients.epoll_fd, EPOLL_CTL_ADD, fd, &interest) == 0) ? 0 : errno;
}

static int open_signals(void) {
    sigset_t set;
    (void)sigemptyset(&set);
    (void)sigaddset(&set, SIGTERM);
    (void)sigaddset(&set, SIGINT);
    (void)sigaddset(&set, SIGHUP);
    (void)sigprocmask(SIG_BLOCK, &set, NULL);
    (void)signal(SIGPIPE, SIG_IGN);
    return signalfd(-1, &set, SFD_NONBLOCK | SFD_CLOEXEC);
}

int gw_loop_open(gw_daemon_t *daemon) {
    int error = sock_wakeup_open(&daemon->wakeup);
    daemon->clients.epoll_fd = daemon->wakeup.fd;
    daemon->loop.signal_fd = (error == 0) ? open_signals() : -1;
    if (error == 0 && daemon->loop.signal_fd < 0) {
        error = errno;
    }
    const int fds[] = {daemon->loop.signal_fd,
                       daemon->clients.listener[SOCK_DRIVE].fd,
                       daemon->clients.listener[SOCK_WATCH].fd,
                       iwl_hal_bus_fd(&daemon->wheels.hal),
                       iwl_hal_estop_fd(&daemon->wheels.hal),
                       iwl_hal_estop2_fd(&daemon->wheels.hal),
                       daemon->box.writer.fd,
                       daemon->box.reader.fd};
    const uint64_t tags[] = {SOCK_TAG_SIGNAL, SOCK_TAG_LISTENER, SOCK_TAG_WATCH_LISTENER,
                             SOCK_TAG_BUS,    SOCK_TAG_ESTOP,    SOCK_TAG_ESTOP,
                             SOCK_TAG_BOX,    SOCK_TAG_BOX};
    for (size_t i = 0; i < sizeof fds / sizeof fds[0] && error == 0; i++) {
        error = watch(daemon, fds[i], tags[i]);
    }
    return error;
}

void gw_loop_close(gw_daemon_t *daemon) {
    (void)close(daemon->loop.signal_fd);
    sock_wakeup_close(&daemon->wakeup);
}

/// Leaves SERVES.
static void shut_down(gw_daemon_t *daemon, gw_loop_phase_t phase) {
    // With a hold the gateway would continue to send; the ramp and the zeros on behalf of a process that died would
    // also become a hold.
    if (daemon->config.core.hold && gw_wheels_are_sent_to(&daemon->wheels)) {
        sock_log(&daemon->log, SOCK_LOG_WARNING,
                 "the zeros of after_stop = hold end with the gateway, and then the machine rolls on a slope: use its "
                 "parking brake");
    }
    daemon->loop.phase = phase;
    daemon->wheels.shutting_down = true;
    gw_notify_stopping(&daemon->notify);
    gw_wheels_stop(&daemon->wheels, IW_CLIENT_NONE, IW_CAUSE_SHUTDOWN);
}

static void take_signal(gw_daemon_t *daemon) {
    struct signalfd_siginfo info;
    if (read(daemon->loop.signal_fd, &info, sizeof info) == (ssize_t)sizeof info &&
        daemon->loop.phase == GW_LOOP_SERVES) {
        sock_log(&daemon->log, SOCK_LOG_INFO, "%s: stopping the wheels, then ending", strsignal((int)info.ssi_signo));
        shut_down(daemon, GW_LOOP_ENDS);
    }
}

/// Gateways of root and of the service do not wait for a gateway of another user.
static void give_way(gw_daemon_t *daemon) {
    const gw_holder_t *holder = &daemon->runtime.lock.holder;
    if (daemon->loop.phase == GW_LOOP_SERVES && gw_bus_lock_poll(&daemon->runtime.lock, daemon->wheels.now_us)) {
        sock_log(&daemon->log, SOCK_LOG_WARNING,
                 "a gateway of user %u (process %ld) serves %s now and has priority over this one: stopping the "
                 "wheels, then ending",
                 (unsigned)holder->uid, (long)holder->pid, daemon->config.bus.interface);
        shut_down(daemon, GW_LOOP_GIVES_WAY);
    }
}

/// Returns true after the first accepted frame: a start after a crash sends nothing if nothing was sent before. The
/// first frames are a zero pair, and another step precedes everything else.
static bool needs_marker(gw_daemon_t *daemon, const iw_snapshot_t *seen) {
    if (!gw_wheels_are_sent_to(&daemon->wheels)) {
        daemon->loop.silent_pairs = seen->sent->pairs;
        return false;
    }
    return daemon->runtime.marked || seen->sent->pairs != daemon->loop.silent_pairs;
}

/// A failure is logged once and tried again.
static void mark_if_sending(gw_daemon_t *daemon, const iw_snapshot_t *seen) {
    const bool needed = needs_marker(daemon, seen);
    if (daemon->config.core.listen_only || daemon->wheels.now_us < daemon->loop.mark_us) {
        return;
    }
    if (gw_runtime_mark(&daemon->runtime, needed)) {
        daemon->loop.mark_us = 0;
        return;
    }
    if (daemon->loop.mark_us == 0U) {
        sock_log(&daemon->log, SOCK_LOG_WARNING,
                 "cannot change the crash marker %s: %s; until this is fixed, the wheels would follow their last "
                 "command for a second after a crash; check owner and free space of the directory",
                 daemon->runtime.marker_path, strerror(errno));
    }
    daemon->loop.mark_us = daemon->wheels.now_us + MARK_AGAIN_US;
}

/// During a suspend of the machine the monotonic clock stopped, but the wheels did not.
static void note_suspend(gw_daemon_t *daemon, iw_time_us_t suspended_us) {
    if (suspended_us > daemon->loop.suspended_us + IW_GATEWAY_LATE_US) {
        gw_wheels_slept(&daemon->wheels, suspended_us - daemon->loop.suspended_us);
        sock_log(&daemon->log, SOCK_LOG_WARNING, "the machine was suspended for %llu ms",
                 (unsigned long long)((suspended_us - daemon->loop.suspended_us) / IW_US_PER_MS));
    }
    if (suspended_us > daemon->loop.suspended_us) {
        daemon->loop.suspended_us = suspended_us;
    }
}

/// Returns the time of the next reading: at most `most_us` apart, with the last one at `until_us`. There is none
/// shortly before it, which would delay it.
static iw_time_us_t evenly(iw_time_us_t now_us, iw_time_us_t until_us, iw_time_us_t most_us) {
    const iw_time_us_t left_us = (until_us > now_us) ? until_us - now_us : 0U;
    return (left_us > most_us) ? now_us + left_us / ((left_us + most_us - 1U) / most_us) : now_us + most_us;
}

/// Frames may wait while nothing depends on one of them immediately. Every step receives them before it judges, and its
/// limits are tens of milliseconds. The e-stop and the clients always wake the loop.
static gw_pace_t pace_of(const gw_daemon_t *daemon, const iw_snapshot_t *seen) {
    if (!gw_wheels_are_sent_to(&daemon->wheels)) {
        return GW_PACE_RESTING;
    }
    return (seen->state == IW_STATE_ARMED && !seen->arming) ? GW_PACE_DRIVING : GW_PACE_ALERT;
}

static void plan_poll(gw_daemon_t *daemon, const iw_snapshot_t *seen) {
    gw_loop_t *loop = &daemon->loop;
    loop->pace = pace_of(daemon, seen);
    const bool echo_waits = loop->pace == GW_PACE_DRIVING && seen->waiting_us != IW_NEVER;
    loop->poll_us = (loop->pace == GW_PACE_RESTING)
                        ? seen->at_us + REST_POLL_US
                        : evenly(seen->at_us, daemon->wheels.step_us, echo_waits ? ECHO_POLL_US : POLL_US);
}

/// Reads one clock, in which a suspend appears as lateness. Reads both after a lateness, and periodically.
static void read_clock(gw_daemon_t *daemon) {
    const iw_time_us_t now_us = iwl_clock_awake_us(daemon->loop.suspended_us);
    if (now_us < daemon->loop.awaited_us + ASLEEP_US && now_us < daemon->loop.clocks_us) {
        gw_wheels_time(&daemon->wheels, now_us);
        return;
    }
    iw_time_us_t suspended_us;
    gw_wheels_time(&daemon->wheels, iwl_clock_read(&suspended_us));
    daemon->loop.clocks_us = daemon->wheels.now_us + CLOCKS_US;
    note_suspend(daemon, suspended_us);
}

/// Runs the cycle of the core, and its immediate effects.
static void step(gw_daemon_t *daemon) {
    gw_wheels_t *wheels = &daemon->wheels;
    iwl_hal_poll(&wheels->hal, wheels->now_us);
    gw_bus_facts_follow(&daemon->facts, wheels, daemon->answers.server.reported.left_behind);
    const iw_snapshot_t seen = gw_wheels_step(wheels);
    mark_if_sending(daemon, &seen);
    iw_observation_step(&wheels->observation, &wheels->core, &seen);
    gw_answers_observe(&daemon->answers, &seen);
    gw_answers_arming(&daemon->answers, &seen);
    plan_poll(daemon, &seen);
    daemon->loop.holder = seen.holder;
}

static iw_time_us_t earlier(iw_time_us_t a_us, iw_time_us_t b_us) {
    return (a_us < b_us) ? a_us : b_us;
}

static bool polls(const gw_daemon_t *daemon) {
    return daemon->loop.frames_wait ||
           (daemon->wheels.hal.estop_ops->present && gw_wheels_are_sent_to(&daemon->wheels));
}

/// Returns the time of the next action without input; 0 for immediately.
static iw_time_us_t next_us(gw_daemon_t *daemon) {
    if (daemon->wheels.requested || sock_service_is_busy(&daemon->clients)) {
        return 0;
    }
    iw_time_us_t next_us = earlier(daemon->wheels.step_us, iwl_hal_next_us(&daemon->wheels.hal));
    next_us = earlier(next_us, gw_answers_next_us(&daemon->answers));
    next_us = earlier(next_us, gw_answers_frames_us(&daemon->answers));
    next_us = earlier(next_us, sock_service_next_us(&daemon->clients));
    return polls(daemon) ? earlier(next_us, daemon->loop.poll_us) : next_us;
}

/// Sets whether the bus wakes the loop. Frames that arrive regularly may wait, unless a client watches them.
static void handle_bus(gw_daemon_t *daemon) {
    const gw_wheels_t *wheels = &daemon->wheels;
    if (wheels->tape.tapped > 0U) {
        daemon->loop.frames_us = wheels->now_us;
    }
    const bool may_wait = daemon->loop.pace != GW_PACE_ALERT &&
                          wheels->now_us < daemon->loop.frames_us + FRAMES_GONE_US && wheels->tape.tapped < GW_FRAMES &&
                          gw_answers_watching_frames(&daemon->answers) == 0U;
    struct epoll_event interest = {.events = may_wait ? 0U : EPOLLIN, .data = {.u64 = SOCK_TAG_BUS}};
    if (may_wait != daemon->loop.frames_wait &&
        epoll_ctl(daemon->clients.epoll_fd, EPOLL_CTL_MOD, iwl_hal_bus_fd(&daemon->wheels.hal), &interest) == 0) {
        daemon->loop.frames_wait = may_wait;
    }
}

/// Records the results of the wait, and does not act on them yet.
static bool note_event(gw_daemon_t *daemon, const struct epoll_event *event) {
    switch (event->data.u64) {
    case SOCK_TAG_SIGNAL:
        take_signal(daemon);
        return false;
    case SOCK_TAG_LISTENER:
    case SOCK_TAG_WATCH_LISTENER:
        return true;
    case SOCK_TAG_BOX:
        daemon->loop.box_poll_us = 0;
        return false;
    case SOCK_TAG_BUS: // Read in every cycle.
    case SOCK_TAG_ESTOP:
        return false;
    default:
        sock_service_note(&daemon->clients, event);
        return false;
    }
}

static bool has_come_to_rest(const gw_daemon_t *daemon) {
    return daemon->loop.phase != GW_LOOP_SERVES && !gw_wheels_are_sent_to(&daemon->wheels);
}

/// Receives from the writer after an event, or periodically if the writer was restarted.
static void listen_to_writer(gw_daemon_t *daemon) {
    if (daemon->wheels.now_us >= daemon->loop.box_poll_us) {
        daemon->loop.box_poll_us = daemon->wheels.now_us + BOX_POLL_US;
        gw_record_take(&daemon->box, &daemon->log);
        if (!gw_recordings_take(&daemon->answers)) {
            sock_log(&daemon->log, SOCK_LOG_WARNING,
                     "the process that reads recordings has ended (was it killed?); it is started again with the next "
                     "request");
        }
    }
}

/// Returns the lease holder if it has sent something while nothing else is due. Its command is executed before the
/// reading of bus and e-stop, which then judges it too, so that it is sent after one reading instead of two. Returns
/// NULL if the reading comes first.
static sock_client_t *holder_first(gw_daemon_t *daemon) {
    const gw_wheels_t *wheels = &daemon->wheels;
    const bool due = wheels->now_us >= wheels->step_us || wheels->requested;
    sock_client_t *holder = (daemon->loop.pace == GW_PACE_DRIVING && !due)
                                ? sock_clients_find(&daemon->clients, daemon->loop.holder)
                                : NULL;
    return (holder != NULL && holder->readable && !holder->leaving) ? holder : NULL;
}

/// Runs the step of the core, which reads everything before it sends.
static void execute_first_and_step(gw_daemon_t *daemon, iwl_reported_t woken) {
    sock_client_t *first = woken.estop ? NULL : holder_first(daemon);
    woken.estop = woken.estop || first != NULL; // Edges since the wait count too.
    iwl_hal_waited(&daemon->wheels.hal, woken);
    if (first != NULL) {
        sock_service_first(&daemon->clients, first);
    }
    step(daemon);
}

static void cycle(gw_daemon_t *daemon, bool client_waits) {
    sock_service_clients(&daemon->clients, daemon->loop.holder);
    if (daemon->wheels.requested) {
        read_clock(daemon);
        step(daemon); // A new command is sent immediately.
    }
    if (client_waits) {
        sock_service_accept(&daemon->clients);
    }
    listen_to_writer(daemon);
    handle_bus(daemon);
    gw_answers_frames(&daemon->answers);
    gw_answers_periodic(&daemon->answers);
    sock_service_flush(&daemon->clients, daemon->loop.holder);
    gw_assumptions_poll(&daemon->assumptions);
    give_way(daemon);
    gw_notify_cycle(&daemon->notify, daemon->wheels.now_us);
}

int gw_loop_run(gw_daemon_t *daemon) {
    bool ready = false;
    while (!has_come_to_rest(daemon)) {
        struct epoll_event events[EVENTS_PER_WAIT];
        daemon->loop.awaited_us = next_us(daemon);
        // Setpoints are sent in time; everything else may be late by the duration of this cycle.
        const iw_time_us_t now_us = gw_wheels_are_sent_to(&daemon->wheels) ? 0U : daemon->wheels.now_us;
        const int count = sock_wakeup_wait(&daemon->wakeup, events, EVENTS_PER_WAIT, now_us, daemon->loop.awaited_us);
        if (count < 0 && errno != EINTR) {
            return errno;
        }
        bool client_waits = false;
        // An interrupted wait has no result.
        iwl_reported_t woken = {.bus = count < 0, .estop = count < 0};
        read_clock(daemon);
        daemon->clients.now_us = daemon->wheels.now_us;
        for (int i = 0; i < count; i++) {
            client_waits = note_event(daemon, &events[i]) || client_waits;
            woken.bus = woken.bus || events[i].data.u64 == SOCK_TAG_BUS;
            woken.estop = woken.estop || events[i].data.u64 == SOCK_TAG_ESTOP;
        }
        execute_first_and_step(daemon, woken);
        cycle(daemon, client_waits);
        if (!ready) {
            ready = true;
            gw_notify_ready(&daemon->notify);
        }
    }
    return 0;
}
