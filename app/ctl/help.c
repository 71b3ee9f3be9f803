// SPDX-License-Identifier: MIT
#include "help.h"

#include "gateway_config.h"

#include <string.h>

static const verb_t verbs[] = {
    {"status", verb_status, "", "everything the gateway knows, and what to do next",
     "Reads only. Unknown values are shown as --. Colours only on a terminal and without NO_COLOR.\n"},
    {"top", verb_top, "", "the same as a live screen; stops the wheels at the touch of the space bar",
     "Reads, and sends stop, e-stop and reset when their keys are pressed; it never arms. Waits for a gateway that is "
     "not "
     "there.\n"
     "SPACE stop, E e-stop, R reset, Q quit. 80 x 24 show everything; smaller terminals show less. NO_COLOR is "
     "heeded.\n"},
    {"watch", verb_watch, "[TOPIC...] [--rate HZ]", "events as they come, one JSON object per line",
     "Reads only. Topics: state bus estop lease stop force frame; without one: the first five.\n"
     "--rate 1..100: events of state and force per second, 10 if not told.\n"
     "Ends with exit code 0 on Ctrl-C or when nobody reads its output any more.\n"},
    {"drive", verb_drive, "LEFT RIGHT [--for TIME] [--takeover] [--current LEFT RIGHT]", "MOVES THE WHEELS, then stops",
     "Arms, drives both wheels at LEFT and RIGHT mm/s (negative: backwards), and stops them: after TIME, on Ctrl-C, "
     "on\n"
     "any error. Then it waits until both are at rest. Before, if they do not stand yet, for a second at the most.\n"
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
    {"ledger", verb_ledger, "", "what is assumed about the wheels, and what is known",
     "Reads only. Per item: the value in force, the evidence, and what a contradiction disables.\n"},
    {"confirm", verb_confirm, "ITEM [VALUE] [--how TEXT]", "the operator's word on an item of the ledger",
     "Moves nothing. VALUE is what was found at the machine, as the configuration\n"
     "file writes it; another one than the configured contradicts the item, and what\n"
     "depends on it is disabled. Without VALUE: what is configured is right.\n"
     "--how TEXT       by what it was found, such as 'a tape'; kept as its evidence\n"},
    {"doctor", verb_doctor, "[IFACE] [--estop LINE] [--config FILE] [--listen 2s] [--no-press]",
     "what is wrong with bus, wheels and e-stop, and what mends it",
     "Sends nothing, moves nothing; works with and without a running gateway.\n"
     "IFACE            can0 or unix:PATH; else the gateway's bus, the configured one, the only one\n"
     "--estop LINE     the e-stop's line, if no gateway runs that knows it\n"
     "--config FILE    else " GATEWAY_CONFIG_PATH ", if it is there\n"
     "--listen TIME    how long to listen, 2s if not told\n"
     "--no-press       do not ask for a press of the e-stop; never asked but on a terminal\n"
     "With --json one object: ok, bus, gateway, findings [check, verdict, text, cure], rates, load_permille.\n"
     "Exit code 1: something is wrong.\n"},
    {"bringup", verb_bringup, "[FILE] [--can BUS] [--estop LINE] [--from FILE] [--learn FILE] [--current MA]",
     "guides from unknown wheels to a configuration; WHEELS TURN, in the air",
     "Asks before every movement. A gateway of its own drives, slowly; any key and the e-stop stop the wheels.\n"
     "FILE             what is written at the end, gateway.conf if not told; replaced only after asking\n"
     "--can BUS        can0 or unix:PATH\n"
     "--estop LINE     the e-stop's line, or none\n"
     "--from FILE      begin with its values; else " GATEWAY_CONFIG_PATH ", if it is there\n"
     "--learn FILE     a recording of another controller (candump -L): the setpoint types to try first\n"
     "--current MA     the most that the motors get, 500 if not told\n"
     "--gateway PROG   the gateway's program, if it is not beside this one\n"
     "Settles e-stop, gear, setpoint type, current role, signs, units of force, radius\n"
     "and track; what was not seen, all of it, is noted and not confirmed.\n"
     "Exit code 1: ended early, nothing was written.\n"},
    {"why", verb_why, "[NUMBER|FILE] [--list] [--frames N] [--directory DIR]",
     "why the wheels were stopped last, in one sentence",
     "Reads only. With the frames around the stop, and where its recording is.\n"
     "NUMBER, FILE     a stop recorded on disk: its number, or the path of its recording; needs no gateway\n"
     "--list           all stops recorded on disk; needs no gateway\n"
     "--frames N       how many frames before and after, 0 to 40; 12 if not told\n"
     "--directory DIR  where they are; else the gateway's, else /var/lib/iwheel\n"},
    {"record", verb_record, "[FILE] [--for TIME] [--can BUS]", "what is on the bus, to a file in candump's log form",
     "Reads only: through the gateway if one runs on that bus, else from the bus itself, without ever sending.\n"
     "FILE        its name; else iwheel-DATE-TIME.log here; -: standard output. A file that is there is never touched\n"
     "--for TIME  500ms, 10s, 5min, 2h; else until Ctrl-C\n"
     "--can BUS   can0 (if not told), or unix:PATH\n"},
    {"decode", verb_decode, "[FILE] [--csv] [--config FILE]", "a recording as readable values with units",
     "Reads only; needs no gateway. FILE: a recording in candump's log form; without one, or with -: standard input, "
     "also\n"
     "live: candump -L can0 | iwheelctl decode. T behind the id: sent by the program that recorded it.\n"
     "--csv          one row per frame, units in the header, empty cells for what a frame does not carry\n"
     "With --json one object per frame and line: t_us, interface, direction, id, extended, remote, fd, dlc, data, "
     "wheel,\n"
     "message, values {what it carries, named as in the CSV}, note.\n"
     "--config FILE  the gateway's configuration, for the units of force; else as documented: left cN, right dN\n"
     "Lines that cannot be understood are told with their number and left out; then the exit code is 65.\n"},
    {"learn", verb_learn, "FILE", "what a recording of another controller tells about the wheels",
     "Reads only; needs no gateway. Record while a controller that works drives both\n"
     "wheels: let it stand, go forwards and backwards for seconds each; best from the\n"
     "moment the wheels are switched on, unloaded. Tells setpoint types, ranges,\n"
     "lengths and periods, what speaks for (+) and against (-) the documented units\n"
     "and signs, and what no recording can tell. What was not seen is not concluded:\n"
     "such a line begins with ? and names what is missing. With --json: one object\n"
     "with the figures, every sentence (item, side, verdict, value, text) and the\n"
     "suggestions. Exit code 1: there is no setpoint in it.\n"},
    {"replay", verb_replay, "FILE [--config FILE]", "a recording through the gateway's core: what it decides",
     "Reads only; needs no gateway and no bus. The same recording gives the same bytes each time.\n"
     "Beside a recording of the black box lie the requests and answers of then (.jsonl) and the configuration "
     "(.conf):\n"
     "with them everything is decided again at the same times and compared with what was decided then.\n"
     "Any other recording is listened to: which wheels are heard, faults, force, assumptions.\n"
     "--config FILE  the gateway's configuration; needed where none lies beside the recording\n"},
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
        "Only drive and bringup move wheels.\n"
        "Exit codes: 0 ok, 1 the gateway said no, 64 usage, 65 bad input, 69 no gateway, 70 internal, 75 timed out,\n"
        "77 permission, 78 configuration\n",
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
