# SPDX-License-Identifier: MIT
"""docs/speed.md, section by section, and the few of its rows that the README shows."""

import os
import platform
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
PAGE = ROOT / "docs" / "speed.md"
README = ROOT / "README.md"
PROCESS = "## The gateway as a process"
TIMED = "## Beside floor and peers"
README_ROWS = ("setpoint period, deviation p50, 617", "21 000 frames/s: lost", "client's line to frame on the bus, p50",
               "edge of the e-stop to both zeros, p50", "resident memory", "SIGKILL")


def table(head, rows):
    lines = ["| " + " | ".join(head) + " |", "|---|" + "---:|" * (len(head) - 1)]
    return lines + ["| " + " | ".join(row) + " |" for row in rows]


def put(title, lines):
    """Replaces what stands between that title and the next one of its rank."""
    text = PAGE.read_text()
    body = "\n".join([title, "", *lines]).rstrip() + "\n"
    PAGE.write_text(re.sub(rf"^{re.escape(title)}\n.*?(?=^## |\Z)", lambda _: body + "\n", text, count=1, flags=re.M | re.S).rstrip() + "\n")


def put_counted(tables, compilers):
    """From the top of the page to the section of the process."""
    lines = ["# Speed", "", f"Made by `test/bench/run --update` with {compilers}.", "",
             "Instructions are counted (callgrind; Unicorn for the Cortex-M), so they are the same on every machine; `./check` counts them again. "
             "Sizes of the core are in [sizes.md](sizes.md).", ""]
    for title, text, head, rows in tables:
        lines += ([title, ""] if title else []) + [*text, "", *table(head, rows), ""]
    PAGE.write_text("\n".join(lines) + "\n" + PROCESS + PAGE.read_text().split(PROCESS, 1)[1])


def put_process(measured):
    put(PROCESS, ["Over the local bus with two simulated wheels (617 frames/s), on the machine that made this page. Not checked: it depends on the machine.",
                  "", *table(["", "figure", "goal"], [list(row) for row in measured])])


def machine():
    model = re.search(r"^model name\s*: (.*)$", Path("/proc/cpuinfo").read_text(), re.M)
    return f"{model[1].strip() if model else platform.machine()}, {os.cpu_count()} processors, Linux {platform.release().split('-')[0]}"


def put_timed(rows):
    put(TIMED, [
        f"Made by `test/bench/run --timed` on {machine()}. All that is compared runs in turns in one boot of the kernel of test/kernel: Linux 6.1 as an "
        "ordinary process, with one processor, vcan and gpio-sim. There a system call costs much more than on bare metal, "
        "so that whoever calls less is further ahead; absolute times are worth nothing, ratios to the floor more. The floor is the leanest program that "
        "does only this (`test/bench/timed/floor_*.c`). Medians of three rounds; a turn beside which somebody who sleeps a millisecond was woken "
        "10 ms late is repeated.",
        "", *table(["", "floor", "gateway", "peers", "goal"], rows)])
    put_readme()


def put_readme():
    """A handful of rows of the page."""
    rows = []
    for line in PAGE.read_text().splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if line.startswith("| ") and any(cells[0].startswith(wanted) for wanted in README_ROWS):
            rows.append([cells[0], cells[2], cells[3]] if len(cells) == 5 else [cells[0], cells[1], "--"])
    text = README.read_text()
    block = "\n".join(["<!-- figures: test/bench/run -->", "", *table(["", "gateway", "peers"], rows), "", "<!-- end of figures -->"])
    README.write_text(re.sub(r"<!-- figures: .*?<!-- end of figures -->", lambda _: block, text, flags=re.S))
