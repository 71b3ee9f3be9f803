# SPDX-License-Identifier: MIT
"""Records which noticer noticed each seeded fault, and in how many seconds: build/report/faults.json and faults.md. Each run adds to the findings
of earlier runs and removes faults that left the table."""

import fcntl
import json

import table

FOLDER = table.ROOT / "build/report"
STORED, PAGE = FOLDER / "faults.json", FOLDER / "faults.md"
found = {}


def add(name, results):
    """Adds `results`: {noticer: (its finding or None, seconds)}"""
    found.setdefault(name, {}).update(results)


def write():
    FOLDER.mkdir(parents=True, exist_ok=True)
    with (FOLDER / "faults.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        stored = json.loads(STORED.read_text()) if STORED.exists() else {}
        rows, lines = {}, ["# Seeded faults", "", "| fault | rule | noticed by | seconds |", "|---|---|---|---:|"]
        for fault in table.load():
            rows[fault.name] = {
                noticer: result for noticer, result in {**stored.get(fault.name, {}), **found.get(fault.name, {})}.items() if noticer in fault.by
            }
            for noticer, (finding, seconds) in rows[fault.name].items():
                lines.append(f"| {fault.name} | {fault.rule} | {noticer}: {(finding or 'not noticed').replace('|', '/')} | {seconds:.1f} |")
        STORED.write_text(json.dumps(rows, indent=0) + "\n")
        PAGE.write_text("\n".join(lines) + "\n")
