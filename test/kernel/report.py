# SPDX-License-Identifier: MIT
"""Writes docs/developer/fault-catalogue.md from the results of a campaign."""

import os

import repeated
import scenarios  # noqa: F401  (fills REGISTRY)
from boot import HERE
from catalogue import ENTRIES
from judge_log import percentile
from scenario import REGISTRY

PATH = os.path.join(os.path.dirname(os.path.dirname(HERE)), "docs", "developer", "fault-catalogue.md")
ROWS = {
    1: "client killed",
    2: "client frozen, its socket open",
    3: "client sends and never reads",
    4: "two clients command",
    5: "observers die, flood, connect 1000 times; no descriptor left",
    6: "client comes back with an old intention",
    7: "nonzero command already there at start and at reset",
    8: "1 MB line, no newline, bytes one by one",
    9: "JSON that is none, or is too much",
    10: "value out of range, one wheel good and the other bad",
    11: "e-stop in motion, at random phase",
    12: "e-stop pulse of 0 to 20 ms",
    13: "e-stop pressed at start, chattering, reset repeated",
    14: "GPIO chip vanishes, line busy, no such line",
    15: "interface down, deleted and made again, adapter unplugged",
    16: "bus-off, error passive, flood of error frames",
    17: "no buffers, stalled adapter, late or missing echo",
    18: "wheel power cut for 10 s at full command, then back",
    19: "foreign setpoints, forged error frames",
    20: "remote, extended, FD and short frames on known ids",
    21: "a full bus",
    22: "wheels silent, or not doing what they are told",
    23: "force in the wrong unit, loaded or late start, reboot",
    24: "wall clock stepped, process stopped, CPU starved",
    25: "gateway killed, aborted, terminated",
    26: "loop alive but stuck",
    27: "disk full or read-only, stderr blocked",
    28: "something else at the socket's path",
    29: "bad configuration",
    30: "two gateways on one interface",
}
HEAD = """# The fault catalogue, measured

What happens when something goes wrong, row by row, as measured on a real Linux kernel that runs as an ordinary process
(SocketCAN, slcan, GPIO lines). This page is written by one command, which runs every test anew:

    test/kernel/run --report

In **virtual time** the processor is infinitely fast, so those figures show what the rules cost, not the machine. In **real time**
the kernel runs on the machine of this run; its timer ticks every 10 ms, and between left and right it may let another process run for
that long, so that pairs are allowed one tick more than the 5 ms of virtual time.

Row 31, one wheel that does something else than the other, is measured in degrees: [pair.md](../user/pair.md) has the table, before and after.

| # | fault | tests: kernel | tests: local bus | longest gap | stop begins within | old frames |
|---|---|---|---|---|---|---|
"""
LEGEND = """
*Longest gap*: between setpoints of one wheel while the bus took frames (100 ms allowed). *Stop begins within*: from the fault to the
first setpoint that is slower, the worst of all tests of the row. *Old frames*: nonzero setpoints that came out on the bus after a
stall, an outage or a stop was over, the most of all tests of the row; on an adapter whose echo proves nothing they cannot be ruled
out (see below). `--`: not measured by any test of the row. Tests in real time beside which the machine stalled each time, at the
end and alone too, are not judged, and not counted.
"""
NATIVE = """
`test/kernel/run --native`, the tests in real time on a machine's own kernel with its modules vcan, slcan and gpio-sim, has not been run on
such a machine: none was at hand. It has been run inside the kernel of these tests, which has all it asks for (`plumbing_native`: nine
tests with vcan, an adapter, GPIO lines and a planted late gateway); what it answers where something is missing is tested by
`test/kernel/test_native.py`.

**A kernel that nobody here configured.** The group `controllers` runs on the distribution's own kernel in an emulated machine with two
Kvaser PCI cards (SJA1000) on one bus: gateway on one, wheels and recorder on the other. Bit timing goes over netlink, the echo is the
driver's, and another rate or sample point is told and refused. Neither bus errors nor the time of a frame are modelled there, and
Debian 12's kernel has no gpio-sim, so that the button is the local one. Row 20 is left out: after a remote frame the emulated controller
receives nothing any more, not even after down and up. A few tests run each time, all of them with `--full`. So do, with
`--full`, two other machines: `controllers-ctucan` with CTU CAN FD, whose driver is built from the source of Debian's kernel (it says STOPPED
until an error, so that the carrier decides), and `controllers-arm64` with the packages for arm64 on Debian's kernel and libraries for it.
"""


def number(values, unit):
    if values and unit and max(values) < 0.5:
        return f"< 1 {unit}"
    return f"{max(values):.0f} {unit}" if values else "--"


