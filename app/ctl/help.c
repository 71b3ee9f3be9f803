// SPDX-License-Identifier: MIT
#include "help.h"

#include "config/gateway_config.h"
#include "config/similar.h"
#include "talk/ctl_words.h"
#include "text/duration.h"

#include "iwheel_northbound/text.h"
#include "iwheel_northbound/words.h"

#include <string.h>

#define WIDTH 80U

static const char *topic_choice(unsigned number) {
    return (number < (unsigned)IWN_TOPICS) ? iwn_topic_name((iwn_topic_t)number) : NULL;
}

static const char *side_choice(unsigned number) {
    static const char *const sides[] = {"left", "right"};
    return (number < 2U) ? sides[number] : NULL;
}

static const char *config_choice(unsigned number) {
    static const char *const words[] = {"show", "set", "commit", "discard"};
    return (number < sizeof words / sizeof words[0]) ? words[number] : NULL;
}

static const char *fleet_choice(unsigned number) {
    static const char *const verbs[] = {"history", "recordings", "recording"};
    return (number < 3U) ? verbs[number] : NULL;
}

static const char *item_choice(unsigned number) {
    return (number < (unsigned)IW_LEDGER_ITEMS) ? iwn_ledger_item_name((iw_ledger_item_t)number) : NULL;
}

static const char *verb_choice(unsigned number);

#define VERB(name_, run_, words_, summary_, details_)                                                                  \
    .name = (name_), .run = (run_), .words = (words_), .summary = (summary_), .details = details_

