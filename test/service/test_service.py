# SPDX-License-Identifier: MIT
"""Tests the service from systemd's point of view: units, users, files, sandbox, restarts, rights to its socket.

Nothing here needs a running systemd.
"""

import contextlib
import grp
import itertools
import math
import os
import re
import shutil
import signal
import socket
import stat
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.dirname(os.path.dirname(HERE))
SHARE = os.path.join(ROOT, "share")
sys.path[:0] = [os.path.join(ROOT, "test", "system"), os.path.join(ROOT, "python", "src")]

from bus import now_us
from harness import BECOME_STRANGER, STRANGER, Process, Rig, lock_names
from trials import until
from verdict import hold

import iwheel

EXPOSURE_MAX = 13
"""Tenths, with the count of systemd-analyze --threshold."""
GATEWAYS = {"iwheel-gateway.service": "iwheel-gateway.service", "iwheel-gateway@.service": "iwheel-gateway@can0.service"}
RESTARTS = {"iwheel-can-restart@.service": "iwheel-can-restart@can0.service", "iwheel-can-restart@.path": "iwheel-can-restart@can0.path"}
UNITS = {**RESTARTS, **GATEWAYS}
ROS2 = "iwheel-ros2.service"
ROS2_EXPOSURE_MAX = 14
"""The bridge has a network."""
SERIAL = "iwheel-serial.service"
WEB = "iwheel-web.service"
WEB_SOCKET = "iwheel-web.socket"
MQTT = "iwheel-mqtt.service"
WEB_EXPOSURE_MAX = 14
"""The bridge may listen on a network."""
RESTART_EXPOSURE_MAX = 16
"""The unit may do one thing: change interfaces."""
SLOW = {"drive": {"lease_ms": 300}, "limits": {"echo_ms": 200, "wheel_silent_ms": 200}}
build = os.environ.get("IWHEEL_BUILD", os.path.join(ROOT, "build", "default"))


def need(*tools):
    for tool in tools:
        if shutil.which(tool) is None:
            raise unittest.SkipTest(f"{tool} is missing (scripts/install_tools check brings it)")


def read(*parts):
    return Path(SHARE, *parts).read_text(encoding="utf-8")


def values(unit, key):
    return re.findall(rf"^{key}=(.*)$", read("systemd", unit), re.MULTILINE)


def without_programs(unit):
    """The unit's text: not every build has the programs of the bridges."""
    return re.sub("/usr/bin/iwheel-[a-z]+", "/bin/true", read("systemd", unit))


def complaints_of_udev(rules):
    """udev's messages about a file of rules. The result does not depend on the groups of this machine."""
    need("udevadm")
    with tempfile.TemporaryDirectory() as root:
        path = Path(root, "usr/lib/udev/rules.d/60-iwheel.rules")
        path.parent.mkdir(parents=True)
        path.write_text(rules, encoding="utf-8")
        command = ["udevadm", "verify", "--resolve-names=never", path]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if "Unknown command verb" in done.stderr:  # Before systemd 254.
            done = read_rules_in(root)
    return [line for line in done.stderr.splitlines() if "60-iwheel.rules:" in line]


def read_rules_in(root):
    """udevadm test reads all rules before it searches its device; here in a root that contains only our rules."""
    if os.geteuid() != 0:
        raise unittest.SkipTest("this udevadm cannot verify rules (systemd 254 can), and only root can show it only our rules")
    program = os.path.realpath(shutil.which("udevadm"))
    libraries = subprocess.run(["ldd", program], capture_output=True, text=True, check=True).stdout
    for path in (program, *re.findall(r"(/\S+) \(0x", libraries)):
        os.makedirs(root + os.path.dirname(path), exist_ok=True)
        shutil.copy(path, root + path)
    os.makedirs(os.path.join(root, "etc"))
    Path(root, "etc/group").write_text("root:x:0:\ngpio:x:1:\n", encoding="utf-8")
    return subprocess.run(["chroot", root, program, "test", "/sys/none"], capture_output=True, text=True, check=False)


