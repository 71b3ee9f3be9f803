# SPDX-License-Identifier: MIT
"""System tests: the real gateway and simulator, judged from the bus log. In real time, or in virtual time with --virtual."""

import pytest
import verdict
from harness import SERVICE_NICE, estop_limit_us
from judge_log import percentile
from scenario import as_documented

ESTOP_AROUND_US = 20_000


def pytest_configure(config):
    config.witness_nice = SERVICE_NICE


def pytest_collection_modifyitems(items):
    """In virtual time telemetry is slower than documented, which is the harder task, but in these."""
    for item in items:
        if as_documented(item.name):
            item.add_marker(pytest.mark.pace(1))


def presses(run):
    """[(microseconds from the e-stop to zero, whether the machine stalled right then)] of row 11."""
    found = []
    for name, attempt in run.passed.items():
        found_in = [report.data for report in attempt.data if report.when == "call"] if "::row11" in name else []
        for at_us, latency_us in (pair for data in found_in for pair in data.get("latencies", ())):
            stalled = run.measured(attempt, at_us - ESTOP_AROUND_US, at_us + latency_us + ESTOP_AROUND_US)
            found.append((latency_us, bool(stalled)))
    return found


def pytest_verdict_end(run):
    """Invariant 2 limits the 99th percentile of all presses of row 11 together. If most of them are not timed, it is skipped."""
    every = presses(run)
    values = [latency_us for latency_us, stalled in every if not stalled]
    if not any("::row11" in name for name in run.passed):
        return
    figures, failures = [f"{len(every)} presses, {len(every) - len(values)} of them not timed (stalled)"], []
    if values:
        p99_ms = percentile(values, 99) / 1000
        figures += [f"median {percentile(values, 50) / 1000:.2f} ms", f"p99 {p99_ms:.2f} ms", f"worst {max(values) / 1000:.2f} ms"]
        limit_ms = estop_limit_us() / 1000
        failures = [] if p99_ms <= limit_ms else [verdict.Failure(f"p99 {p99_ms:.2f} ms, {limit_ms:.0f} ms allowed", verdict.TIMING)]
    run.add("row11_all_presses", verdict.Attempt(failures, None if failures or len(values) * 2 > len(every) else ", ".join(figures)), figures)
