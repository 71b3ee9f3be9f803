# SPDX-License-Identifier: MIT
"""Judges the result of a test in real time. A conclusive verdict is final: nothing repeats it.

    attempt --no failure-------------------------------------------------------> PASSED
            --RULE: a safety rule was broken-----------------------------------> FAILED, whatever the machine did
            --CRASH: a program died, a sanitizer reported, no end in time,
                     or the test names what does not exist---------------------> FAILED, whatever the machine did
            --TIMING, CHECK: no measured stall is long and near enough---------> FAILED
            --TIMING, CHECK: a measured stall can have caused each of them-----> INCONCLUSIVE

An inconclusive test runs again, alone, at most RETRIES times, until an attempt is conclusive. If none is, the test counts as skipped; its
name and the stall are printed. But if each of these attempts misses a limit by LONG_US, it has failed: a program can be the cause of such stalls.
The module does not depend on a runner: a runner passes one function that makes an attempt and one that prints a verdict.

    verdict.py --run NAME COMMAND...    the same for a command that is a test
"""

import contextlib
import ctypes
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

PASSED, FAILED, SKIPPED, INCONCLUSIVE = "passed", "failed", "skipped", "inconclusive"
RULE, CRASH, TIMING, CHECK = "rule", "crash", "timing", "check"
RETRIES = 3
NOT_JUDGED = 75  # exit status: more than a quarter of the tests is inconclusive
LATE_US = 5_000  # a sleeper that wakes later than this has measured a stall
CHECK_US = 20_000  # a shorter stall changes no decision of the gateway (IW_GATEWAY_LATE_US), so it explains no failed check
LONG_US = 200_000  # only measured stalls explain a limit that was missed by more
BEFORE_US, AFTER_US = 400_000, 50_000  # a stall this near to a failure may have caused it
QUIET_US, PATIENCE_S, POLL_S = 1_000_000, 10, 0.1  # before a test runs again
PROCESSORS_MAX = 4
PR_SET_PDEATHSIG = 1

DIED = re.compile(
    r"(Address|Leak|Thread|Memory|UndefinedBehavior)Sanitizer|runtime error: |Segmentation fault|core dumped|Aborted|"
    r"\bended with -(4|6|7|8|11)\b"
)
# A stall can make a value None, but it removes no name.
WRONG = re.compile(
    r"\b(NameError|UnboundLocalError|ImportError|ModuleNotFoundError|ReferenceError): |\bAttributeError: (?!'NoneType')|"
    r"\bTypeError: .*(is not a function|unexpected keyword argument|required positional argument)"
)
ERROR = re.compile(r"^(?:\w+\.)*\w*(?:Error|Exception)\b.*", re.MULTILINE)  # The last line of a traceback.
GATEWAY_LATE = re.compile(r"gateway\s+itself\s+was\s+held\s+up\s+for\s+(\d+)\s+ms")


class RuleBroken(AssertionError):
    """A test raises this if a safety rule was broken: motion without permission, a latch that does not hold. See `hold`."""


def hold(condition, text):
    """Checks a safety rule, in tests that fail by exceptions."""
    if not condition:
        raise RuleBroken(text)


class Found(AssertionError):
    """A test, or pytest_verdict.py for it, raises this with failures that have more data than their texts."""

    def __init__(self, failures):
        super().__init__("\n".join(f"{failure.kind}: {failure.text}" for failure in failures))
        self.failures = failures


class Failure(NamedTuple):
    """`need_us`: the shortest stall that can have caused the failure, e.g. the time by which a limit was missed. None: unknown."""

    text: str
    kind: str = CHECK
    at_us: int = 0  # CLOCK_MONOTONIC; 0: at any time in the test
    need_us: float | None = None


class Attempt(NamedTuple):
    """Stalls are pairs (end_us, late_us). `claims` are stalls that a program under test reports; they count only next to a measured one."""

    failures: list = []
    skip: str | None = None
    stalls: list = []
    claims: list = []
    begin_us: int = 0
    end_us: int = 0
    tests: int = 1  # number of tests that it counts as, if nothing failed
    skips: int = 0  # skipped tests among them
    data: Any = None  # data of the runner


class Findings:
    """Findings of a test for its Attempt. `data`: other data for the test's folder."""

    def __init__(self):
        self.failures, self.figures, self.stalls, self.claims, self.data = [], [], [], [], {}


def now_us():
    return time.monotonic_ns() // 1000


def kind_of(text):
    """The kind of a failure with this text: a traceback, or the output of a program."""
    return RULE if re.search(r"\bRuleBroken\b", text) else CRASH if DIED.search(text) or WRONG.search(text) else CHECK


def gist(text):
    """The one line of a failure's text that says most."""
    return (ERROR.findall(text) or text.strip().splitlines() or [""])[-1][:160]


def of_text(text, **fields):
    """The attempt of a test that failed with this text."""
    return Attempt([Failure(text, kind_of(text))], claims=[(now_us(), int(ms) * 1000) for ms in GATEWAY_LATE.findall(text)], **fields)


