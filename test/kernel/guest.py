#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Inside the kernel: works off one plan, test by test, each in a process of its own.

Usage: guest.py PLAN.json
The plan: {"build": DIR, "tests": [NAME...], "virtual": BOOL, "full": BOOL, "results": FILE, "seed": N}. One JSON object per test
is appended to the results as the tests end: name, verdict (passed, failed, skipped), figures, failures, measures, latencies
(microseconds), seconds.
"""

import json
import os
import select
import signal
import subprocess
import sys
import time
import traceback

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [HERE, os.path.join(os.path.dirname(HERE), "system")]

import kernel_rig  # noqa: E402
import kernel_scenarios  # noqa: E402,F401  (registers them)
from catalogue import ENTRIES  # noqa: E402
from harness import as_a_service, die_with_parent  # noqa: E402
from runner import AFTER_US, BEFORE_US, Run  # noqa: E402
from scenario import Skip  # noqa: E402

ALWAYS_JUDGED = ("latched expected", "nonzero_after_estop", "motion_", "must not unlatch")
WITNESS_FILE = "/run/test/witness"
LIMIT_S, SOAK_LIMIT_S = 600, 100_000  # of one test, by the guest's clock


def run_one(entry, plan):
    """In the worker: runs the test, returns its result."""
    test, skip, begin_us = kernel_rig.KernelTest(plan["build"], entry.rig_type), None, kernel_rig.now_us()
    test.plan = plan
    kernel_rig.PACE["slow"] = entry.pace if plan["virtual"] else 1
    try:
        entry.function(test)
    except Skip as reason:
        skip = str(reason) if not test.failures else None  # what was found already is judged
    except Exception as error:  # pylint: disable=broad-except
        where = [f"{os.path.basename(s.filename)}:{s.lineno}" for s in traceback.extract_tb(error.__traceback__)][-4:]
        output = "".join(rig.gateway.text()[-600:] for rig in test.rigs if rig.gateway)
        test.failures.append([f"{type(error).__name__}: {error} ({' > '.join(where)}) {output}", "check", 0])
    logs = save_logs(test, plan, entry.name) if test.failures else []
    for rig in test.rigs:
        rig.close()
    return {
        "failures": test.failures,
        "figures": test.figures,
        "measures": test.measures,
        "skip": skip,
        "begin_us": begin_us,
        "end_us": kernel_rig.now_us(),
        "latencies": test.latencies,
        "logs": logs,
    }


def save_logs(test, plan, name):
    """The bus log and the gateway's words of a failed test, beside the results."""
    paths = []
    for number, rig in enumerate(test.rigs):
        base = f"{plan['results'].rsplit('.', 1)[0]}.{name}.{number}"
        with open(base + ".bus.log", "w", encoding="ascii") as file:
            for frame in sorted(rig.bus.frames):
                file.write(f"({frame.t_us / 1e6:.6f}) bus {frame.id & 0x1FFFFFFF:03X}#{frame.data.hex().upper()}\n")
        with open(base + ".timeline", "w", encoding="utf-8") as file:
            file.writelines(f"{event}\n" for event in sorted(rig.timeline))
        with open(base + ".gateway.out", "w", encoding="utf-8") as file:
            file.write(rig.gateway.text() if rig.gateway else "never started\n")
        paths += [base + ".bus.log", base + ".timeline", base + ".gateway.out"]
    return paths


def died(text):
    return {"failures": [[text, "rule", 0]], "figures": [], "measures": {}, "skip": None, "latencies": [], "begin_us": 0, "end_us": 0}


