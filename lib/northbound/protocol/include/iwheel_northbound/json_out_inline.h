// SPDX-License-Identifier: MIT
/// @file
/// Bodies of the functions of json_out.h with a name argument. That header includes this file, or json_out.c
/// compiles it once.
#ifndef IWHEEL_NORTHBOUND_JSON_OUT_INLINE_H
#define IWHEEL_NORTHBOUND_JSON_OUT_INLINE_H

IWN_OUT_INLINE void iwn_out_open(iwn_out_t *self, const char *name, char bracket) {
    iwn_out_bracket(self, iwn_span(name), bracket);
}

IWN_OUT_INLINE void iwn_out_int(iwn_out_t *self, const char *name, int64_t value) {
    iwn_out_number(self, iwn_span(name), value);
}

IWN_OUT_INLINE void iwn_out_bool(iwn_out_t *self, const char *name, bool value) {
    iwn_out_span(self, iwn_span(name), value ? iwn_span("true") : iwn_span("false"));
}

IWN_OUT_INLINE void iwn_out_null(iwn_out_t *self, const char *name) {
    iwn_out_span(self, iwn_span(name), iwn_span("null"));
}

IWN_OUT_INLINE void iwn_out_known(iwn_out_t *self, const char *name, bool known, int64_t value) {
    if (known) {
        iwn_out_int(self, name, value);
    } else {
        iwn_out_null(self, name);
    }
}

IWN_OUT_INLINE void iwn_out_known32(iwn_out_t *self, const char *name, bool known, int32_t value) {
    iwn_out_known(self, name, known, value);
}

IWN_OUT_INLINE void iwn_out_text(iwn_out_t *self, const char *name, const char *text) {
    iwn_out_string(self, iwn_span(name), text);
}

#endif
