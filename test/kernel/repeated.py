# SPDX-License-Identifier: MIT
"""Several campaigns in a row: the result of each, and of all together, as text."""

from typing import NamedTuple

from groups import GROUPS
from judge_log import percentile

VERDICTS = ("passed", "failed", "skipped")
REAL_TIME = {group.name for group in GROUPS if not group.virtual or group.distribution}
ESTOP_ROWS = ("row11_", "row12_")


class Outcome(NamedTuple):
    """Of one campaign."""

    seed: int
    seconds: float
    results: list

    def names(self, verdict):
        return [f"{result['group']}/{result['name']}" for result in self.results if result["verdict"] == verdict]

    def counts(self):
        return [len(self.names(verdict)) for verdict in VERDICTS]


def minutes(seconds):
    return f"{int(seconds) // 60} min {int(seconds) % 60} s"


def one_line(number, count, outcome):
    """After each campaign."""
    passed, failed, skipped = outcome.counts()
    line = f"campaign {number} of {count}, seed {outcome.seed}: {passed} passed, {failed} failed, {skipped} skipped, in {minutes(outcome.seconds)}"
    return f"==== {line}" + (f"; failed: {', '.join(outcome.names('failed'))}" if failed else "")


def where(outcomes, verdict):
    """{test: seeds of the campaigns in which it had that verdict}, the most frequent first."""
    seeds = {}
    for outcome in outcomes:
        for name in outcome.names(verdict):
            seeds.setdefault(name, []).append(outcome.seed)
    return dict(sorted(seeds.items(), key=lambda pair: (-len(pair[1]), pair[0])))


def estop_words(outcomes):
    """All presses in motion of all campaigns."""
    results = [r for outcome in outcomes for r in outcome.results if r["name"].startswith(ESTOP_ROWS)]
    for kind, words, real in (("latencies", "its edge, in virtual time", False), ("from_level", "its level, in real time", True)):
        values = [us / 1000 for r in results if (r["group"] in REAL_TIME) == real for us in r[kind]]
        if values:
            figures = f"p50 {percentile(values, 50):.2f} ms, p99 {percentile(values, 99):.2f} ms, worst {max(values):.2f} ms"
            yield f"e-stop to the zero pair from {words}: {figures} of {len(values)}"


def summary(outcomes, wanted):
    """At the end: the number of campaigns without a failure; the tests that failed or were skipped, and in which campaigns."""
    clean = sum(not outcome.names("failed") for outcome in outcomes)
    yield f"{len(outcomes)} of {wanted} campaigns in {minutes(sum(o.seconds for o in outcomes))}: {clean} without a failure, {len(outcomes) - clean} with one"
    ran = {f"{r['group']}/{r['name']}" for outcome in outcomes for r in outcome.results}
    failed, skipped = where(outcomes, "failed"), where(outcomes, "skipped")
    yield f"{len(ran - set(failed) - set(skipped))} of {len(ran)} tests passed every time"
    for word, tests in (("failed", failed), ("was not judged", skipped)):
        for name, seeds in tests.items():
            yield f"{name} {word} in {len(seeds)} of {len(outcomes)}, with seed {', '.join(map(str, seeds))}"
    yield from estop_words(outcomes)