class Units(unittest.TestCase):
    def assert_confined(self, unit, limit):
        need("systemd-analyze")
        path = os.path.join(SHARE, "systemd", unit)
        done = subprocess.run(["systemd-analyze", "security", "--offline=true", f"--threshold={limit}", path], capture_output=True, text=True, check=False)
        self.assertEqual(done.returncode, 0, done.stdout[-200:])

    def assert_clean(self, texts, name):
        """systemd has nothing to say about this one of the units, {name: text}."""
        need("systemd-analyze")
        with tempfile.TemporaryDirectory() as folder:
            for unit, text in texts.items():
                Path(folder, unit).write_text(re.sub("(?m)^Documentation=.*$", "", text), encoding="utf-8")
            done = subprocess.run(["systemd-analyze", "verify", os.path.join(folder, name)], capture_output=True, text=True, check=False)
        self.assertEqual(([line for line in done.stderr.splitlines() if "iwheel" in line], done.returncode), ([], 0), done.stderr)

    def test_the_exposure_is_small(self):
        limits = {**dict.fromkeys(GATEWAYS, EXPOSURE_MAX), "iwheel-can-restart@.service": RESTART_EXPOSURE_MAX, ROS2: ROS2_EXPOSURE_MAX, SERIAL: EXPOSURE_MAX}
        for unit, limit in limits.items():
            self.assert_confined(unit, limit)

    def test_the_units_are_clean(self):
        made = {}
        for unit, name in {**UNITS, ROS2: ROS2, SERIAL: SERIAL}.items():
            text = read("systemd", unit).replace("/usr/bin/iwheel-gateway", os.path.join(build, "app/gateway/iwheel-gateway"))
            text = text.replace("/usr/bin/iwheel-ros2", "/bin/true")  # Not every build has it.
            made[name] = text.replace("/usr/bin/iwheel-serial", os.path.join(build, "app/bridge/serial/iwheel-serial"))
            self.assert_clean(made, name)

    def test_systemd_waits_for_the_longest_hold(self):
        """SIGKILL earlier would end the zeros while a wheel still moves."""
        longest_s = int(re.search(r"^hold_max_s = .*; 10\.\.(\d+) s", read("gateway.conf"), re.MULTILINE)[1])
        for unit in GATEWAYS:
            (wait,) = values(unit, "TimeoutStopSec")
            self.assertGreaterEqual(int(wait.removesuffix("s")), longest_s + 30, unit)

    def test_watching_bridges_are_confined_and_not_autostarted(self):
        for unit, ends in ((WEB, "64 77 78"), (MQTT, "64 73 77 78")):
            self.assert_confined(unit, WEB_EXPOSURE_MAX)
            self.assertEqual(values(unit, "SupplementaryGroups"), ["iwheel-watch"])
            self.assertEqual(values(unit, "RestartPreventExitStatus"), [ends])
            self.assert_clean({unit: without_programs(unit)}, unit)

    def test_ros_bridge_stays_on_this_machine_and_in_its_memory(self):
        self.assertEqual(values(ROS2, "IPAddressDeny"), ["any"])
        self.assertEqual(values(ROS2, "IPAddressAllow"), ["localhost"])
        self.assertEqual(values(ROS2, "MemoryMax"), ["64M"])
        self.assertEqual(re.findall(r"^network = (\w+)", read("ros2.conf"), re.MULTILINE), ["loopback"])

    def test_mqtt_bridge_has_memory_for_its_largest_spool(self):
        largest_kB = int(re.search(r"^max_kB = .*; 64\.\.(\d+) kB", read("mqtt.conf"), re.MULTILINE)[1])
        limit = values(MQTT, "MemoryMax")[0]
        self.assertGreater(int(limit.removesuffix("M")) << 20, 3 * largest_kB * 1000 + 16_000_000, limit)

    def test_programs_without_a_network_may_have_none(self):
        for unit in (*GATEWAYS, SERIAL):
            self.assertEqual(values(unit, "IPAddressDeny"), ["any"], unit)
            self.assertEqual(values(unit, "IPAddressAllow"), [], unit)
            self.assertNotIn("AF_INET", values(unit, "RestrictAddressFamilies")[0], unit)

    def test_the_port_of_the_page_is_held_on_both_loopbacks(self):
        port = re.search(r"^port = (\d+)", read("web.conf"), re.MULTILINE)[1]
        self.assertEqual(values(WEB_SOCKET, "ListenStream"), [f"127.0.0.1:{port}", f"[::1]:{port}"])
        self.assertEqual(values(WEB_SOCKET, "BindIPv6Only"), ["ipv6-only"])
        self.assertEqual(values(WEB_SOCKET, "WantedBy"), ["sockets.target"])  # Before any user.
        self.assertEqual((values(WEB, "Wants"), values(WEB, "Also")), ([WEB_SOCKET], [WEB_SOCKET]))
        self.assertIn(WEB_SOCKET, values(WEB, "After")[0].split())
        # With PartOf, BindsTo or its own restart the port would be free for a moment.
        self.assertNotRegex(read("systemd", WEB_SOCKET), "(?m)^(PartOf|BindsTo|Requires|RemoveOnStop)=")
        self.assert_clean({unit: without_programs(unit) for unit in (WEB, WEB_SOCKET)}, WEB_SOCKET)

    def test_template_differs_only_in_the_name_of_the_bus(self):
        plain, template = (read("systemd", unit).splitlines() for unit in GATEWAYS)
        different = {line.split("=")[0] for line in set(plain) ^ set(template)}
        self.assertEqual(different, {"Description", "ExecStart", "After"})

    def test_the_unit_that_may_restart_a_link_does_nothing_else(self):
        service, path = RESTARTS
        self.assertEqual(values(path, "PathChanged"), ["/run/iwheel/%i.restart"])
        commands = [f"/usr/bin/ip link set dev %i {state}" for state in ("down", "up")]
        self.assertEqual(values(service, "ExecStart"), commands)
        self.assertEqual(values(service, "CapabilityBoundingSet"), ["CAP_NET_ADMIN"])
        self.assertEqual(values(service, "Type"), ["oneshot"])
        for unit in GATEWAYS:
            self.assertEqual(values(unit, "CapabilityBoundingSet"), [""])

    def test_user_groups_and_folders_are_made(self):
        need("systemd-sysusers", "systemd-tmpfiles")
        if os.geteuid() != 0:
            self.skipTest("needs root to make folders for another user")
        with tempfile.TemporaryDirectory() as root:
            os.mkdir(os.path.join(root, "etc"))
            for tool, kind in (("systemd-sysusers", "sysusers.d"), ("systemd-tmpfiles", "tmpfiles.d")):
                more = ["--create"] if tool.endswith("tmpfiles") else []
                subprocess.run([tool, f"--root={root}", *more, os.path.join(SHARE, kind, "iwheel.conf")], check=True)
            groups = dict(line.split(":", 1) for line in Path(root, "etc/group").read_text(encoding="utf-8").splitlines())
            self.assertTrue(groups["gpio"].endswith(":iwheel"))
            for folder, mode in (("run/iwheel", 0o755), ("run/iwheel/watch", 0o2755), ("var/lib/iwheel", 0o750)):
                self.assertEqual(stat.S_IMODE(os.stat(os.path.join(root, folder)).st_mode), mode)
            number = int(groups["iwheel-watch"].split(":")[1])
            self.assertEqual(os.stat(os.path.join(root, "run/iwheel/watch")).st_gid, number)

    def test_the_udev_rules_are_valid(self):
        for rules in ("60-iwheel.rules", "61-iwheel-serial.rules"):
            self.assertEqual(complaints_of_udev(read("udev", rules)), [])

    def test_a_wrong_udev_rule_would_be_noticed(self):
        for wrong in ('SUBSYSTEM=="gpio", NONSENSE="1"', 'SUBSYSTEM=="gpio", GROUP=="gpio"', 'SUBSYSTEM="gpio"', 'KERNEL=="x'):
            with self.subTest(wrong):
                self.assertNotEqual(complaints_of_udev(wrong + "\n"), [])

    def test_udev_uses_only_groups_that_we_create(self):
        made = set(re.findall(r"^g (\w+)", read("sysusers.d", "iwheel.conf"), re.MULTILINE))
        listed = set(re.findall(r'\bGROUP="([^"]*)"', read("udev", "60-iwheel.rules")))
        self.assertTrue(listed and listed <= made, f"{listed} is not among {made}")

    def test_the_network_example_asks_for_the_wheels_timing(self):
        text = read("networkd", "80-iwheel-can.network")
        self.assertIn("\nBitRate=1M\n", text)
        self.assertIn("\nSamplePoint=62.5%\n", text)
        self.assertIn("\nTransmitQueueLength=4\n", read("networkd", "70-iwheel-can.link"))

    def test_socket_buffers_may_be_as_large_as_requested(self):
        header = Path(ROOT, "port/linux/include/iwheel_linux/bus_link.h").read_text(encoding="utf-8")
        factors = re.search(r"IWL_LINK_ROOM_BYTES \((\d+)U \* (\d+)U \* (\d+)U\)", header).groups()
        granted = re.search(r"^net\.core\.rmem_max = (\d+)$", read("sysctl.d", "10-iwheel.conf"), re.MULTILINE)
        self.assertEqual(int(granted[1]), math.prod(map(int, factors)))