static const verb_t verbs[] = {
    {VERB("status", verb_status, "", "everything the gateway knows, and what to do next",
          "Reads only. Unknown values are shown as --. Colours only on a terminal and without NO_COLOR.\n")},
    {VERB("top", verb_top, "", "the same as a live screen; the space bar stops the wheels",
          "Reads, and sends stop, e-stop and reset when their keys are pressed; it never arms. Waits for a gateway "
          "that is not "
          "there.\n"
          "SPACE stop, E e-stop, R reset, Q quit. 80 x 24 show everything; smaller terminals show less, larger ones "
          "also speed "
          "and force of the last minute. NO_COLOR is heeded.\n"),
     .no_json = "top draws a screen; for JSON lines: iwheelctl watch state"},
    {VERB("web", verb_web, "", "the address of the web page, for this browser or a phone",
          "Reads only; needs the package iwheel-web and the right to read its token: sudo iwheelctl web. On a terminal "
          "as a QR code too.\n"
          "WHO HAS THE ADDRESS MAY LOOK AND STOP, and drive if that is configured.\n"),
     .no_json = "web prints an address; it has no --json"},
    {VERB("fleet", verb_fleet,
          "[history|recordings|recording] [ID] [NAME] [--last SPAN] [--since WHEN] [--until WHEN] [--all] [--output "
          "FILE] [--wait SECONDS] [--for SECONDS] [--config FILE]",
          "who of a fleet is there, who stopped and why, as its broker knows",
          "Asks an MQTT broker, not this machine's gateway; needs the package iwheel-mqtt and /etc/iwheel/fleet.conf.\n"
          "Alone a row per machine, until Ctrl-C. history: the stops of one machine or all; recordings: which "
          "recordings "
          "a machine has; recording: fetches one (NAME or its number, else the newest) into files here, checked.\n"
          "--last SPAN      of the history: 90min, 12h or 7d; 24h if not told\n"
          "--since WHEN     2026-11-21T22:00, local time\n"
          "--until WHEN     now if not told\n"
          "--all            not only stops: faults, e-stop, bus, lease, ledger, zeros\n"
          "--output FILE    where a recording's frames go, the rest beside it; ID-NAME.log if not told. Without a "
          "verb: the rows as JSON, for iwheel-web\n"
          "--wait SECONDS   for a machine that does not answer; 60 if not told\n"
          "--for SECONDS    listen so long, then show the rows once; --json needs it\n"
          "--config FILE    whose [broker] to use\n"),
     .choice = fleet_choice},
    {VERB("watch", verb_watch, "[TOPIC...] [--rate HZ]", "events as they come, one JSON object per line",
          "Reads only. Topics: state bus estop lease stop force frame; without one: the first five.\n"
          "--rate HZ  1 to 100: events of state and force per second, 10 if not told\n"
          "A reader that is too slow gets the latest values instead of a backlog, and before them how many events\n"
          "were left out: {\"event\":\"lost\",\"count\":N}.\n"
          "Ends with exit code 0 on Ctrl-C or when nobody reads its output any more.\n"),
     .choice = topic_choice},
    {VERB("drive", verb_drive, "LEFT RIGHT [--for TIME] [--takeover] [--current LEFT RIGHT]",
          "MOVES THE WHEELS, then stops",
          "Arms, drives both wheels at LEFT and RIGHT mm/s (negative: backwards), and stops them: after TIME, on "
          "Ctrl-C, on any "
          "error. Then it waits until both are at rest. Before, if they do not stand yet, for a second at the most.\n"
          "--for TIME       " DURATION_FORM "; 2s if not told; 20ms to 10min\n"
          "--takeover       takes the lease from another client, if the wheels stand\n"
          "--current L R    mA per wheel; needed if the configuration says current_role = setpoint\n"
          "Exit code 1: refused, cut short, or interrupted.\n")},
    {VERB("stop", verb_stop, "", "ramp to zero and disarm; needs no lease", "Whoever drives must arm again.\n")},
    {VERB("disarm", verb_stop, "", "the same as stop", "Whoever drives must arm again.\n")},
    {VERB("estop", verb_estop, "[REASON...]", "zero without ramp, latched until reset; needs no lease",
          "REASON appears in `why`. This is no substitute for the button that cuts power.\n")},
    {VERB("reset", verb_reset, "", "leave the latched state, if its cause is gone",
          "Moves nothing: motion needs a new drive command.\n")},
    {VERB(
        "release", verb_release, "", "end the zeros of after_stop = hold; then the wheels may roll",
        "Set the parking brake first: in silence the machine rolls on a slope. Without a hold it changes nothing.\n")},
    {VERB("tare", verb_tare, "[left|right]", "make the present force the zero; both wheels if none is named",
          "Moves nothing. Refused while a wheel turns or its force is not quiet.\n"),
     .choice = side_choice},
    {VERB("ledger", verb_ledger, "", "what is assumed about the wheels, and what is known",
          "Reads only. Per item: the value in force, the evidence, and what a contradiction disables.\n")},
    {VERB("confirm", verb_confirm, "ITEM [VALUE] [--how TEXT]", "the operator's word on an item of the ledger",
          "Moves nothing. VALUE is what was found at the machine, as the configuration file writes it; another one "
          "than the "
          "configured contradicts the item, and what depends on it is disabled. Without VALUE: what is configured is "
          "right.\n"
          "--how TEXT  by what it was found: a tape, bringup; kept as the item's evidence, 127 bytes at most\n"),
     .choice = item_choice},
    {VERB("config", verb_config, "[show|set KEY VALUE|commit|discard]",
          "the configuration of a board behind iwheel-serial",
          "For a gateway that keeps its configuration itself; that of iwheel-gateway is its file, and it refuses.\n"
          "show           every key and its value, with what is staged; also without a word\n"
          "set KEY VALUE  stages one, such as drive.lease_ms 300: keys and values as in the file\n"
          "commit         writes what is staged into the board's flash, all or nothing, and starts it anew; only while "
          "it "
          "listens, silent after a stop. Its clients are closed and come again\n"
          "discard        forgets what is staged\n"),
     .choice = config_choice},
    {VERB("doctor", verb_doctor, "[IFACE] [--estop LINE] [--config FILE] [--listen TIME] [--no-press]",
          "what is wrong with bus, wheels and e-stop, and what mends it",
          "Sends nothing, moves nothing; works with and without a running gateway.\n"
          "IFACE            can0 or unix:PATH; else the gateway's bus, the configured one, the only one\n"
          "--estop LINE     the e-stop's line, if no gateway runs that knows it\n"
          "--config FILE    else " GATEWAY_CONFIG_PATH ", if it is there\n"
          "--listen TIME    how long to listen, 2s if not told; 200ms to 1min\n"
          "--no-press       do not ask for a press of the e-stop; never asked but on a terminal\n"
          "With --json one object: ok, bus, gateway, findings [check, verdict, text, cure], rates, load_permille.\n"
          "Exit code 1: something is wrong.\n")},
    {VERB("bringup", verb_bringup,
          "[FILE] [--can BUS] [--estop LINE] [--from FILE] [--learn FILE] [--current MA] [--gateway PROG]",
          "guides from unknown wheels to a configuration; WHEELS TURN",
          "Wheels turn in the air. It asks before every movement. A gateway of its own drives, slowly; any key and the "
          "e-stop "
          "stop the wheels.\n"
          "FILE             what is written at the end, gateway.conf if not told; replaced only after asking\n"
          "--can BUS        can0 or unix:PATH\n"
          "--estop LINE     the e-stop's line, or none\n"
          "--from FILE      begin with its values; else " GATEWAY_CONFIG_PATH ", if it is there\n"
          "--learn FILE     a recording of another controller (candump -L): the setpoint types to try first\n"
          "--current MA     the most that the motors get, 500 if not told\n"
          "--gateway PROG   the gateway's program, if it is not beside this one\n"
          "Settles e-stop, gear, setpoint type, current role, signs, units of force, radius and track; what was not "
          "seen, all of it, is noted and not confirmed.\n"
          "Exit code 1: ended early, nothing was written.\n"),
     .no_json = "bringup talks with a person; it has no --json (doctor has)"},
    {VERB("why", verb_why, "[NUMBER|FILE] [--list] [--frames N] [--directory DIR]",
          "why the wheels were stopped last, in one sentence",
          "Reads only. With the frames around the stop, and where its recording is.\n"
          "NUMBER, FILE     a stop recorded on disk: its number, or the path of its recording\n"
          "--list           all stops recorded on disk\n"
          "--frames N       how many frames before and after, 0 to 40; 12 if not told\n"
          "--directory DIR  where they are; else the gateway's, else /var/lib/iwheel\n"
          "NUMBER, FILE and --list need no gateway where the files may be read; else it is asked for them.\n")},
    {VERB("record", verb_record, "[FILE] [--for TIME] [--can BUS]",
          "what is on the bus, to a file in candump's log form",
          "Reads only: through the gateway if one runs on that bus, else from the bus itself, without ever sending.\n"
          "FILE        its name; else iwheel-DATE-TIME.log here; -: standard output. A file that is there is never "
          "touched\n"
          "--for TIME  " DURATION_FORM "; else until Ctrl-C\n"
          "--can BUS   can0 (if not told), or unix:PATH\n"
          "With --json one object at the end: ok, file, bus, gateway, frames, lost, span_us.\n")},
    {VERB("decode", verb_decode, "[FILE] [--csv] [--config FILE]", "a recording as readable values with units",
          "Reads only; needs no gateway. FILE: a recording in candump's log form; without one, or with -: standard "
          "input, also "
          "live: candump -L can0 | iwheelctl decode. T behind the id: sent by the program that recorded it.\n"
          "--csv          one row per frame, units in the header, empty cells for what a frame does not carry\n"
          "--config FILE  the gateway's configuration, for the units of force; else as documented: left cN, right dN\n"
          "With --json one object per frame and line: t_us, interface, direction, id, extended, remote, fd, dlc, data, "
          "wheel, "
          "message, values {what it carries, named as in the CSV}, note.\n"
          "Lines that cannot be understood are told with their number and left out; then the exit code is 65.\n")},
    {VERB(
        "learn", verb_learn, "FILE [--interface NAME] [--config FILE]",
        "what a recording of another controller tells about the wheels",
        "Reads only; needs no gateway. Record while a controller that works drives both wheels: let it stand, go "
        "forwards and backwards for seconds each; best from the moment the wheels are switched on, unloaded. Tells "
        "setpoint types, ranges, lengths and periods, what speaks for (+) and against (-) the documented units and "
        "signs, and what no recording can tell. What was not seen is not concluded: such a line begins with ? and "
        "names what is missing. Of each drive it tells how far the machine left its path by what the wheels measured, "
        "and where the gateway would stop it.\n"
        "--interface NAME  only the frames of this interface; needed if the recording has frames of several\n"
        "--config FILE     the gateway's configuration, for invert, gear, pair_mm and wheel_lag_ms; else its defaults\n"
        "With --json one object: the figures, every sentence (item, side, verdict, value, text), the suggestions.\n"
        "Exit code 1: there is no setpoint in it.\n")},
    {VERB("replay", verb_replay, "FILE [--config FILE] [--interface NAME]",
          "a recording through the gateway's core: what it decides",
          "Reads only; needs no bus, and no gateway unless a recording of it is not to be read here: then it is asked "
          "for "
          "it. The same recording gives the same bytes each time.\n"
          "Beside a recording of the black box lie the requests and answers of then (.jsonl) and the configuration "
          "(.conf): "
          "with them everything is decided again at the same times and compared with what was decided then. Any other "
          "recording "
          "is listened to: which wheels are heard, faults, force, assumptions.\n"
          "--config FILE     the gateway's configuration; needed where none lies beside the recording\n"
          "--interface NAME  only the frames of this interface; needed if the recording has frames of several\n"
          "With --json one object per line: t_us, event, text; events note and summary tell the rest.\n")},
    {VERB("help", verb_help, "[VERB] [--list]", "this page, or the page of a verb",
          "--list  the bare words that may follow VERB, or all verbs, one a line; FILE and BUS stand for names of "
          "these. For "
          "completion in a shell\n"),
     .no_json = "help is text for people; it has no --json", .choice = verb_choice},
};
#define VERBS (sizeof verbs / sizeof verbs[0])

