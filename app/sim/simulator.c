// SPDX-License-Identifier: MIT
#include "simulator.h"

#include <errno.h>
#include <inttypes.h>
#include <poll.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <sys/signalfd.h>
#include <sysexits.h>
#include <unistd.h>

#define MESSAGE_BYTES 1024U

/// Prints a line, unless standard output cannot accept it now: a full pipe must not delay the wheels.
__attribute__((format(printf, 2, 3))) static void print(const sim_simulator_t *self, const char *format, ...) {
    char text[MESSAGE_BYTES];
    struct pollfd out = {.fd = STDOUT_FILENO, .events = POLLOUT};
    if (self->quiet || poll(&out, 1U, 0) != 1 || (out.revents & POLLOUT) == 0) {
        return;
    }
    iw_time_us_t const elapsed_ms = (self->now_us - self->start_us) / IW_US_PER_MS;
    int const head =
        snprintf(text, sizeof text, "[%5" PRIu64 ".%03" PRIu64 " s] ", elapsed_ms / 1000U, elapsed_ms % 1000U);
    va_list arguments;
    va_start(arguments, format);
    int const body = vsnprintf(&text[head], sizeof text - (size_t)head - 1U, format, arguments);
    va_end(arguments);
    size_t const whole = (size_t)head + (size_t)body;
    size_t length = (whole < sizeof text - 1U) ? whole : sizeof text - 2U;
    text[length++] = '\n';
    (void)!write(STDOUT_FILENO, text, length);
}

static iw_time_us_t real_us(const sim_simulator_t *self, iw_time_us_t simulated_us) {
    return simulated_us + self->skipped_us;
}

static void mark(void *context, const char *text) {
    sim_simulator_t *const self = context;
    sim_bus_log_mark(&self->log, real_us(self, self->now_us), text);
}

static void quit(void *context) {
    sim_simulator_t *const self = context;
    self->ended = true;
}

/// Refuses a command that the bus in use does not support. Returns false if it supports the command.
static bool refuse(sim_panel_t *panel, const char *line) {
    if (!sim_socketcan_refuses(line)) {
        return false;
    }
    (void)snprintf(panel->answer, sizeof panel->answer,
                   "error only on a local bus (--can unix:PATH); on an interface use ip link, or tc with netem\n");
    return true;
}

static const char *execute(void *context, const char *line) {
    sim_simulator_t *const self = context;
    if (self->can.is_open && refuse(&self->panel, line)) {
        return self->panel.answer;
    }
    if (sim_panel_execute(&self->panel, self->now_us, line) == SIM_CHANGED) {
        mark(self, line);
        print(self, "%s", line);
    }
    return self->panel.answer;
}

static const char *check_command(void *context, const char *command) {
    sim_simulator_t *const self = context;
    sim_panel_t *const scratch = &self->panel;
    if (!(self->on_socketcan && refuse(scratch, command)) &&
        sim_panel_execute(scratch, scratch->world->bus.free_us, command) != SIM_REFUSED) {
        return NULL;
    }
    scratch->answer[strcspn(scratch->answer, "\n")] = '\0';
    return scratch->answer;
}

static int load_script(sim_simulator_t *self, const char *path) {
    sim_script_fault_t fault;
    self->panel.world = &self->world;
    if (sim_script_load(&self->script, path, check_command, self, &fault)) {
        return -1;
    }
    if (fault.line == 0U) {
        (void)fprintf(stderr, "iwheel-sim: %s: %s\n", path, fault.reason);
        return EX_DATAERR;
    }
    (void)fprintf(stderr, "iwheel-sim: %s:%u: %s\n", path, fault.line, fault.reason);
    return EX_DATAERR;
}

/// Reads all frames that were on the bus by now from the world, and passes them to the clients.
static void catch_up(sim_simulator_t *self) {
    sim_delivery_t delivery;
    while (sim_world_step(&self->world, self->now_us, &delivery)) {
        bool const from_client = delivery.port >= SIM_PORT_CLIENT;
        sim_bus_log_frame(&self->log, real_us(self, delivery.end_us), &delivery.frame, from_client);
        if (self->on_socketcan) {
            sim_socketcan_deliver(&self->can, &delivery);
        } else if (!self->world.bus_off) {
            sim_hub_deliver(&self->hub, &delivery);
        }
    }
}

