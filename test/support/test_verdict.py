#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Tests the verdicts of test/support/verdict.py with a fake runner whose attempts and stalls are invented, and tests that each seeded fault is noticed.

usage: test/support/test_verdict.py [unittest's arguments]

The last line sums up: "N passed, N failed, N skipped".
"""

import contextlib
import io
import os
import shutil
import subprocess
import sys
import tempfile
import textwrap
import time
import types
import unittest
from pathlib import Path
from unittest import mock

HERE = os.path.dirname(os.path.abspath(__file__))
SOURCE = os.path.join(HERE, "verdict.py")
sys.path.insert(0, HERE)
sys.dont_write_bytecode = True
import verdict

AT_US = 3_000_000
# The decisions of the module are tested on copies of it, each with one of these faults: (fault, old, new). Each fault must fail a test below.
FAULTS = (
    ("a broken rule is excused by a stall", "if failure.kind not in (TIMING, CHECK)", "if failure.kind not in (TIMING, CHECK, RULE)"),
    ("a crash is excused by a stall", "if failure.kind not in (TIMING, CHECK)", "if failure.kind not in (TIMING, CHECK, CRASH)"),
    ("one explained failure excuses the others", "INCONCLUSIVE if all(", "INCONCLUSIVE if any("),
    ("no stall is needed", "or not stalls:", "or False:"),
    ("a stall of any length explains a check", "CHECK_US = 20_000", "CHECK_US = 0"),
    ("a stall of any length explains a missed limit", "else failure.need_us", "else 0"),
    ("a stall explains what happened long after it", "BEFORE_US, AFTER_US = 400_000", "BEFORE_US, AFTER_US = 40_000_000"),
    ("stalls of other tests count", "if begin_us <= at_us and at_us - late_us <= end_us", "if at_us"),
    ("one stall seen on two processors counts twice", "if spans and begin_us <= spans[-1][1]:", "if False:"),
    ("the gateway's own report is enough", "claims=[(now_us()", "stalls=[(now_us()"),
    ("the gateway's own report is ignored", "[*stalls, *claims]", "stalls"),
    ("the gateway's own report explains any time", "stalls if need_us >= LONG_US else", "stalls if False else"),
    ("a limit missed by far in every attempt is skipped", "FAILED if far == RETRIES else verdict", "verdict"),
    ("a limit missed by far once fails", "FAILED if far == RETRIES else verdict", "FAILED if far else verdict"),
    ("a conclusive failure is repeated", "if verdict == INCONCLUSIVE:\n                undecided", "if verdict != PASSED:\n                undecided"),
    ("the last attempt counts as passed", "self.counts[SKIPPED if verdict == INCONCLUSIVE", "self.counts[PASSED if verdict == INCONCLUSIVE"),
    ("repeated until it passes", "if verdict != INCONCLUSIVE:\n                break", "if verdict == PASSED:\n                break"),
    ("repeated without end", "RETRIES = 3", "RETRIES = 30"),
    ("repeated among other tests", "for name in undecided:", "for name in []:"),
    ("inconclusive tests are not named", "self.inconclusive.append(name)", "pass"),
    ("all inconclusive is a success", "NOT_JUDGED if unjudged", "0 if unjudged"),
    ("the quarter is a half", "4 * len(inconclusive)", "2 * len(inconclusive)"),
    ("not judged hides a failure", "return 1 if failed else NOT_JUDGED if unjudged", "return NOT_JUDGED if unjudged else 1 if failed"),
    ("nothing ran is a success", "else 0 if passed else 1", "else 0"),
    ("a sanitizer's report counts as late", "(Address|Leak|", "(Leak|"),
    ("a name that does not exist counts as late", " or WRONG.search(text)", ""),
    ("a broken rule in a traceback counts as late", "return RULE if re", "return CHECK if re"),
    ("what failed is skipped", "return SKIPPED if attempt.skip else PASSED", "return PASSED"),
    ("the runner's own exception is inconclusive", 'the runner failed: {error!r}", CRASH', 'the runner failed: {error!r}", CHECK'),
    ("a sleeper that never writes", "if late_us > LATE_US:", "if False:"),
    ("a sleeper that always writes", "if late_us > LATE_US:", "if True:"),
)


# The same for the readers of the runners' sums: (fault, file, old, new).
START, COUNT = "test/all/start", "test/all/count_tests.py"
READER_FAULTS = (
    (
        "check accepts the result of a second run",
        START,
        "status = 77 if missing else run(command, file)",
        "status = 77 if missing else run(command, file) and run(command, file)",
    ),
    ("check counts 75 as success", COUNT, "return 1 if sums[1] else 75 if unjudged else int(not sums[0])", "return 1 if sums[1] else int(not sums[0])"),
    ("check lets 75 outweigh a failure", COUNT, "return 1 if sums[1] else 75 if unjudged", "return 75 if unjudged else 1 if sums[1]"),
    ("check counts any status as 75", COUNT, "status not in (0, 77) and not (status == 75 and", "status == 1 and not (status == 75 and"),
    ("check cuts the reason of a failure", START, "5 if FAILED", "1 if FAILED"),
    ("check shows a traceback without its exception", START, "20 if REASON", "1 if REASON"),
    ("check does not name inconclusive tests", COUNT, 'above\\n" if inconclusive', 'above\\n" if False'),
    ("check counts a killed step as skipped", COUNT, '("none", 77 if status == 77 else 1, 0, 0)', '("none", 77, 0, 0)'),
    ("check shows no output of a killed step", COUNT, 'if layer == "none":', "if False:"),
    ("CTest's reader counts 75 as a failure", COUNT, "failed = 75 if NOT_JUDGED.search(output) else 1", "failed = 1"),
    (
        "CTest's reader counts 75 as success",
        COUNT,
        'return 1 if sums[1] else 75 if any(line.startswith("real time") for line in lines) else ended',
        "return 1 if sums[1] else 0",
    ),
    ("CTest's reader accepts the sum of a crashed test", COUNT, "return passed, failed or int(judged), skipped", "return passed, failed, skipped"),
)


class Made:
    """A session with invented attempts: {name: attempts in order}. `late`: stalls of the machine."""

    def __init__(self, attempts, late=()):
        self.attempts, self.late, self.made, self.printed = {name: list(all_of) for name, all_of in attempts.items()}, list(late), [], {}
        self.session = verdict.Session(self.next, self.report)
        self.session.stalls = lambda begin_us, end_us: verdict.within(self.late, begin_us, end_us)
        self.session.await_quiet = lambda: None

    def next(self, name):
        self.made.append(name)
        made = self.attempts[name].pop(0)
        if isinstance(made, Exception):
            raise made
        return made._replace(begin_us=AT_US - 1_000_000, end_us=AT_US + 1_000_000)

    def report(self, name, kind, attempt, tries):
        self.printed[name] = (kind, attempt.skip, tries)

    def run(self):
        """(exit status, lines, number of attempts of each test)"""
        out = io.StringIO()
        with contextlib.redirect_stdout(out):
            self.session.run(list(self.attempts))
            status = self.session.end()
        return status, out.getvalue().splitlines(), {name: self.made.count(name) for name in self.attempts}


def ok():
    return verdict.Attempt()


def bad(kind, **fields):
    return verdict.Attempt([verdict.Failure("it was wrong", kind, **fields)])


def stall(late_us=200_000, at_us=AT_US):
    return at_us, late_us


class Conclusive(unittest.TestCase):
    def test_failure_names_the_longest_stall_that_was_measured(self):
        for late, words in (((), "meanwhile: 0 ms"), ((stall(7_000), stall(19_000)), "meanwhile: 19 ms")):
            made, printed = Made({"one": [bad(verdict.CHECK)]}, late), []
            made.session.report = lambda name, kind, attempt, tries, printed=printed: printed.extend(attempt.failures)
            made.run()
            self.assertEqual(f"it was wrong\nlongest stall of the machine measured {words}", printed[0].text)

    def final(self, first, late=()):
        """Asserts one attempt, which fails although the next one would pass."""
        status, lines, made = Made({"one": [first, ok(), ok(), ok()], "two": [ok()]}, late).run()
        self.assertEqual((1, ["1 passed, 1 failed, 0 skipped"], 1), (status, lines, made["one"]))

    def test_broken_rule_then_pass_fails_whatever_the_machine_did(self):
        self.final(bad(verdict.RULE))
        self.final(bad(verdict.RULE, at_us=AT_US), [stall()])
        self.final(bad(verdict.RULE, at_us=AT_US, need_us=0), [stall()])

    def test_crash_or_hang_then_pass_fails_whatever_the_machine_did(self):
        self.final(bad(verdict.CRASH))
        self.final(bad(verdict.CRASH, at_us=AT_US), [stall()])

    def test_late_on_a_quiet_machine_fails(self):
        self.final(bad(verdict.TIMING, at_us=AT_US, need_us=0))
        self.final(bad(verdict.CHECK))

    def test_rule_next_to_an_explained_failure_fails(self):
        both = verdict.Attempt([verdict.Failure("late", verdict.TIMING, AT_US, 0), verdict.Failure("moved", verdict.RULE, AT_US)])
        self.final(both, [stall()])

    def test_stall_shorter_than_the_excess_fails(self):
        self.final(bad(verdict.TIMING, at_us=AT_US, need_us=60_000), [stall(50_000)])

    def test_stall_too_short_for_a_check_fails(self):
        self.final(bad(verdict.CHECK), [stall(19_999)])

    def test_one_stall_on_two_processors_counts_once(self):
        self.final(bad(verdict.TIMING, at_us=AT_US, need_us=60_000), [stall(40_000), stall(40_000, AT_US + 1_000)])

    def test_stall_far_from_the_failure_fails(self):
        self.final(bad(verdict.TIMING, at_us=AT_US, need_us=0), [stall(at_us=AT_US - 900_000)])

    def test_stall_of_another_test_fails(self):
        self.final(bad(verdict.CHECK), [stall(at_us=AT_US + 9_000_000), stall(at_us=AT_US - 9_000_000)])

    def test_exception_of_the_runner_fails(self):
        self.final(RuntimeError("no port"), [stall(60_000_000, verdict.now_us() + 60_000_000)])

    def test_gateway_late_on_a_quiet_machine_fails(self):
        self.final(verdict.of_text("the gateway itself was held up for 583 ms"))


class Inconclusive(unittest.TestCase):
    def test_pass_in_a_later_attempt_passes_and_is_named(self):
        made = Made({"one": [bad(verdict.CHECK)] * 3 + [ok()], "two": [ok()]}, [stall()])
        status, lines, times = made.run()
        self.assertEqual((0, 4, ("passed", None, 4)), (status, times["one"], made.printed["one"]))
        self.assertIn("later attempt", lines[0])
        self.assertEqual("2 passed, 0 failed, 0 skipped", lines[-1])

    def test_rule_broken_in_a_later_attempt_fails(self):
        status, lines, made = Made({"one": [bad(verdict.CHECK), bad(verdict.RULE), ok()]}, [stall()]).run()
        self.assertEqual((1, "0 passed, 1 failed, 0 skipped", 2), (status, lines[-1], made["one"]))

    def test_stalled_each_time_is_skipped_by_name_with_the_stall(self):
        made = Made({"one": [bad(verdict.TIMING, at_us=AT_US, need_us=90_000)] * 40, **{f"ok{n}": [ok()] for n in range(3)}}, [stall(123_000)])
        status, lines, times = made.run()
        self.assertEqual((0, 4), (status, times["one"]))
        self.assertEqual(["1 inconclusive, counted as skipped: one", "3 passed, 0 failed, 1 skipped"], lines)
        words = "inconclusive in each of 4 attempts: the machine stalled for up to 123 ms; the last failure: it was wrong"
        self.assertEqual(("inconclusive", words, 4), made.printed["one"])

    def test_limit_missed_by_far_in_every_attempt_alone_fails(self):
        far, near = bad(verdict.TIMING, at_us=AT_US, need_us=250_000), bad(verdict.TIMING, at_us=AT_US, need_us=50_000)
        for attempts, expected in (([near, far, far, far], "failed"), ([far, far, near, far], "inconclusive"), ([far, ok()], "passed")):
            made = Made({"one": attempts}, [stall(300_000)])
            made.run()
            self.assertEqual(expected, made.printed["one"][0])

    def test_gateway_late_by_far_is_no_reason(self):
        far = bad(verdict.TIMING, at_us=AT_US, need_us=250_000)._replace(claims=[(AT_US, 300_000)])
        status, _, made = Made({"one": [far, ok()]}, [stall(6_000)]).run()
        self.assertEqual((1, 1), (status, made["one"]))

    def test_gist_of_a_traceback_is_its_error(self):
        text = "Traceback (most recent call last):\n  File ...\nAssertionError: 3 != 4\niwheel-gateway: info: state: armed\n"
        self.assertEqual(["AssertionError: 3 != 4", "it was wrong", ""], list(map(verdict.gist, (text, "first\nit was wrong\n", ""))))

    def test_others_end_before_it_is_repeated(self):
        made = Made({"one": [bad(verdict.CHECK), ok()], "two": [ok()]}, [stall()])
        made.run()
        self.assertEqual(["one", "two", "one"], made.made)

    def test_short_stalls_add_up_near_the_failure(self):
        first = bad(verdict.TIMING, at_us=AT_US, need_us=60_000)
        status, _, made = Made({"one": [first, ok()]}, [stall(40_000, AT_US - 100_000), stall(40_000)]).run()
        self.assertEqual((0, 2), (status, made["one"]))

    def test_gateway_late_next_to_a_late_machine_is_repeated(self):
        first = verdict.of_text("why: the gateway itself\n  was held up for 583 ms")
        first = first._replace(claims=[(AT_US, late_us) for _, late_us in first.claims])
        status, _, made = Made({"one": [first, ok()]}, [stall(6_000)]).run()
        self.assertEqual((0, 2), (status, made["one"]))

    def test_stall_that_the_test_measured_itself_counts(self):
        first = bad(verdict.CHECK)._replace(stalls=[stall()])
        self.assertEqual(2, Made({"one": [first, ok()]}).run()[2]["one"])


class Status(unittest.TestCase):
    def of(self, passed, inconclusive, **more):
        attempts = {f"ok{n}": [ok()] for n in range(passed)} | {f"late{n}": [bad(verdict.CHECK)] * 4 for n in range(inconclusive)} | more
        return Made(attempts, [stall()]).run()

    def test_all_stalled_is_75_and_is_reported(self):
        status, lines, _ = self.of(0, 3)
        self.assertEqual((75, "0 passed, 0 failed, 3 skipped"), (status, lines[-1]))
        self.assertTrue(lines[-2].startswith("real time not judged"), lines)

    def test_more_than_a_quarter_is_75_and_a_quarter_is_not(self):
        self.assertEqual(75, self.of(5, 2)[0])
        self.assertEqual(0, self.of(6, 2)[0])

    def test_quarter_counts_only_tests_in_real_time(self):
        with contextlib.redirect_stdout(io.StringIO()):
            self.assertEqual(75, verdict.summary(100, 0, 2, ["a", "b"], real_time=5))

    def test_failure_outranks_unjudged_tests(self):
        self.assertEqual(1, self.of(0, 3, bad=[bad(verdict.RULE)])[0])

    def test_nothing_that_ran_is_no_success(self):
        self.assertEqual(1, Made({}).run()[0])
        self.assertEqual(1, Made({"one": [verdict.Attempt(skip="no port")]}).run()[0])

    def test_skipped_is_counted_as_skipped(self):
        self.assertEqual("1 passed, 0 failed, 1 skipped", Made({"one": [verdict.Attempt(skip="no port")], "two": [ok()]}).run()[1][-1])
        self.assertEqual("2 passed, 0 failed, 1 skipped", Made({"one": [verdict.Attempt(tests=3, skips=1)]}).run()[1][-1])


class Words(unittest.TestCase):
    def kind(self, text):
        return verdict.of_text(text).failures[0].kind

    def test_kind_of_a_text(self):
        for text in ("==1==ERROR: AddressSanitizer: heap-use-after-free", "a.c:3:1: runtime error: signed integer overflow", "iwheel-gateway ended with -11: "):
            self.assertEqual(verdict.CRASH, self.kind(text))
        for text in (
            "NameError: name 'press' is not defined",
            "playwright._impl._errors.Error: Page.evaluate: ReferenceError: press is not defined",
            "AttributeError: module 'os' has no attribute 'press'",
            "TypeError: press() got an unexpected keyword argument 'late'",
        ):
            self.assertEqual(verdict.CRASH, self.kind(text), "no stall removes a name")
        self.assertEqual(verdict.CHECK, self.kind("AttributeError: 'NoneType' object has no attribute 'group'"))
        self.assertEqual(verdict.RULE, self.kind("Traceback\nverdict.RuleBroken: nonzero after e-stop"))
        self.assertEqual(verdict.CHECK, self.kind("AssertionError: not within 10 s: it is armed"))


class Processes(unittest.TestCase):
    """Tests the sleepers."""

    def test_sleepers_notice_a_stalled_machine_and_end(self):
        witness = verdict.Witness()
        try:
            late = []
            for _ in range(10):  # Until the sleepers have started.
                time.sleep(0.5)
                begin_us = verdict.now_us()
                os.kill(witness.process.pid, 19)
                time.sleep(0.2)
                os.kill(witness.process.pid, 18)
                time.sleep(0.2)
                late = [late_us for _, late_us in witness.stalls(begin_us, verdict.now_us())]
                if any(late_us > 150_000 for late_us in late):
                    break
            self.assertTrue([late_us for late_us in late if late_us > 150_000], late)
            self.assertGreater(min(late), 5_000, "a sleeper on time writes nothing")
        finally:
            witness.close()
        self.assertFalse(os.path.exists(witness.folder))

    def test_wait_until_the_machine_is_quiet_ends(self):
        clock, session = [10.0], verdict.Session()
        session.stalls = lambda begin_us, _: verdict.within([(12_000_000, 200_000)], begin_us, 1 << 60)
        with mock.patch.object(verdict, "now_us", lambda: int(clock[0] * 1e6)), mock.patch.object(verdict, "time") as fake:
            fake.monotonic, fake.sleep = (lambda: clock[0]), lambda seconds: clock.__setitem__(0, clock[0] + seconds)
            session.await_quiet()
        self.assertAlmostEqual(13.0, clock[0], delta=0.15)


class Check(unittest.TestCase):
    """./check with the test `system.realtime`, whose pytest is a script of this test, and with `unit`, whose tests are a file with CTest's output.
    Both wait for the build, which does nothing here and counts as one."""

    FILES = ("check", "docs/developer/proofs.csv", START, COUNT, "test/all/CMakeLists.txt", "test/all/steps.cmake")
    CTEST = """#!/bin/sh
        case "$*" in
        --test-dir*) exec {ctest} "$@" ;;
        *unit.programs.xml*) echo "<suite/>" >build/check/unit.programs.xml ;;
        *) echo '<suite>{junit}</suite>' >build/check/unit.xml && exit 8 ;;
        esac
        """

    faulty = {}  # {file: (old, new)}: a seeded fault

    def check(self, runner, *steps, junit=""):
        """(exit status, lines, number of runs of the runner)"""
        with tempfile.TemporaryDirectory() as folder:
            files = {name: Path(HERE, "../..", name).read_text(encoding="utf-8") for name in self.FILES}
            for name, (old, new) in self.faulty.items():
                assert files[name].count(old) == 1, f"{name}: {old}"
                files[name] = files[name].replace(old, new)
            files |= {
                "bin/cmake": f'#!/bin/sh\n[ "$1" != -S ] || exec {shutil.which("cmake")} "$@"\n',
                "bin/ctest": textwrap.dedent(self.CTEST.format(ctest=shutil.which("ctest"), junit=junit)),
                ".venv/bin/python": f"#!/bin/bash\n[ $1 != -c ] || exit 0\necho x >>{folder}/ran\nran=$(wc -l <{folder}/ran)\n{runner}",
            }
            for name, text in files.items():
                path = Path(folder, name)
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_text(text, encoding="utf-8")
                path.chmod(0o755)
            done = subprocess.run(
                ["./check", "--no-install", *steps],
                cwd=folder,
                capture_output=True,
                text=True,
                check=False,
                env={**os.environ, "PATH": f"{folder}/bin:{os.environ['PATH']}"},
            )
            ran = Path(folder, "ran")
            return done.returncode, done.stdout.splitlines(), ran.stat().st_size // 2 if ran.exists() else 0

    def test_broken_rule_that_shows_once_fails_check(self):
        once = """if [ "$ran" = 1 ]; then
            echo "FAIL row11 rule 202: nonzero after e-stop"; echo "3 passed, 1 failed, 0 skipped"; exit 1
        fi
        echo "4 passed, 0 failed, 0 skipped"
        """
        status, lines, ran = self.check(once, "system.realtime")
        self.assertEqual((1, "4 passed, 1 failed, 0 skipped", 1), (status, lines[-1], ran), lines)

    def test_check_shows_the_reason_that_follows_a_failure(self):
        runner = "echo 'FAIL row11'; for i in 1 2 3 4 5; do echo \"  reason $i\"; done; seq 100 199; echo '0 passed, 1 failed, 0 skipped'; exit 1\n"
        _, lines, _ = self.check(runner, "system.realtime")
        shown = "\n".join(lines)
        for what in ("FAIL row11", *(f"  reason {i}" for i in range(1, 5)), "199"):
            self.assertIn(what, shown)
        for what in ("reason 5", "150"):
            self.assertNotIn(what, shown)

    def test_exception_after_traceback_is_shown_with_its_details(self):
        runner = (
            "echo 'FAIL: test_x (x.X)'; seq 301 309; echo \"AssertionError: 'ready' did not come; after the last text came:\"\n"
            "echo busy; seq 401 430; seq 501 540; exit 1\n"
        )
        shown = "\n".join(self.check(runner, "system.realtime")[1])
        for what in ("FAIL: test_x", "AssertionError: 'ready'", ": busy", ": 401", ": 418"):
            self.assertIn(what, shown)
        for what in (": 309", ": 419"):
            self.assertNotIn(what, shown)

    def test_not_judged_is_75_and_named(self):
        status, lines, _ = self.check(f"cd {HERE}; python3 -c 'import sys, verdict; sys.exit(verdict.summary(2, 0, 1, [\"row11\"]))'\n", "system.realtime")
        self.assertEqual((75, "3 passed, 0 failed, 1 skipped"), (status, lines[-1]), lines)
        self.assertRegex(lines[-2], "^real time not judged: system.realtime;")
        self.assertRegex(lines[-3], "^1 inconclusive, counted as skipped")

    def test_inconclusive_test_alone_is_reported_and_no_failure(self):
        status, lines, _ = self.check(f"cd {HERE}; python3 -c 'import sys, verdict; sys.exit(verdict.summary(3, 0, 1, [\"row11\"]))'\n", "system.realtime")
        self.assertEqual((0, "4 passed, 0 failed, 1 skipped"), (status, lines[-1]), lines)
        self.assertRegex(lines[-2], "^1 inconclusive, counted as skipped")

    def test_runner_that_dies_of_another_status_fails_check(self):
        for number in (1, 74, 134):
            self.assertEqual(1, self.check(f"echo '4 passed, 0 failed, 0 skipped'; exit {number}\n", "system.realtime")[0])

    def test_runner_killed_fails_check_which_shows_its_output(self):
        status, lines, _ = self.check("echo as far as this; kill -9 $PPID; sleep 5\n", "system.realtime")
        self.assertEqual((1, "1 passed, 1 failed, 0 skipped"), (status, lines[-1]), lines)
        self.assertTrue([line for line in lines if line.endswith("as far as this")], lines)

    @staticmethod
    def case(output, status="fail"):
        return f'<testcase name="ctl.x" status="{status}"><system-out>{output}</system-out></testcase>'

    def test_not_judged_among_unit_tests_is_75(self):
        late = self.case("1 inconclusive, counted as skipped: a\nreal time not judged: more\n2 passed, 0 failed, 1 skipped\n")
        status, lines, _ = self.check("", "unit", junit=late)
        self.assertEqual((75, "4 passed, 0 failed, 1 skipped"), (status, lines[-1]), lines)
        died = self.case("2 passed, 0 failed, 1 skipped\n")
        for junit in (died, late + died, late + self.case("1 passed, 1 failed, 0 skipped\n")):
            self.assertEqual(1, self.check("", "unit", junit=junit)[0], junit)

    def test_failure_of_one_step_outranks_inconclusive_step(self):
        late = self.case("1 inconclusive, counted as skipped: a\nreal time not judged: more\n2 passed, 0 failed, 1 skipped\n")
        self.assertEqual(1, self.check("echo '1 passed, 1 failed, 0 skipped'; exit 1\n", "unit", "system.realtime", junit=late)[0])


def suite(classes=(Conclusive, Inconclusive, Status, Words)):
    return unittest.TestSuite(map(unittest.defaultTestLoader.loadTestsFromTestCase, classes))


def seed(old, new):
    """The names of the tests that fail with this fault in the module."""
    global verdict
    with open(SOURCE, encoding="utf-8") as file:
        text = file.read()
    if text.count(old) != 1:
        return None
    sound, faulty = verdict, types.ModuleType("verdict")
    with tempfile.TemporaryDirectory() as folder:
        faulty.__file__ = os.path.join(folder, "verdict.py")  # The sleepers are started from this file.
        with open(faulty.__file__, "w", encoding="utf-8") as file:
            file.write(text.replace(old, new))
        exec(compile(text.replace(old, new), faulty.__file__, "exec"), faulty.__dict__)
        verdict, result = faulty, unittest.TestResult()
        try:
            suite().run(result)
            if result.wasSuccessful():
                Processes("test_sleepers_notice_a_stalled_machine_and_end").run(result)
        finally:
            verdict = sound
    return [case.id().split(".")[-1] for case, _ in result.failures + result.errors]


def seed_reader(name, old, new):
    Check.faulty, result = {name: (old, new)}, unittest.TestResult()
    suite([Check]).run(result)
    return [case.id().split(".")[-1] for case, _ in result.failures]


def main():
    result = unittest.TextTestRunner(stream=sys.stdout).run(suite((Conclusive, Inconclusive, Status, Words, Processes, Check)))
    failed = len(result.failures + result.errors)
    passed = result.testsRun - failed
    seeded = [(what, seed(old, new)) for what, old, new in FAULTS] + [(what, seed_reader(*fault)) for what, *fault in READER_FAULTS] if not failed else []
    for what, noticed in seeded:
        print(
            f"{'ok  ' if noticed else 'FAIL'} seeded fault: {what}: "
            + ("its code does not occur exactly once in verdict.py" if noticed is None else ", ".join(noticed) or "no test notices it")
        )
        passed, failed = passed + bool(noticed), failed + (not noticed)
    print(f"{passed} passed, {failed} failed, 0 skipped")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(unittest.main() if len(sys.argv) > 1 else main())
