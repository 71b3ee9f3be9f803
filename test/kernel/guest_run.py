# SPDX-License-Identifier: MIT
"""Inside the kernel: runs one test in a process of its own, and decides whether a late machine caused its failure."""

import contextlib
import json
import os
import select
import shutil
import signal
import subprocess
import tempfile
import time
import traceback

import harness
import kernel_rig
from catalogue import ENTRIES
from harness import SERVICE_NICE, as_a_service, die_with_parent
from scenario import Skip
from verdict import CRASH, Attempt, Failure, Session, explains, kind_of

KINDS = ("latencies", "from_level")  # of the e-stop: since the edge, since the level
START_US = 1_000_000  # Limit of a restart in real time: fork and exec alone take 0.3 s in such a kernel on a busy machine.
LIMIT_S, FULL_LIMIT_S, SOAK_LIMIT_S = 600, 3600, 100_000  # of one test, by the guest's clock


def run_one(entry, plan):
    """In the worker: runs the test, returns its result."""
    test, skip, begin_us = kernel_rig.KernelTest(plan["build"], entry.rig_type), None, kernel_rig.now_us()
    test.plan = plan
    harness.PACE["slow"] = entry.pace if plan["virtual"] else 1
    if not plan["virtual"] and not plan["native"]:
        harness.Rig.restart_us = START_US
    try:
        entry.function(test)
    except Skip as reason:
        skip = str(reason) if not test.failures else None  # the findings so far are judged
    except Exception as error:  # noqa: BLE001
        where = [f"{os.path.basename(s.filename)}:{s.lineno}" for s in traceback.extract_tb(error.__traceback__)][-4:]
        output = "".join(rig.gateway.text()[-600:] for rig in test.rigs if rig.gateway)
        text = f"{type(error).__name__}: {error} ({' > '.join(where)}) {output}"
        test.failures.append(Failure(text, kind_of(text)))
    logs = save_logs(test, plan, entry.name) if test.failures else []
    for rig in test.rigs:
        rig.close()
    return {
        "failures": test.failures,
        "figures": test.figures,
        "measures": test.measures,
        "skip": skip,
        "begin_us": begin_us,
        "end_us": kernel_rig.now_us(),
        "latencies": test.latencies,
        "from_level": test.from_level,
        "stalls": test.stalls,
        "claims": test.claims,
        "logs": logs,
    }


def save_logs(test, plan, name):
    """Stores bus log and gateway log of a failed test next to the results."""
    paths = []
    for number, rig in enumerate(test.rigs):
        base = f"{plan['results'].rsplit('.', 1)[0]}.{name}.{number}"
        with open(base + ".bus.log", "w", encoding="ascii") as file:
            for frame in sorted(rig.bus.frames):
                file.write(f"({frame.t_us / 1e6:.6f}) bus {frame.id & 0x1FFFFFFF:03X}#{frame.data.hex().upper()}\n")
        with open(base + ".timeline", "w", encoding="utf-8") as file:
            file.writelines(f"{event}\n" for event in sorted(rig.timeline))
        with open(base + ".gateway.out", "w", encoding="utf-8") as file:
            file.write(rig.gateway.text() if rig.gateway else "never started\n")
        paths += [base + ".bus.log", base + ".timeline", base + ".gateway.out"]
    return paths


def died(text):
    return {"failures": [[text, CRASH]], "figures": [], "measures": {}, "skip": None, "latencies": [], "from_level": []}


def hasten_received_frames():
    """Under load, Linux processes received frames and echoes in a thread without priority: services would receive nothing for some ticks while tests compute."""
    for pid in filter(str.isdigit, os.listdir("/proc")):
        try:
            with open(f"/proc/{pid}/comm", encoding="ascii", errors="replace") as file:
                if file.read().startswith("ksoftirqd/"):
                    os.setpriority(os.PRIO_PROCESS, int(pid), SERVICE_NICE)
        except (FileNotFoundError, ProcessLookupError):
            pass  # it has just ended


