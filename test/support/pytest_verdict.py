# SPDX-License-Identifier: MIT
"""pytest runs the tests and verdict.py judges them: a conclusive verdict is final; an inconclusive test runs again, alone, after all others have ended.

Each attempt is a separate process, so a test that crashes or hangs is one failure and affects no other test. Processes without threads fork the
attempts (Nursery), so modules are imported only once. A class that prepares something once (setUpClass) is one attempt, and so are tests marked
`together(name)`. Other plugins, such as --junitxml, receive the last attempt only. The lines before the last name the skipped tests; the last line
is "N passed, N failed, N skipped". The exit status is that of verdict.summary.

    --build DIR    build under test (build/default)         --jobs N       parallel attempts (2)
    --virtual      in virtual time: pytest_virtual.py       --sample N     native tests, and N others selected by the hash of the commit
    --keep         retains the folders of the tests         --sample=-N    the tests that --sample N leaves out
    --pdb          runs all tests in this process and judges nothing

A fixture that is a verdict.Findings collects the findings of a test. If a test fails, the result of a fixture's `said()` is shown and judged too.
@pytest.mark.full: only with IWHEEL_FULL=1. @pytest.mark.exact: no result depends on time. record_property("tests", N): the test counts as N tests.
-rP shows the output of passed tests.
"""

import contextlib
import functools
import hashlib
import io
import json
import multiprocessing
import os
import queue
import shutil
import signal
import subprocess
import tempfile
import threading
import traceback
import unittest

import pytest
import verdict

LIMIT_S, FULL_LIMIT_S = 240, 7200  # limits of one test
MISSING = 77  # exit status: this machine has no virtual time
SKIPS = (unittest.SkipTest, pytest.skip.Exception)
RUN = pytest.StashKey()
pytest_plugins = ("pytest_virtual",)


class Hooks:
    @pytest.hookspec
    def pytest_verdict_end(self, run):
        """Called after all tests have a verdict. A folder may `add` a verdict about all of them together."""


def pytest_addhooks(pluginmanager):
    pluginmanager.add_hookspecs(Hooks)


def pytest_addoption(parser):
    group = parser.getgroup("verdicts")
    group.addoption("--build", default="build/default", metavar="DIR", help="build directory (default: build/default)")
    group.addoption("--jobs", type=int, default=2, metavar="N", help="parallel tests (default: 2)")
    group.addoption(
        "--sample", type=int, metavar="N", help="only the native tests and N others; each commit has another sample; -N: the tests that N leaves out"
    )
    group.addoption("--virtual", action="store_true", help="run them in virtual time, in the kernel of test/kernel")
    group.addoption("--inside", metavar="PLAN", help="set by guest_pytest.py: pytest runs inside that kernel")
    group.addoption("--keep", action="store_true", help="do not delete the folders with configuration and outputs")


def pytest_configure(config):
    config.addinivalue_line("markers", "full: only with IWHEEL_FULL=1")
    config.addinivalue_line("markers", "exact: no stall of the machine explains a failure")
    config.addinivalue_line("markers", "together(name): tests of this name share their preparation and are one attempt")
    config.addinivalue_line("markers", f"limit(seconds): time limit of the test; default {LIMIT_S} s, for IWHEEL_FULL {FULL_LIMIT_S} s")
    if config.option.jobs < 1:
        raise pytest.UsageError("--jobs must be at least 1")
    config.option.build = os.environ["IWHEEL_BUILD"] = os.path.abspath(config.option.build)


def pytest_collection_modifyitems(config, items):
    """Without IWHEEL_FULL=1 the long tests do not run; a list of the tests names them."""
    if os.environ.get("IWHEEL_FULL") != "1" and not config.option.collectonly:
        long = [item for item in items if item.get_closest_marker("full")]
        config.hook.pytest_deselected(items=long)
        items[:] = [item for item in items if item not in long]
    if config.option.sample:
        chosen = sample(items, commit(config.rootpath), abs(config.option.sample))
        left_out = [item for item in items if (item in chosen) != (config.option.sample > 0)]
        config.hook.pytest_deselected(items=left_out)
        items[:] = [item for item in items if item not in left_out]


def commit(folder):
    """The commit that is checked out; empty without git, which selects a sample too."""
    return subprocess.run(["git", "rev-parse", "HEAD"], cwd=folder, capture_output=True, text=True, check=False).stdout.strip()