def row_line(row, results, real_time):
    here = [r for r in results if ENTRIES[r["name"]].row == row and r["verdict"] != "skipped"]
    passed = [r for r in here if r["verdict"] == "passed"]
    ours = f"{len(passed)} of {len(here)}" if here else "--"
    local = len([name for name in REGISTRY if name.startswith(f"row{row:02d}_")]) or "--"
    values = {key: [r["measures"][key] for r in here if key in r["measures"] and r["group"] not in real_time] for key in ("gap_ms", "stop_ms", "stale_frames")}
    gap, stop = number(values["gap_ms"], "ms"), number(values["stop_ms"], "ms")
    return f"| {row} | {ROWS[row]} | {ours} | {local} | {gap} | {stop} | {number(values['stale_frames'], '')} |".replace("  |", " |")


ESTOP = """
## E-stop: to the zero pair on the bus

| time | from | presses | p50 | p99 | worst |
|---|---|---|---|---|---|
"""
ESTOP_LEGEND = """
To the second of both zeros. *From the edge*: since the kernel's stamp of the line's edge. *From the level*: since the moment at which the
test began to write the line's level. That is 0.7 ms before a tick of that kernel, because its simulated line tells of an edge at the next
tick only; what is left of that wait is in the figure, and so is the gateway's next look at the level, which may come before the edge: it
looks whenever a frame, a client or its own period of 20 ms wakes it. A stop that was complete at the edge has no time from the edge, so
those presses are fewer in real time.
"""


def estop_line(results, time, since, kind):
    """The percentiles of all presses."""
    values = [latency_us / 1000 for r in results for latency_us in r[kind]]
    if not values:
        return f"| {time} | {since} | none judged: the machine stalled | -- | -- | -- |"
    p50, p99 = percentile(values, 50), percentile(values, 99)
    return f"| {time} | {since} | {len(values)} | {p50:.2f} ms | {p99:.2f} ms | {max(values):.2f} ms |"


def estop_text(results, real_time):
    """The table, in virtual and in real time."""
    presses = [r for r in results if ENTRIES[r["name"]].row in (11, 12)]
    real = [r for r in presses if r["group"] in real_time]
    virtual = [r for r in presses if r["group"] not in real_time]
    lines = [estop_line(virtual, "virtual", "the edge", "latencies"), estop_line(real, "real", "the level", "from_level")]
    lines.append(estop_line(real, "real", "the edge", "latencies"))
    return ESTOP + "\n".join(lines) + "\n" + ESTOP_LEGEND


def figure_lines(results, title, names):
    lines = ["", f"## {title}", ""]
    for r in results:
        if any(r["name"].startswith(name) for name in names) and r["figures"] and r["verdict"] != "skipped":
            lines.append(f"- {ENTRIES[r['name']].title} ({r['group']}): {', '.join(r['figures'])}")
    return lines


def run_text(outcomes, options):
    """What this run was, and what it was not: a longer one counts only where it was made."""
    last = outcomes[-1]
    text = "{} tests passed, {} failed, {} were not judged.".format(*last.counts())
    text = f"One campaign with seed {last.seed}: {text}"
    if options.full:
        text += " With `--full`: 1000 presses, in virtual and in real time, "
    else:
        text += "\n100 presses in motion (and 25 for each other way of wiring), "
    text += f"a soak of {options.hours:g} virtual h."
    for word, tests in (("Failed", last.names("failed")), ("Not judged, because the machine was late each time", last.names("skipped"))):
        text += f"\n{word}: {', '.join(tests)}." if tests else ""
    if not options.full:
        text += "\nNot run for this page: `--full`, with a soak of 24 virtual hours and 1000 presses."
    return "\n## What was run\n\n" + text + "\n" + row_text(outcomes)


def row_text(outcomes):
    """Of several campaigns in a row; the tables are of the last one, the e-stop's of all."""
    if len(outcomes) == 1:
        return "Not run for this page: several campaigns in a row (`--repeat`).\n"
    lines = "".join(f"- {line}\n" for line in repeated.summary(outcomes, len(outcomes)))
    return f"\nIt was the last of {len(outcomes)} campaigns in a row, whose presses are all in the table of the e-stop:\n\n{lines}"


def write(outcomes, options):
    """Replaces the page: of the last campaign of a row, with the presses of all."""
    real_time = repeated.REAL_TIME
    results = outcomes[-1].results
    lines = [row_line(row, results, real_time) for row in ROWS]
    text = HEAD + "\n".join(lines) + "\n" + LEGEND
    text += estop_text([result for outcome in outcomes for result in outcome.results], real_time)
    text += "\n".join(figure_lines(results, "What comes out after a stall", ("row17_", "row18_"))) + "\n"
    text += "\n".join(figure_lines(results, "Soak", ("soak",))) + "\n"
    text += run_text(outcomes, options) + NATIVE
    with open(PATH, "w", encoding="utf-8") as file:
        file.write(text)
    print(f"wrote {os.path.relpath(PATH)}")