def die_with_parent():
    """Called in a child process."""
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)


def within(stalls, begin_us, end_us):
    return [(at_us, late_us) for at_us, late_us in stalls if begin_us <= at_us and at_us - late_us <= end_us]


def spans_us(stalls):
    """The durations of the stalls; stalls that overlap, on several processors, are one."""
    spans = []
    for begin_us, end_us in sorted((at_us - late_us, at_us) for at_us, late_us in stalls):
        if spans and begin_us <= spans[-1][1]:
            spans[-1][1] = max(spans[-1][1], end_us)
        else:
            spans.append([begin_us, end_us])
    return [end_us - begin_us for begin_us, end_us in spans]


def explains(failure, stalls, claims=()):
    """True if these stalls, all near enough in time, can have caused the failure."""
    if failure.kind not in (TIMING, CHECK) or not stalls:
        return False
    need_us = CHECK_US if failure.need_us is None else failure.need_us
    spans = spans_us(stalls if need_us >= LONG_US else [*stalls, *claims])
    return (sum(spans) if failure.at_us else max(spans)) >= need_us


def read_stalls(path, begin_us, end_us, more_than_us=0):
    """The stalls of this time that the sleepers wrote to that file."""
    with open(path, encoding="ascii") as file:
        pairs = [tuple(map(int, line.split())) for line in file if line.endswith("\n")]
    return within([pair for pair in pairs if pair[1] > more_than_us], begin_us, end_us)


class Witness:
    """One sleeper on each processor, each a process, until `close`. They also end with this process."""

    def __init__(self, nice=0):
        self.folder = tempfile.mkdtemp(prefix="iwheel-witness-")
        self.path = os.path.join(self.folder, "stalls")
        open(self.path, "w", encoding="ascii").close()
        self.process = subprocess.Popen([sys.executable, os.path.abspath(__file__), self.path, str(nice)], stdin=subprocess.DEVNULL)

    def stalls(self, begin_us, end_us):
        return read_stalls(self.path, begin_us, end_us)

    def close(self):
        self.process.kill()
        self.process.wait()
        shutil.rmtree(self.folder, ignore_errors=True)


class Session:
    """Runs and counts tests. `attempt(name)` makes an Attempt; `report(name, verdict, attempt, tries)` prints one verdict."""

    def __init__(self, attempt=None, report=None, witness=None):
        self.attempt, self.report, self.witness = attempt, report, witness
        self.counts = {PASSED: 0, FAILED: 0, SKIPPED: 0}
        self.inconclusive, self.repeated = [], []

    def stalls(self, begin_us, end_us):
        return self.witness.stalls(begin_us, end_us)

    def measured(self, attempt, begin_us, end_us):
        """Stalls measured by the sleepers and by the test itself."""
        return self.stalls(begin_us, end_us) + within(attempt.stalls, begin_us, end_us)

    def await_quiet(self):
        """Waits until no sleeper was late for a second, at most PATIENCE_S."""
        end = time.monotonic() + PATIENCE_S
        while self.stalls(now_us() - QUIET_US, now_us()) and time.monotonic() < end:
            time.sleep(POLL_S)

    def explained(self, attempt, failure):
        begin_us, end_us = attempt.begin_us, attempt.end_us
        if failure.at_us:
            begin_us, end_us = failure.at_us - BEFORE_US, failure.at_us + AFTER_US
        return explains(failure, self.measured(attempt, begin_us, end_us), within(attempt.claims, begin_us, end_us))

    def verdict_of(self, attempt):
        if not attempt.failures:
            return SKIPPED if attempt.skip else PASSED
        return INCONCLUSIVE if all(self.explained(attempt, failure) for failure in attempt.failures) else FAILED

    def once(self, name):
        """(verdict, attempt)"""
        begin_us = now_us()
        try:
            attempt = self.attempt(name)
        except Exception as error:  # noqa: BLE001
            attempt = Attempt([Failure(f"the runner failed: {error!r}", CRASH)])
        if not attempt.begin_us:
            attempt = attempt._replace(begin_us=begin_us, end_us=now_us())
        return self.verdict_of(attempt), attempt

    def again(self, name):
        """(verdict, attempt, number of attempts): repeats an inconclusive test, alone, until an attempt is conclusive or all missed a limit by far."""
        far = 0  # Attempts that miss a limit by far.
        for tries in range(1, RETRIES + 1):  # noqa: B007
            self.await_quiet()
            verdict, attempt = self.once(name)
            if verdict != INCONCLUSIVE:
                break
            far += any((failure.need_us or 0) >= LONG_US for failure in attempt.failures)
        return FAILED if far == RETRIES else verdict, attempt, tries

    def stall_ms(self, attempt):
        """The longest stall measured during the attempt."""
        return max((late_us for _, late_us in self.measured(attempt, attempt.begin_us, attempt.end_us)), default=0) / 1000

    def count_verdict(self, name, verdict, attempt, tries=1):
        """Counts and prints a verdict. An inconclusive test counts as skipped."""
        if verdict == INCONCLUSIVE:
            self.inconclusive.append(name)
            words = f"inconclusive in each of {tries} attempts: the machine stalled for up to {self.stall_ms(attempt):.0f} ms"
            attempt = attempt._replace(skip=f"{words}; the last failure: {gist(attempt.failures[0].text)}")
        elif tries > 1:
            self.repeated.append(name)
        if verdict == FAILED and attempt.failures:
            first, *others = attempt.failures
            words = f"{first.text}\nlongest stall of the machine measured meanwhile: {self.stall_ms(attempt):.0f} ms"
            attempt = attempt._replace(failures=[first._replace(text=words), *others])
        skips = attempt.skips if verdict == PASSED else 0
        self.counts[SKIPPED if verdict == INCONCLUSIVE else verdict] += attempt.tests - skips if verdict == PASSED else 1
        self.counts[SKIPPED] += skips
        self.report(name, verdict, attempt, tries)

    def run(self, names, jobs=1):
        """Runs each test once, `jobs` in parallel; then the inconclusive ones again, one by one."""
        undecided = []

        def first(name):
            verdict, attempt = self.once(name)
            if verdict == INCONCLUSIVE:
                undecided.append(name)
            else:
                self.count_verdict(name, verdict, attempt)

        with ThreadPoolExecutor(jobs) as pool:
            list(pool.map(first, names))
        for name in undecided:
            verdict, attempt, tries = self.again(name)
            self.count_verdict(name, verdict, attempt, tries + 1)

    def end(self):
        """Prints the sums and returns the exit status."""
        return summary(*self.counts.values(), self.inconclusive, self.repeated)


