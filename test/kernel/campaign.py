# SPDX-License-Identifier: MIT
"""Boots the groups of tests, two at a time, and reports the result of each test.

Virtual time does not depend on the load of the machine. A group in real time has a processor of its own.
"""

import argparse
import copy
import os
import shutil
import signal
import sys
import tempfile
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import gpiod2
import kernel_scenarios  # noqa: F401  (registers them)
import repeated
import report
from boot import HERE, Boot, find_kernel
from catalogue import ENTRIES
from distribution import EmulatedBoot, why_not_emulated
from groups import GROUPS
from harness import find_program
from native import why_not_native, NativeBoot
from verdict import summary

POLL_S = 0.1
HOURS, HOURS_FULL = 1, 24  # of the soak
LOG_LINES = 40
INTERRUPTED = 143


class Campaign:
    """All the boots of one call of test/kernel/run."""

    def __init__(self, options, kernel):
        self.options, self.kernel = options, kernel
        self.folder = tempfile.mkdtemp(prefix="iwheel-kernel-")
        self.lock = threading.Lock()
        self.results = []
        self.boots = []
        self.interrupted = False
        self.processors = sorted(os.sched_getaffinity(0))
        self.reserved = set()  # of those, while something runs in real time
        self.used = dict.fromkeys(self.processors, 0)  # how many kernels run on it
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, self.interrupt)

    def plan(self, group):
        """The tests of the group that are selected; None if there is none."""
        options = self.options
        names = [
            entry.name
            for entry in ENTRIES.values()
            if group.runs(entry.name, entry.groups, options.full) and (not options.only or any(part in entry.name for part in options.only))
        ]
        if not names or (options.part and group.part not in options.part) or (group.full_only and not options.full):
            return None
        if group.name == "soak" and options.hours == 0:
            return None
        return {
            "build": os.path.abspath(options.build),
            "group": group.name,
            "tests": names,
            "virtual": group.virtual and not group.distribution,
            "native": self.options.native or bool(group.distribution),
            "full": options.full,
            "seed": options.seed,
            "hours": options.hours,
            "kernel_arguments": list(group.kernel_arguments),
        }

    def boot(self, group):
        """Runs one group. If a boot hangs or ends early, the tests that it did not reach fail."""
        plan = self.plan(group)
        if plan is None or self.interrupted:
            return
        reason = self.why_skipped(group, plan)
        if reason:
            for name in plan["tests"]:
                self.add(group, {"name": name, "verdict": "skipped", "figures": [reason]})
            return
        processor = self.take_processor(group)
        boot_type = EmulatedBoot if group.distribution else NativeBoot if self.options.native else Boot
        boot = boot_type(group.distribution or self.kernel, self.folder, group.name, plan, {processor})
        self.boots.append(boot)
        limit_s = group.full_limit_s if self.options.full else group.limit_s
        done, since = set(), 0
        try:
            while True:
                running = boot.running()
                for result in boot.results():
                    done.add(result["name"])
                    result["host_s"], since = boot.seconds() - since, boot.seconds()
                    self.add(group, result)
                if not running or boot.seconds() > limit_s:
                    break
                boot.stall_as_asked()
                time.sleep(POLL_S)
        finally:
            hung = boot.running()
            boot.end()
            with self.lock:
                self.used[processor] -= 1
        with self.lock:
            print(f"     {group.name}: {boot.seconds():.0f} s, {boot.cpu_s:.0f} s of processor time", flush=True)
        why = f"the boot was ended after {limit_s} s" if hung else "the kernel ended before this test did"
        for number, name in enumerate(name for name in plan["tests"] if name not in done):
            text = f"{why}\n{boot.complaint()}" if number == 0 else f"not reached: {why}"
            self.add(group, {"name": name, "verdict": "failed", "failures": [[text, "rule", 0]]})

    def take_processor(self, group):
        """The processor with the fewest kernels. A kernel stays on one, because it needs half as long again if it changes between two."""
        with self.lock:
            wanted = set(self.processors) - self.reserved if group.virtual else self.reserved or set(self.processors)
            processor = min(wanted, key=lambda number: (self.used[number], number))
            self.used[processor] += 1
            return processor

    def real_time(self):
        """Runs all groups, one at a time, so that none slows another one."""
        for group in GROUPS:
            if not group.virtual:
                self.boot(group)
        self.reserved = set()

    def work(self):
        """The soak is the longest: it is started first, with the tests in real time in parallel."""
        jobs, virtual = max(1, self.options.jobs), [group for group in GROUPS if group.virtual and not self.options.native]
        if jobs == 1 or len(self.processors) == 1:
            for group in virtual:
                self.boot(group)
            self.real_time()
            return
        self.reserved = set(self.processors[-1:])
        with ThreadPoolExecutor(jobs) as pool:
            for done in [pool.submit(self.real_time)] + [pool.submit(self.boot, group) for group in virtual]:
                done.result()

    def why_skipped(self, group, plan):
        """The missing part for a group that needs another build. If nothing is missing, adds that build to the plan and returns None."""
        if group.distribution:
            return why_not_emulated(group.distribution)
        if group.gpiod == 0:
            return None
        if gpiod2.generation(plan["build"]) == group.gpiod:
            return f"this system has only libgpiod {group.gpiod}, which other groups test"
        try:
            plan["build"] = gpiod2.find_build(plan["build"], not self.options.no_install)
        except RuntimeError as error:
            return f"no gateway with libgpiod {group.gpiod}: {error}"
        return None

    def add(self, group, result):
        result = {"figures": [], "failures": [], "measures": {}, "latencies": [], "from_level": [], "logs": [], "seconds": 0, "host_s": 0, **result}
        result["group"] = group.name
        result["inconclusive"] = result["verdict"] == "inconclusive"
        if result["inconclusive"]:
            result["verdict"] = "skipped"
        with self.lock:
            self.results.append(result)
            self.print_result(result)

    def print_result(self, result):
        mark = {"passed": "ok  ", "failed": "FAIL", "skipped": "skip"}[result["verdict"]]
        figures = f"  [{', '.join(result['figures'])}]" if result["figures"] else ""
        title = ENTRIES[result["name"]].title
        times = f"{result['seconds']:.1f} s in {result['host_s']:.1f} s"
        print(f"{mark} {result['group']}/{result['name']}: {title}{figures}  {times}", flush=True)
        for text, kind, *_ in result["failures"]:
            print(f"       {kind}: " + text.replace("\n", "\n       | "), flush=True)
        for path in result["logs"]:
            self.report_log(path)

    def report_log(self, path):
        """The end of a log of a failed test; of a bus log only the last frames that the gateway sent."""
        with open(path, encoding="utf-8", errors="replace") as file:
            lines = file.read().splitlines()
        if path.endswith(".bus.log"):
            lines = [line for line in lines if " 10A#" in line or " 12A#" in line]
        print(f"       {path}, the end:")
        for line in lines[max(len(lines) - self.options.log_lines, 0) :]:
            print(f"       | {line}")

    def count(self, verdict):
        return sum(result["verdict"] == verdict for result in self.results)

    def interrupt(self, *_):
        """Ends every kernel. The threads that wait for them continue."""
        self.interrupted = True
        for boot in self.boots:
            boot.kill()

    def close(self):
        if self.options.keep or self.count("failed"):
            print(f"logs are in {self.folder}")
        else:
            shutil.rmtree(self.folder, ignore_errors=True)


