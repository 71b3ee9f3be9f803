# SPDX-License-Identifier: MIT
"""docs/developer/speed.md, section by section, and those of its rows that the README shows."""

import os
import platform
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
PAGE = ROOT / "docs/developer/speed.md"
README = ROOT / "README.md"
PROCESS = "## The gateway as a process"
BUILDS = "## Building and installing"
TIMED = "## Compared with floor and peers"
README_ROWS = {  # Row of the page, and its name in the README.
    "x86-64 decode": "read a frame, id and length checked: instructions on x86-64",
    "x86-64 encode": "write a setpoint, held within its limits: instructions on x86-64",
    "cortex-m4 decode": "read a frame on a Cortex-M4",
    "cortex-m4 encode": "write a setpoint on a Cortex-M4",
    "memory of all": "memory of the gateway's processes together (PSS)",
    "its mean error, 617 frames/s": "mean error of the setpoint period, 617 frames/s of telemetry",
    "setpoint period, deviation p50, 617": "deviation of the setpoint period, p50, × leanest program",
    "21 000 frames/s: lost": "lost of a full bus, 21 000 frames/s",
    "617 frames/s: system calls for a frame, driving": "system calls for a frame, 617 frames/s, driving",
    "617 frames/s: system calls for a frame, no client": "system calls for a frame, 617 frames/s, no client",
    "client's line to frame on the bus, p50": "client's line to frame on the bus, p50, × leanest program",
    "client's line to frame on the bus, p90": "the same, p90",
    "frame on the bus to client's line, p50": "frame on the bus to client's line, p50, × leanest program",
}


def table(head, rows):
    lines = ["| " + " | ".join(head) + " |", "|---|" + "---:|" * (len(head) - 1)]
    return lines + ["| " + " | ".join(row) + " |" for row in rows]


def put(title, lines):
    """Replaces the text between that title and the next one of its level."""
    text = PAGE.read_text()
    body = "\n".join([title, "", *lines]).rstrip() + "\n"
    PAGE.write_text(re.sub(rf"^{re.escape(title)}\n.*?(?=^## |\Z)", lambda _: body + "\n", text, count=1, flags=re.M | re.S).rstrip() + "\n")


def put_counted(tables, compilers):
    """The page from its top to the section of the process."""
    lines = [
        "# Speed",
        "",
        f"Made by `test/bench/run --update` with {compilers}.",
        "",
        "Instructions are counted (callgrind; Unicorn for the Cortex-M), so they are the same on every machine; `./check` counts them again. "
        "Sizes of the core are in [sizes.md](sizes.md).",
        "",
    ]
    for title, text, head, rows in tables:
        lines += ([title, ""] if title else []) + [*text, "", *table(head, rows), ""]
    PAGE.write_text("\n".join(lines) + "\n" + PROCESS + PAGE.read_text().split(PROCESS, 1)[1])


def put_process(measured):
    put(
        PROCESS,
        [
            "Over the local bus with two simulated wheels (617 frames/s), on the machine that wrote this page. Not checked: it depends on the machine.",
            "",
            *table(["", "figure", "goal"], [list(row) for row in measured]),
        ],
    )


def put_builds(measured):
    has_packages = any(name.startswith("package ") for name, _ in measured)
    source = "The packages are those of `test/debian/run --build`." if has_packages else "The sizes of the packages need `test/debian/run --build` first."
    put(
        BUILDS,
        [
            f"Made by `test/bench/run --builds` on {machine()}. A build from blank, without a compiler cache, as `RelWithDebInfo`; everything includes all tests. Processor time "
            f"hardly depends on other load on the machine, elapsed time does. {source} Not checked.",
            "",
            *table(["", "figure"], measured),
        ],
    )


def machine():
    model = re.search(r"^model name\s*: (.*)$", Path("/proc/cpuinfo").read_text(), re.M)
    return f"{model[1].strip() if model else platform.machine()}, {os.cpu_count()} processors, Linux {platform.release().split('-')[0]}"


def put_timed(rows):
    put(
        TIMED,
        [
            f"Made by `test/bench/run --timed` on {machine()}. All candidates run in turns in one boot of the kernel of test/kernel: Linux 6.1 as an "
            "ordinary process, with one processor, vcan and gpio-sim. There a system call costs much more than on bare metal, "
            "so a program with fewer calls has a larger advantage; absolute times mean nothing, ratios to the floor more. The floor is the leanest program that "
            "does only this (`test/bench/timed/floor_*.c`); *leanest that reads the e-stop* is the leanest that reads bus and e-stop before it acts, as a program that drives "
            "a person must (`floor_looks.c`). Medians of three rounds; a turn in which a program that sleeps a millisecond was woken "
            "10 ms late is repeated. The gateway runs with priority -10, as in its unit, and each socket may have a buffer of 4 MiB, as the package's "
            "sysctl allows; with the kernel's own 208 KiB the gateway lost 26 to 37 % of a full bus next to four programs that compute. System calls are counted in virtual time, where each frame comes alone, however slow the tracing is.",
            "",
            *table(["", "floor", "gateway", "peers", "goal"], rows),
        ],
    )
    put_readme()


def put_timed_rows(rows):
    """Updates a part of the measures: each row replaces the row of its name, or is added at the end."""
    before, section = PAGE.read_text().split(TIMED, 1)
    body, _, after = section.partition("\n## ")
    lines = body.rstrip().splitlines()
    for row in rows:
        new, head = table([], [row])[-1], f"| {row[0]} |"
        at = next((number for number, line in enumerate(lines) if line.startswith(head)), None)
        if at is None:
            lines.append(new)
        else:
            lines[at] = new
    PAGE.write_text(before + TIMED + "\n".join(lines) + "\n\n## " + after)
    put_readme()


def put_readme():
    """Some rows of the page: those of five cells, with measure, floor, gateway, peers and goal; and the memory, which has no peer."""
    rows = []
    for line in PAGE.read_text().splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        words = [words for start, words in README_ROWS.items() if line.startswith(f"| {start}")]
        if words and len(cells) == 5:
            rows.append([words[0], cells[2], f"cantools {cells[3]}" if cells[0].endswith(("decode", "encode")) else cells[3]])
        elif words and cells[0].startswith("memory of all"):
            rows.append([words[0], cells[1], "--"])
    text = README.read_text()
    block = "\n".join(["<!-- figures: test/bench/run -->", "", *table(["", "gateway", "others"], rows), "", "<!-- end of figures -->"])
    README.write_text(re.sub(r"<!-- figures: .*?<!-- end of figures -->", lambda _: block, text, flags=re.S))
