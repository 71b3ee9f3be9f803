#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Several campaigns in a row: the printed lines, and the written page. Needs no kernel.

Usage: test/kernel/test_repeated.py
"""

import contextlib
import io
import os
import sys
import tempfile
import unittest
from unittest import mock

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [HERE, os.path.join(os.path.dirname(HERE), "system")]
import campaign
import repeated
import report


def result(name, verdict="passed", group="estop", **fields):
    empty = {"figures": [], "failures": [], "measures": {}, "latencies": [], "from_level": [], "logs": []}
    return {**empty, "name": name, "group": group, "verdict": verdict, **fields}


def outcome(seed, *results):
    return repeated.Outcome(seed, 61.0, list(results))


class Campaigns(unittest.TestCase):
    def run_main(self, arguments, outcomes):
        """Output and exit code of campaign.main for campaigns with these outcomes; None is an interrupted one."""
        made = [mock.Mock(interrupted=one is None, results=one or []) for one in outcomes]
        patches = [mock.patch.object(campaign, name) for name in ("find_program", "find_kernel")]
        patches.append(mock.patch.object(campaign, "once", side_effect=made))
        out = io.StringIO()
        with contextlib.ExitStack() as stack:
            self.once = [stack.enter_context(patch) for patch in patches][-1]
            stack.enter_context(contextlib.redirect_stdout(out))
            code = campaign.main(arguments)
        return code, out.getvalue().splitlines()

    def test_each_campaign_has_the_next_seed(self):
        self.run_main(["--repeat", "3", "--seed", "7"], [[result("row12_glitch")]] * 3)
        self.assertEqual([7, 8, 9], [call.args[0].seed for call in self.once.call_args_list])

    def test_repeat_with_one_failed_campaign_fails_and_names_seed(self):
        good, bad = [result("row12_glitch")], [result("row12_glitch", "failed")]
        code, lines = self.run_main(["--repeat", "3"], [good, bad, good])
        self.assertEqual(1, code)
        self.assertRegex(lines[1], "^==== campaign 2 of 3, seed 2: 0 passed, 1 failed, 0 skipped, in .*failed: estop/row12_glitch$")
        self.assertIn("estop/row12_glitch failed in 1 of 3, with seed 2", lines)
        self.assertRegex(lines[3], "3 of 3 campaigns .* 2 without a failure, 1 with one")
        self.assertEqual("2 passed, 1 failed, 0 skipped", lines[-1])

    def test_one_campaign_is_printed_without_a_summary(self):
        self.assertEqual((0, ["1 passed, 0 failed, 0 skipped"]), self.run_main([], [[result("row12_glitch")]]))

    def test_interrupted_row_prints_complete_campaigns(self):
        code, lines = self.run_main(["--repeat", "3"], [[result("row12_glitch")], None])
        self.assertEqual((campaign.INTERRUPTED, "1 passed, 0 failed, 0 skipped"), (code, lines[-1]))
        self.assertRegex(lines[1], "^1 of 3 campaigns")
        self.assertIn("interrupted: 1 of 3 campaigns were completed; only these are counted", lines)


class Summary(unittest.TestCase):
    def test_not_judged_is_reported_and_is_not_passed(self):
        lines = list(repeated.summary([outcome(1, result("row12_glitch", "skipped"), result("row13_chatter"))], 1))
        self.assertIn("1 of 2 tests passed every time", lines)
        self.assertIn("estop/row12_glitch was not judged in 1 of 1, with seed 1", lines)

    def test_presses_of_campaigns_are_merged_but_times_are_not(self):
        virtual = result("row11_presses_low", latencies=[1000, 2000], from_level=[9000])
        real = result("row11_presses_real_time", group="realtime", latencies=[8000], from_level=[3000])
        lines = list(repeated.summary([outcome(1, virtual, real), outcome(2, virtual, real)], 2))
        self.assertIn("e-stop to the zero pair from its edge, in virtual time: p50 1.00 ms, p99 2.00 ms, worst 2.00 ms of 4", lines)
        self.assertIn("e-stop to the zero pair from its level, in real time: p50 3.00 ms, p99 3.00 ms, worst 3.00 ms of 2", lines)


class Page(unittest.TestCase):
    def page(self, *outcomes):
        with tempfile.NamedTemporaryFile("r", suffix=".md") as file, contextlib.redirect_stdout(io.StringIO()):
            with mock.patch.object(report, "PATH", file.name):
                report.write(list(outcomes), campaign.parse([]))
            return file.read()

    def test_real_time_follows_from_the_level(self):
        text = self.page(outcome(1, result("row11_presses_real_time", group="realtime", from_level=[1000, 2500])))
        self.assertIn("| real | the level | 2 | 1.00 ms | 2.50 ms | 2.50 ms |", text)
        self.assertIn("| real | the edge | none judged", text)

    def test_failure_of_an_earlier_campaign_is_on_the_page(self):
        text = self.page(outcome(1, result("row12_glitch", "failed")), outcome(2, result("row12_glitch")))
        self.assertIn("the last of 2 campaigns in a row", text)
        self.assertIn("estop/row12_glitch failed in 1 of 2, with seed 1", text)

    def test_single_campaign_says_that_there_was_no_row(self):
        self.assertIn("Not run for this page: several campaigns in a row", self.page(outcome(1, result("row12_glitch"))))


if __name__ == "__main__":
    unittest.main()
