# SPDX-License-Identifier: MIT
"""Starts simulator and gateway in a private folder, stores the timeline, and ends the started processes by their ids."""

import contextlib
import ctypes
import glob
import grp
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time

sys.path.append(os.path.join(os.path.dirname(os.path.dirname(os.path.abspath(__file__))), "support"))  # verdict.py

from bus import Bus, now_us
from client import Client
from judge import Judge
from judge_log import ESTOP_US, PAIR_REAL_US, Config, Event
from verdict import die_with_parent

sys.setswitchinterval(0.0005)  # s between threads of a test, default 0.005: a press does not wait for the recorder
HERE = os.path.dirname(os.path.abspath(__file__))
SERVICE_NICE = -10
PACE = {"slow": 1}  # how many times slower than documented telemetry comes, where time is virtual: test/kernel/catalogue.py
WORDS = 800  # characters of a program's output that are shown with a failure
DELAYED_US = 6_000  # with --delays: three system calls between the button and the zero pair begin 2 ms late
RESTART_US = 300_000  # row 25: the gateway answers within this time after a restart, and has then sent its zeros
DEFAULTS = {"wheels": {"setpoint_type": 1, "current_role": "limit", "track_mm": 540}, "drive": {}, "northbound": {"mode": "0600"}}


STRANGER = 65534
BECOME_STRANGER = f"""
import os, signal, socket, sys
os.setgroups([]); os.setgid({STRANGER}); os.setuid({STRANGER})  # After the imports: that user may have no right to read our Python.
"""
HOLD_NAMES = f"""{BECOME_STRANGER}
held = []
for name in sys.argv[2:]:
    held.append(socket.socket(socket.AF_UNIX))
    held[-1].bind("\\0" + name)
    if sys.argv[1] == "listening":
        held[-1].listen(0)
print("held", flush=True)
signal.pause()
"""


def lock_names(bus):
    """The names of root's gateway in the network namespace: app/gateway/lock/bus_names.h."""
    key = bus
    if bus.startswith("unix:"):
        value = 0xCBF29CE484222325
        for byte in os.path.realpath(bus[5:]).encode():
            value = (value ^ byte) * 0x100000001B3 % 2**64
        key = f"unix-{value:016x}"
    return [f"iwheel-gateway/{key}"] + [f"iwheel-gateway/{key}/0/{place}" for place in (1, 2, 3)]


def become_stranger():
    os.setgroups([])
    os.setgid(STRANGER)
    os.setuid(STRANGER)


def read_only(folder):
    """Returns a function for a new process of root: it mounts a read-only file system at the folder."""

    def mount():
        libc = ctypes.CDLL(None, use_errno=True)
        own, private, reads = 0x20000, 0x44000, 1  # CLONE_NEWNS, MS_REC | MS_PRIVATE, MS_RDONLY
        if (
            libc.unshare(own) != 0
            or libc.mount(None, b"/", None, private, None) != 0
            or libc.mount(b"none", os.fsencode(folder), b"tmpfs", reads, b"mode=0755") != 0
        ):
            raise OSError(ctypes.get_errno(), "mount")

    return mount


def children(pid):
    """{name: process number} of its children, on every kernel: not every kernel has /proc/PID/task/PID/children."""
    found = {}
    for stat in glob.glob("/proc/[0-9]*/stat"):
        with contextlib.suppress(FileNotFoundError, ProcessLookupError), open(stat, encoding="utf-8", errors="replace") as file:
            number, rest = file.read().split(" (", 1)
            name, rest = rest.rsplit(")", 1)
            if int(rest.split()[1]) == pid:
                found[name] = int(number)
    return found


def as_a_service():
    """Sets the priority of a service, if permitted: these processes must not wait for the scenarios."""
    with contextlib.suppress(PermissionError):
        os.setpriority(os.PRIO_PROCESS, 0, SERVICE_NICE)


