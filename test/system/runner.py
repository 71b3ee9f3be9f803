# SPDX-License-Identifier: MIT
"""Runs scenarios in worker processes, several at a time, and decides what a stalled machine excuses.

Rules about latching are always judged. Other failures are judged if the 1 ms sleeper beside was on time; else the
scenario is repeated, three times at most, each time when the machine has been quiet for a second. What met a stall each time
is put off until all others have ended, and repeated alone. If that does not help either, a failure of timing alone counts as
skipped, with how late the machine was.
"""

import argparse
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from concurrent.futures import ThreadPoolExecutor

import scenarios  # noqa: F401  (registers them)
import selftest
from harness import die_with_parent, find_program, now_us
from judge import percentile
from scenario import REGISTRY, Skip, Test

HERE = os.path.dirname(os.path.abspath(__file__))
WORKER = os.path.join(HERE, "run")  # Another folder of scenarios has its own.
TRIES = 3
TIMEOUT_S = 120
QUIET_US, PATIENCE_S, LOOK_S = 1_000_000, 10, 0.1  # before a scenario is repeated
ESTOP_AROUND_US = 20_000
BEFORE_US, AFTER_US = 400_000, 50_000  # a stall this near to a failure may have caused it


def work(name, build, keep):
    """In the worker: runs one scenario, prints its result as JSON."""
    test, skip, begin_us = Test(build), None, now_us()
    try:
        REGISTRY[name][2](test)
    except Skip as reason:
        skip = str(reason)
    except Exception as error:  # pylint: disable=broad-except
        where = traceback.extract_tb(error.__traceback__)
        here = [f"{os.path.basename(step.filename)}:{step.lineno}" for step in where][-3:]
        output = "".join(rig.gateway.text()[-400:] for rig in test.rigs if rig.gateway)
        test.check(False, f"{type(error).__name__}: {error} ({' > '.join(here)}) {output}")
    for rig in test.rigs:
        rig.close(keep)
        if keep:
            test.figure(f"kept {rig.folder}")
    print(
        json.dumps(
            {
                "failures": test.failures,
                "figures": test.figures,
                "skip": skip,
                "begin_us": begin_us,
                "end_us": now_us(),
                "latencies": test.latencies,
                "bus_stalls": test.bus_stalls,
            }
        ),
        flush=True,
    )
    return 0


def overlaps(stalls, begin_us, end_us):
    return any(since <= end_us and until >= begin_us for since, until in stalls)