static const char *interface_state(iw_bus_state_t state) {
    static const char *const names[] = {[IW_BUS_DOWN] = "absent or down",
                                        [IW_BUS_OFF] = "bus-off",
                                        [IW_BUS_PASSIVE] = "passive",
                                        [IW_BUS_ACTIVE] = "up"};
    return names[state];
}

/// Called at every wake-up before any input is read.
static void awake(void *context) {
    sim_simulator_t *const self = context;
    iw_time_us_t now_us = sim_loop_clock_us() - self->skipped_us;
    if (self->wake_us != IW_NEVER && now_us > self->wake_us + SIM_PAUSE_US) {
        iw_time_us_t const pause_us = now_us - self->wake_us;
        self->skipped_us += pause_us;
        now_us -= pause_us;
        print(self, "this process was stopped for %" PRIu64 " ms, and the wheels with it", pause_us / IW_US_PER_MS);
    }
    self->now_us = now_us;
    catch_up(self);
    if (sim_socketcan_step(&self->can, now_us)) {
        print(self, "the interface is %s", interface_state(self->can.state));
    }
    const bool second_ends = sim_button_step(&self->second, now_us);
    if (sim_button_step(&self->button, now_us) || second_ends) {
        mark(self, "estop release");
        print(self, "estop release (end of the pulse)");
    }
    for (;;) {
        const char *const command = sim_script_take(&self->script, now_us - self->start_us);
        if (command == NULL) {
            break;
        }
        const char *const answer = execute(self, command);
        if (answer[0] == 'e') {
            print(self, "script: %s: %.*s", command, (int)strcspn(answer, "\n"), answer);
        }
    }
}

static iw_time_us_t earlier(iw_time_us_t one_us, iw_time_us_t other_us) {
    return (one_us < other_us) ? one_us : other_us;
}

static iw_time_us_t next_us(const sim_simulator_t *self) {
    iw_time_us_t const script_us = sim_script_next_us(&self->script);
    iw_time_us_t const step_us = (script_us == IW_NEVER) ? IW_NEVER : self->start_us + script_us;
    iw_time_us_t const world_us = earlier(sim_world_wake_us(&self->world), sim_socketcan_next_us(&self->can));
    return earlier(earlier(step_us, world_us), earlier(self->button.release_us, self->second.release_us));
}

void sim_simulator_run(sim_simulator_t *self) {
    while (!self->ended) {
        iw_time_us_t const log_us = sim_bus_log_step(&self->log, real_us(self, self->now_us));
        iw_time_us_t const due_us = next_us(self);
        self->wake_us = (due_us > self->now_us) ? due_us : self->now_us; // An overdue action is not a pause.
        iw_time_us_t const world_us = (self->wake_us == IW_NEVER) ? IW_NEVER : real_us(self, self->wake_us);
        sim_loop_wait(&self->loop, earlier(world_us, log_us), awake, self);
    }
    print(self, "ended");
}

static void signalled(sim_watch_t *watch) {
    struct signalfd_siginfo signal_info;
    if (read(watch->fd, &signal_info, sizeof signal_info) == (ssize_t)sizeof signal_info) {
        quit(watch->owner);
    }
}

static bool open_signals(sim_simulator_t *self) {
    sigset_t set;
    (void)sigemptyset(&set);
    (void)sigaddset(&set, SIGTERM);
    (void)sigaddset(&set, SIGINT);
    (void)sigprocmask(SIG_BLOCK, &set, NULL);
    (void)signal(SIGPIPE, SIG_IGN);
    self->signals = (sim_watch_t){signalled, self, signalfd(-1, &set, SFD_NONBLOCK | SFD_CLOEXEC)};
    return self->signals.fd >= 0 && sim_loop_add(&self->loop, &self->signals);
}

static bool open_bus(sim_simulator_t *self, const sim_options_t *options, sim_reason_t *out_reason) {
    if (self->on_socketcan) {
        return sim_socketcan_open(&self->can, options->can_interface, &self->loop, &self->world, out_reason);
    }
    return sim_hub_open(&self->hub, options->can_path, out_reason);
}