def summary(passed, failed, skipped, inconclusive=(), repeated=(), real_time=None):
    """Prints the last lines of a runner: the inconclusive tests, then "N passed, N failed, N skipped". Returns the exit status.
    `real_time`: the number of tests that ran in real time, if not all."""
    unjudged = 4 * len(inconclusive) > (passed + failed + skipped if real_time is None else real_time)
    if repeated:
        print(f"judged in a later attempt, because the machine stalled in the first: {', '.join(repeated)}")
    if inconclusive:
        print(f"{len(inconclusive)} inconclusive, counted as skipped: {', '.join(inconclusive)}")
    if unjudged:
        print("real time not judged: more than a quarter is inconclusive; repeat on a machine with less load")
    print(f"{passed} passed, {failed} failed, {skipped} skipped", flush=True)
    return 1 if failed else NOT_JUDGED if unjudged else 0 if passed else 1


def sleep_on(file, parent):
    before = time.monotonic_ns()
    while os.getppid() == parent:
        time.sleep(0.001)
        after = time.monotonic_ns()
        late_us = (after - before) // 1000 - 1000
        if late_us > LATE_US:
            file.write(f"{after // 1000} {late_us}\n")
        before = after


def sleepers(path, nice):
    """Runs one sleeper on each processor, with the priority of the tests' programs."""
    with contextlib.suppress(PermissionError):
        os.setpriority(os.PRIO_PROCESS, 0, nice)
    parent, own, processors = os.getppid(), os.getpid(), sorted(os.sched_getaffinity(0))[:PROCESSORS_MAX]
    with open(path, "a", encoding="ascii", buffering=1) as file:
        for processor in processors[1:]:
            if os.fork() == 0:
                os.sched_setaffinity(0, {processor})
                sleep_on(file, own)
                return
        os.sched_setaffinity(0, {processors[0]})
        sleep_on(file, parent)


def report(name, verdict, attempt, tries):
    """Prints a verdict in one line, and the reason."""
    words = "\n".join(failure.text for failure in attempt.failures)
    later = f", attempt {tries}, alone" if tries > 1 else ""
    seconds = (attempt.end_us - attempt.begin_us) / 1e6
    head = f"skip: {name}: {attempt.skip}" if attempt.skip else f"{'ok' if verdict == PASSED else 'FAILED':7} {name} ({seconds:.1f} s{later})"
    print(head + (f"\n{words}" if words else ""), flush=True)


def run_all(names, attempt, jobs=1, show=report):
    """Runs all tests of a runner next to a witness. Returns the session; `end` prints the sums."""
    session = Session(attempt, show, Witness())
    try:
        session.run(names, jobs)
    finally:
        session.witness.close()
    return session


def run_command(name, command):
    """Runs one command as a test. Prints its output and returns the exit status of a runner; status 77 of the command means skipped."""

    def attempt(_):
        done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace", check=False)
        print(done.stdout, end="", flush=True)
        if done.returncode == 77:
            return Attempt(skip=(done.stdout.splitlines() or [""])[-1])
        return Attempt() if done.returncode == 0 else of_text(f"ended with {done.returncode}; its output is above\n{done.stdout}")

    session = run_all([name], attempt)
    status = session.end()
    return 77 if status == 1 and session.counts[SKIPPED] else status


if __name__ == "__main__":
    if sys.argv[1] == "--run":
        sys.exit(run_command(sys.argv[2], sys.argv[3:]))
    sleepers(sys.argv[1], int(sys.argv[2]))