def sample(items, key, number):
    """The native tests, and so many others. The key alone selects these, so the same commit always has the same sample."""
    native = [item for item in items if item.get_closest_marker("native")]
    others = [item for item in items if item not in native]
    return native + sorted(others, key=lambda item: hashlib.sha256(f"{key} {item.nodeid}".encode()).digest())[:number]


# ---- in the process of an attempt ------------------------------------------------------------------------------------


def findings_of(item):
    return [one for one in (getattr(item, "funcargs", None) or {}).values() if isinstance(one, verdict.Findings)]


@pytest.hookimpl(wrapper=True)
def pytest_pyfunc_call(pyfuncitem):
    """One of the Findings of a test fails the test, even if the test is skipped after it."""
    __tracebackhide__ = True
    result = error = None
    try:
        result = yield
    except (Exception, pytest.skip.Exception, pytest.fail.Exception) as raised:  # noqa: BLE001
        error = raised
    found = [failure for one in findings_of(pyfuncitem) for failure in one.failures]
    if found:
        more = verdict.of_text(words_of(error)).failures if error and not isinstance(error, SKIPS) else []
        raise verdict.Found(found + more) from error
    if error:
        raise error
    return result


def words_of(error):
    return "".join(traceback.format_exception(error))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item, call):
    """The report of each phase carries the input of verdict.py: failures with their kinds, stalls and claims."""
    report = yield
    report.failures, report.claims = [], []
    if report.when == "call":
        rigs = [one for one in (item.funcargs or {}).values() if not isinstance(one, type)]  # rig_type is a type and has no output.
        report.sections += [("output of its programs", one.said()) for one in rigs if report.failed and hasattr(one, "said")]
    if report.failed:
        error = call.excinfo.value if call.excinfo else report.longreprtext
        text = error if isinstance(error, str) else words_of(error)
        judged = verdict.of_text("\n".join([text, *(said for _, said in report.sections)]))
        if isinstance(error, verdict.Found):
            report.longrepr = str(error)
        report.failures, report.claims = getattr(error, "failures", judged.failures), judged.claims
    findings = findings_of(item) if report.when == "call" else []
    report.claims += [claim for one in findings for claim in one.claims]
    report.stalls = [stall for one in findings for stall in one.stalls]
    report.figures = [figure for one in findings for figure in one.figures]
    report.data = {key: value for one in findings for key, value in one.data.items()}
    return report


class Listener:
    """Collects the reports of one attempt."""

    def __init__(self):
        self.reports = []

    def pytest_runtest_logreport(self, report):
        self.reports.append(report)


def perform(config, items):
    """Runs one attempt and returns its reports."""
    capture, listener, begin_us = config.pluginmanager.getplugin("capturemanager"), Listener(), verdict.now_us()
    capture.stop_global_capturing()  # Parallel attempts share the old one.
    capture.start_global_capturing()
    capture.suspend_global_capture()
    config.pluginmanager.register(listener)
    for item, following in zip(items, [*items[1:], None], strict=True):
        config.hook.pytest_runtest_protocol(item=item, nextitem=following)
    return {
        "reports": [config.hook.pytest_report_to_serializable(config=config, report=report) for report in listener.reports],
        "begin_us": begin_us,
        "end_us": verdict.now_us(),
    }


# ---- between the processes -------------------------------------------------------------------------------------------


def limit_of(items):
    def one(item):
        mark = item.get_closest_marker("limit")
        return mark.args[0] if mark else FULL_LIMIT_S if item.get_closest_marker("full") else LIMIT_S

    return sum(map(one, items))


def apart(function, limit_s):
    """Runs the function in a separate process and session, and kills that session afterwards. Returns the result, or a text on how the process ended."""
    ours, theirs = multiprocessing.Pipe(duplex=False)
    child = os.fork()
    if child == 0:
        try:
            os.setsid()
            verdict.die_with_parent()
            signal.signal(signal.SIGINT, signal.default_int_handler)  # A background job of a shell ignores SIGINT, and so would the tests' programs.
            theirs.send(function())
        finally:
            os._exit(1)
    theirs.close()
    answer, late = None, not ours.poll(limit_s)
    with contextlib.suppress(EOFError):
        answer = None if late else ours.recv()
    if late:
        os.kill(child, signal.SIGABRT)  # Python then prints its current line.
        ours.poll(1)
    with contextlib.suppress(ProcessLookupError):
        os.killpg(child, signal.SIGKILL)
    _, status = os.waitpid(child, 0)
    ours.close()
    return answer or (f"did not end within {limit_s} s" if late else f"the test's own process ended with {os.waitstatus_to_exitcode(status)}")