/// Opens the second contact. Returns true also without one.
static bool open_second(sim_simulator_t *self, const sim_options_t *options, sim_reason_t *out_reason) {
    return options->estop2_path[0] == '\0' || sim_button_open(&self->second, options->estop2_path, out_reason);
}

static int open_sockets(sim_simulator_t *self, const sim_options_t *options) {
    sim_reason_t reason = {""};
    self->hub = (sim_hub_t){.loop = &self->loop, .world = &self->world, .now_us = &self->now_us};
    self->button = (sim_button_t){.loop = &self->loop};
    self->second = (sim_button_t){.loop = &self->loop, .release_us = IW_NEVER};
    self->control = (sim_control_t){.loop = &self->loop, .execute = execute, .context = self};
    self->hub.listener.watch.fd = -1;
    self->button.listener.watch.fd = -1;
    self->second.listener.watch.fd = -1;
    self->control.listener.watch.fd = -1;
    if (open_bus(self, options, &reason) && sim_button_open(&self->button, options->estop_path, &reason) &&
        open_second(self, options, &reason) && sim_control_open(&self->control, options->control_path, &reason)) {
        return -1;
    }
    (void)fprintf(stderr, "iwheel-sim: %s\n", reason.text);
    sim_socketcan_close(&self->can);
    sim_listener_close(&self->hub.listener);
    sim_listener_close(&self->button.listener);
    sim_listener_close(&self->second.listener);
    sim_listener_close(&self->control.listener);
    return EX_UNAVAILABLE;
}

static int system_refuses(const char *what) {
    (void)fprintf(stderr, "iwheel-sim: %s: %s\n", what, strerror(errno));
    return EX_UNAVAILABLE;
}

static void greet(sim_simulator_t *self, const sim_options_t *options) {
    print(self, "two simulated wheels, seed %" PRIu64 "; end with Ctrl-C", options->seed);
    print(self, "start the gateway with: --can %s%s --estop unix:%s",
          self->on_socketcan ? "" : "unix:", self->on_socketcan ? options->can_interface : options->can_path,
          options->estop_path);
    if (options->estop2_path[0] != '\0') {
        print(self, "its configuration: [estop] line2 = unix:%s", options->estop2_path);
    }
    print(self, "commands: iwheel-sim --control %s help", options->control_path);
}

int sim_simulator_open(sim_simulator_t *self, const sim_options_t *options) {
    sim_pair_config_t pair;
    sim_pair_default(&pair);
    pair.age_us = options->age_us;
    self->quiet = options->quiet;
    self->on_socketcan = options->can_interface[0] != '\0';
    self->can.is_open = false;
    self->now_us = sim_loop_clock_us();
    self->start_us = self->now_us;
    self->wake_us = IW_NEVER;
    sim_world_init(&self->world, &pair, self->now_us, options->seed);
    if (options->script_path != NULL) {
        int const result = load_script(self, options->script_path);
        if (result >= 0) {
            return result;
        }
        sim_world_init(&self->world, &pair, self->now_us, options->seed);
    }
    if (!sim_bus_log_open(&self->log, options->log_path, options->log_direction)) {
        return system_refuses(options->log_path);
    }
    if (!sim_loop_open(&self->loop) || !open_signals(self)) {
        return system_refuses("event loop");
    }
    int const result = open_sockets(self, options);
    if (result < 0) {
        self->panel.world = &self->world;
        self->panel.hooks = (sim_hooks_t){self->on_socketcan ? NULL : &self->hub,
                                          &self->button,
                                          (self->second.listener.watch.fd >= 0) ? &self->second : NULL,
                                          mark,
                                          quit,
                                          self};
        greet(self, options);
        self->keys = (sim_keys_t){.watch.fd = -1, .loop = &self->loop, .execute = execute, .context = self};
        if (!options->quiet && !options->no_keys) {
            sim_keys_open(&self->keys);
        }
    }
    return result;
}

void sim_simulator_close(sim_simulator_t *self) {
    sim_keys_close(&self->keys);
    sim_control_close(&self->control);
    sim_button_close(&self->button);
    if (self->second.listener.watch.fd >= 0) {
        sim_button_close(&self->second);
    }
    if (self->on_socketcan) {
        sim_socketcan_close(&self->can);
    } else {
        sim_hub_close(&self->hub);
    }
    sim_bus_log_flush(&self->log);
}
