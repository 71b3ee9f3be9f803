# SPDX-License-Identifier: MIT
"""Writes docs/fault-catalogue.md from the results of a campaign."""

import os

import scenarios  # noqa: F401  (fills REGISTRY)
from boot import HERE
from catalogue import ENTRIES
from groups import GROUPS
from judge_log import percentile
from scenario import REGISTRY

PATH = os.path.join(os.path.dirname(os.path.dirname(HERE)), "docs", "fault-catalogue.md")
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
the kernel runs on the machine of this run; its timer ticks every 10 ms.

| # | fault | tests: kernel | tests: local bus | longest gap | stop begins within | old frames |
|---|---|---|---|---|---|---|
"""
LEGEND = """
*Longest gap*: between setpoints of one wheel while the bus took frames (100 ms allowed). *Stop begins within*: from the fault to the
first setpoint that is slower, the worst of all tests of the row. *Old frames*: nonzero setpoints that came out on the bus after a
stall, an outage or a stop was over, the most of all tests of the row; on an adapter whose echo proves nothing they cannot be ruled
out (see below). `--`: not measured by any test of the row. Tests in real time beside which the machine stalled three times are not
judged, and not counted.
"""
NATIVE = """
`test/kernel/run --native`, the same tests on a machine's own kernel with its modules vcan, slcan and gpio-sim, has not been run: no
machine at hand has those modules. Tested of it is what it asks for, what it answers where that is missing, and that it works off a
plan without tests (`test/kernel/test_native.py`).
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
    values = {
        key: [r["measures"][key] for r in here if key in r["measures"] and r["group"] not in real_time]
        for key in ("gap_ms", "stop_ms", "stale_frames")
    }
    gap, stop = number(values["gap_ms"], "ms"), number(values["stop_ms"], "ms")
    return f"| {row} | {ROWS[row]} | {ours} | {local} | {gap} | {stop} | {number(values['stale_frames'], '')} |".replace("  |", " |")


def estop_lines(results, real_time):
    """The percentiles of all presses, in virtual and in real time."""
    lines = ["", "## E-stop: from the edge to the zero pair on the bus", "", "| time | presses | p50 | p99 | worst |", "|---|---|---|---|---|"]
    for name, wanted in (("virtual", False), ("real", True)):
        values = [
            latency_us / 1000
            for r in results
            if ENTRIES[r["name"]].row in (11, 12) and (r["group"] in real_time) == wanted
            for latency_us in r["latencies"]
        ]
        if values:
            p50, p99 = percentile(values, 50), percentile(values, 99)
            lines.append(f"| {name} | {len(values)} | {p50:.2f} ms | {p99:.2f} ms | {max(values):.2f} ms |")
        else:
            lines.append(f"| {name} | none judged: the machine stalled | -- | -- | -- |")
    return lines


def figure_lines(results, title, names):
    lines = ["", f"## {title}", ""]
    for r in results:
        if any(r["name"].startswith(name) for name in names) and r["figures"] and r["verdict"] != "skipped":
            lines.append(f"- {ENTRIES[r['name']].title} ({r['group']}): {', '.join(r['figures'])}")
    return lines


def run_lines(results, options):
    """What this run was, and what it was not: a longer one counts only where it was made."""
    count = {verdict: sum(r["verdict"] == verdict for r in results) for verdict in ("passed", "failed", "skipped")}
    text = f"One campaign with seed {options.seed}: {count['passed']} tests passed, {count['failed']} failed, {count['skipped']} were not judged."
    if options.full:
        text += " With `--full`: 1000 presses, a soak of 24 virtual hours."
    else:
        text += f"\nA soak of {options.hours or 1:g} virtual h, 100 presses in motion (and 25 for each other way of wiring). Not run for this page: `--full` with a"
        text += "\nsoak of 24 virtual hours and 1000 presses, and twenty campaigns in a row."
    skipped = [f"{r['group']}/{r['name']}" for r in results if r["verdict"] == "skipped"]
    if skipped:
        text += f"\nNot judged, because the machine was late each time: {', '.join(skipped)}."
    return ["", "## What was run", "", text]


def write(results, options):
    """Replaces the page."""
    real_time = {group.name for group in GROUPS if not group.virtual}
    lines = [row_line(row, results, real_time) for row in ROWS]
    text = HEAD + "\n".join(lines) + "\n" + LEGEND
    text += "\n".join(estop_lines(results, real_time)) + "\n"
    text += "\n".join(figure_lines(results, "What comes out after a stall", ("row17_", "row18_"))) + "\n"
    text += "\n".join(figure_lines(results, "Soak", ("soak",))) + "\n"
    text += "\n".join(run_lines(results, options)) + "\n" + NATIVE
    with open(PATH, "w", encoding="utf-8") as file:
        file.write(text)
    print(f"wrote {os.path.relpath(PATH)}")
