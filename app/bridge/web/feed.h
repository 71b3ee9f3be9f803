// SPDX-License-Identifier: MIT
/// One stream of events for any number of readers: what happened in order, and of the state only the newest.
///
/// Pure: no socket, no clock. Bounded: WEB_FEED_STORED events, one state, and what readers are in the middle of. A reader that falls behind is
/// told how many it missed (event `lost`, as the gateway tells it), never waited for. One thread.
#ifndef WEB_FEED_H
#define WEB_FEED_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define WEB_FEED_STORED 64U

typedef struct web_message web_message_t;

typedef struct {
    web_message_t *events[WEB_FEED_STORED]; ///< Number n is at n % WEB_FEED_STORED.
    uint64_t count;                         ///< Events ever.
    web_message_t *state;                   ///< NULL: none.
    uint64_t states;                        ///< States ever.
} web_feed_t;

typedef struct {
    uint64_t event; ///< Number of the next one.
    uint64_t state; ///< Of the last one taken.
    web_message_t *sending;
    size_t sent;
} web_reader_t;

/// Adds a line of the gateway as it came, under the name of its event; `is_state`: it replaces the one before. False: no memory, nothing
/// changed.
bool web_feed_add(web_feed_t *self, const char *name, const char *json, size_t length, bool is_state);

/// The state is not known any more.
void web_feed_forget(web_feed_t *self);
void web_feed_free(web_feed_t *self);

/// From the newest state, and what happens from now on.
void web_reader_begin(web_reader_t *self, const web_feed_t *feed);
void web_reader_end(web_reader_t *self);

/// True if `take` would give something.
bool web_reader_waits(const web_reader_t *self, const web_feed_t *feed);

/// The next bytes of the stream (Server-Sent Events) into `out`; 0: nothing waits.
size_t web_reader_take(web_reader_t *self, web_feed_t *feed, char *out, size_t size);

#endif
