// SPDX-License-Identifier: MIT
/// What the small programs of the timed benchmark share. Whatever fails here ends the program: a figure without its program is none.
#ifndef BENCH_TIMED_H
#define BENCH_TIMED_H

#include <linux/can.h>
#include <stdint.h>
#include <time.h>

#define TIMED_NS_PER_S 1000000000LL
#define TIMED_LEFT     0x10AU
#define TIMED_RIGHT    0x12AU

/// Prints what could not be done, and why, and ends the program.
_Noreturn void timed_fail(const char *what);

/// The value, unless it is negative: then the end, as above.
int timed_need(int value, const char *what);

int64_t timed_now_ns(clockid_t clock);
void timed_sleep_until_ns(int64_t at_ns);

/// A raw socket on that interface. `id` 0: hears everything; CAN_INV_FILTER: nothing. Or, as unix:PATH, a local bus: everything.
int timed_can(const char *interface, canid_t id);

/// Both wheels' setpoints, one after the other, as a gateway sends them.
void timed_send_pair(int can, int16_t left_mm_s, int16_t right_mm_s);

/// The next frame of that id (0: of any) and the kernel's stamp of it, CLOCK_REALTIME. False: none came within that time.
int timed_receive(int can, canid_t id, struct can_frame *out_frame, int64_t *out_at_ns, int within_ms);

/// Asks for stamps.
void timed_ask_for_stamps(int can);

/// A unix stream socket at that path.
int timed_connect(const char *path);

/// The first client of a unix stream socket that is made at that path.
int timed_accept(const char *path);

/// A line of a GPIO chip that tells of its falling edges.
int timed_line(const char *path, uint32_t offset);

#endif