def parse(arguments):
    parser = argparse.ArgumentParser(
        prog="test/kernel/run", description="Tests on a real Linux kernel that runs as an ordinary process, in virtual and in real time."
    )
    root = os.path.dirname(os.path.dirname(HERE))
    parser.add_argument("--build", default=os.path.join(root, "build", "default"), metavar="DIR", help="build directory (default: build/default)")
    parser.add_argument("--only", action="append", metavar="NAME", help="only tests whose name contains NAME; may be repeated")
    parts = "only the groups in virtual time, in real time, or the long ones: the soak and the distribution's kernels; may be repeated"
    parser.add_argument("--part", action="append", choices=("virtual", "real", "long"), help=parts)
    parser.add_argument("--native", action="store_true", help="run on the machine's own kernel, with its vcan and gpio-sim, in real time")
    parser.add_argument("--full", action="store_true", help=f"all tests: 1000 presses of the e-stop, a soak of {HOURS_FULL} virtual hours")
    parser.add_argument("--repeat", type=int, default=1, metavar="N", help="N campaigns in a row, each with the next seed")
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="seed of the random faults (default: 1)")
    soak = f"virtual hours of the soak, 0: no soak (default: {HOURS}, with --full {HOURS_FULL}); a short soak prints what it cannot judge"
    parser.add_argument("--hours", type=float, metavar="H", help=soak)
    parser.add_argument("--jobs", type=int, default=2, metavar="N", help="kernels that run at the same time (default: 2)")
    parser.add_argument("--log-lines", type=int, default=LOG_LINES, metavar="N", help=f"lines printed of each log of a failed test (default: {LOG_LINES})")
    parser.add_argument("--no-install", action="store_true", help="do not install missing packages for the build of the kernel")
    parser.add_argument("--keep", action="store_true", help="do not delete results and logs")
    parser.add_argument("--report", action="store_true", help="write docs/developer/fault-catalogue.md from this run")
    parser.add_argument("--list", action="store_true", help="list the tests and exit")
    options = parser.parse_args(arguments)
    if options.hours is None:
        options.hours = HOURS_FULL if options.full else HOURS
    if min(options.repeat, options.jobs) < 1 or options.hours < 0:
        parser.error("--repeat and --jobs must be above 0, --hours must not be below 0")
    if options.native and options.report:
        parser.error("--report describes the kernel of build_kernel, not the machine's own: leave out --native")
    return options


