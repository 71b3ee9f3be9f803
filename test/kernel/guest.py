#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Inside the kernel: works off one plan, test by test.

Usage: guest.py PLAN.json
The plan: {"build": DIR, "tests": [NAME...], "virtual": BOOL, "full": BOOL, "results": FILE, "seed": N}. One JSON object per test
is appended to the results as the tests end: name, verdict (passed, failed, skipped), figures, failures, measures, latencies
and from_level (microseconds from the e-stop's edge and from its level), seconds.
"""

import json
import os
import sys
import time

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [HERE, os.path.join(os.path.dirname(HERE), "system")]

import kernel_rig  # noqa: E402
import kernel_scenarios  # noqa: E402,F401  (registers them)
from guest_run import GuestRun  # noqa: E402


def main(path):
    with open(path, encoding="utf-8") as file:
        plan = json.load(file)
    kernel_rig.CLOCK["virtual"] = plan["virtual"]
    run = GuestRun(plan)
    if not plan["virtual"]:
        run.watch()
    with open(plan["results"], "a", encoding="utf-8", buffering=1) as results:
        stalled = [name for name in plan["tests"] if not work_off(run, name, run.test, results)]
        for name in stalled:
            work_off(run, name, run.test_alone, results)
    run.close()
    return 0


def work_off(run, name, test, results):
    """False, and nothing is told, if the machine stalled in each attempt: to be tried again at the end."""
    begin, run.last, run.latencies = time.monotonic(), {}, {}
    verdict, figures, failures = test(name)
    if verdict == "stalled":
        return False
    result = {"name": name, "verdict": verdict, "figures": figures, "failures": failures}
    result["seconds"] = time.monotonic() - begin
    result.update(run.latencies)
    result["measures"], result["logs"] = run.last.get("measures", {}), run.last.get("logs", [])
    results.write(json.dumps(result) + "\n")
    return True


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
