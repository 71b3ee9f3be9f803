// SPDX-License-Identifier: MIT
// The same as the report, for programs: what was counted (evidence), what it tells, what it suggests.
#include "learn_findings.h"

#include <inttypes.h>
#include <jansson.h>
#include <stdio.h>
#include <string.h>

/// [low, high], or null.
static json_t *range(const learn_range_t *range) {
    return learn_is_empty(range) ? json_null() : json_pack("[i,i]", (int)range->low, (int)range->high);
}

static json_t *number(uint64_t value) {
    return json_integer((json_int_t)value);
}

static json_t *types(const uint64_t count[256]) {
    json_t *object = json_object();
    for (unsigned type = 0; type < 256U; type++) {
        char name[8];
        (void)snprintf(name, sizeof name, "%u", type);
        if (count[type] > 0U) {
            (void)json_object_set_new(object, name, number(count[type]));
        }
    }
    return object;
}

static json_t *id(const learn_id_t *id) {
    const uint32_t period_ms = learn_period_ms(&id->period);
    const bool timed = id->period.counted >= 2U;
    json_t *object = json_pack("{s:I,s:b,s:o,s:o}", "id", (json_int_t)id->id, "extended", (int)id->extended, "frames",
                               number(id->count), "length", range(&id->length));
    (void)json_object_set_new(object, "period_ms", timed ? json_integer((json_int_t)period_ms) : json_null());
    (void)json_object_set_new(object, "longest_us",
                              timed ? json_integer((json_int_t)id->period.longest_us) : json_null());
    return object;
}

static json_t *setpoints(const learn_t *self, unsigned side) {
    const learn_setpoint_t *each = &self->setpoint[side];
    json_t *object = id(&self->known[side]);
    json_t *more =
        json_pack("{s:o,s:o,s:o,s:o,s:o,s:o,s:o,s:o}", "sent", number(each->sent), "types", types(each->type),
                  "types_moving", types(each->type_moving), "at_rest", number(each->at_rest), "forward",
                  number(each->forward), "backward", number(each->backward), "changes_of_type",
                  number(each->changes_of_type), "over_limit", number(each->over_limit));
    (void)json_object_update(object, more);
    json_decref(more);
    (void)json_object_set_new(object, "padding", number(each->padding));
    (void)json_object_set_new(object, "speed_mm_s", range(&each->speed_mm_s));
    (void)json_object_set_new(object, "current_mA", range(&each->current_mA));
    (void)json_object_set_new(object, "current_at_rest_mA", range(&each->current_at_rest_mA));
    (void)json_object_set_new(object, "current_forward_mA", range(&each->current_forward_mA));
    (void)json_object_set_new(object, "current_backward_mA", range(&each->current_backward_mA));
    return object;
}

static json_t *answer(const learn_answer_t *answer) {
    return json_pack("{s:o,s:o,s:o}", "with_ms", json_integer(answer->with_us / 1000), "against_ms",
                     json_integer(answer->against_us / 1000), "still_ms", json_integer(answer->still_us / 1000));
}

static json_t *wheel(const learn_wheel_t *each) {
    json_t *object = json_pack("{s:o,s:o,s:o,s:o,s:o,s:o}", "speed_frames", number(each->speeds), "told_forward",
                               answer(&each->forward), "told_backward", answer(&each->backward), "stood_at_zero_ms",
                               json_integer(each->stood_us / 1000), "ran_at_zero_ms", json_integer(each->ran_us / 1000),
                               "status_frames", number(each->statuses));
    const json_int_t um_s = (each->steady_rpm > 0) ? each->steady_mm_s * 1000 / each->steady_rpm : 0;
    (void)json_object_set_new(object, "um_s_per_rpm", (um_s > 0) ? json_integer(um_s) : json_null());
    (void)json_object_set_new(object, "ticks", number(each->ticks));
    (void)json_object_set_new(object, "milli_turns", json_integer(each->turned_rpm_us / 60000));
    (void)json_object_set_new(object, "force_frames", number(each->forces));
    (void)json_object_set_new(object, "force_raw", range(&each->force));
    (void)json_object_set_new(object, "force_raw_at_rest", range(&each->rest_force));
    (void)json_object_set_new(object, "offset_dN", range(&each->offset_dN));
    return object;
}

static json_t *findings_of(const learn_findings_t *self, json_t *suggested) {
    json_t *list = json_array();
    for (unsigned i = 0; i < self->count; i++) {
        const learn_finding_t *each = &self->at[i];
        const char *section;
        const char *key;
        (void)json_array_append_new(
            list, json_pack("{s:s,s:s?,s:s,s:s?,s:s}", "item", each->item, "side",
                            (each->side == LEARN_BOTH) ? NULL : learn_side(each->side), "verdict",
                            (each->mark == '+')   ? "for"
                            : (each->mark == '-') ? "against"
                                                  : "unknown",
                            "value", (each->value[0] != '\0') ? each->value : NULL, "text", each->text));
        if (learn_suggests(self, each, &section, &key)) {
            json_t *lines = json_object_get(suggested, section);
            if (lines == NULL) {
                lines = json_object();
                (void)json_object_set_new(suggested, section, lines);
            }
            (void)json_object_set_new(lines, key, json_string(each->value));
        }
    }
    return list;
}

static json_t *ids(const learn_id_t *from, unsigned count) {
    json_t *list = json_array();
    for (unsigned i = 0; i < count; i++) {
        (void)json_array_append_new(list, id(&from[i]));
    }
    return list;
}

bool learn_report_json(const learn_t *self, const char *name) {
    static learn_findings_t findings;
    json_t *suggested = json_object();
    learn_weigh(self, &findings);
    json_t *root = json_pack("{s:s,s:o,s:I,s:{s:o,s:o},s:{s:o,s:o},s:o,s:o,s:o,s:o,s:o}", "file", name, "frames",
                             number(self->frames), "duration_us", (json_int_t)(self->last_us - self->first_us),
                             "setpoints", "left", setpoints(self, IW_LEFT), "right", setpoints(self, IW_RIGHT),
                             "wheels", "left", wheel(&self->wheel[IW_LEFT]), "right", wheel(&self->wheel[IW_RIGHT]),
                             "telemetry", ids(&self->known[IW_SIDES], LEARN_IDS - IW_SIDES), "other_ids",
                             ids(self->other, self->others), "more_others", number(self->more_others), "findings",
                             findings_of(&findings, suggested), "suggested", suggested);
    if (root == NULL) {
        return false;
    }
    (void)json_dumpf(root, stdout, JSON_COMPACT);
    (void)putchar('\n');
    json_decref(root);
    return true;
}