class GuestRun(Run):
    """The runner of the system tests, with forked workers; in virtual time nothing excuses anything.

    In real time a witness runs beside, with the gateway's priority. Setting up a test always delays it a little (a fork is slow in
    such a kernel), so what counts is a delay that is long enough, and near enough, to have caused what is wrong.
    """

    def __init__(self, plan):  # pylint: disable=super-init-not-called
        self.plan, self.last, self.latencies = plan, {}, []
        self.limit_s = LIMIT_S if plan["group"] != "soak" else SOAK_LIMIT_S
        self.witness = None
        if not plan["virtual"]:
            command = [os.path.join(plan["build"], "test", "kernel", "iwheel-sleeper"), WITNESS_FILE, str(kernel_rig.PRESS_LATE_US)]
            self.witness = subprocess.Popen(command, preexec_fn=as_a_service)
            kernel_rig.WITNESS["file"] = WITNESS_FILE

    def close(self):
        if self.witness:
            self.witness.kill()
            self.witness.wait()

    def excused(self, result, failure):
        text, kind, at_us = failure
        if self.plan["virtual"] or kind == "rule" or any(always in text for always in ALWAYS_JUDGED):
            return False
        if text.startswith("pair_spread"):  # the strictest of all, and over in a moment
            return kernel_rig.machine_late(at_us - kernel_rig.TICK_US, at_us + kernel_rig.TICK_US, kernel_rig.PRESS_LATE_US)
        near = (at_us - BEFORE_US, at_us + AFTER_US)
        if not at_us or text.startswith("no_silence"):  # the end of a hold depends on all that was heard before
            near = result["begin_us"], result["end_us"]
        return kernel_rig.machine_late(*near, kernel_rig.STALL_US)

    def softened(self, result):
        """In real time: what a stalled machine may have caused is a matter of time. Latching is judged all the same."""
        if not self.plan["virtual"] and kernel_rig.machine_late(result["begin_us"], result["end_us"], kernel_rig.STALL_US):
            for failure in result["failures"]:
                failure[1] = "timing"
        return result

    def take_latencies(self, name, result):
        """The test has left out those of presses beside which the machine was late."""
        self.latencies = [latency_us for _, latency_us in result["latencies"]]

    def once(self, name):
        entry = ENTRIES[name]
        read_end, write_end = os.pipe()
        child = os.fork()
        if child == 0:
            os.setsid()
            die_with_parent()
            try:
                answer = run_one(entry, self.plan)
            except BaseException as error:  # pylint: disable=broad-except
                answer = died(f"the worker failed: {''.join(traceback.format_exception(error))[-1500:]}")
            with os.fdopen(write_end, "w", encoding="utf-8") as pipe:
                json.dump(answer, pipe)
            os._exit(0)
        os.close(write_end)
        text = read_all(read_end, self.limit_s)
        try:
            os.killpg(child, signal.SIGKILL)
        except ProcessLookupError:
            pass
        os.waitpid(child, 0)
        if text is None:
            return died(f"did not end within {self.plan.get('limit_s', LIMIT_S)} s of the guest's clock")
        self.last = self.softened(json.loads(text)) if text else died("the worker died")
        return self.last


def read_all(descriptor, seconds):
    """What comes until the end of the pipe; None if that takes longer."""
    text, deadline = b"", time.monotonic() + seconds
    with os.fdopen(descriptor, "rb", buffering=0) as pipe:
        while True:
            if not select.select([pipe], [], [], max(0, deadline - time.monotonic()))[0]:
                return None
            part = pipe.read(65536)
            if not part:
                return text.decode()
            text += part


def main(path):
    with open(path, encoding="utf-8") as file:
        plan = json.load(file)
    kernel_rig.CLOCK["virtual"] = plan["virtual"]
    run = GuestRun(plan)
    with open(plan["results"], "a", encoding="utf-8", buffering=1) as results:
        for name in plan["tests"]:
            begin, run.last, run.latencies = time.monotonic(), {}, []
            verdict, figures, failures = run.test(name)
            result = {"name": name, "verdict": verdict, "figures": figures, "failures": failures}
            result["seconds"] = time.monotonic() - begin
            result["latencies"] = run.latencies
            result["measures"], result["logs"] = run.last.get("measures", {}), run.last.get("logs", [])
            results.write(json.dumps(result) + "\n")
    run.close()
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
