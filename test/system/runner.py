# SPDX-License-Identifier: MIT
"""Runs scenarios in worker processes, several at a time. What a stalled machine explains, decides test/support/verdict.py."""

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

import scenarios  # noqa: F401  (registers them)
import selftest
from harness import SERVICE_NICE, die_with_parent, find_program, now_us
from judge import percentile
from scenario import REGISTRY, Skip, Test
from verdict import CRASH, FAILED, PASSED, RULE, SKIPPED, TIMING, Attempt, Failure, Session, Witness, kind_of

HERE = os.path.dirname(os.path.abspath(__file__))
WORKER = os.path.join(HERE, "run")  # Another folder of scenarios has its own.
TIMEOUT_S = 120
ESTOP_AROUND_US = 20_000
MARKS = {PASSED: "ok  ", FAILED: "FAIL", SKIPPED: "skip"}


def work(name, build, keep):
    """In the worker: runs one scenario, prints its result as JSON."""
    test, skip, begin_us = Test(build), None, now_us()
    try:
        REGISTRY[name][2](test)
    except Skip as reason:
        skip = str(reason)
    except Exception as error:  # noqa: BLE001
        where = traceback.extract_tb(error.__traceback__)
        here = [f"{os.path.basename(step.filename)}:{step.lineno}" for step in where][-3:]
        output = "".join(rig.gateway.text()[-400:] for rig in test.rigs if rig.gateway)
        text = f"{type(error).__name__}: {error} ({' > '.join(here)}) {output}"
        test.failures.append(Failure(text, kind_of(text)))
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
                "stalls": test.stalls,
                "claims": test.claims,
            }
        ),
        flush=True,
    )
    return 0


class Run(Session):
    """One run of many scenarios."""

    command = "test/system/run"

    def __init__(self, options):
        super().__init__(self.work_off, self.tell, Witness(SERVICE_NICE))
        self.options = options
        self.latencies = []  # (microseconds from the e-stop to zero, whether the machine stalled meanwhile)
        self.folder = tempfile.mkdtemp(prefix="iwheel-system-")

    def close(self):
        self.witness.close()
        if not self.options.keep:
            shutil.rmtree(self.folder, ignore_errors=True)

    def work_off(self, name):
        """Runs the worker; its children die with it."""
        command = [sys.executable, WORKER, "--worker", name, "--build", self.options.build]
        begin = time.monotonic()
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
            result = json.loads(out.splitlines()[-1])
        except subprocess.TimeoutExpired:
            os.killpg(worker.pid, signal.SIGKILL)
            worker.communicate()
            result = died(f"did not end within {TIMEOUT_S} s")
        except (IndexError, ValueError):
            result = died(f"the worker died: {err[-600:]}")
        return attempt_of({**result, "seconds": time.monotonic() - begin})

    def take_latencies(self, attempt):
        """Of row 11, with whether the machine stalled right then."""
        for at_us, latency_us in attempt.data["latencies"]:
            stalled = self.measured(attempt, at_us - ESTOP_AROUND_US, at_us + latency_us + ESTOP_AROUND_US)
            self.latencies.append((latency_us, bool(stalled)))

    def tell(self, name, verdict, attempt, tries):
        """A session's report of one verdict."""
        data = attempt.data or {"figures": [], "seconds": 0}
        if verdict == PASSED and name.startswith("row11") and "latencies" in data:
            self.take_latencies(attempt)
        figures = data["figures"] + ([attempt.skip] if attempt.skip else []) + ([f"attempt {tries}, alone"] if tries > 1 else [])
        if verdict not in MARKS:
            figures.append(f"end what else runs here, then: {self.command} --only {name}")
        title = REGISTRY[name][0] if name in REGISTRY else data["title"]
        print(
            f"{MARKS.get(verdict, 'skip')} {name:<34} {title}" + (f"  [{', '.join(figures)}]" if figures else "") + f"  {data['seconds']:.1f} s",
            flush=True,
        )
        for failure in attempt.failures:
            print(f"       {failure.kind}: {failure.text}", flush=True)

    def add(self, name, title, failures, figures, verdict=None):
        """The verdict on something that is no scenario."""
        data = {"title": title, "figures": figures, "seconds": 0}
        self.take(name, verdict or (FAILED if failures else PASSED), Attempt(failures, data=data))

    def judge_first(self):
        count, failures = selftest.run()
        self.add("judge_selftest", "the judge finds every planted fault", [Failure(text, RULE) for text in failures], [f"{count} logs"])

    def estop_summary(self):
        """Invariant 2 speaks of the 99th percentile: over all presses of row 11 together."""
        if not self.latencies:
            return
        values = [latency_us for latency_us, stalled in self.latencies if not stalled]
        figures, failures = [f"{len(self.latencies)} presses, {len(self.latencies) - len(values)} of them not timed (stalled)"], []
        if values:
            p50_ms, p99_ms = percentile(values, 50) / 1000, percentile(values, 99) / 1000
            figures += [f"median {p50_ms:.2f} ms", f"p99 {p99_ms:.2f} ms", f"worst {max(values) / 1000:.2f} ms"]
            failures = [] if p99_ms <= 5 else [Failure(f"p99 {p99_ms:.2f} ms, 5 ms allowed", TIMING)]
        verdict = None if failures or len(values) * 2 > len(self.latencies) else SKIPPED
        self.add("row11_all_presses", "e-stop to first zero pair, all presses", failures, figures, verdict)


def died(text):
    return {"failures": [[text, CRASH]], "figures": [], "latencies": []}


def attempt_of(result):
    """From what a worker printed."""
    failures = [Failure(*failure) for failure in result["failures"]]
    known = {key: result[key] for key in ("skip", "stalls", "claims", "begin_us", "end_us") if key in result}
    return Attempt(failures, data=result, **known)


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
        run.run(sorted(names, key=lambda name: -REGISTRY[name][1]), options.jobs)
        run.estop_summary()
    finally:
        run.close()
    return run.end()