def hook_library(build):
    """The library that delays system calls of a program and lets them hang: hook.c."""
    path = os.path.join(build, "test", "system", "libiwheel_hook.so")
    if not os.path.exists(path):  # The loader would only print a warning.
        raise FileNotFoundError(f"{path} is missing; build it first: cmake --build {build} --target iwheel_hook")
    return path


def delayed(build):
    """In a child, before it becomes a program: with pytest's --delays, its system calls begin 0 to 2 ms late at random."""
    if "IWHEEL_DELAYS" in os.environ:
        os.environ["LD_PRELOAD"] = hook_library(build)


def estop_limit_us():
    """The limit of the 99th percentile of the time from the e-stop to the zero pair."""
    return ESTOP_US + (DELAYED_US if "IWHEEL_DELAYS" in os.environ else 0)


class Process:
    """A child whose output goes to a file."""

    def __init__(self, command, output, setup=None, **options):
        self.output = output

        def prepare():
            die_with_parent()
            as_a_service()
            if setup:
                setup()

        with open(output, "ab") as file:
            self.child = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=options.pop("stdout", file), stderr=file, preexec_fn=prepare, **options)

    def signal(self, number):
        if self.child.poll() is None:
            self.child.send_signal(number)

    def wait(self, seconds):
        try:
            return self.child.wait(seconds)
        except subprocess.TimeoutExpired:
            return None

    def text(self):
        with open(self.output, encoding="utf-8", errors="replace") as file:
            return file.read()

    def cpu_share(self, seconds):
        """Of one processor, in that time."""
        cpu, begin = self.cpu_seconds(), time.monotonic()
        time.sleep(seconds)
        return (self.cpu_seconds() - cpu) / (time.monotonic() - begin)

    def cpu_seconds(self):
        with open(f"/proc/{self.child.pid}/stat", encoding="ascii") as file:
            fields = file.read().rsplit(")", 1)[1].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def resident_kB(self):
        with open(f"/proc/{self.child.pid}/statm", encoding="ascii") as file:
            return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") // 1024

    def descriptors(self):
        return len(os.listdir(f"/proc/{self.child.pid}/fd"))

    def end(self):
        self.signal(signal.SIGCONT)
        self.signal(signal.SIGTERM)
        if self.wait(0.3) is None:
            self.signal(signal.SIGKILL)
            self.wait(2)


class Sim:
    """The simulator and its control socket."""

    def __init__(self, rig, extra=()):
        self.rig = rig
        command = [
            rig.program("iwheel-sim"),
            "--can",
            rig.wheels_bus(),
            "--estop",
            rig.path("button"),
            "--control",
            rig.path("control"),
            "--seed",
            "1",
            *rig.sim_arguments(),
            *extra,
        ]
        self.process = Process(command, rig.path("sim.out"), lambda: delayed(rig.build))
        self.control = wait_connect(rig.path("control"), self.process)
        self.lines = self.control.makefile("r")

    def ask(self, command):
        """Sends one command and returns the answer's text; raises if it is refused."""
        answer = self.try_ask(command)
        if not answer.startswith("ok"):
            raise RuntimeError(f"simulator: {command}: {answer}")
        return answer[3:]

    def try_ask(self, command):
        self.control.sendall((command + "\n").encode())
        return self.lines.readline().rstrip("\n")

    def end(self):
        self.control.close()
        self.process.end()


class Hand:
    """Pushes both wheels without a pause until `let_go`. After at most 5 s of pushing they are at standstill within 1 s."""

    STEP_S = 0.05
    STEP_M = 0.09  # The simulated hand needs 0.06 s for it.

    def __init__(self, sim):
        self.sim = sim
        self.ended = threading.Event()
        self.thread = threading.Thread(target=self.push, daemon=True)
        self.thread.start()

    def push(self):
        while not self.ended.is_set():
            self.sim.ask(f"push both {self.STEP_M}")
            self.ended.wait(self.STEP_S)

    def let_go(self):
        self.ended.set()
        self.thread.join()