def internet_sockets(pid):
    """Sockets of this process in the kernel's tables of TCP, UDP and raw sockets, as (table, address)."""
    inodes, found = set(), []
    for fd in os.listdir(f"/proc/{pid}/fd"):
        with contextlib.suppress(FileNotFoundError):  # The descriptor of this listing.
            inodes.update(re.findall(r"^socket:\[(\d+)\]$", os.readlink(f"/proc/{pid}/fd/{fd}")))
    for table in ("tcp", "tcp6", "udp", "udp6", "raw", "raw6"):
        if os.path.exists(f"/proc/{pid}/net/{table}"):
            with open(f"/proc/{pid}/net/{table}", encoding="ascii") as file:
                rows = [line.split() for line in file.readlines()[1:]]
            found += [(table, row[1]) for row in rows if row[9] in inodes]
    return found


class Running(unittest.TestCase):
    def rig(self, **options):
        rig = Rig(build, SLOW, **options)
        self.addCleanup(rig.close)
        return rig

    def test_the_gateway_has_no_internet_socket(self):
        with socket.create_server(("127.0.0.1", 0)):
            self.assertEqual(len(internet_sockets(os.getpid())), 1, "the function finds its own socket")
        rig = self.rig()
        rig.start_gateway()
        self.assertEqual(internet_sockets(rig.gateway.child.pid), [])

    def test_a_wrong_configuration_is_not_tried_again(self):
        rig = self.rig()
        never = {int(code) for text in values("iwheel-gateway.service", "RestartPreventExitStatus") for code in text.split()}
        broken = rig.path("broken.conf")
        Path(broken).write_text("[bus]\ninterfaec = can0\n", encoding="utf-8")
        gateway = rig.program("iwheel-gateway")
        for arguments in (["-c", broken], ["-c", rig.path("missing.conf")], ["--nonsense"], ["-c", "/etc/passwd"]):
            code = subprocess.run([gateway, *arguments], capture_output=True, check=False, timeout=5).returncode
            self.assertIn(code, never, arguments)

    def test_ready_watchdog_and_stopping_are_reported(self):
        rig = self.rig()
        notifications = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.addCleanup(notifications.close)
        notifications.bind(rig.path("notify"))
        notifications.settimeout(3)
        os.environ.update(NOTIFY_SOCKET=rig.path("notify"), WATCHDOG_USEC="200000")
        try:
            rig.start_gateway()
        finally:
            del os.environ["NOTIFY_SOCKET"], os.environ["WATCHDOG_USEC"]
        words = [notifications.recv(100) for _ in range(4)]
        self.assertEqual(words, [b"READY=1"] + 3 * [b"WATCHDOG=1"])
        rig.gateway.signal(signal.SIGTERM)
        while words[-1] != b"STOPPING=1":
            words.append(notifications.recv(100))
        self.assertEqual(rig.gateway.wait(5), 0)

    def test_the_sandbox_allows_every_system_call_it_makes(self):
        need("strace", "systemd-analyze")
        rig = self.rig()
        trace = rig.path("trace")
        command = rig.gateway_command
        rig.gateway_command = lambda *extra: ["strace", "-f", "-qq", "-e", "signal=none", "-o", trace, *command(*extra)]
        rig.start_gateway(wheels=False)
        with iwheel.Gateway(rig.path("gateway.sock"), timeout=3) as gateway:
            gateway.watch("state", "frame")
            gateway.status()
            with contextlib.suppress(iwheel.IWheelError):  # The traced gateway is slow, and may detect that it is late.
                gateway.arm()
            gateway.estop()
        tracer = rig.gateway.child.pid
        with open(f"/proc/{tracer}/task/{tracer}/children", encoding="ascii") as file:
            os.kill(int(file.read().split()[0]), signal.SIGTERM)
        self.assertEqual(rig.gateway.wait(15), 0)
        made = set(re.findall(r"(?m)^\d+ +(?:<\.\.\. )?([a-z_0-9]+)[( ]", Path(trace).read_text(encoding="utf-8", errors="replace")))
        self.assertTrue({"epoll_wait", "epoll_pwait2"} & made, made)
        made -= {"execve", "exit_group"}  # Called before the filter is installed, and always allowed.
        self.assertEqual(made - self.allowed(), set())

    def allowed(self):
        def members(name):
            lines = subprocess.check_output(["systemd-analyze", "syscall-filter", name], text=True).splitlines()[1:]
            words = [line.strip() for line in lines if not line.strip().startswith("#")]
            return set().union(*(members(word) if word.startswith("@") else {word} for word in words if word), set())

        allowed = set()
        for line in values("iwheel-gateway.service", "SystemCallFilter"):
            sets = set().union(*(members(word) if word.startswith("@") else {word} for word in line.lstrip("~").split()))
            allowed = allowed - sets if line.startswith("~") else allowed | sets
        self.assertGreater(len(allowed), 100)
        return allowed

    def test_upgrade_while_a_client_drives_never_moves_a_wheel(self):
        rig = self.rig()
        rig.start_gateway()
        with iwheel.Gateway(rig.path("gateway.sock"), wait=10) as gateway:
            wheels = gateway.arm("client that goes on")
            wheels.drive_for(0.6, 300, 300)
            rig.gateway.signal(signal.SIGTERM)  # As the package manager does ...
            stopped_us = now_us()
            with self.assertRaises(iwheel.IWheelError):
                wheels.drive_for(5, 300, 300)
            self.assertEqual(rig.gateway.wait(15), 0)
            ended_us = now_us()
            rig.start_gateway()  # ... with the new version.
            for _ in range(20):
                with self.assertRaises(iwheel.IWheelError):
                    wheels.drive(300, 300)
                time.sleep(0.05)
            self.assertEqual(gateway.status()["state"], "listening")
        nonzero = [t for t, _, speed in rig.bus.setpoints() if speed != 0]
        self.assertTrue(nonzero and nonzero[-1] < stopped_us + 600_000, "it continued to drive, or never drove")
        zeros = [t for t, _, speed in rig.bus.setpoints(nonzero[-1]) if speed == 0]
        self.assertGreater(zeros[-1] - nonzero[-1], 1_000_000, "no zeros stopped the wheels, only their own watchdog")
        hold(not rig.bus.setpoints(ended_us), "the new version sent something unasked")