def attempt_of(result):
    """The outcome from the report of a worker."""
    known = {key: result[key] for key in ("skip", "stalls", "claims", "begin_us", "end_us") if key in result}
    return Attempt([Failure(*failure) for failure in result["failures"]], data=result, **known)


class GuestRun(Session):
    """The runner of the scenarios, with forked workers; in virtual time no machine is late, so every verdict is conclusive.

    In real time a witness runs in parallel, with the gateway's priority. Setting up a test always delays it a little (a fork is slow in
    such a kernel), so what counts is a delay that is long enough, and near enough, to have caused the failure.
    """

    def __init__(self, plan):
        super().__init__(self.work_off)
        self.plan = plan
        self.limit_s = SOAK_LIMIT_S if plan["group"] == "soak" else FULL_LIMIT_S if plan["full"] else LIMIT_S
        self.folder = None

    def watch(self):
        """In real time: from now on the witness runs in parallel, until `close`."""
        if not self.plan["native"]:  # a machine's own kernel is not changed
            hasten_received_frames()
        self.folder = tempfile.mkdtemp(prefix="iwheel-witness-")  # not next to the results: the host's files are slow
        file = os.path.join(self.folder, "late")
        open(file, "w", encoding="ascii").close()
        command = [os.path.join(self.plan["build"], "test", "kernel", "iwheel-sleeper"), file, str(kernel_rig.PRESS_LATE_US)]
        self.witness = subprocess.Popen(command, preexec_fn=as_a_service)
        kernel_rig.WITNESS["file"] = file

    def close(self):
        if self.witness:
            self.witness.kill()
            self.witness.wait()
            shutil.rmtree(self.folder, ignore_errors=True)

    def stalls(self, begin_us, end_us):
        return kernel_rig.late_wakings(begin_us, end_us, kernel_rig.STALL_US)

    def explained(self, attempt, failure):
        if failure.text.startswith("pair_spread"):  # the strictest limit of all, and the test is short
            around = failure.at_us - kernel_rig.TICK_US, failure.at_us + kernel_rig.TICK_US
            return explains(failure, kernel_rig.late_wakings(*around, kernel_rig.PRESS_LATE_US))
        if failure.text.startswith("no_silence"):  # the end of a hold depends on all frames received before
            failure = failure._replace(at_us=0)
        return super().explained(attempt, failure)

    def take_latencies(self, result):
        """{kind: microseconds}. The test has left out presses during which the machine was late."""
        return {kind: [latency_us for _, latency_us in result[kind]] for kind in KINDS}

    def work_off(self, name):
        entry = ENTRIES[name]
        read_end, write_end = os.pipe()
        child = os.fork()
        if child == 0:
            os.setsid()
            die_with_parent()
            try:
                answer = run_one(entry, self.plan)
            except BaseException as error:  # noqa: BLE001
                answer = died(f"the worker failed: {''.join(traceback.format_exception(error))[-1500:]}")
            with os.fdopen(write_end, "w", encoding="utf-8") as pipe:
                json.dump(answer, pipe)
            os._exit(0)
        os.close(write_end)
        text = read_all(read_end, self.limit_s)
        with contextlib.suppress(ProcessLookupError):
            os.killpg(child, signal.SIGKILL)
        os.waitpid(child, 0)
        if text is None:
            return attempt_of(died(f"did not end within {self.limit_s} s of the guest's clock"))
        attempt = attempt_of(json.loads(text) if text else died("the worker died"))
        for failure in attempt.failures:
            explained = "explained by a stall" if self.explained(attempt, failure) else "not explained"
            print(f"{name}: {failure.kind}, {explained}: {failure.text}", flush=True)
        return attempt


def read_all(descriptor, seconds):
    """Reads until the end of the pipe; None if that takes longer."""
    text, deadline = b"", time.monotonic() + seconds
    with os.fdopen(descriptor, "rb", buffering=0) as pipe:
        while True:
            if not select.select([pipe], [], [], max(0, deadline - time.monotonic()))[0]:
                return None
            part = pipe.read(65536)
            if not part:
                return text.decode()
            text += part