def wait_connect(path, process, seconds=5.0):
    deadline = time.monotonic() + seconds
    while True:
        sock = socket.socket(socket.AF_UNIX)
        sock.settimeout(3)
        try:
            sock.connect(path)
            return sock
        except OSError as error:
            sock.close()
            if process.child.poll() is not None:
                raise RuntimeError(f"{process.child.args[0]} ended with {process.child.returncode}: {process.text()[-600:]}") from error
            if time.monotonic() > deadline:
                raise
            time.sleep(0.005)


class Rig:
    """One simulator, one bus recorder, one gateway (restartable), one timeline."""

    exit_clears = True  # The simulator forgets the waiting frames of a client that ends; a kernel does not.
    restart_us = RESTART_US

    def __init__(self, build, config=None, sim_args=(), estop=True):
        self.build = build
        self.folder = tempfile.mkdtemp(prefix="iwheel-")
        try:
            self.begin(config, sim_args, estop)
        except BaseException:
            self.remove_folder()
            raise

    def begin(self, config, sim_args, estop):
        self.timeline = []
        self.processes, self.clients = [], []
        self.gateway = None
        self.estop, self.button = estop, "button"
        self.socket_name = "gateway.sock"
        self.settings = {section: dict(keys) for section, keys in DEFAULTS.items()}
        self.settings["northbound"]["group"] = grp.getgrgid(os.getgid()).gr_name
        self.settings["record"] = {"directory": self.folder}
        self.configure(**(config or {}))
        self.prepare()
        self.sim = self.start_wheels(sim_args)
        self.bus = self.listen()

    # Steps that differ on another bus (test/kernel) ------------------------------------------------------

    def prepare(self):
        """Called before any program starts."""

    def start_wheels(self, sim_args):
        """Two wheels and their bus."""
        return Sim(self, sim_args)

    def sim_arguments(self):
        """More arguments of the simulator."""
        if PACE["slow"] == 1:
            return ()
        with open(self.path("pace"), "w", encoding="ascii") as file:
            file.write(f"at 0 slow {PACE['slow']}\n")
        return ("--script", self.path("pace"))

    def listen(self, frames=None):
        """The recorder of the bus; `frames`: the frames of an earlier recorder."""
        return Bus(self.path("bus"), frames)

    def wheels_bus(self):
        """The simulator's --can."""
        return f"unix:{self.path('bus')}"

    def gateway_bus(self):
        """The gateway's --can."""
        return self.wheels_bus()

    def estop_line(self):
        """The gateway's --estop."""
        return f"unix:{self.path(self.button)}" if self.estop else "none"

    # Files and configuration ------------------------------------------------------------------------------------------

    def path(self, name):
        return os.path.join(self.folder, name)

    def program(self, name):
        return find_program(self.build, name)

    def configure(self, **sections):
        """Changes these keys of the gateway's configuration, and writes it."""
        for section, keys in sections.items():
            self.settings.setdefault(section, {}).update(keys)
        self.write_config()

    def hand(self):
        return Hand(self.sim)

    def write_config(self, name="gateway.conf"):
        with open(self.path(name), "w", encoding="utf-8") as file:
            for section, keys in self.settings.items():
                file.write(f"[{section}]\n" + "".join(f"{key} = {value}\n" for key, value in keys.items()))

    def judge_config(self):
        wheels, drive = self.settings["wheels"], self.settings["drive"]
        values = {key: drive[key] for key in drive if key in Config._fields}
        return Config(
            setpoint_type=wheels["setpoint_type"],
            role=wheels["current_role"],
            dlc=wheels.get("setpoint_dlc", 5),
            track_mm=wheels.get("track_mm", 540),  # Without a track nothing moves, so the value judges nothing.
            radius_mm=wheels.get("radius_mm", 192),
            invert=tuple(self.settings.get(side, {}).get("invert") == "yes" for side in ("left", "right")),
            **values,
        )

    # The gateway ------------------------------------------------------------------------------------------------------

    def gateway_command(self, *extra):
        return [
            self.program("iwheel-gateway"),
            "-c",
            self.path("gateway.conf"),
            "--can",
            self.gateway_bus(),
            "--socket",
            self.path(self.socket_name),
            "--estop",
            self.estop_line(),
            *extra,
        ]

    def start_gateway(self, *extra, setup=None, wheels=True, restart_hold=False):
        """Starts the gateway and waits until it answers, and with `wheels` until both are online. Returns the milliseconds to the answer."""
        begin_us = now_us()

        def prepare():
            delayed(self.build)
            if setup:
                setup()

        self.gateway = self.launch(self.gateway_command(*extra), "gateway.out", prepare)
        self.timeline.append(Event(begin_us, "start"))
        if restart_hold:
            self.timeline.append(Event(begin_us, "restart_hold", within_us=self.restart_us))
        wait_connect(self.path(self.socket_name), self.gateway).close()
        client = self.client(name="starter")
        client.request("hello")
        answered_ms = (now_us() - begin_us) / 1000
        if wheels:
            self.wait_status(
                client,
                lambda s: (
                    s["left"]["at_rest"]
                    and s["right"]["at_rest"]
                    and s["bus"]["state"] == "active"
                    and s["estop"]["state"] in ("released", "none")
                    and s["memory"]["state"] != "loading"  # Before that the gateway refuses arm.
                ),
            )
        client.close()
        return answered_ms

    def connect_to_new(self, *extra, name="test", **options):
        """Starts the gateway as above, and returns a client of it."""
        self.start_gateway(*extra, **options)
        return self.client(name)

    def wait_status(self, client, condition, seconds=4.0):
        """Polls the status until it fulfils the condition; returns it, or None after that time."""
        deadline = time.monotonic() + seconds
        while True:
            status = client.request("status")
            if condition(status):
                if status["state"] == "listening":
                    self.note("silent")
                return status
            if time.monotonic() > deadline:
                return None
            time.sleep(0.05)

    def wait_at_rest(self, client, seconds=4.0, active=False):
        """As wait_status, until both wheels are online and at standstill, and with `active` the bus is active."""
        return self.wait_status(client, lambda s: s["left"]["at_rest"] and s["right"]["at_rest"] and (not active or s["bus"]["state"] == "active"), seconds)

    def kill_gateway(self, number):
        """Ends it by a signal that it cannot or does not handle."""
        self.note("end")
        self.gateway.signal(number)
        return self.gateway.wait(3)

    def stranger(self, way, names):
        """Another user's process that holds these names, "listening" or "silent". Needs root."""
        process = self.launch([sys.executable, "-c", HOLD_NAMES, way, *names], "stranger.out")
        deadline = time.monotonic() + 10
        while "held" not in process.text():
            if time.monotonic() > deadline:
                raise RuntimeError(f"the other user's process holds no name: {process.text()}")
            time.sleep(0.02)
        return process

    def client(self, name="test"):
        client = Client(self.path(self.socket_name), self.timeline, name)
        self.clients.append(client)
        return client

    def launch(self, command, output, setup=None):
        """Starts a process that ends with this rig; `output`: the name of its file."""
        process = Process(command, self.path(output), setup)
        self.processes.append(process)
        return process

    def spawn(self, script, *arguments):
        return self.launch([sys.executable, os.path.join(HERE, script), *map(str, arguments)], f"{script}.{len(self.processes)}.out")

    def take_events(self, process):
        """Adds the output of a drive_client.py to the timeline."""
        for line in process.text().splitlines():
            words = line.split()
            if len(words) == len(Event._fields):
                numbers = [int(word) if word.lstrip("-").isdigit() else word for word in words]
                self.timeline.append(Event(*numbers)._replace(ok=words[3] == "True"))

    def restart_sim(self, frames, extra=()):
        """Starts another simulator after the first one ended; `frames`: the frames of the recorder until then."""
        self.sim.end()
        self.sim = Sim(self, extra)
        self.bus = self.listen(frames)

    def relisten(self):
        """After the interface was made again or set up again."""
        self.bus.close()
        self.bus = self.listen(self.bus.frames)

    # The timeline -----------------------------------------------------------------------------------------------------

    def note(self, kind, **fields):
        """Adds an event of now to the timeline; returns its time."""
        event = Event(now_us(), kind, **fields)
        self.timeline.append(event)
        return event.t_us

    def pressed_by(self, action):
        """Does what counts as a press of the e-stop. Returns when it began."""
        t_us = now_us()
        action()
        self.timeline.append(Event(t_us, "press", now_us()))
        return t_us

    def press(self):
        return self.pressed_by(lambda: self.sim.ask("estop press"))

    def release(self):
        self.sim.ask("estop release")

    def fault(self, command, kind="cut", within_ms=0):
        """Injects a fault that must stop the wheels."""
        self.timeline.append(Event(now_us(), kind, within_us=within_ms * 1000))
        return self.sim.ask(command)

    def cut_by(self, action, within_ms):
        """Does what takes the bus away: the wheels must stop within that time after it was done. Returns when it was done."""
        begin_us = now_us()
        action()
        done_us = now_us()
        self.timeline.append(Event(done_us, "dead"))
        self.timeline.append(Event(begin_us, "cut", within_us=done_us - begin_us + within_ms * 1000))
        return done_us

    def judge(self, moves=True, **options):
        """Stops recording and judges. Call it once, at the end."""
        time.sleep(0.05)
        finished_us = now_us() - 20_000
        self.bus.close()
        frames = [frame for frame in self.bus.frames if frame.t_us <= finished_us]
        judge = Judge(
            self.judge_config(),
            frames,
            self.timeline,
            moves=moves,
            finished_us=finished_us,
            **{"pair_limit_us": PAIR_REAL_US, "estop_limit_us": estop_limit_us(), "exit_clears": self.exit_clears, **options},
        )
        judge.judge()
        return judge

    def said(self):
        """The output that is shown with a failure."""
        return self.gateway.text()[-WORDS:] if self.gateway else ""

    def close(self, keep=False):
        for client in self.clients:
            client.close()
        for process in reversed(self.processes):
            process.end()
        self.sim.end()
        self.bus.close()
        if not keep:
            self.remove_folder()

    def remove_folder(self):
        """Waits for the gateway's helpers, which write their last file after the gateway has ended and would make the folder again."""
        end = time.monotonic() + 3
        while self.is_used() and time.monotonic() < end:
            time.sleep(0.01)
        shutil.rmtree(self.folder, ignore_errors=True)

    def is_used(self):
        """Whether a process has our folder in its command line, as the gateway's helpers inherit it."""
        for path in glob.glob("/proc/[0-9]*/cmdline"):
            try:
                with open(path, "rb") as file:
                    if self.folder.encode() in file.read() and path != f"/proc/{os.getpid()}/cmdline":
                        return True
            except OSError:
                pass
        return False


def find_program(build, name):
    folder = {
        "iwheel-gateway": "app/gateway",
        "iwheelctl": "app/ctl",
        "iwheel-sim": "app/sim",
        "iwheel-web": "app/bridge/web",
        "iwheel-mqtt": "app/bridge/mqtt",
        "iwheel-fleet": "app/bridge/mqtt",
        "iwheel-serial": "app/bridge/serial",
        "iwheel-ros2": "app/bridge/ros2",
    }[name]
    for path in (os.path.join(build, folder, name), os.path.join(build, "bin", name), os.path.join(build, name)):
        if os.access(path, os.X_OK):
            return path
    raise FileNotFoundError(f"{name} is not in {build}; build it first: cmake --build {build} --target {name}")
