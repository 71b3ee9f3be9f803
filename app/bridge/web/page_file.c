// SPDX-License-Identifier: MIT
#include "page_file.h"

#include "iwheel_northbound/line.h"

#include <gnutls/crypto.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#define FILE_MAX 1000000L
/// Size of the CRC-32 and length of the unpacked bytes at the end of a gzip file (RFC 1952).
#define GZIP_TRAILER 8U

char *page_read_all(const char *path, size_t *out_length) {
    FILE *file = fopen(path, "re");
    char *text = (file != NULL) ? malloc((size_t)FILE_MAX) : NULL;
    *out_length = (text != NULL) ? fread(text, 1, (size_t)FILE_MAX - 1U, file) : 0U;
    const bool good = text != NULL && ferror(file) == 0 && feof(file) != 0;
    if (file != NULL) {
        (void)fclose(file);
    }
    if (!good) {
        free(text);
        return NULL;
    }
    text[*out_length] = '\0';
    char *fitting = realloc(text, *out_length + 1U);
    return (fitting != NULL) ? fitting : text;
}

/// Sets the tag. Without a tag the browser reads the whole file each time.
static void make_tag(page_body_t *self) {
    unsigned char sum[32];
    self->tag[0] = '\0';
    if (self->text == NULL || gnutls_hash_fast(GNUTLS_DIG_SHA256, self->text, self->length, sum) != 0) {
        return;
    }
    char *at = self->tag;
    *at++ = '"';
    for (size_t i = 0; i < 16U; i++, at += 2) {
        (void)snprintf(at, 3, "%02x", sum[i]);
    }
    memcpy(at, "\"", 2);
}

static uint32_t little_endian(const char *text) {
    unsigned char byte[4];
    memcpy(byte, text, sizeof byte);
    return byte[0] | ((uint32_t)byte[1] << 8) | ((uint32_t)byte[2] << 16) | ((uint32_t)byte[3] << 24);
}

static bool is_made_of(const page_body_t *packed, const page_body_t *plain) {
    if (packed->text == NULL || packed->length <= GZIP_TRAILER || memcmp(packed->text, "\x1f\x8b", 2) != 0) {
        return false;
    }
    const char *trailer = packed->text + packed->length - GZIP_TRAILER;
    return little_endian(trailer) == iwn_line_crc(0, plain->text, plain->length) &&
           little_endian(trailer + 4) == (uint32_t)plain->length;
}

bool page_file_read(page_file_t *self, const char *path) {
    char packed_path[272];
    *self = (page_file_t){.plain = {.text = NULL}};
    self->plain.text = page_read_all(path, &self->plain.length);
    if (self->plain.text == NULL) {
        return false;
    }
    (void)snprintf(packed_path, sizeof packed_path, "%s.gz", path);
    self->packed.text = page_read_all(packed_path, &self->packed.length);
    if (!is_made_of(&self->packed, &self->plain)) {
        free(self->packed.text);
        self->packed = (page_body_t){.text = NULL};
    }
    make_tag(&self->plain);
    make_tag(&self->packed);
    return true;
}

void page_file_free(page_file_t *self) {
    free(self->plain.text);
    free(self->packed.text);
    *self = (page_file_t){.plain = {.text = NULL}};
}

/// Returns true if this entry of Accept-Encoding is gzip with a weight above 0.
static bool is_gzip(const char *entry, size_t length) {
    static const char name[] = "gzip";
    const size_t word = strcspn(entry, " \t;,");
    if (word != sizeof name - 1U || strncasecmp(entry, name, word) != 0) {
        return false;
    }
    const char *weight = memchr(entry, '=', length);
    const char *digit = (weight != NULL) ? weight + 1 : "1";
    return strcspn(digit, "123456789") < strcspn(digit, ",");
}

const page_body_t *page_file_choose(const page_file_t *self, const char *accepted) {
    const char *entry = (accepted != NULL && self->packed.text != NULL) ? accepted : "";
    while (*(entry += strspn(entry, " \t,")) != '\0') {
        const size_t length = strcspn(entry, ",");
        if (is_gzip(entry, length)) {
            return &self->packed;
        }
        entry += length;
    }
    return &self->plain;
}

bool page_body_is_known(const page_body_t *self, const char *known) {
    return known != NULL && self->tag[0] != '\0' && strstr(known, self->tag) != NULL;
}