class Rights(unittest.TestCase):
    """Users outside the socket's group can neither watch nor drive nor stop; members can do all three."""

    def setUp(self):
        if os.geteuid() != 0:
            self.skipTest("needs root to change the user")
        self.rig = Rig(build, {**SLOW, "northbound": {"mode": "0660", "group": "daemon"}})
        self.addCleanup(self.rig.close)
        os.chmod(self.rig.folder, 0o755)
        self.rig.start_gateway()
        self.socket = self.rig.path("gateway.sock")

    def as_user(self, groups, action):
        """The result of the action in a process of that user: "ok" or the error's class."""
        reading, writing = os.pipe()
        child = os.fork()
        if child == 0:
            try:
                os.setgroups(groups)
                os.setgid(STRANGER)
                os.setuid(STRANGER)
                action()
                os.write(writing, b"ok")
            except Exception as error:  # noqa: BLE001
                os.write(writing, type(error).__name__.encode())
            os._exit(0)
        os.close(writing)
        os.waitpid(child, 0)
        with open(reading, encoding="ascii") as pipe:
            return pipe.read()

    def drive(self):
        with iwheel.Gateway(self.socket).arm() as wheels:
            wheels.drive(50, 50)

    def watch(self):
        with iwheel.Gateway(self.socket) as gateway:
            gateway.watch("state")
            next(gateway.events(timeout=2))

    def stop(self):
        iwheel.Gateway(self.socket).estop()

    def test_strangers_can_do_nothing(self):
        for action in (self.watch, self.drive, self.stop):
            self.assertEqual(self.as_user([], action), "GatewayUnavailable")
        self.assertEqual(stat.S_IMODE(os.stat(self.socket).st_mode), 0o660)

    def test_members_can_watch_drive_and_stop(self):
        for action in (self.watch, self.drive, self.stop):
            self.assertEqual(self.as_user([1], action), "ok")

    def test_strangers_cannot_put_another_socket_in_its_place(self):
        self.assertEqual(self.as_user([], lambda: os.unlink(self.socket)), "PermissionError")
        self.assertEqual(self.as_user([], lambda: os.rename(self.socket, self.socket + "2")), "PermissionError")


