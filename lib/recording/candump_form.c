// SPDX-License-Identifier: MIT
#include "candump_form.h"

#include <stdbool.h>
#include <string.h>

#define LOGCONVERT "; convert it: can_logconvert FILE OUT.log (of python-can)"
#define SCREEN     "; record with candump -L or iwheelctl record"

typedef struct {
    const char *begin;
    size_t length;
    const char *why;
} form_t;

#define FORM(begin_, why_)                                                                                             \
    { (begin_), sizeof(begin_) - 1U, (why_) }

static const form_t forms[] = {
    FORM("\x1f\x8b", "is a gzip file; unpack it: gunzip -c FILE | iwheelctl VERB -"),
    FORM("\x28\xb5\x2f\xfd", "is a zstd file; unpack it: zstdcat FILE | iwheelctl VERB -"),
    FORM("\xfd"
         "7zXZ",
         "is an xz file; unpack it: xzcat FILE | iwheelctl VERB -"),
    FORM("BZh", "is a bzip2 file; unpack it: bzcat FILE | iwheelctl VERB -"),
    FORM("PK\x03\x04", "is a zip file; unpack it: unzip FILE"),
    FORM("\xff\xfe", "is UTF-16 text; convert it: iconv -f UTF-16 -t UTF-8 FILE | iwheelctl VERB -"),
    FORM("\xfe\xff", "is UTF-16 text; convert it: iconv -f UTF-16 -t UTF-8 FILE | iwheelctl VERB -"),
    FORM("(\0", "is UTF-16 text; convert it: iconv -f UTF-16LE -t UTF-8 FILE | iwheelctl VERB -"),
    FORM("\0(", "is UTF-16 text; convert it: iconv -f UTF-16BE -t UTF-8 FILE | iwheelctl VERB -"),
    FORM("LOGG", "is a BLF file (Vector)" LOGCONVERT),
    FORM("MDF ", "is an MF4 file (ASAM MDF)" LOGCONVERT),
    FORM("SQLite format 3", "is a database of python-can" LOGCONVERT),
    FORM(";$FILEVERSION", "is a TRC file (PEAK)" LOGCONVERT),
    FORM("date ", "is an ASC file (Vector); convert it: asc2log <FILE >OUT.log (of can-utils)"),
    FORM("Timestamp: ", "is python-can's screen form" SCREEN),
    FORM("{", "is JSON; the frames of a recording are in its file .log"),
    FORM("\x0a\x0d\x0d\x0a", "is a pcapng file" SCREEN),
    FORM("\xd4\xc3\xb2\xa1", "is a pcap file" SCREEN),
    FORM("\xa1\xb2\xc3\xd4", "is a pcap file" SCREEN),
};

static bool begins(const char *bytes, size_t size, const char *begin, size_t length) {
    return size >= length && memcmp(bytes, begin, length) == 0;
}

/// Recognises `... 10A   [4]  01 00`, with or without a time: the output of candump without -L.
static bool is_screen(const char *line, size_t length) {
    for (size_t i = 1; i + 2U < length; i++) {
        if (line[i] == '#') {
            return false;
        }
        if (line[i] == '[' && line[i - 1U] == ' ' &&
            (line[i + 2U] == ']' || (i + 3U < length && line[i + 3U] == ']'))) {
            return true;
        }
    }
    return false;
}

size_t candump_form_mark(const char *bytes, size_t size) {
    return begins(bytes, size, "\xef\xbb\xbf", 3U) ? 3U : 0U;
}

const char *candump_form_foreign(const char *bytes, size_t size) {
    for (size_t i = 0; i < sizeof forms / sizeof forms[0]; i++) {
        if (begins(bytes, size, forms[i].begin, forms[i].length)) {
            return forms[i].why;
        }
    }
    if (size == 0U || bytes[0] == '#' || bytes[0] == ';') {
        return NULL; // A comment.
    }
    const char *end = memchr(bytes, '\n', size);
    const size_t length = (end != NULL) ? (size_t)(end - bytes) : size;
    if (is_screen(bytes, length)) {
        return "is candump's screen form" SCREEN;
    }
    if (memchr(bytes, ',', length) != NULL && memchr(bytes, '(', length) == NULL) {
        return begins(bytes, size, "time_s,", 7U)
                   ? "is a CSV file of iwheelctl decode; read the recording that it was made of"
                   : "is a CSV file" LOGCONVERT;
    }
    return NULL;
}
