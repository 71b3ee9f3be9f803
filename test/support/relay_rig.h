// SPDX-License-Identifier: MIT
/// The complete loop of the relay with a simulated board: this part replaces time, waits and the port. The sockets are
/// real. Each step takes 1 ms.
#ifndef TEST_RELAY_RIG_H
#define TEST_RELAY_RIG_H

#include "relay.h"

#include "unity.h"

#define BOOT  "0123456789abcdef"
#define EARLY 700000

extern relay_t relay;
extern serial_settings_t settings;
extern uint64_t now_us;
extern unsigned step;
extern char folder[];
extern char to_relay[8192]; ///< Bytes that the board has written and the relay has not read yet.
extern size_t to_relay_length;
extern char to_board[65536]; ///< All bytes that the relay has written.
extern bool port_is_full;
extern bool port_is_missing;
extern int client_fd;
extern char received[1024]; ///< Result of client_receives.
extern char guest_got[512];
extern bool guest_is_closed;

/// Runs the relay. `play` is called before each wait; true: the relay ends.
void run(bool (*play)(void));
/// The same without a judgement of the exit code, which is returned.
int run_code(bool (*play)(void));

void board_writes(uint8_t channel, uint64_t t_us, const char *json);
void board_links(uint64_t t_us);
/// Answers the last request with this text on the line.
void board_answers(uint8_t channel, const char *words, const char *rest);

void connect_to(const char *path);
void client_connects(void);
void client_writes(const char *line);
void client_receives(void);
void client_closes(void);

/// For scripts: the board links at step 2, and again once a second.
void begin_with_the_board(void);
/// The same, and the board welcomes the client of step 10.
void begin_with_a_client(void);

/// A client beyond the maximum, or another one.
void guest_sends(const char *line);
/// Reads and closes.
void guest_reads(void);
void guest_closes(void);

unsigned count_in(const char *text, const char *words);
/// Returns how often the relay has written this.
unsigned written(const char *words);

#endif
