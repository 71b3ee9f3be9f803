// SPDX-License-Identifier: MIT
/// The lines in a handle's buffer: taking them in, handing them out, leaving superseded ones out.
#ifndef IWC_QUEUE_H
#define IWC_QUEUE_H

#include "connection.h"

/// Looks at what came since the last time. False: a line is no message, or too long; the good ones before it are kept.
bool iwc_queue_admit(iwc_t *self);

/// Hands out the oldest message, in `self->line`. False: there is none.
bool iwc_queue_take(iwc_t *self, iwc_message_t *out_message);

/// Leaves out, counted, every event of which a newer one is there, and then the oldest messages until half of the buffer is free.
void iwc_queue_thin(iwc_t *self);

/// Makes room to read into: a line at least.
void iwc_queue_make_room(iwc_t *self);

#endif
