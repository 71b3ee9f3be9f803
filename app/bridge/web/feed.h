// SPDX-License-Identifier: MIT
/// Stream of events for any number of readers: all events in order, and only the newest state.
///
/// Pure: no socket, no clock. Bounded: WEB_FEED_STORED events, one state, and the messages that readers are sending. A
/// slow reader receives the number of missed events (event `lost`, as from the gateway); the feed never waits for it.
/// One thread.
#ifndef WEB_FEED_H
#define WEB_FEED_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define WEB_FEED_STORED 64U

typedef struct web_message web_message_t;

typedef struct {
    web_message_t *events[WEB_FEED_STORED]; ///< Event n is at n % WEB_FEED_STORED.
    uint64_t count;                         ///< Number of events since the start.
    web_message_t *state;                   ///< NULL: none.
    uint64_t states;                        ///< Number of states since the start.
} web_feed_t;

typedef struct {
    uint64_t event; ///< Number of the next event.
    uint64_t state; ///< Number of the last state that was read.
    web_message_t *sending;
    size_t sent;
} web_reader_t;

/// Adds a line of the gateway unchanged, under the name of its event. `is_state`: it replaces the former state. Returns
/// false and changes nothing if there is no memory.
bool web_feed_add(web_feed_t *self, const char *name, const char *json, size_t length, bool is_state);

/// Clears the state, because it is unknown.
void web_feed_forget(web_feed_t *self);
void web_feed_free(web_feed_t *self);

/// Starts a reader at the newest state and the next event.
void web_reader_begin(web_reader_t *self, const web_feed_t *feed);
void web_reader_end(web_reader_t *self);

/// Returns true if web_reader_take has data.
bool web_reader_waits(const web_reader_t *self, const web_feed_t *feed);

/// Copies the next bytes of the stream (Server-Sent Events) to `out`. Returns their number; 0 if there are none.
size_t web_reader_take(web_reader_t *self, web_feed_t *feed, char *out, size_t size);

#endif
