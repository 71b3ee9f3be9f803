// SPDX-License-Identifier: MIT
/// Shared by the small programs of the timed benchmark. Any failure here ends the program, so there is no figure without a complete run.
#ifndef BENCH_TIMED_H
#define BENCH_TIMED_H

#include <linux/can.h>
#include <stdint.h>
#include <time.h>

#define TIMED_NS_PER_S 1000000000LL
#define TIMED_LEFT     0x10AU
#define TIMED_RIGHT    0x12AU

/// Prints the failed action and the reason, and ends the program.
_Noreturn void timed_fail(const char *what);

/// Returns the value, unless it is negative: then it ends the program as above.
int timed_need(int value, const char *what);

int64_t timed_now_ns(clockid_t clock);
void timed_sleep_until_ns(int64_t at_ns);

/// Opens a raw socket on that interface. `id` 0: it receives everything; CAN_INV_FILTER: nothing. unix:PATH: a local bus, everything.
int timed_can(const char *interface, canid_t id);

/// Sends both wheels' setpoints, one after the other, as a gateway does.
void timed_send_pair(int can, int16_t left_mm_s, int16_t right_mm_s);

/// Waits for the next frame of that id (0: any) and its stamp of the kernel, CLOCK_REALTIME. Returns false if none came within that time.
int timed_receive(int can, canid_t id, struct can_frame *out_frame, int64_t *out_at_ns, int within_ms);

/// Requests stamps.
void timed_ask_for_stamps(int can);

/// Opens a unix stream socket at that path.
int timed_connect(const char *path);

/// Accepts the first client of a unix stream socket that is made at that path.
int timed_accept(const char *path);

/// Opens a line of a GPIO chip that reports its falling edges.
int timed_line(const char *path, uint32_t offset);

#endif