class Run:
    """One run of many scenarios."""

    command = "test/system/run"

    def __init__(self, options):
        self.options = options
        self.passed = self.failed = self.skipped = 0
        self.stalled = []  # scenarios that met a stall in each attempt
        self.latencies = []  # (e-stop pressed at, microseconds to zero, bus or machine stalled meanwhile)
        self.folder = tempfile.mkdtemp(prefix="iwheel-system-")
        self.stalls_file = os.path.join(self.folder, "stalls")
        open(self.stalls_file, "w", encoding="ascii").close()
        self.sleeper = subprocess.Popen(
            [sys.executable, os.path.join(HERE, "sleeper.py"), self.stalls_file], preexec_fn=die_with_parent
        )

    def close(self):
        self.sleeper.kill()
        self.sleeper.wait()
        if not self.options.keep:
            shutil.rmtree(self.folder, ignore_errors=True)

    def stalls(self, begin_us, end_us):
        with open(self.stalls_file, encoding="ascii") as file:
            pairs = [tuple(map(int, line.split())) for line in file if line.endswith("\n")]
        return [(t, late) for t, late in pairs if begin_us <= t and t - late <= end_us]

    def await_quiet(self):
        """Until nothing was late for a second; not for ever."""
        end = time.monotonic() + PATIENCE_S
        while self.stalls(now_us() - QUIET_US, now_us()) and time.monotonic() < end:
            time.sleep(LOOK_S)

    def once(self, name):
        """Runs the worker; its children die with it."""
        command = [sys.executable, WORKER, "--worker", name, "--build", self.options.build]
        worker = subprocess.Popen(
            command + (["--keep"] if self.options.keep else []),
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
            preexec_fn=die_with_parent,
            env={**os.environ, "TMPDIR": self.folder},
        )
        try:
            out, err = worker.communicate(timeout=TIMEOUT_S)
        except subprocess.TimeoutExpired:
            os.killpg(worker.pid, signal.SIGKILL)
            worker.communicate()
            return {
                "failures": [[f"did not end within {TIMEOUT_S} s", "rule", 0]],
                "figures": [],
                "skip": None,
                "bus_stalls": [],
            }
        try:
            return json.loads(out.splitlines()[-1])
        except (IndexError, ValueError):
            return {
                "failures": [[f"the worker died: {err[-600:]}", "rule", 0]],
                "figures": [],
                "skip": None,
                "bus_stalls": [],
            }

    def excused(self, result, failure):
        _, kind, at_us = failure
        if kind == "rule":
            return False
        begin_us, end_us = (at_us - BEFORE_US, at_us + AFTER_US) if at_us else (result["begin_us"], result["end_us"])
        return bool(self.stalls(begin_us, end_us)) or overlaps(result["bus_stalls"], begin_us, end_us)

    def test(self, name):
        """Returns (verdict, figures, failures); the verdict is "stalled" if only a quieter machine could judge it."""
        for attempt in range(1, TRIES + 1):
            if attempt > 1:
                self.await_quiet()
            result = self.once(name)
            if result["skip"]:
                return "skipped", [result["skip"]], []
            failures = result["failures"]
            if not failures:
                self.take_latencies(name, result)
                return "passed", result["figures"] + ([f"attempt {attempt}"] if attempt > 1 else []), []
            if not all(self.excused(result, failure) for failure in failures):
                return "failed", result["figures"], failures
        late_us = max((late for _, late in self.stalls(result["begin_us"], result["end_us"])), default=0)
        return "stalled", [f"this machine was up to {late_us / 1000:.0f} ms late"], failures

    def test_alone(self, name):
        """Once more, when nothing else of ours runs. What still meets a stall is skipped, with the cure."""
        self.await_quiet()
        verdict, figures, failures = self.test(name)
        if verdict == "stalled" and any(kind != "timing" for _, kind, _ in failures):
            return "failed", figures, failures
        if verdict == "stalled":
            cure = f"in each of {2 * TRIES} attempts, alone too; end what else runs here, then: {self.command} --only {name}"
            return "skipped", [f"{figures[0]} {cure}"], failures
        return verdict, [*figures, "alone, because the machine had stalled"], failures

    def take_latencies(self, name, result):
        """Of row 11, with whether machine or bus stalled right then."""
        for at_us, latency_us in result["latencies"] if name.startswith("row11") else []:
            around = (at_us - ESTOP_AROUND_US, at_us + latency_us + ESTOP_AROUND_US)
            stalled = bool(self.stalls(*around)) or overlaps(result["bus_stalls"], *around)
            self.latencies.append((latency_us, stalled))

    def report(self, name, title, outcome, seconds):
        verdict, figures, failures = outcome
        setattr(self, verdict, getattr(self, verdict) + 1)
        mark = {"passed": "ok  ", "failed": "FAIL", "skipped": "skip"}[verdict]
        print(
            f"{mark} {name:<34} {title}" + (f"  [{', '.join(figures)}]" if figures else "") + f"  {seconds:.1f} s",
            flush=True,
        )
        for text, kind, _ in failures:
            print(f"       {kind}: {text}", flush=True)

    def one(self, name, alone=False):
        begin = time.monotonic()
        try:
            outcome = self.test_alone(name) if alone else self.test(name)
        except Exception as error:  # pylint: disable=broad-except
            outcome = ("failed", [], [[f"the runner failed: {error!r}", "rule", 0]])
        if outcome[0] == "stalled":
            self.stalled.append(name)
            return
        self.report(name, REGISTRY[name][0], outcome, time.monotonic() - begin)

    def judge_first(self):
        count, failures = selftest.run()
        texts = [[text, "rule", 0] for text in failures]
        self.report(
            "judge_selftest",
            "the judge finds every planted fault",
            ("failed" if failures else "passed", [f"{count} logs"], texts),
            0,
        )

    def estop_summary(self):
        """Invariant 2 speaks of the 99th percentile: over all presses of row 11 together."""
        if not self.latencies:
            return
        values = [latency_us for latency_us, stalled in self.latencies if not stalled]
        figures, failures = [
            f"{len(self.latencies)} presses, {len(self.latencies) - len(values)} of them not timed (stalled)"
        ], []
        if values:
            p50_ms, p99_ms = percentile(values, 50) / 1000, percentile(values, 99) / 1000
            figures += [f"median {p50_ms:.2f} ms", f"p99 {p99_ms:.2f} ms", f"worst {max(values) / 1000:.2f} ms"]
            failures = [] if p99_ms <= 5 else [[f"p99 {p99_ms:.2f} ms, 5 ms allowed", "timing", 0]]
        verdict = "failed" if failures else ("passed" if len(values) * 2 > len(self.latencies) else "skipped")
        self.report("row11_all_presses", "e-stop to first zero pair, all presses", (verdict, figures, failures), 0)


def parse(arguments):
    parser = argparse.ArgumentParser(
        prog="test/system/run", description="System tests: the real gateway and simulator, judged from the bus log."
    )
    root = os.path.dirname(os.path.dirname(HERE))
    parser.add_argument(
        "--build",
        default=os.path.join(root, "build", "default"),
        metavar="DIR",
        help="build directory (default: build/default)",
    )
    parser.add_argument(
        "--only", action="append", metavar="NAME", help="only tests whose name contains this; may be repeated"
    )
    parser.add_argument("--jobs", type=int, default=4, metavar="N", help="scenarios at a time (default: 4)")
    parser.add_argument("--keep", action="store_true", help="keep the folders with configuration and outputs")
    parser.add_argument("--list", action="store_true", help="list the tests and exit")
    parser.add_argument("--worker", help=argparse.SUPPRESS)
    return parser.parse_args(arguments)


def main(arguments):
    options = parse(arguments)
    if options.worker:
        return work(options.worker, options.build, options.keep)
    names = [name for name in REGISTRY if not options.only or any(part in name for part in options.only)]
    if options.list:
        print("\n".join(f"{name:<34} {REGISTRY[name][0]}" for name in names))
        return 0
    if options.jobs < 1:
        print("--jobs must be at least 1", file=sys.stderr)
        return 64
    try:
        for program in ("iwheel-gateway", "iwheel-sim", "iwheelctl"):
            find_program(options.build, program)
    except FileNotFoundError as error:
        print(error, file=sys.stderr)
        return 69
    run = Run(options)
    try:
        if not options.only or any(part in "judge_selftest" for part in options.only):
            run.judge_first()
        with ThreadPoolExecutor(options.jobs) as pool:
            list(pool.map(run.one, sorted(names, key=lambda name: -REGISTRY[name][1])))
        for name in run.stalled:
            run.one(name, alone=True)
        run.estop_summary()
    finally:
        run.close()
    print(f"{run.passed} passed, {run.failed} failed, {run.skipped} skipped")
    return 1 if run.failed or not run.passed else 0
