#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Tests the rules of verdict.py in pytest_verdict.py: pytest runs invented tests on a machine with invented stalls. Each fault that is seeded into the
plugin must fail the test that is named in its row.

usage: test/support/test_pytest_verdict.py [unittest's arguments]

The last line sums up: "N passed, N failed, N skipped".
"""

import os
import re
import signal
import subprocess
import sys
import tempfile
import textwrap
import time
import unittest
import xml.etree.ElementTree
from pathlib import Path
from typing import NamedTuple

HERE = Path(__file__).resolve().parent
SOURCES = (HERE / "pytest_verdict.py", HERE / "pytest_virtual.py")
# (fault, old, new, the test that must fail)
FAULTS = (
    ("a collected failure is forgotten", "    if found:\n        more", "    if False:\n        more", "test_collected_rule_is_final"),
    (
        "an exception behind a collected failure is forgotten",
        "if error and not isinstance(error, SKIPS) else []",
        "if False else []",
        "test_crash_behind_a_collected_failure_is_final",
    ),
    ("a skip hides what was found before it", "except (Exception, pytest.skip.Exception,", "except (AssertionError,", "test_skip_hides_no_failure"),
    ("the kind of a failure is lost", 'getattr(error, "failures", judged.failures)', "judged.failures", "test_collected_rule_is_final"),
    ("the output of a program is not judged", "(said for _, said in report.sections)", "()", "test_sanitizer_report_is_final"),
    ("the output of a fixture's programs is not judged", 'report.failed and hasattr(one, "said")]', "False]", "test_words_of_a_fixture_are_judged"),
    ("a fixture that is a type hides the failure", "if not isinstance(one, type)]", "]", "test_fixture_that_is_a_type_hides_no_failure"),
    ("stalls that the test measured are lost", "for stall in one.stalls]", "for stall in ()]", "test_stall_that_the_test_measured_counts"),
    ("the gateway's own report is lost", "judged.failures), judged.claims", "judged.failures), []", "test_gateway_late_next_to_a_late_machine_is_repeated"),
    (
        "the gateway's own report is enough",
        "claims=claims, stalls=stalls,",
        "claims=[], stalls=stalls + claims,",
        "test_gateway_late_on_a_quiet_machine_is_final",
    ),
    ("a crash counts as late", "[verdict.Failure(answer, verdict.CRASH)]", "[verdict.Failure(answer)]", "test_crash_is_final"),
    ("a crash passes", "return verdict.Attempt([verdict.Failure(answer, verdict.CRASH)])", "return verdict.Attempt()", "test_crash_is_final"),
    ("no time limit", "not ours.poll(limit_s)", "not ours.poll(None)", "test_hang_is_final"),
    ("remaining processes of a test live on", "os.killpg(child, signal.SIGKILL)", "os.kill(child, signal.SIGKILL)", "test_nothing_is_left_behind"),
    ("other users cannot enter the folder of the tests", "os.chmod(self.folder, 0o1777)", "pass", "test_other_users_may_enter_the_folder_of_all_tests"),
    (
        "attempts share their output",
        "    capture.stop_global_capturing()",
        "    return_ = None\n    capture.stop_global_capturing if return_ else None",
        "test_output_is_not_mixed",
    ),
    (
        "a failure after the test is forgotten",
        "    if report.failed:\n        error = call",
        '    if report.failed and report.when == "call":\n        error = call',
        "test_failure_before_or_after_the_test_fails",
    ),
    (
        "tests of a class are prepared one by one",
        'shared = item.cls and "setUpClass" in vars(item.cls)',
        "shared = False",
        "test_class_that_prepares_once_is_one_attempt",
    ),
    ("tests of one group run separately", "if mark else item.parent.nodeid", "if False else item.parent.nodeid", "test_tests_together_are_one_attempt"),
    ("a stall excuses an exact test", 'if items[0].get_closest_marker("exact"):', "if False:", "test_exact_test_is_final"),
    ("a test always counts as one", '.get("tests", 1)', '.get("test", 1)', "test_number_of_tests_of_a_test_counts"),
    ("skipped tests of a class pass", "skips=len(skips)", "skips=0", "test_class_that_prepares_once_is_one_attempt"),
    (
        "other plugins receive each attempt",
        'report.outcome, report.longrepr = "skipped"',
        'report.summary, report.longrepr = "skipped"',
        "test_late_on_a_late_machine_is_not_judged",
    ),
    ("pytest's own status wins", "session.exitstatus = MISSING if", "_ = MISSING if", "test_late_on_a_late_machine_is_not_judged"),
    ("a skipped test has no name", "print(*folders, *run.skipped.values(),", "print(*folders,", "test_late_on_a_late_machine_is_not_judged"),
    ("all tests run although some cannot be read", "or session.testsfailed", "", "test_broken_file_is_no_success"),
    ("the long tests always run", 'if os.environ.get("IWHEEL_FULL") != "1" and', "if False and", "test_long_tests"),
    ("the long tests never run", 'os.environ.get("IWHEEL_FULL") != "1"', "True", "test_long_tests"),
    ("the verdict of a folder is not counted", "session.config.hook.pytest_verdict_end(run=run)", "pass", "test_verdict_of_a_folder_counts"),
    ("the data for a folder's verdict is lost", "for key, value in one.data.items()}", "for key, value in ()}", "test_verdict_of_a_folder_counts"),
    (
        "virtual time is real",
        '(self.config.pluginmanager.getplugin("pytest_virtual").Boots if virtual else Nursery)',
        "Nursery",
        "test_each_test_of_each_share_is_judged_once_inside",
    ),
    (
        "a test that its kernel did not run passes",
        'self.answers[name].put(f"{why}\\n{boot.complaint()}")',
        "self.answers[name].put(verdict.Attempt())",
        "test_kernel_that_ends_early_fails_the_remaining_tests",
    ),
    ("tests without a kernel pass", "MISSING if", "0 if", "test_without_a_kernel_nothing_is_judged"),
    (
        "what is for real time runs in virtual time",
        "items[:] = [item for item in items if item not in native]",
        "pass",
        "test_native_test_is_left_out_of_virtual_time",
    ),
    ("a test that is skipped inside ends the run", "tuple(report.longrepr)", "report.longrepr", "test_skipped_test_inside_is_named_with_its_reason"),
    ("no call is late", 'os.environ["IWHEEL_DELAYS"] = ', "_ = ", "test_delays_reach_the_tests_inside"),
    (
        "the rest of a sample is the sample",
        "(item in chosen) != (config.option.sample > 0)",
        "item not in chosen",
        "test_sample_has_native_tests_and_the_rest_has_the_others",
    ),
    ("a sample can leave out a native test", "return native + sorted", "return sorted", "test_sample_has_native_tests_and_the_rest_has_the_others"),
    ("the sample is always the same", 'f"{key} {item.nodeid}"', "item.nodeid", "test_sample_is_of_the_commit"),
    ("an interrupted run goes on", "        self.over = True\n        self.nursery.close()\n", "", "test_interrupted_run_ends_with_its_tests"),
)
LATE = "[(verdict.now_us(), 500_000)]"
CONFTEST = """
    import verdict
    verdict.Witness.stalls = lambda *_: {stalls}
    verdict.Session.await_quiet = lambda *_: None
    """
HEAD = """
    import os, subprocess, sys, time, unittest
    import pytest, verdict

    def note(word):
        with open(os.path.join(os.path.dirname(__file__), "notes"), "a") as file:
            file.write(word + " ")

    @pytest.fixture
    def t():
        return verdict.Findings()
    """


def runs(pid):
    """True if the process exists and is not only waiting for its parent (a zombie)."""
    path = Path(f"/proc/{pid}/cmdline")
    return path.exists() and bool(path.read_bytes())


class Ran(NamedTuple):
    status: int
    lines: list
    notes: list  # The notes of the tests, in order.
    cases: dict  # {name: passed, failed, error or skipped} from JUnit's file.

    @property
    def last(self):
        return self.lines[-1]


class Made(unittest.TestCase):
    """Each test writes a file of tests and runs it."""

    plugin = HERE

    def begin(self, tests, stalls, more=""):
        self.folder = Path(self.enterContext(tempfile.TemporaryDirectory()) if hasattr(self, "enterContext") else tempfile.mkdtemp())
        for name, text in {
            "conftest.py": textwrap.dedent(CONFTEST).format(stalls=stalls) + textwrap.dedent(more),
            "test_it.py": textwrap.dedent(HEAD) + textwrap.dedent(tests),
            "pytest.ini": "[pytest]\naddopts = -p no:cacheprovider -p no:anyio -p pytest_verdict\n",
        }.items():
            (self.folder / name).write_text(text)

    def command(self, *options):
        return [
            sys.executable,
            "-m",
            "pytest",
            "-v",
            f"--junitxml={self.folder}/junit.xml",
            f"--rootdir={self.folder}",
            "-c",
            f"{self.folder}/pytest.ini",
            str(self.folder),
            *options,
        ]

    def surroundings(self, **more):
        return {
            **{key: value for key, value in os.environ.items() if key != "IWHEEL_FULL"},
            "PYTHONPATH": f"{self.plugin}:{HERE}",
            "TMPDIR": str(self.folder),
            "PYTHONDONTWRITEBYTECODE": "1",
            **more,
        }

    def run_made(self, tests, *options, stalls=LATE, conftest="", **more):
        self.begin(tests, stalls, conftest)
        done = subprocess.run(
            self.command(*options), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=60, env=self.surroundings(**more), check=False
        )
        cases, junit, notes = {}, self.folder / "junit.xml", self.folder / "notes"
        if junit.exists():
            for case in xml.etree.ElementTree.parse(junit).getroot().iter("testcase"):
                cases[case.get("name")] = next((child.tag for child in case if child.tag in ("failure", "error", "skipped")), "passed")
        self.assertEqual([], [path.name for path in self.folder.glob("iwheel-*")], "folders of tests are removed")
        return Ran(done.returncode, done.stdout.splitlines(), notes.read_text().split() if notes.exists() else [], cases)

    def final(self, tests, *options, junit="failure", **how):
        """Asserts one attempt, which fails."""
        ran = self.run_made(tests, *options, **how)
        self.assertEqual(
            (1, "0 passed, 1 failed, 0 skipped", ["tried"], {"test_one": junit}), (ran.status, ran.last, ran.notes, ran.cases), "\n".join(ran.lines)
        )
        return "\n".join(ran.lines)

    def repeated(self, tests, **how):
        """Asserts four attempts and no verdict."""
        ran = self.run_made(tests, **how)
        self.assertEqual(
            (75, "0 passed, 0 failed, 1 skipped", ["tried"] * 4, {"test_one": "skipped"}), (ran.status, ran.last, ran.notes, ran.cases), "\n".join(ran.lines)
        )
        return ran


class Conclusive(Made):
    def test_broken_rule_is_final(self):
        self.assertIn("nonzero after e-stop", self.final('def test_one():\n    note("tried")\n    verdict.hold(False, "nonzero after e-stop")\n'))

    def test_exact_test_is_final(self):
        self.final('@pytest.mark.exact\ndef test_one():\n    note("tried")\n    assert False, "2 != 3"\n')

    def test_collected_rule_is_final(self):
        self.assertIn("rule: moved", self.final('def test_one(t):\n    note("tried")\n    t.failures.append(verdict.Failure("moved", verdict.RULE))\n'))

    def test_rule_next_to_an_explained_failure_is_final(self):
        self.final("""
            def test_one(t):
                note("tried")
                t.failures += [verdict.Failure("late", verdict.TIMING), verdict.Failure("moved", verdict.RULE)]
                assert False, "not within 1 s"
            """)

    def test_crash_behind_a_collected_failure_is_final(self):
        self.final("""
            def test_one(t):
                note("tried")
                t.failures.append(verdict.Failure("late", verdict.TIMING))
                raise AssertionError("iwheel-gateway ended with -11")
            """)

    def test_skip_hides_no_failure(self):
        for skip in ('pytest.skip("no port")', 'raise unittest.SkipTest("no port")'):
            self.final(f'def test_one(t):\n    note("tried")\n    t.failures.append(verdict.Failure("moved", verdict.RULE))\n    {skip}\n')

    def test_limit_missed_by_more_than_the_stall_is_final(self):
        self.final('def test_one(t):\n    note("tried")\n    t.failures.append(verdict.Failure("late", verdict.TIMING, 0, 600_000))\n')

    def test_sanitizer_report_is_final(self):
        self.final('def test_one():\n    note("tried")\n    os.system("echo ==1==ERROR: AddressSanitizer: heap-use-after-free >&2")\n    assert False\n')

    def test_words_of_a_fixture_are_judged(self):
        output = self.final("""
            class Rig:
                def said(self):
                    return "iwheel-gateway: Segmentation fault"

            @pytest.fixture
            def rig():
                return Rig()

            def test_one(rig):
                note("tried")
                assert False
            """)
        self.assertIn("Segmentation fault", output)

    def test_fixture_that_is_a_type_hides_no_failure(self):
        output = self.final("""
            class Rig:
                def said(self):
                    return "nothing"

            @pytest.fixture
            def rig_type():
                return Rig

            def test_one(rig_type):
                note("tried")
                assert False, "Segmentation fault, the reason"
            """)
        self.assertIn("the reason", output)

    def test_crash_is_final(self):
        for crash in ("os.abort()", "os._exit(0)", "os.kill(os.getpid(), 9)"):
            self.final(f'def test_one():\n    note("tried")\n    {crash}\n')

    def test_hang_is_final(self):
        output = self.final('@pytest.mark.limit(3)\ndef test_one():\n    note("tried")\n    time.sleep(20)\n')
        self.assertIn("did not end within 3 s", output)
        self.assertIn("in test_one", output, "Python reports the function")

    def test_end_of_the_forking_process_is_final(self):
        self.final('def test_one():\n    note("tried")\n    os.kill(os.getppid(), 9)\n    time.sleep(20)\n')

    def test_check_on_a_quiet_machine_is_final(self):
        self.final('def test_one():\n    note("tried")\n    assert False, "not within 1 s"\n', stalls="[]")

    def test_gateway_late_on_a_quiet_machine_is_final(self):
        self.final('def test_one():\n    note("tried")\n    assert False, "the gateway itself was held up for 583 ms"\n', stalls="[]")

    def test_one_of_several_parts_is_final(self):
        """A final failure counts even if another part is only late."""
        self.final("""
            class Test(unittest.TestCase):
                def test_one(self):
                    note("tried")
                    with self.subTest("late"):
                        self.fail("not within 1 s")
                    with self.subTest("good"):
                        pass
                    with self.subTest("moved"):
                        verdict.hold(False, "moved")
            """)

    def test_failure_before_or_after_the_test_fails(self):
        for before, after, junit in (("assert False", "", "error"), ("", "verdict.hold(False, 'moved')", "error")):
            self.final(
                f"""
                @pytest.fixture
                def rig():
                    {before or "pass"}
                    yield 1
                    {after or "pass"}

                class TestIt:
                    def test_one(self, rig):
                        pass

                @pytest.fixture(autouse=True)
                def tried():
                    note("tried")
                """,
                stalls="[]",
                junit=junit,
            )


class Inconclusive(Made):
    def test_late_on_a_late_machine_is_not_judged(self):
        ran = self.repeated('def test_one():\n    note("tried")\n    assert False, "not within 1 s"\n')
        self.assertIn("real time not judged", ran.lines[-2])
        self.assertEqual("1 inconclusive, counted as skipped: test_it.py::test_one", ran.lines[-3])
        words = "inconclusive in each of 4 attempts: the machine stalled for up to 500 ms; the last failure: AssertionError: not within 1 s"
        self.assertEqual(f"skip: test_it.py::test_one: {words}", ran.lines[-4])

    def test_late_part_is_not_judged(self):
        self.repeated("""
            class Test(unittest.TestCase):
                def test_one(self):
                    note("tried")
                    with self.subTest("late"):
                        self.fail("not within 1 s")
            """)

    def test_collected_check_is_not_judged(self):
        self.repeated('def test_one(t):\n    note("tried")\n    t.failures.append(verdict.Failure("late", verdict.TIMING, 0, 150_000))\n')

    def test_stall_that_the_test_measured_counts(self):
        self.repeated(
            """
            def test_one(t):
                note("tried")
                t.stalls.append((verdict.now_us(), 500_000))
                t.failures.append(verdict.Failure("late"))
            """,
            stalls="[]",
        )

    def test_gateway_late_next_to_a_late_machine_is_repeated(self):
        self.repeated(
            'def test_one():\n    note("tried")\n    assert False, "the gateway itself was held up for 583 ms"\n', stalls="[(verdict.now_us(), 6_000)]"
        )

    def test_rule_broken_in_a_later_attempt_fails(self):
        ran = self.run_made("""
            def test_one():
                note("tried")
                notes = open(os.path.join(os.path.dirname(__file__), "notes")).read()
                verdict.hold(notes.count("tried") < 2, "moved")
                assert False
            """)
        self.assertEqual((1, "0 passed, 1 failed, 0 skipped", ["tried"] * 2), (ran.status, ran.last, ran.notes))

    def test_pass_in_a_later_attempt_alone_when_others_have_ended(self):
        ran = self.run_made(
            """
            def later():
                notes = open(os.path.join(os.path.dirname(__file__), "notes")).read()
                return notes.count("others") == 2

            def test_one():
                note("one")
                assert later()

            def test_two():
                note("two")
                assert later()

            @pytest.mark.parametrize("number", (0, 1))
            def test_others(number):
                time.sleep(1)
                note("others")
            """,
            "--jobs",
            "3",
        )
        self.assertEqual((0, "4 passed, 0 failed, 0 skipped"), (ran.status, ran.last), ran.lines)
        self.assertEqual(["one", "two", "others", "others", "one", "two"], [*sorted(ran.notes[:2]), *ran.notes[2:4], *sorted(ran.notes[4:])])
        self.assertEqual({"passed"}, set(ran.cases.values()))
        self.assertRegex("\n".join(ran.lines), r"test_one PASSED \(0\.\d s, attempt 2, alone\)")
        self.assertRegex(ran.lines[-2], "^judged in a later attempt.*test_it.py::test_one")


class Processes(Made):
    def test_nothing_is_left_behind(self):
        ran = self.run_made(
            """
            def test_one():
                note(str(subprocess.Popen(["sleep", "30"], stdout=subprocess.DEVNULL).pid))
                subprocess._active = []

            def test_two():
                time.sleep(0.2)
            """,
            "--jobs",
            "1",
        )
        self.assertEqual(0, ran.status, ran.lines)
        self.assertFalse(runs(ran.notes[0]))

    def test_tests_together_are_one_attempt(self):
        ran = self.run_made(
            """
            SEEN = []

            @pytest.mark.parametrize("number", [pytest.param(number, marks=pytest.mark.together(str(number % 2))) for number in range(4)])
            def test_one(number):
                SEEN.append(number)
                assert len(SEEN) == 1 + number // 2
            """,
            stalls="[]",
        )
        self.assertEqual((0, "4 passed, 0 failed, 0 skipped"), (ran.status, ran.last), ran.lines)

    def test_number_of_tests_of_a_test_counts(self):
        ran = self.run_made('def test_one(record_property):\n    record_property("tests", 7)\n')
        self.assertEqual((0, "7 passed, 0 failed, 0 skipped"), (ran.status, ran.last), ran.lines)

    def test_other_users_may_enter_the_folder_of_all_tests(self):
        ran = self.run_made(
            """
            import tempfile

            def test_one():
                assert os.stat(tempfile.gettempdir()).st_mode & 0o7777 == 0o1777 and "iwheel-tests-" in tempfile.gettempdir()
            """,
            stalls="[]",
        )
        self.assertEqual("1 passed, 0 failed, 0 skipped", ran.last, ran.lines)

    def test_output_is_not_mixed(self):
        ran = self.run_made("""
            def test_loud():
                end = time.monotonic() + 2
                while time.monotonic() < end:
                    os.write(1, b"AddressSanitizer\\n" * 10)
                    time.sleep(0.001)

            def test_late():
                time.sleep(0.5)
                print("my own words")
                assert False
            """)
        self.assertEqual("1 passed, 0 failed, 1 skipped", ran.last, ran.lines)

    def test_class_that_prepares_once_is_one_attempt(self):
        ran = self.run_made("""
            class Test(unittest.TestCase):
                @classmethod
                def setUpClass(cls):
                    note("prepared")

                def test_one(self):
                    pass

                def test_two(self):
                    pass

                @unittest.skip("no port")
                def test_three(self):
                    pass
            """)
        self.assertEqual((0, "2 passed, 0 failed, 1 skipped", ["prepared"]), (ran.status, ran.last, ran.notes), ran.lines)
        self.assertIn("skip: test_it.py::Test::test_three: no port", ran.lines)

    def test_measurements_are_printed(self):
        ran = self.run_made('def test_one(t):\n    t.figures.append("7 ms")\n')
        self.assertRegex("\n".join(ran.lines), r"test_one PASSED \(0\.\d s, 7 ms\)")

    def test_verdict_of_a_folder_counts(self):
        conftest = """
            def pytest_verdict_end(run):
                values = [value for attempt in run.passed.values() for report in attempt.data if report.when == "call" for value in report.data["values"]]
                failures = [verdict.Failure("too much", verdict.TIMING)] if sum(values) > 5 else []
                run.add("all_together", verdict.Attempt(failures, "not enough" if sum(values) < 3 else None), [f"sum {sum(values)}"])
            """
        for value, status, last, case in (
            (1, 0, "2 passed, 0 failed, 1 skipped", "skipped"),
            (2, 0, "3 passed, 0 failed, 0 skipped", "passed"),
            (3, 1, "2 passed, 1 failed, 0 skipped", "failure"),
        ):
            ran = self.run_made(
                f"""
                @pytest.mark.parametrize("number", (0, 1))
                def test_one(t, number):
                    t.data["values"] = [{value}]
                """,
                stalls="[]",
                conftest=conftest,
            )
            self.assertEqual((status, last, case), (ran.status, ran.last, ran.cases["all_together"]), ran.lines)

    def test_interrupted_run_ends_with_its_tests(self):
        for number in (signal.SIGINT, signal.SIGTERM):
            self.begin(
                "def test_one():\n    note(str(os.getpid()))\n    time.sleep(40)\n\ndef test_two():\n    test_one()\n\ndef test_three():\n    test_one()\n",
                "[]",
            )
            process = subprocess.Popen(self.command(), stdout=subprocess.PIPE, text=True, env=self.surroundings())
            notes, end = self.folder / "notes", time.monotonic() + 20
            while (not notes.exists() or len(notes.read_text().split()) < 2) and time.monotonic() < end:
                time.sleep(0.05)
            process.send_signal(number)
            try:
                output, _ = process.communicate(timeout=10)
            except subprocess.TimeoutExpired:
                process.kill()
                process.communicate()
                self.fail("it goes on")
            self.assertNotEqual(0, process.returncode)
            self.assertNotRegex(output, r"passed, \d+ failed")
            self.assertEqual([], [path.name for path in self.folder.glob("iwheel-*")])
            time.sleep(0.2)
            self.assertEqual([], [pid for pid in notes.read_text().split() if runs(pid)])


class Chosen(Made):
    TWO = "@pytest.mark.full\ndef test_long():\n    pass\n\ndef test_short():\n    pass\n"

    def test_long_tests(self):
        for full, last in (("0", "1 passed, 0 failed, 0 skipped"), ("1", "2 passed, 0 failed, 0 skipped")):
            ran = self.run_made(self.TWO, IWHEEL_FULL=full)
            self.assertEqual((0, last), (ran.status, ran.last), ran.lines)

    def test_list_names_the_long_ones_and_sums_nothing_up(self):
        ran = self.run_made(self.TWO, "--collect-only", "-q", "-q")
        self.assertEqual(["test_it.py::test_long", "test_it.py::test_short"], [line for line in ran.lines if "::" in line])
        self.assertFalse(re.search(r"\d+ passed", "\n".join(ran.lines)))

    def test_sample_is_of_the_commit(self):
        many = 'import pytest\n@pytest.mark.parametrize("number", range(40))\ndef test_it(number):\n    pass\n'
        git = "import pytest_verdict\npytest_verdict.commit = lambda _: {!r}\n".format
        first, again, other = (self.run_made(many, "--sample", "4", conftest=git(key)) for key in ("abc", "abc", "def"))
        self.assertEqual("4 passed, 0 failed, 0 skipped", first.last, first.lines)
        self.assertEqual(first.cases, again.cases)
        self.assertNotEqual(first.cases, other.cases)

    def test_sample_has_native_tests_and_the_rest_has_the_others(self):
        many = 'import pytest\n@pytest.mark.parametrize("number", range(9))\ndef test_it(number):\n    pass\n'
        many += '@pytest.mark.native("a race")\ndef test_race():\n    pass\n'
        chosen, rest = (self.run_made(many, f"--sample={number}") for number in (4, -4))
        self.assertEqual(("5 passed, 0 failed, 0 skipped", True), (chosen.last, "test_race" in chosen.cases), chosen.lines)
        self.assertEqual(("5 passed, 0 failed, 0 skipped", 10), (rest.last, len({**chosen.cases, **rest.cases})), rest.lines)

    def test_nothing_that_ran_is_no_success(self):
        for tests, options, last in (
            (self.TWO, ("-k", "nothing"), "0 passed, 0 failed, 0 skipped"),
            ('def test_one():\n    pytest.skip("no port")\n', (), "0 passed, 0 failed, 1 skipped"),
        ):
            ran = self.run_made(tests, *options)
            self.assertEqual((1, last), (ran.status, ran.last), ran.lines)

    def test_broken_file_is_no_success(self):
        for options in ((), ("--continue-on-collection-errors",)):
            self.begin("import nothing_of_that_name\n", "[]")
            (self.folder / "test_other.py").write_text("def test_other():\n    pass\n")
            done = subprocess.run(self.command(*options), stdout=subprocess.PIPE, text=True, timeout=60, env=self.surroundings(), check=False)
            self.assertNotEqual(0, done.returncode, done.stdout)
            self.assertNotRegex(done.stdout, r"[1-9] passed, 0 failed")


class Virtual(Made):
    """The kernel is a process that immediately carries out the plan."""

    BOOT = """
        import sys
        sys.path += [{here!r} + "/../kernel", {here!r} + "/../system"]
        import boot
        def kernel(install=True):
            {kernel}
        boot.find_kernel = kernel
        GUEST = "import guest_pytest, sys; guest_pytest.own_tmp = lambda *_: None; sys.exit(guest_pytest.main(sys.argv[1]))"
        boot.Boot.command = lambda self, kernel: [sys.executable, "-c", GUEST, self.path("json")]
        """
    TWO = 'def test_one():\n    note("tried")\n    {}\n\ndef test_two():\n    pass\n'

    def virtual(self, tests, *options, kernel="return 'none'", more=""):
        return self.run_made(tests, "--virtual", *options, conftest=textwrap.dedent(self.BOOT).format(here=str(HERE), kernel=kernel) + more)

    def results(self, ran):
        return ran.status, ran.last, ran.notes

    def test_each_test_of_each_share_is_judged_once_inside(self):
        where = 'note("inside" if request.config.option.inside else "outside")'
        ran = self.virtual(f"def test_one(request):\n    {where}\n\ndef test_two(request):\n    {where}\n", "--jobs", "2")
        self.assertEqual((0, "2 passed, 0 failed, 0 skipped", ["inside"] * 2), self.results(ran), ran.lines)
        self.assertEqual({"test_one": "passed", "test_two": "passed"}, ran.cases)

    def test_nothing_is_excused_in_virtual_time(self):
        ran = self.virtual(self.TWO.format('assert False, "not within 1 s"'), "--jobs", "1")
        self.assertEqual((1, "1 passed, 1 failed, 0 skipped", ["tried"]), self.results(ran), ran.lines)
        self.assertIn("not within 1 s", "\n".join(ran.lines))

    def test_kernel_that_ends_early_fails_the_remaining_tests(self):
        ran = self.virtual(self.TWO.format("os.kill(os.getppid(), 9)"), "--jobs", "1")
        self.assertEqual((1, "0 passed, 2 failed, 0 skipped", ["tried"]), self.results(ran), ran.lines)
        self.assertIn("its kernel ended before it did", "\n".join(ran.lines))

    def test_without_a_kernel_nothing_is_judged(self):
        ran = self.virtual(self.TWO.format("pass"), kernel="raise RuntimeError('no flex')")
        self.assertEqual((77, "0 passed, 0 failed, 2 skipped", []), self.results(ran), ran.lines)
        self.assertIn("skip: test_it.py::test_two: no virtual time: no flex", ran.lines)

    def test_skipped_test_inside_is_named_with_its_reason(self):
        ran = self.virtual(self.TWO.format('pytest.skip("no wheel")'))
        self.assertEqual((0, "1 passed, 0 failed, 1 skipped"), (ran.status, ran.last), ran.lines)
        self.assertIn("skip: test_it.py::test_one: no wheel", ran.lines)

    def test_delays_reach_the_tests_inside(self):
        ran = self.virtual('def test_one():\n    note(os.environ.get("IWHEEL_DELAYS", "none"))\n', "--delays", "7")
        self.assertEqual((0, "1 passed, 0 failed, 0 skipped", ["7"]), self.results(ran), ran.lines)

    def test_native_test_is_left_out_of_virtual_time(self):
        tests = '@pytest.mark.native("a race")\n' + self.TWO.format("pass")
        self.assertEqual((0, "1 passed, 0 failed, 0 skipped", []), self.results(self.virtual(tests)))
        self.assertEqual(["tried"], self.run_made(tests).notes)


def seed(old, new, noticer):
    """Whether the test fails with this fault in the plugin; None if the plugin does not have this code exactly once."""
    texts = {source: source.read_text(encoding="utf-8") for source in SOURCES}
    found = [source for source, text in texts.items() for _ in range(text.count(old))]
    if len(found) != 1:
        return None
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / found[0].name).write_text(texts[found[0]].replace(old, new), encoding="utf-8")
        Made.plugin, result = folder, unittest.TestResult()
        try:
            unittest.defaultTestLoader.loadTestsFromName(
                next(f"{one.__name__}.{noticer}" for one in CLASSES if hasattr(one, noticer)), sys.modules[__name__]
            ).run(result)
        finally:
            Made.plugin = HERE
    return bool(result.failures or result.errors)


CLASSES = (Conclusive, Inconclusive, Processes, Chosen, Virtual)


def main():
    suite = unittest.TestSuite(map(unittest.defaultTestLoader.loadTestsFromTestCase, CLASSES))
    result = unittest.TextTestRunner(stream=sys.stdout).run(suite)
    failed = len(result.failures + result.errors)
    passed = result.testsRun - failed
    for what, old, new, noticer in FAULTS if not failed else ():
        noticed = seed(old, new, noticer)
        print(
            f"{'ok  ' if noticed else 'FAIL'} seeded fault: {what}: {noticer}"
            + (" does not notice it" if noticed is False else "; its code does not occur exactly once" if noticed is None else ""),
            flush=True,
        )
        passed, failed = passed + bool(noticed), failed + (not noticed)
    print(f"{passed} passed, {failed} failed, 0 skipped")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(unittest.main() if len(sys.argv) > 1 else main())