class Nursery:
    """One process per parallel attempt, which forks each attempt."""

    def __init__(self, config, units):
        self.free, self.children = queue.SimpleQueue(), []
        for _ in range(config.option.jobs):
            ours, theirs = multiprocessing.Pipe()
            child = os.fork()
            if child == 0:
                with contextlib.suppress(EOFError):
                    self.serve(theirs, config, units)
                os._exit(0)
            theirs.close()
            self.children.append(child)
            self.free.put(ours)

    @staticmethod
    def serve(line, config, units):
        verdict.die_with_parent()
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        config.pluginmanager.unregister(name="terminalreporter")
        while True:
            items = units[line.recv()]
            line.send(apart(lambda: perform(config, items), limit_of(items)))

    def ask(self, name):
        """The result of one attempt. Several threads may call it."""
        line = self.free.get()
        try:
            line.send(name)
            return line.recv()
        finally:
            self.free.put(line)

    def close(self):
        """Kills the processes; attempts that still run end with them."""
        while self.children:
            child = self.children.pop()
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)


# ---- in the process that judges --------------------------------------------------------------------------------------


def units_of(items):
    """{name: the tests of one attempt}"""
    units = {}
    for item in items:
        shared = item.cls and "setUpClass" in vars(item.cls)
        mark = item.get_closest_marker("together")
        name = f"{item.path.name}: {mark.args[0]}" if mark else item.parent.nodeid if shared else item.nodeid
        units.setdefault(name, []).append(item)
    return units


class Run(verdict.Session):
    """One run of many tests."""

    def __init__(self, session):
        self.config, self.units, self.lock = session.config, units_of(session.items), threading.Lock()
        self.over, self.skipped, self.passed = False, {}, {}
        self.folder = tempfile.mkdtemp(prefix="iwheel-tests-")
        os.chmod(self.folder, 0o1777)  # As /tmp: tests that run as another user can write only into their own folders.
        tempfile.tempdir = os.environ["TMPDIR"] = self.folder
        virtual = self.config.option.virtual
        self.nursery = (self.config.pluginmanager.getplugin("pytest_virtual").Boots if virtual else Nursery)(self.config, self.units)
        super().__init__(self.work_off, self.forward, None if virtual else verdict.Witness(getattr(self.config, "witness_nice", 0)))

    def stalls(self, begin_us, end_us):
        """There are no stalls in virtual time."""
        return super().stalls(begin_us, end_us) if self.witness else []

    def close(self):
        self.nursery.close()
        if self.witness:
            self.witness.close()
        tempfile.tempdir = os.environ["TMPDIR"] = os.path.dirname(self.folder)
        if not self.config.option.keep:
            shutil.rmtree(self.folder, ignore_errors=True)

    def interrupt(self, *_):
        self.over = True
        self.nursery.close()
        raise KeyboardInterrupt

    def work_off(self, name):
        """Makes one attempt of these tests."""
        answer, items = self.nursery.ask(name), self.units[name]
        if isinstance(answer, verdict.Attempt):
            return answer
        if isinstance(answer, str):
            return verdict.Attempt([verdict.Failure(answer, verdict.CRASH)])
        reports = [self.config.hook.pytest_report_from_serializable(config=self.config, data=data) for data in answer.pop("reports")]
        for report in reports:
            if isinstance(report.longrepr, list):  # The place and the reason of a skipped test were a tuple before JSON.
                report.longrepr = tuple(report.longrepr)
        failures, claims, stalls = ([tuple(one) for report in reports for one in getattr(report, what)] for what in ("failures", "claims", "stalls"))
        if items[0].get_closest_marker("exact"):
            failures = [(text, verdict.RULE) for text, *_ in failures]
        skips = {report.nodeid for report in reports if report.skipped}
        tests = sum(dict(report.user_properties).get("tests", 1) for report in reports if report.when == "teardown")
        failures = [verdict.Failure(*failure) for failure in failures]
        return verdict.Attempt(failures, claims=claims, stalls=stalls, tests=tests, skips=len(skips), data=reports, **answer)

    def forward(self, name, kind, attempt, tries):
        """Passes the reports of the last attempt to pytest's other plugins, with the verdict."""
        with self.lock:
            if self.over:
                return
            if kind == verdict.PASSED:
                self.passed[name] = attempt
            for report in attempt.data or [report_of(self.units[name][0].nodeid, self.units[name][0].location, attempt)]:
                if kind == verdict.INCONCLUSIVE and report.failed:
                    report.outcome, report.longrepr = "skipped", (*report.location[:2], attempt.skip)
                if report.skipped:
                    self.skipped[report.nodeid] = f"skip: {report.nodeid}: {report.longrepr[2].removeprefix('Skipped: ')}"
                more = [f"attempt {tries}, alone"] if tries > 1 else []
                more += [f"longest stall {self.stall_ms(attempt):.0f} ms"] if report.failed else []
                report.summary = ", ".join([f"{report.duration:.1f} s", *(getattr(report, "figures", [])), *more])
                if report.when == "setup":
                    self.config.hook.pytest_runtest_logstart(nodeid=report.nodeid, location=report.location)
                self.config.hook.pytest_runtest_logreport(report=report)

    def add(self, name, attempt, figures):
        """Adds a verdict on something that is not a test."""
        report = report_of(name, (name, 0, name), attempt)
        report.figures = figures
        self.count_verdict(name, self.verdict_of(attempt), attempt._replace(data=[report]))