def once(options, kernel):
    """One campaign; returns it."""
    campaign = Campaign(options, kernel)
    try:
        campaign.work()
    finally:
        campaign.close()
    return campaign


def campaigns(options, kernel):
    """Runs all of them in a row and prints each as it ends; returns their outcomes. Ctrl-C ends the row; complete ones are printed."""
    outcomes = []
    for number in range(options.repeat):
        now, began = copy.copy(options), time.monotonic()
        now.seed += number
        campaign = once(now, kernel)
        if campaign.interrupted:
            break
        outcomes.append(repeated.Outcome(now.seed, time.monotonic() - began, campaign.results))
        if options.repeat > 1:
            print(repeated.one_line(number + 1, options.repeat, outcomes[-1]), flush=True)
        if options.report and not options.only:
            report.write(outcomes, options)
    if options.repeat > 1 and outcomes:
        print("\n".join(repeated.summary(outcomes, options.repeat)))
    return outcomes


def main(arguments):
    options = parse(arguments)
    if options.list:
        for group in GROUPS:
            for entry in ENTRIES.values():
                if group.runs(entry.name, entry.groups, options.full):
                    print(f"{group.name + '/' + entry.name:<50} {entry.title}")
        return 0
    try:
        for program in ("iwheel-gateway", "iwheel-sim"):
            find_program(options.build, program)
    except FileNotFoundError as error:
        print(error, file=sys.stderr)
        return 69
    kernel = None
    if options.native:
        reason = why_not_native()
        if reason:
            print(f"SKIPPED: {reason}\n0 passed, 0 failed, 1 skipped")
            return 0
    else:
        try:
            kernel = find_kernel(not options.no_install)
        except RuntimeError as error:
            print(f"SKIPPED: {error}\n0 passed, 0 failed, 1 skipped")
            return 0
    outcomes = campaigns(options, kernel)
    totals = [sum(counts) for counts in zip([0, 0, 0], *(outcome.counts() for outcome in outcomes), strict=False)]
    results = [result for outcome in outcomes for result in outcome.results]
    inconclusive = [f"{result['group']}/{result['name']}" for result in results if result.get("inconclusive")]
    if len(outcomes) < options.repeat:
        print(f"interrupted: {len(outcomes)} of {options.repeat} campaigns were completed; only these are counted")
    code = summary(*totals, inconclusive, real_time=sum(result["group"] in repeated.REAL_TIME for result in results))
    return INTERRUPTED if len(outcomes) < options.repeat else code