FLOOD = """
import select, socket, sys
def watcher():
    one = socket.socket(socket.AF_UNIX)
    one.connect(sys.argv[1])
    one.sendall(b'{"cmd":"watch","topics":["state","force","frame"],"rate_hz":100}\\n')
    one.setblocking(False)
    return one
watchers = [watcher() for _ in range(int(sys.argv[2]))]
print("ready", flush=True)
lines = 8 * b'{"cmd":"status"}\\n{"cmd":"arm"}\\n{"cmd":"why"}\\n{"cmd":"reset"}\\n'
while True:
    for i, one in enumerate(watchers):
        try:
            one.recv(1 << 20)
            one.send(lines)
        except BlockingIOError:
            pass
        except OSError:  # The gateway closes a client that reads its replies too slowly.
            watchers[i] = watcher()
"""


class Watchers(Rights):
    """Members of the second socket's group may watch and stop. They can never drive, and they use no place of the drivers' socket."""

    GROUP = 4
    """A group with some name on every Debian (adm); group `daemon` (1) may drive."""

    def setUp(self):
        super().setUp()
        self.rig.gateway.end()
        name = grp.getgrgid(self.GROUP).gr_name
        self.rig.settings["northbound"].update(watch_socket=self.rig.path("watch/gateway.sock"), watch_group=name, max_watchers=64, max_clients=2)
        self.rig.write_config()
        self.rig.start_gateway()
        self.driving, self.socket = self.socket, self.rig.path("watch/gateway.sock")

    def test_members_can_watch_drive_and_stop(self):
        for action, answer in ((self.watch, "ok"), (self.drive, "Refused"), (self.stop, "ok")):
            self.assertEqual(self.as_user([self.GROUP], action), answer)
        self.socket = self.driving
        for action, answer in ((self.watch, "GatewayUnavailable"), (self.drive, "GatewayUnavailable"), (self.stop, "ok")):
            self.assertEqual(self.as_user([self.GROUP], action), answer)  # For the stop, the client uses the watch socket.

    def test_reset_refused_by_repeated_stops_names_the_stopping_user(self):
        self.assertEqual(self.as_user([self.GROUP], self.stop), "ok")
        with self.assertRaises(iwheel.Refused) as refusal:
            iwheel.Gateway(self.driving).reset()
        self.assertRegex(str(refusal.exception), f"user {STRANGER} .process [0-9]+")

    def test_iwheelctl_reports_by_which_socket_it_watches(self):
        done = subprocess.run(
            [self.rig.program("iwheelctl"), "--socket", self.socket, "drive", "50", "50", "--for", "100ms"], capture_output=True, text=True, check=False
        )
        self.assertIn(f"{self.socket} allows watch, stop and estop, but not drive", done.stderr)
        self.assertIn(f"clients that drive use {self.driving} and are in group daemon", done.stderr)
        self.assertNotEqual(done.returncode, 0)

    def test_request_flood_costs_the_driver_no_gap_and_no_slot(self):
        flood = subprocess.Popen([sys.executable, "-c", FLOOD, self.socket, "64"], stdout=subprocess.PIPE, text=True)
        self.addCleanup(flood.stdout.close)
        self.addCleanup(flood.wait)
        self.addCleanup(flood.kill)
        self.assertEqual(flood.stdout.readline(), "ready\n")
        with iwheel.Gateway(self.driving, timeout=3) as gateway, iwheel.Gateway(self.driving, timeout=3) as second:
            self.assertEqual(second.hello()["rights"], "drive")
            with gateway.arm() as wheels:
                begin_us = now_us()
                while now_us() < begin_us + 2_000_000:
                    wheels.drive(100, 100)
                    time.sleep(0.03)
        self.assertIsNone(flood.poll(), "the crowd must continue")
        moments = [t for t, side, _ in self.rig.bus.setpoints(begin_us) if t < begin_us + 2_000_000]
        gaps = [later - sooner for sooner, later in itertools.pairwise(moments)]
        self.assertLess(max(gaps), 100_000, "half of the time that the wheels' watchdog and the lease allow")
        self.assertGreater(len(moments), 150)


