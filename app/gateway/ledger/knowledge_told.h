// SPDX-License-Identifier: MIT
/// What is learnt about the wheels, in words: lines of the log and events. Private to knowledge.c.
#ifndef GATEWAY_KNOWLEDGE_TOLD_H
#define GATEWAY_KNOWLEDGE_TOLD_H

#include "knowledge.h"

/// An item has changed.
void gw_knowledge_tell_item(gw_knowledge_t *self, iw_ledger_item_t item);

/// The offset in force has changed.
void gw_knowledge_tell_offset(gw_knowledge_t *self, iw_side_t side, const gw_told_offset_t *now,
                              const gw_told_offset_t *before);

/// Where it is kept, or why not.
void gw_knowledge_tell_memory(gw_knowledge_t *self);

/// The whole ledger, at start.
void gw_knowledge_tell_ledger(gw_knowledge_t *self);

#endif
