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
    5: "observers end, flood, connect 1000 times; no descriptor left",
    6: "client returns and continues with an old command",
    7: "nonzero command present at start and at reset",
    8: "1 MB line, no newline, bytes one by one",
    9: "invalid JSON, too much JSON",
    10: "value out of range, one wheel valid and the other invalid",
    11: "e-stop in motion, at random phase",
    12: "e-stop pulse of 0 to 20 ms",
    13: "e-stop pressed at start, chattering, reset repeated",
    14: "GPIO chip disappears, line busy, line missing",
    15: "interface down, deleted and created again, adapter unplugged",
    16: "bus-off, error passive, flood of error frames",
    17: "no buffers, stalled adapter, late or missing echo",
    18: "wheel power off for 10 s at full command, then on",
    19: "foreign setpoints, forged error frames",
    20: "remote, extended, FD and short frames on known ids",
    21: "a full bus",
    22: "wheels offline, or not following their setpoints",
    23: "force in the wrong unit, loaded or late start, reboot",
    24: "wall clock stepped, process stopped, CPU starved",
    25: "gateway killed, aborted, terminated",
    26: "loop alive but stuck",
    27: "disk full or read-only, stderr blocked",
    28: "another file at the path of the socket",
    29: "invalid configuration",
    30: "two gateways on one interface",
}
HEAD = """# The fault catalogue, measured

This page shows how the gateway reacts to each fault. The figures are measured on a real Linux kernel that runs as an
ordinary process (SocketCAN, slcan, GPIO lines).

| command | result |
|---|---|
| `test/kernel/run --list` | lists the tests |
| `test/kernel/run --only NAME` | runs the tests whose name contains NAME |
| `test/kernel/run --report` | runs every test and writes this page |

There are two kinds of time:

- In **virtual time** the processor is infinitely fast. Its figures show the effect of the rules, without the machine.
- In **real time** the kernel runs on the machine of this run. Its timer ticks every 10 ms. Between the left and the
  right setpoint, the kernel may run another process for that long. Pairs may therefore need one tick more than the 5 ms
  of virtual time.

In row 31, one wheel moves differently from the other. [pair.md](../user/pair.md) shows how far each such fault turns the
machine, with the rule of the pair and before it. The [safety case](safety-case.md#the-fault-catalogue) has the rows 32
to 34, and the tests of all other rows.

| # | fault | tests: kernel | tests: local bus | longest gap | stop begins within | old frames |
|---|---|---|---|---|---|---|
"""
LEGEND = """
- *tests: kernel*: passed tests of all judged tests. *tests: local bus*: number of tests in `test/system`.
- *longest gap*: the longest time between setpoints of one wheel while the bus accepted frames. The limit is 100 ms.
- *stop begins within*: the time from the fault to the first slower setpoint, the worst of all tests of the row.
- *old frames*: nonzero setpoints that reached the bus after a stall, an outage or a stop was over, the most of all
  tests of the row. They are possible on an adapter whose echo proves nothing (see below).
- `--`: no test of the row measures this value.

A test in real time is not judged and not counted if the machine stalled during each attempt, even during the last one,
which runs alone.
"""
NATIVE = """
## Limits

**The machine's own kernel.** `test/kernel/run --native` runs the tests in real time on the machine's own kernel, with
the modules vcan, slcan and gpio-sim. It has not been run on such a machine, because none was available. It has been run
inside the kernel of these tests, which has everything that they need (`plumbing_native`: nine tests with vcan, an
adapter, GPIO lines and a gateway with a seeded delay). `test/kernel/test_native.py` tests the messages about missing
modules.

**A kernel of a distribution.** The group `controllers` runs on the distribution's own kernel in an emulated machine
with two Kvaser PCI cards (SJA1000) on one bus. The gateway uses one card, the wheels and the recorder use the other.
The gateway sets no bit timing: it reads it over netlink, and reports and refuses another bit rate or sample point. The
driver sends the echo. A few tests run each time, all of them with `--full`.

The emulated machine has these limits:

- It models neither bus errors nor the duration of a frame.
- The kernel of Debian 12 has no gpio-sim, so the button is the one of the local bus.
- Row 20 is left out. After a remote frame, the emulated controller receives nothing, not even after down and up.

With `--full`, two other machines run the same tests:

- `controllers-ctucan` has CTU CAN FD. Its driver is built from the source of Debian's kernel. The driver reports
  STOPPED until an error happens, so the gateway uses the carrier.
- `controllers-arm64` has the packages for arm64, on Debian's kernel and libraries for arm64.
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
The time ends with the second of the two zeros.

- *the edge*: the time starts at the kernel's time stamp of the edge of the line.
- *the level*: the time starts when the test begins to write the level of the line. That is 0.7 ms before a tick of that
  kernel, because its simulated line reports an edge only at the next tick. The figure contains the rest of this wait.
  It also contains the time until the gateway reads the level again. The gateway can read the level before the edge: a
  frame, a client or its own period of 20 ms wakes it.

If the stop was complete at the edge, the press has no time from the edge. The row in real time therefore counts fewer
presses from the edge.
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
    lines = ["", f"## {title}", "", "| test | group | figures |", "|---|---|---|"]
    for r in results:
        if any(r["name"].startswith(name) for name in names) and r["figures"] and r["verdict"] != "skipped":
            lines.append(f"| {ENTRIES[r['name']].title} | `{r['group']}` | {', '.join(r['figures'])} |")
    return lines


def run_text(outcomes, options):
    """Describes this run, and the parts that it did not have."""
    last = outcomes[-1]
    text = "{} tests passed, {} failed, {} were not judged.".format(*last.counts())
    text = f"One campaign with seed {last.seed}: {text}"
    if options.full:
        text += " With `--full`: 1000 presses, in virtual and in real time, "
    else:
        text += "\n100 presses in motion (and 25 for each other wiring), "
    text += f"a soak of {options.hours:g} virtual h."
    for word, tests in (("Failed", last.names("failed")), ("Not judged, because the machine stalled each time", last.names("skipped"))):
        text += f"\n{word}: {', '.join(tests)}." if tests else ""
    if not options.full:
        text += "\nNot run for this page: `--full`, with a soak of 24 virtual hours and 1000 presses."
    return "\n## Tests of this run\n\n" + text + "\n" + row_text(outcomes)


def row_text(outcomes):
    """Describes several campaigns in a row. The tables are from the last one, the e-stop's table is from all."""
    if len(outcomes) == 1:
        return "Not run for this page: several campaigns in a row (`--repeat`).\n"
    lines = "".join(f"- {line}\n" for line in repeated.summary(outcomes, len(outcomes)))
    return f"\nThis is the last of {len(outcomes)} campaigns in a row. The table of the e-stop contains the presses of all of them:\n\n{lines}"


def write(outcomes, options):
    """Replaces the page: results of the last campaign in a row, with the presses of all."""
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