class Strangers(unittest.TestCase):
    """Another local user without any right: it can neither prevent the start of the gateway nor gain anything in its place."""

    def setUp(self):
        if os.geteuid() != 0:
            self.skipTest("needs root to change the user")
        self.rig = Rig(build, SLOW)
        self.addCleanup(self.rig.close)
        os.chmod(self.rig.folder, 0o755)

    def make_folder(self, name, mode, owner=0):
        path = self.rig.path(name)
        os.mkdir(path)
        os.chmod(path, mode)
        os.chown(path, owner, owner)
        return path

    def second(self):
        """Exit code and output of another gateway on the same bus, with its socket elsewhere."""
        os.makedirs(self.rig.path("elsewhere"), exist_ok=True)
        other = Process(self.rig.gateway_command("--socket", self.rig.path("elsewhere/gateway.sock")), self.rig.path("second.out"))
        self.rig.processes.append(other)
        return other.wait(5), other.text()

    def test_lock_names_held_by_stranger_prevent_no_restart(self):
        names = lock_names(self.rig.gateway_bus())
        self.rig.start_gateway()
        with iwheel.Gateway(self.rig.path("gateway.sock"), wait=10) as gateway:
            gateway.arm("client").drive_for(0.6, 300, 300)
            self.rig.kill_gateway(signal.SIGKILL)
            killed_us = now_us()
        stranger = self.rig.stranger("listening", names)
        self.rig.start_gateway(wheels=False)
        time.sleep(0.3)
        speeds = {speed for _, _, speed in self.rig.bus.setpoints(killed_us + 20_000)}
        hold(not any(speeds), f"the wheels are commanded to zero, and nothing else: {speeds}")
        self.assertEqual(speeds, {0})
        self.assertIn(f"process {stranger.child.pid} of user {STRANGER} holds @{names[0]}", self.rig.gateway.text())
        code, text = self.second()
        self.assertEqual(code, 69, text)

    def test_unsafe_folder_is_refused_with_the_fix(self):
        for mode, owner, word in ((0o777, 0, "chmod go-w"), (0o775, 0, "chmod go-w"), (0o755, STRANGER, "make the gateway's user its owner")):
            folder = self.make_folder(f"folder-{mode:o}-{owner}", mode, owner)
            command = self.rig.gateway_command("--socket", os.path.join(folder, "gateway.sock"))
            done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=5)
            self.assertEqual(done.returncode, 77, done.stderr)
            self.assertIn(word, done.stderr)

    def test_socket_in_folder_like_tmp_cannot_block_root(self):
        self.make_folder("shared", 0o1777)
        self.rig.socket_name = "shared/gateway.sock"
        path = self.rig.path(self.rig.socket_name)
        squat = BECOME_STRANGER + "s = socket.socket(socket.AF_UNIX); s.bind(sys.argv[1]); s.listen(); signal.pause()"
        stranger = Process([sys.executable, "-c", squat, path], self.rig.path("squat.out"))
        self.rig.processes.append(stranger)
        until(lambda: os.path.exists(path), 5)
        gateway = Process(self.rig.gateway_command(), self.rig.path("gateway.out"))
        self.rig.processes.append(gateway)
        until(lambda: os.path.exists(path) and os.stat(path).st_uid == 0, 5)
        self.assertIn("warning: socket", gateway.text())
        with iwheel.Gateway(path, wait=5) as gateway:
            self.assertEqual(gateway.status()["state"], "listening")

    def test_record_directory_unsafe_is_reported_and_stays_empty(self):
        for mode, owner, word in ((0o1777, 0, "chmod go-w"), (0o755, STRANGER, "make the gateway's user its owner")):
            folder = self.make_folder(f"records-{mode:o}", mode, owner)
            self.rig.settings["record"] = {"directory": folder}
            self.rig.write_config()
            self.rig.start_gateway()
            with iwheel.Gateway(self.rig.path("gateway.sock"), timeout=3) as gateway:
                until(lambda: gateway.status()["memory"]["state"] != "loading", 5)
                memory = gateway.status()["memory"]
            self.assertEqual(memory["state"], "failed")
            self.assertIn("put any file there", memory["reason"])
            self.rig.kill_gateway(signal.SIGTERM)
            self.assertIn(word, self.rig.gateway.text())
            self.assertIn("no recording can be written", self.rig.gateway.text())
            self.assertEqual(os.listdir(folder), [])
