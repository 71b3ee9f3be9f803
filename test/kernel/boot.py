# SPDX-License-Identifier: MIT
"""Boots the kernel of build_kernel as an ordinary process, with the host's files as its root, and always ends it."""

import contextlib
import json
import os
import signal
import subprocess
import sys
import time

from harness import die_with_parent

HERE = os.path.dirname(os.path.abspath(__file__))
VIRTUAL_NICE = 5
MEMORY_ELSEWHERE = ("TMPDIR", "TMP", "TEMP")  # Folders for the memory of the kernel, possibly on a disk; without these variables it is in /dev/shm.


def find_kernel(install=True):
    """Path of the kernel, which is built first if it does not exist. Raises RuntimeError with the reason if that fails."""
    command = [os.path.join(HERE, "build_kernel")]
    known = subprocess.run([*command, "--print"], stdout=subprocess.PIPE, text=True, check=False)
    if known.returncode == 0:
        return known.stdout.strip()
    with subprocess.Popen(command + ([] if install else ["--no-install"]), stdout=subprocess.PIPE, text=True) as child:
        last = ""
        for line in child.stdout:
            last = line.rstrip("\n")
            print(f"  {last}", flush=True)
    if child.returncode != 0:
        raise RuntimeError("the kernel could not be built; its reason: test/kernel/build_kernel")
    return last


class Boot:
    """One boot that executes one plan.

    It runs on `processors`. The plan (see guest.py) and its results are in `folder`: NAME.json, NAME.results (one JSON object per line, as
    the tests end), NAME.out (what the guest printed), NAME.console (what the kernel printed), NAME.status.
    """

    def __init__(self, kernel, folder, name, plan, processors):
        self.name, self.folder, self.processors = name, folder, processors
        self.plan = plan
        with open(self.path("json"), "w", encoding="utf-8") as file:
            json.dump({**plan, "results": self.path("results")}, file)
        open(self.path("results"), "w", encoding="utf-8").close()
        self.began = time.monotonic()
        with open(self.path("console"), "wb") as console:
            # In its own session: the kernel is a tree of processes, and all of them must end with it.
            self.child = subprocess.Popen(
                self.command(kernel),
                stdin=subprocess.DEVNULL,
                stdout=console,
                stderr=console,
                start_new_session=True,
                preexec_fn=self.prepare,
                cwd=folder,
                env={key: value for key, value in os.environ.items() if key not in MEMORY_ELSEWHERE},
            )
        self.read_bytes, self.cpu_s = 0, 0

    def prepare(self):
        """In the child: sets processors and priority. Virtual time has a low priority; real time has a high one, if permitted."""
        die_with_parent()
        os.sched_setaffinity(0, self.processors)
        if self.plan["virtual"]:
            os.nice(VIRTUAL_NICE)
        if self.plan["virtual"] or self.plan["group"] == "starved":  # With a real-time priority it would use up its share of the processor and be stopped.
            return
        with contextlib.suppress(PermissionError):  # then the witness's file shows what can be judged
            os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(1))

    def command(self, kernel):
        plan, folder, name = self.plan, self.folder, self.name
        command = [kernel, f"mem={plan.get('memory_MB', 384)}M", "root=none", "rootfstype=hostfs", "rootflags=/", "rw"]
        command += [f"init={os.path.join(HERE, 'init')}", "con0=fd:0,fd:1", "con=null", "quiet", "random.trust_cpu=on"]
        command += [f"uml_dir={folder}", f"umid={name}", "panic=-1"]
        command += ["time-travel=inf-cpu"] if plan["virtual"] else []
        command += plan.get("kernel_arguments", [])
        command += [f"iwheel_python={os.path.realpath(sys.executable)}"]
        command += [f"iwheel_guest={plan.get('guest', os.path.join(HERE, 'guest.py'))}", f"iwheel_plan={self.path('json')}"]
        return command

    def path(self, ending):
        return os.path.join(self.folder, f"{self.name}.{ending}")

    def text(self, ending, last=4000):
        try:
            with open(self.path(ending), encoding="utf-8", errors="replace") as file:
                return file.read()[-last:]
        except FileNotFoundError:
            return ""

    def results(self):
        """Results since the last call."""
        with open(self.path("results"), encoding="utf-8") as file:
            file.seek(self.read_bytes)
            lines = file.read()
        whole = lines[: lines.rfind("\n") + 1]
        self.read_bytes += len(whole.encode())
        return [json.loads(line) for line in whole.splitlines()]

    def running(self):
        """Without reaping it: `end` reads its processor time."""
        return os.waitid(os.P_PID, self.child.pid, os.WEXITED | os.WNOHANG | os.WNOWAIT) is None

    def seconds(self):
        return time.monotonic() - self.began

    def stall_as_asked(self):
        """A test may ask for a stalled machine, by NAME.stall with the seconds in it: the kernel's process is stopped for that time."""
        try:
            with open(self.path("stall"), encoding="ascii") as file:
                seconds = float(file.read())
        except (FileNotFoundError, ValueError):  # no request, or not written yet
            return
        os.kill(self.child.pid, signal.SIGSTOP)
        time.sleep(seconds)
        os.kill(self.child.pid, signal.SIGCONT)
        os.unlink(self.path("stall"))

    def kill(self):
        """All its processes, by their group."""
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.child.pid, signal.SIGKILL)

    def end(self):
        """Kills its remaining processes; stores the processor time of all of them."""
        self.kill()
        _, status, usage = os.wait4(self.child.pid, 0)
        self.child.returncode = os.waitstatus_to_exitcode(status)
        self.cpu_s = usage.ru_utime + usage.ru_stime

    def complaint(self):
        """Why it ended before the end of its plan."""
        console = [line for line in self.text("console").splitlines() if line.strip()]
        return "\n".join(["the guest's last output:", self.text("out", 1500), "the console's:", *console[-12:]])


if __name__ == "__main__":
    print(find_kernel("--no-install" not in sys.argv))
