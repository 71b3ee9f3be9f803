# SPDX-License-Identifier: MIT
"""pytest --virtual: the tests run inside the kernel of test/kernel, where waiting takes no time and no load of the machine delays a program.

Outside, `Boots` replaces the Nursery of pytest_verdict.py: as many kernels as --jobs, each with its share of the attempts. Inside, guest_pytest.py
makes the attempts one by one and reports each result. No failure is excused there, so each attempt is conclusive.

@pytest.mark.native("reason"): virtual time cannot show this, for example a race, a flood or a duration; --virtual skips it, by name.
@pytest.mark.pace(N): in virtual time telemetry comes N times slower than documented; 4 times without the mark (test/kernel/catalogue.py explains why).
--delays SEED: the system calls of gateway and simulator begin 0 to 2 ms late at random (test/system/hook.c).
"""

import os
import queue
import sys
import tempfile
import threading
import time
from pathlib import Path

import pytest
import verdict

ROOT = Path(__file__).resolve().parent.parent.parent
KERNEL = ROOT / "test/kernel"
GUEST = Path(__file__).resolve().parent / "guest_pytest.py"
PACE = 4
LIMIT_S = 1800  # limit of one kernel, by the host's clock
POLL_S = 0.1
MEMORY_MB = 512


def pytest_addoption(parser):
    help_ = "random delays of 0 to 2 ms at system calls of gateway and simulator"
    parser.getgroup("verdicts").addoption("--delays", type=int, metavar="SEED", help=help_)


def pytest_configure(config):
    if config.option.delays is not None:
        os.environ["IWHEEL_DELAYS"] = str(config.option.delays)
    config.addinivalue_line("markers", "native(reason): the test cannot run in virtual time")
    config.addinivalue_line("markers", f"pace(times): in virtual time telemetry is this many times slower; default {PACE}")


def pytest_runtest_setup(item):
    if item.config.option.inside and "harness" in sys.modules:
        mark = item.get_closest_marker("pace")
        sys.modules["harness"].PACE["slow"] = mark.args[0] if mark else PACE


class Boots:
    """The kernels. `ask` has the interface of Nursery's; `reason` is the reason why there is no kernel; None if there is one."""

    def __init__(self, config, units):
        sys.path.append(str(KERNEL))
        import boot

        self.answers, self.boots, self.watches, self.reason = {name: queue.SimpleQueue() for name in units}, [], [], None
        try:
            kernel = boot.find_kernel(install=False)
        except RuntimeError as error:
            self.reason = str(error)
            return
        folder, processors = tempfile.mkdtemp(prefix="iwheel-kernels-"), sorted(os.sched_getaffinity(0))
        for number in range(min(config.option.jobs, len(units))):
            names = list(units)[number :: config.option.jobs]
            plan = self.plan(config, names)
            self.boots.append(boot.Boot(kernel, folder, f"share{number}", plan, {processors[number % len(processors)]}))
            self.watches.append(threading.Thread(target=self.watch, args=(self.boots[-1], names)))
            self.watches[-1].start()

    @staticmethod
    def plan(config, names):
        environment = {key: value for key, value in os.environ.items() if key.startswith("IWHEEL_")}
        arguments = [*names, f"--build={config.option.build}", f"--rootdir={config.rootpath}", *([f"-c{config.inipath}"] if config.inipath else [])]
        return {
            "group": "pytest",
            "virtual": True,
            "guest": str(GUEST),
            "memory_MB": MEMORY_MB,
            "tests": names,
            "python": sys.executable,
            "root": str(config.rootpath),
            "arguments": arguments,
            "environment": environment,
            "folders": sorted({str(config.rootpath), str(ROOT), config.option.build, sys.prefix, sys.base_prefix}),
        }

    def watch(self, boot, names):
        """Passes the results of the kernel on until it ends; tests without a result have failed."""
        left = dict.fromkeys(names)
        while True:
            running = boot.running() and boot.seconds() < LIMIT_S
            for result in boot.results():
                left.pop(result["name"], None)
                self.answers[result["name"]].put(result["answer"])
            if not running:
                break
            time.sleep(POLL_S)
        why = f"its kernel was ended after {LIMIT_S} s" if boot.running() else "its kernel ended before it did"
        boot.end()
        for name in left:
            self.answers[name].put(f"{why}\n{boot.complaint()}")

    def ask(self, name):
        return verdict.Attempt(skip=f"no virtual time: {self.reason}") if self.reason else self.answers[name].get()

    def close(self):
        for boot in self.boots:
            if boot.child.returncode is None:
                boot.kill()
        for watch in self.watches:
            watch.join()


def native_only(items):
    """{item: reason} of the tests marked native."""
    marks = {item: item.get_closest_marker("native") for item in items}
    return {item: mark.args[0] for item, mark in marks.items() if mark}


def pytest_collection_modifyitems(config, items):
    """Native tests belong to another run, without --virtual."""
    if config.option.virtual:
        native = native_only(items)
        config.hook.pytest_deselected(items=list(native))
        items[:] = [item for item in items if item not in native]
        if not items:
            raise pytest.UsageError("none of these can run in virtual time")