static const char *verb_choice(unsigned number) {
    return (number < VERBS) ? verbs[number].name : NULL;
}

const verb_t *help_find(const char *name) {
    for (size_t i = 0; i < VERBS; i++) {
        if (strcmp(verbs[i].name, name) == 0) {
            return &verbs[i];
        }
    }
    return NULL;
}

int help_unknown(const char *name) {
    char known[256];
    iwn_text_t list = iwn_text_begin(known, sizeof known);
    const char *best = NULL;
    size_t best_distance = GW_WORD_STRANGE;
    for (size_t i = 0; i < VERBS; i++) {
        const size_t far = gw_word_distance(name, verbs[i].name);
        if (far < best_distance) {
            best = verbs[i].name;
            best_distance = far;
        }
        IWN_TEXT_JOIN(&list, (i > 0) ? " " : "", verbs[i].name);
    }
    if (name[0] == '\0') {
        return ctl_fail(CTL_USAGE, "no verb given; known are: %s", known);
    }
    return (best != NULL) ? ctl_fail(CTL_USAGE, "unknown verb \"%s\"; did you mean %s? All: iwheelctl help", name, best)
                          : ctl_fail(CTL_USAGE, "unknown verb \"%s\"; known are: %s", name, known);
}

/// Where a line that goes on is indented to: below what an option's name is explained by.
static size_t hang_of(const char *line, size_t length) {
    for (size_t i = 0; i + 2U < length && (i < 24U); i++) {
        if (line[i] == ' ' && line[i + 1U] == ' ' && line[i + 2U] != ' ') {
            return i + 2U;
        }
    }
    return 0;
}