def attempts_inside(session):
    """Makes all attempts of a plan of pytest_virtual.py and writes each result when the attempt ends."""
    config, units = session.config, units_of(session.items)
    config.pluginmanager.unregister(name="terminalreporter")
    with open(config.option.inside, encoding="utf-8") as file:
        plan = json.load(file)
    with open(plan["results"], "a", encoding="utf-8", buffering=1) as results:
        for name in plan["tests"]:
            answer = apart(functools.partial(perform, config, units[name]), limit_of(units[name]))
            results.write(json.dumps({"name": name, "answer": answer}) + "\n")
    return True


def report_of(nodeid, location, attempt):
    """A report for an attempt without one of pytest: no test, or a process that sent none."""
    text = "\n".join(failure.text for failure in attempt.failures)
    outcome, longrepr = ("failed", text) if text else ("skipped", (*location[:2], attempt.skip)) if attempt.skip else ("passed", None)
    return pytest.TestReport(nodeid, location, {}, outcome, longrepr, "call")


@pytest.hookimpl(tryfirst=True)
def pytest_report_teststatus(report):
    """With -v: the duration, the measurements and the number of the attempt."""
    if report.when == "call" and report.outcome in ("passed", "failed") and hasattr(report, "summary") and not hasattr(report, "context"):  # No subtest.
        return report.outcome, ".F"[report.failed], f"{report.outcome.upper()} ({report.summary})"
    return None


@pytest.hookimpl(tryfirst=True)
def pytest_runtestloop(session):
    option = session.config.option
    if option.collectonly or option.usepdb or session.testsfailed:  # A failure before any test: a file cannot be imported.
        return None
    if option.inside:
        return attempts_inside(session)
    run, handlers = Run(session), {}
    try:
        for number in (signal.SIGINT, signal.SIGTERM):
            handlers[number] = signal.signal(number, run.interrupt)
        run.run(list(run.units), len(run.units) if option.virtual else option.jobs)  # Each kernel gets its share.
        session.config.hook.pytest_verdict_end(run=run)
        session.config.stash[RUN] = run
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
        run.close()
    return True


@pytest.hookimpl(tryfirst=True)
def pytest_sessionfinish(session):
    run = session.config.stash.get(RUN, None)
    if run:
        with contextlib.redirect_stdout(io.StringIO()) as sums:
            status = run.end()
            session.exitstatus = MISSING if getattr(run.nursery, "reason", None) else status
        run.sums = sums.getvalue()


@pytest.hookimpl(trylast=True)
def pytest_unconfigure(config):
    run = config.stash.get(RUN, None)
    if run:
        folders = [f"kept: {run.folder}"] if config.option.keep else []
        print(*folders, *run.skipped.values(), run.sums, sep="\n", end="", flush=True)
