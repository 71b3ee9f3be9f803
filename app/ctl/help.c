// SPDX-License-Identifier: MIT
#include "help.h"

#include <string.h>

static const verb_t verbs[] = {
    {"status", verb_status, "", "everything the gateway knows, and what to do next",
     "Reads only. Unknown values are shown as --. Colours only on a terminal and without NO_COLOR.\n"},
    {"watch", verb_watch, "[TOPIC...] [--rate HZ]", "events as they come, one JSON object per line",
     "Reads only. Topics: state bus estop lease stop force frame; without one: the first five.\n"
     "--rate 1..100: events of state and force per second, 10 if not told.\n"
     "Ends with exit code 0 on Ctrl-C or when nobody reads its output any more.\n"},
    {"drive", verb_drive, "LEFT RIGHT [--for TIME] [--takeover] [--current LEFT RIGHT]", "MOVES THE WHEELS, then stops",
     "Arms, drives both wheels at LEFT and RIGHT mm/s (negative: backwards), and stops them: after TIME, on Ctrl-C, "
     "on\n"
     "any error. Then it waits until both are at rest.\n"
     "--for TIME       2s if not told; 20ms to 600s, with its unit\n"
     "--takeover       takes the lease from another client, if the wheels stand\n"
     "--current L R    mA per wheel; needed if the configuration says current_role = setpoint\n"
     "Exit code 1: refused, cut short, or interrupted.\n"},
    {"stop", verb_stop, "", "ramp to zero and disarm; needs no lease", "Whoever drives must arm again.\n"},
    {"disarm", verb_stop, "", "the same as stop", "Whoever drives must arm again.\n"},
    {"estop", verb_estop, "[REASON...]", "zero without ramp, latched until reset; needs no lease",
     "REASON appears in `why`. This is no substitute for the button that cuts power.\n"},
    {"reset", verb_reset, "", "leave the latched state, if its cause is gone",
     "Moves nothing: motion needs a new drive command.\n"},
    {"tare", verb_tare, "[left|right]", "make the present force the zero; both wheels if none is named",
     "Moves nothing. Refused while a wheel turns or its force is not quiet.\n"},
    {"why", verb_why, "", "why the wheels were stopped last, in one sentence", "Reads only.\n"},
};
#define VERBS (sizeof(verbs) / sizeof(verbs[0]))

const verb_t *help_find(const char *name) {
    for (size_t i = 0; i < VERBS; i++) {
        if (strcmp(verbs[i].name, name) == 0) {
            return &verbs[i];
        }
    }
    return NULL;
}

void help_print(FILE *out) {
    (void)fputs("iwheelctl - talk to the iWheel gateway\n\n"
                "Usage: iwheelctl [--socket PATH] [--json] VERB ...\n\n",
                out);
    for (size_t i = 0; i < VERBS; i++) {
        (void)fprintf(out, "  %-9s%s\n", verbs[i].name, verbs[i].summary);
    }
    (void)fputs(
        "\n"
        "  --socket PATH   the gateway's socket; else $IWHEEL_SOCKET, else the only one under /run/iwheel\n"
        "  --json          print the gateway's own reply lines\n"
        "  --help          this page, or after a verb its own page\n"
        "  --version       the version\n\n"
        "Only drive moves wheels.\n"
        "Exit codes: 0 ok, 1 the gateway said no, 64 usage, 69 no gateway, 70 internal, 75 timed out, 77 permission\n",
        out);
}

void help_print_verb(const verb_t *verb, FILE *out) {
    (void)fprintf(out, "Usage: iwheelctl [--socket PATH] [--json] %s%s%s\n\n%s: %s\n%s", verb->name,
                  verb->words[0] != '\0' ? " " : "", verb->words, verb->name, verb->summary, verb->details);
}

void help_names(char *out, size_t size) {
    size_t used = 0;
    out[0] = '\0';
    for (size_t i = 0; i < VERBS; i++) {
        const int n = snprintf(out + used, size - used, "%s%s", i > 0 ? " " : "", verbs[i].name);
        used += n > 0 && (size_t)n < size - used ? (size_t)n : 0U;
    }
}