/// Lines that end with '\n', broken between words where they are longer than a terminal is wide.
static void print_wrapped(const char *text, size_t hang, FILE *out) {
    while (*text != '\0') {
        size_t left = strcspn(text, "\n");
        const char *next = text + left + ((text[left] == '\n') ? 1U : 0U);
        const size_t indent = (hang > 0) ? hang : hang_of(text, left);
        size_t room = WIDTH;
        while (left > room) {
            size_t cut = room;
            for (; cut > 1U && text[cut] != ' '; cut--) {
            }
            (void)fprintf(out, "%.*s\n%*s", (int)cut, text, (int)indent, "");
            text += cut + 1U;
            left -= cut + 1U;
            room = WIDTH - indent;
        }
        (void)fprintf(out, "%.*s\n", (int)left, text);
        text = next;
    }
}

void help_print(FILE *out) {
    (void)fputs("iwheelctl - talk to the iWheel gateway\n\n"
                "Usage: iwheelctl [--socket PATH] [--json] VERB ...\n\n",
                out);
    for (size_t i = 0; i < VERBS; i++) {
        (void)fprintf(out, "  %-9s%s\n", verbs[i].name, verbs[i].summary);
    }
    print_wrapped(
        "\n"
        "  --socket PATH   the gateway's socket; else $IWHEEL_SOCKET, else the only one\n"
        "                  under /run/iwheel\n"
        "  --json          objects, one a line: the gateway's own replies, or the verb's\n"
        "                  (see its page)\n"
        "  --help          this page, or after a verb its own page\n"
        "  --version       the version\n\n"
        "Only drive and bringup move wheels.\n"
        "Exit codes: 0 ok, 1 the gateway said no, 64 usage, 65 bad input, 69 no gateway, 70 internal, 75 timed "
        "out, 77 permission, 78 configuration\n",
        0, out);
}

