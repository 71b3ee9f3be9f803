// SPDX-License-Identifier: MIT
/// @file
/// Bodies of the functions of json_out.h with a name argument. That header includes this file, or json_out.c
/// compiles it once.
#ifndef IWHEEL_NORTHBOUND_JSON_OUT_INLINE_H
#define IWHEEL_NORTHBOUND_JSON_OUT_INLINE_H

IWN_OUT_INLINE char *iwn_out_begin(iwn_out_t *self, iwn_span_t name, size_t length) {
    const size_t comma = self->comma ? 1U : 0U;
    const size_t needed = comma + ((name.text != NULL) ? name.length + 3U : 0U) + length;
    self->comma = true;
    if (self->overflow || needed >= self->size - self->length) {
        self->overflow = true;
        return NULL;
    }
    char *at = &self->data[self->length];
    self->length += needed;
    *at = ',';
    at += comma;
    if (name.text != NULL) {
        *at = '"';
        memcpy(at + 1, name.text, name.length);
        at += name.length + 1U;
        at[0] = '"';
        at[1] = ':';
        at += 2;
    }
    return at;
}

IWN_OUT_INLINE void iwn_out_open(iwn_out_t *self, const char *name, char bracket) {
    char *const at = iwn_out_begin(self, iwn_span(name), 1U);
    self->comma = false;
    if (at != NULL) {
        *at = bracket;
    }
}

IWN_OUT_INLINE void iwn_out_known(iwn_out_t *self, const char *name, bool known, int64_t value) {
    if (!known) {
        iwn_out_span(self, iwn_span(name), iwn_span("null"));
    } else if (iwn_out_begin(self, iwn_span(name), iwn_digits_length(value)) != NULL) {
        (void)iwn_digits(value, &self->data[self->length]);
    }
}

IWN_OUT_INLINE void iwn_out_int(iwn_out_t *self, const char *name, int64_t value) {
    iwn_out_known(self, name, true, value);
}

IWN_OUT_INLINE void iwn_out_bool(iwn_out_t *self, const char *name, bool value) {
    iwn_out_span(self, iwn_span(name), value ? iwn_span("true") : iwn_span("false"));
}

IWN_OUT_INLINE void iwn_out_null(iwn_out_t *self, const char *name) {
    iwn_out_known(self, name, false, 0);
}

IWN_OUT_INLINE void iwn_out_known32(iwn_out_t *self, const char *name, bool known, int32_t value) {
    iwn_out_known(self, name, known, value);
}

IWN_OUT_INLINE void iwn_out_text(iwn_out_t *self, const char *name, const char *text) {
    iwn_out_string(self, iwn_span(name), text);
}

#endif
