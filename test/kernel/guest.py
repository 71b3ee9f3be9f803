#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Inside the kernel: executes one plan, test by test.

Usage: guest.py PLAN.json
The plan: {"build": DIR, "tests": [NAME...], "virtual": BOOL, "full": BOOL, "results": FILE, "seed": N}. One JSON object per test
is appended to the results as the tests end: name, verdict (passed, failed, skipped, inconclusive), figures, failures, measures, latencies
and from_level (microseconds from the e-stop's edge and from its level), seconds.
"""

import json
import os
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [HERE, os.path.join(os.path.dirname(HERE), "system")]

import kernel_rig
import kernel_scenarios  # noqa: F401  (registers them)
from guest_run import GuestRun


def main(path):
    with open(path, encoding="utf-8") as file:
        plan = json.load(file)
    kernel_rig.CLOCK["virtual"] = plan["virtual"]
    run = GuestRun(plan)
    if not plan["virtual"]:
        run.watch()
    with open(plan["results"], "a", encoding="utf-8", buffering=1) as results:
        run.report = lambda *what: results.write(json.dumps(result_of(run, *what)) + "\n")
        run.run(plan["tests"])
    run.close()
    return 0


def result_of(run, name, verdict, attempt, tries):
    """One line of the results. An inconclusive test counts as skipped; `verdict` still states it."""
    data = attempt.data or {}
    figures = data.get("figures", []) + ([attempt.skip] if attempt.skip else []) + ([f"attempt {tries}, alone"] if tries > 1 else [])
    result = {"name": name, "verdict": verdict, "figures": figures, "failures": attempt.failures, "seconds": (attempt.end_us - attempt.begin_us) / 1e6}
    latencies = run.take_latencies(data) if verdict == "passed" else {}
    return {**result, **latencies, "measures": data.get("measures", {}), "logs": data.get("logs", [])}


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