static void print_choices(const verb_t *verb, FILE *out) {
    char line[512];
    iwn_text_t text = iwn_text_begin(line, sizeof line);
    for (unsigned i = 0; verb->choice(i) != NULL; i++) {
        IWN_TEXT_JOIN(&text, (i > 0) ? ", " : "ITEM  ", verb->choice(i));
    }
    print_wrapped(line, 6U, out);
}

void help_print_verb(const verb_t *verb, FILE *out) {
    char usage[256];
    (void)snprintf(usage, sizeof usage, "Usage: iwheelctl [--socket PATH]%s %s%s%s",
                   (verb->no_json == NULL) ? " [--json]" : "", verb->name, (verb->words[0] != '\0') ? " " : "",
                   verb->words);
    print_wrapped(usage, 7U, out);
    (void)fprintf(out, "\n%s: %s\n", verb->name, verb->summary);
    print_wrapped(verb->details, 0, out);
    if (verb->choice == item_choice) {
        print_choices(verb, out);
    }
}

/// The options in the verb's words, and FILE and BUS where it takes such.
static void list_words(const verb_t *verb, FILE *out) {
    const char *at = verb->words;
    for (at = strstr(at, "--"); at != NULL; at = strstr(at, "--")) {
        const size_t length = 2U + strspn(at + 2, "abcdefghijklmnopqrstuvwxyz-");
        (void)fprintf(out, "%.*s\n", (int)length, at);
        at += length;
    }
    for (unsigned i = 0; verb->choice != NULL && verb->choice(i) != NULL; i++) {
        (void)fprintf(out, "%s\n", verb->choice(i));
    }
    if (strncmp(verb->words, "FILE", 4U) == 0 || strncmp(verb->words, "[FILE", 5U) == 0 ||
        strstr(verb->words, "|FILE") != NULL) {
        (void)fputs("FILE\n", out);
    }
    if (strncmp(verb->words, "[IFACE", 6U) == 0) {
        (void)fputs("BUS\n", out);
    }
    (void)fputs((verb->no_json == NULL) ? "--json\n--socket\n--help\n" : "--socket\n--help\n", out);
}

int verb_help(ctl_t *self, int count, char **words) {
    const bool list = count > 0 && strcmp(words[count - 1], "--list") == 0;
    (void)self;
    count -= list ? 1 : 0;
    if (!words_at_most("help", count, 1, words)) {
        return CTL_USAGE;
    }
    const verb_t *verb = (count > 0) ? help_find(words[0]) : NULL;
    if (count > 0 && verb == NULL) {
        return help_unknown(words[0]);
    }
    if (!list && verb != NULL) {
        help_print_verb(verb, stdout);
    } else if (!list) {
        help_print(stdout);
    } else if (verb != NULL) {
        list_words(verb, stdout);
    } else {
        for (size_t i = 0; i < VERBS; i++) {
            (void)printf("%s\t%s\n", verbs[i].name, verbs[i].summary);
        }
    }
    return CTL_OK;
}
