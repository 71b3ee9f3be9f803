# SPDX-License-Identifier: MIT
"""Upgrades from the previous version to this one, and downgrades, with the Debian packages of both (packages.py), while a client drives.

The test runs in a disposable copy of this system (an overlay in its own mount namespace: this system does not change; needs root), with a service manager
that only stops and starts. Each sentence counts as a test.
"""

import contextlib
import ctypes
import hashlib
import json
import os
import re
import shutil
import signal
import subprocess
import tempfile
import time
from pathlib import Path

import pytest
import verdict
from bus import Bus, now_us
from packages import WANTED, Missing, of_both

CLONE_NEWNS = 0x00020000
CONF = "etc/iwheel/gateway.conf"
# The answer to dpkg's question about a configuration that both sides have changed; it is the default without an answer.
KEEP = ("--force-confdef", "--force-confold")
EDITED = """; Edited by the administrator.
[bus]
interface = unix:/run/wheels/bus
[wheels]
setpoint_type = 1
current_role = limit
track_mm = 540
[estop]
line = unix:/run/wheels/button
[drive]
lease_ms = 300
[limits]
echo_ms = 200
wheel_silent_ms = 200
"""
# The systemctl that the maintainer scripts call. It stops as systemd does, with SIGTERM, and starts as the unit requires; it does nothing else.
MANAGER = """#!/usr/bin/python3
import os, signal, subprocess, sys, time
with open("/run/wheels/asked", "a") as log: log.write(" ".join(sys.argv[1:]) + "\\n")
def pid():
    try: return int(open("/run/wheels/gateway.pid").read())
    except (OSError, ValueError): return 0
def active(): return pid() > 0 and os.path.exists(f"/proc/{pid()}/exe")
def start():
    unit = [line for folder in ("/usr/lib", "/lib") for path in [folder + "/systemd/system/iwheel-gateway.service"] if os.path.exists(path) for line in open(path)]
    command = next(line[10:].split() for line in unit if line.startswith("ExecStart="))
    child = subprocess.Popen(["setpriv", "--reuid", "iwheel", "--regid", "iwheel", "--init-groups", "--no-new-privs", *command],
                             stdin=subprocess.DEVNULL, stdout=open("/run/wheels/gateway.out", "a"), stderr=subprocess.STDOUT, umask=0o027, start_new_session=True,
                             preexec_fn=lambda: os.setpriority(os.PRIO_PROCESS, 0, -10))
    open("/run/wheels/gateway.pid", "w").write(str(child.pid))
verb = next((word for word in sys.argv[1:] if not word.startswith("-")), "")
if verb == "is-active": sys.exit(0 if active() else 3)
if verb == "try-restart" and not active(): sys.exit(0)
if verb in ("stop", "try-restart") and "iwheel-gateway.service" in sys.argv and active():
    os.kill(pid(), signal.SIGTERM)
    for _ in range(1500):
        if not active(): break
        time.sleep(0.01)
if verb == "start" or (verb == "try-restart" and "iwheel-gateway.service" in sys.argv): start()
"""
DRIVER = """import iwheel
with iwheel.Gateway("/run/iwheel/gateway.sock", wait=10) as gateway:
    gateway.arm("walker").drive_for(60, 300, 300)
"""
FINDINGS, JUDGED = verdict.Findings(), []  # Findings of this attempt, which is a separate process.


def judge(sentence, good, detail="", rule=False):
    """`rule`: a safety rule, which holds no matter how late the machine is."""
    JUDGED.append(sentence)
    if not good:
        FINDINGS.failures.append(verdict.Failure(f"{sentence}: {detail}", verdict.RULE if rule else verdict.kind_of(str(detail))))
    print(f"{'ok     ' if good else 'FAILED '} {sentence}")


# ---- the copy of this system ---------------------------------------------------------------------------------------


class Machine:
    """This system under an overlay. Its processes end with it."""

    def __init__(self):
        self.folder = Path(tempfile.mkdtemp(prefix="iwheel-upgrade-"))
        mount("-t", "tmpfs", "tmpfs", self.folder)
        upper, work, self.root = (self.folder / name for name in ("upper", "work", "root"))
        for folder in (upper, work, self.root):
            folder.mkdir()
        mount("-t", "overlay", "overlay", "-o", f"lowerdir=/,upperdir={upper},workdir={work}", self.root)
        for name in ("dev", "proc"):
            mount("--rbind", f"/{name}", self.root / name)
        mount("-t", "tmpfs", "tmpfs", self.root / "run")
        for name in ("run/wheels", "run/systemd/system", "tmp/packages"):
            (self.root / name).mkdir(parents=True)
        (self.root / "usr/sbin/policy-rc.d").unlink(missing_ok=True)
        (self.root / "var/lib/man-db/auto-update").unlink(missing_ok=True)  # dpkg would index all manual pages each time.
        systemctl = self.root / "usr/bin/systemctl"
        systemctl.unlink(missing_ok=True)
        systemctl.write_text(MANAGER)
        systemctl.chmod(0o755)
        (self.root / "tmp/driver.py").write_text(DRIVER)
        self.run("dpkg", "--purge", *(name.rstrip("_") for name in WANTED), "libiwheel-client-dev")

    def run(self, *command):
        """(status, its whole output)"""
        done = subprocess.run(self.inside(command), stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=600, env=self.environment(), check=False)
        return done.returncode, done.stdout + done.stderr

    def inside(self, command):
        return ["chroot", str(self.root), *map(str, command)]

    def environment(self):
        return {"PATH": "/usr/sbin:/usr/bin:/sbin:/bin", "LC_ALL": "C.UTF-8", "DEBIAN_FRONTEND": "noninteractive"}

    def start(self, *command):
        with open(self.root / "run/wheels/out", "ab") as out:
            return subprocess.Popen(
                self.inside(command),
                stdin=subprocess.DEVNULL,
                stdout=out,
                stderr=out,
                env=self.environment(),
                preexec_fn=lambda: os.setpriority(os.PRIO_PROCESS, 0, -10),
            )

    def install(self, packages, *options):
        names = []
        for package in packages:
            shutil.copy(package, self.root / "tmp/packages")
            names.append(f"/tmp/packages/{os.path.basename(package)}")
        return self.run("dpkg", *options, "-i", *names)

    def status(self, condition=lambda status: True, seconds=30.0):
        """The gateway's snapshot, once it fulfils the condition; the last one, or {}, after that time."""
        deadline, status = time.monotonic() + seconds, {}
        while time.monotonic() < deadline:
            code, output = self.run("iwheelctl", "--json", "status")
            status = json.loads(output.splitlines()[-1]) if code == 0 else {}
            if status and condition(status):
                break
            time.sleep(0.05)
        return status

    def ready(self):
        return self.status(lambda s: s["state"] == "listening" and s["left"]["at_rest"] and s["right"]["at_rest"] and s["memory"]["state"] not in ("loading",))

    def pid(self):
        try:
            return int((self.root / "run/wheels/gateway.pid").read_text())
        except (OSError, ValueError):
            return 0

    def alive(self):
        return os.path.exists(f"/proc/{self.pid()}/exe")

    def close(self):
        for name in ("asked", "gateway.out", "out"):
            path = self.root / "run/wheels" / name
            print(f"---- {name}", path.read_text()[-1500:] if path.exists() else "", sep="\n")
        mine = os.readlink("/proc/self/ns/mnt")
        for process in Path("/proc").glob("[0-9]*"):
            with contextlib.suppress(OSError):
                if process.name != str(os.getpid()) and os.readlink(process / "ns/mnt") == mine:
                    os.kill(int(process.name), signal.SIGKILL)
        subprocess.run(["umount", "--recursive", "--lazy", self.folder], check=False)
        self.folder.rmdir()


def mount(*arguments):
    done = subprocess.run(["mount", *map(str, arguments)], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        pytest.skip(f"mount {' '.join(map(str, arguments))}: {done.stderr.strip()}")


def sums(folder):
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in sorted(folder.iterdir()) if path.is_file()}


def recordings(machine):
    return {name: value for name, value in sums(machine.root / "var/lib/iwheel").items() if name.startswith("stop-")}


def owner(machine):
    """Numbers and names of the user and its groups."""
    return set(re.split(r"[ ,]|groups=", machine.run("id", "iwheel")[1].strip())) - {""}


def socket_rights(machine):
    return machine.run("stat", "-c", "%U:%G %a", "/run/iwheel/gateway.sock")[1].strip()


def item(status, name):
    entry = status.get("ledger", {}).get(name, {})
    return {key: entry.get(key) for key in ("state", "value")}


# ---- the checks ----------------------------------------------------------------------------------------------------


def drive(machine, bus):
    """Starts a client that drives until something ends it."""
    machine.ready()
    driver = machine.start("python3", "/tmp/driver.py")
    deadline = time.monotonic() + 60
    while not any(speed == 300 for _, _, speed in bus.setpoints(now_us() - 100_000)):
        if time.monotonic() > deadline:
            raise RuntimeError("no client drives: " + (machine.root / "run/wheels/out").read_text()[-500:])
        time.sleep(0.02)
    return driver


def stops_for_good(packages):
    """True for the packages of 0.1.0: debhelper stops the service before an upgrade and does not start it afterwards."""
    gateway = next(package for package in packages if "iwheel-gateway_" in package)
    return "deb-systemd-invoke stop" in subprocess.run(["dpkg-deb", "--info", gateway, "preinst"], capture_output=True, text=True, check=False).stdout


def change_in_motion(machine, bus, packages, version, way):
    driver = drive(machine, bus)
    begun_us = now_us()
    code, output = machine.install(packages, *KEEP)
    installed_us = now_us()
    judge(f"{way} while a client drives: the packages are installed", code == 0, output[-800:])
    judge(f"{way}: the client learns that it no longer drives", driver.wait(60) != 0, "it ended well")
    if stops_for_good(packages):
        judge(f"{way}: that version stops the running gateway and does not restart it: its own fault, documented in docs/user/deploy.md", not machine.alive())
        machine.run("systemctl", "start", "iwheel-gateway.service")
    status = machine.ready()
    judge(
        f"{way}: the running gateway is restarted with the other version",
        status.get("version") == version and status["state"] == "listening",
        (status.get("version"), output[-800:]),
    )
    nonzero = [t_us for t_us, _, speed in bus.setpoints(begun_us) if speed != 0]
    zeros = [t_us for t_us, _, speed in bus.setpoints(nonzero[-1]) if speed == 0] if nonzero else []
    judge(
        f"{way}: the wheels get zeros until they are at standstill, for more than a second",
        zeros and zeros[-1] - nonzero[-1] > 1_000_000,
        f"{len(nonzero)} setpoints, then {len(zeros)} zeros",
    )
    judge(
        f"{way}: no motion follows",
        not [t for t, _, speed in bus.setpoints(nonzero[-1] + 1) if speed != 0] and not bus.setpoints(installed_us + 2_500_000),
        rule=True,
    )
    return status


def killed_in_motion(machine, bus, packages, way):
    """A gateway is killed while it drives, and the packages are changed before it is started again."""
    driver = drive(machine, bus)
    os.kill(machine.pid(), signal.SIGKILL)
    driver.wait(60)
    code, output = machine.install(packages, *KEEP)
    begun_us = now_us()
    machine.run("systemctl", "start", "iwheel-gateway.service")
    machine.ready()
    speeds = [speed for _, _, speed in bus.setpoints(begun_us)]
    judge(f"{way} after a crash in motion: the other version sends only zeros", not any(speeds), set(speeds), rule=True)
    judge(
        f"{way} after a crash in motion: it begins with zeros",
        code == 0 and len(speeds) > 50,
        f"{len(speeds)} setpoints, {set(speeds)}; {output[-300:] if code else ''}",
    )


def check_preserved(machine, way, before):
    status = machine.ready()
    judge(f"{way}: the edited configuration is unchanged", (machine.root / CONF).read_text() == EDITED)
    judge(f"{way}: user and group are the same, and the user is still in every group", before["owner"] <= owner(machine), owner(machine))
    judge(f"{way}: the socket has the same owner, group and mode", socket_rights(machine) == before["socket"], socket_rights(machine))
    now = recordings(machine)
    judge(f"{way}: every recording is there, byte for byte", before["recordings"].items() <= now.items() and before["recordings"], sorted(now))
    judge(
        f"{way}: learned values are preserved",
        status.get("memory", {}).get("state") == "kept" and item(status, "setpoint_type") == before["item"],
        (status.get("memory"), item(status, "setpoint_type")),
    )
    listed = machine.run("iwheelctl", "why", "--list")[1]
    judge(f"{way}: the recorded stop is listed", "software e-stop" in listed, listed[-600:])


def facts(machine):
    status = machine.ready()
    return {"owner": owner(machine), "socket": socket_rights(machine), "recordings": recordings(machine), "item": item(status, "setpoint_type")}


def live_some(machine):
    """Confirms an assumption and makes a stop that is recorded."""
    machine.ready()
    code, output = machine.run("iwheelctl", "confirm", "setpoint_type", "1")
    judge("before: an assumption is confirmed", code == 0, output)
    machine.run("iwheelctl", "drive", "200", "200", "--for", "500ms")
    machine.run("iwheelctl", "estop")
    deadline = time.monotonic() + 15
    while len(recordings(machine)) < 3 and time.monotonic() < deadline:
        time.sleep(0.1)
    machine.status(lambda s: s["left"]["at_rest"] and s["right"]["at_rest"])
    time.sleep(3)  # The recording ends two seconds after its stop, and wheels at standstill permit the reset.
    machine.run("iwheelctl", "reset")
    status = machine.ready()
    judge(
        "before: a stop is recorded, and the assumption store is on disk",
        len(recordings(machine)) >= 3 and status.get("memory", {}).get("state") in ("new", "kept"),
        (sorted(recordings(machine)), status.get("memory")),
    )


def talk_across(machine, tool, words):
    """Uses the tool of the other version with the running gateway."""
    code, output = machine.run(tool, "--json", "status")
    judge(f"{words}: it shows the state", code == 0 and json.loads(output.splitlines()[-1])["state"] == "listening", output[-300:])
    code, output = machine.run(tool, "drive", "100", "100", "--for", "500ms")
    judge(f"{words}: it drives and stops", code == 0, output[-300:])


def keep_tool(machine, packages, name):
    package = next(package for package in packages if "iwheel-tools_" in package)
    subprocess.run(["dpkg-deb", "-x", package, machine.root / "opt" / name], check=True)
    return f"/opt/{name}/usr/bin/iwheelctl"


def other_default(packages, folder):
    """The same packages, with another default configuration."""
    gateway = next(package for package in packages if "iwheel-gateway_" in package)
    subprocess.run(["dpkg-deb", "-R", gateway, folder], check=True)
    with open(folder / CONF, "a", encoding="utf-8") as file:
        file.write("; A line that is new.\n")
    control = folder / "DEBIAN/control"
    control.write_text(re.sub(r"(?m)^(Version: .*)$", r"\1+new", control.read_text()))
    subprocess.run(["dpkg-deb", "--root-owner-group", "-b", folder, f"{folder}.deb"], check=True, capture_output=True)
    return f"{folder}.deb"


def refused_now(machine, old, new):
    """A configuration that the previous version accepts and this one refuses."""
    machine.install(old, *KEEP)
    (machine.root / CONF).write_text(EDITED + "rest_rpm = 20\nfollow_mm_s = 5000\n")
    machine.run("systemctl", "stop", "iwheel-gateway.service")
    machine.run("systemctl", "start", "iwheel-gateway.service")
    before = machine.ready().get("state")
    code, output = machine.install(new, *KEEP)
    words = ("warning: this version refuses /etc/iwheel/gateway.conf", "follow_mm_s = 5000", "write 50..500 mm/s", "systemctl restart iwheel-gateway.service")
    judge(
        "a configuration that is refused now: the upgrade warns, and names key and range",
        before == "listening" and code == 0 and all(word in output for word in words),
        (before, code, output[-1500:]),
    )
    judge("a configuration that is refused now: nothing is sent with it", not machine.alive(), output[-500:])
    (machine.root / CONF).write_text(EDITED)
    machine.run("systemctl", "start", "iwheel-gateway.service")
    code, output = machine.install(new, *KEEP)
    judge("a configuration that is accepted: the upgrade does not warn", code == 0 and "warning: " not in output, output[-500:])
    machine.install(old, *KEEP)


def track_is_missing(machine, old, new):
    """A configuration of the previous version, which had a default for the track: nothing moves with a guessed track."""
    (machine.root / CONF).write_text(EDITED.replace("track_mm = 540\n", ""))
    machine.run("systemctl", "start", "iwheel-gateway.service")
    before = machine.ready().get("state")
    code, output = machine.install(new, *KEEP)
    words = (
        "warning: /etc/iwheel/gateway.conf: track_mm not configured",
        "arm will be refused",
        "iwheelctl bringup",
        "systemctl restart iwheel-gateway.service",
    )
    judge(
        "a configuration without a track: the upgrade warns and names the fix",
        before == "listening" and code == 0 and all(word in output for word in words),
        (before, code, output[-1500:]),
    )
    judge("a configuration without a track: the gateway starts and listens", machine.ready().get("state") == "listening", output[-500:])
    code, output = machine.run("iwheelctl", "drive", "100", "100", "--for", "1s")
    judge(
        "a configuration without a track: arm is refused with the key and the command that measures it",
        code != 0 and "track_mm" in output and "iwheelctl bringup" in output,
        (code, output[-500:]),
    )
    (machine.root / CONF).write_text(EDITED)
    machine.install(old, *KEEP)


def conffiles(machine, old, new):
    machine.run("systemctl", "stop", "iwheel-gateway.service")
    packages = [name.rstrip("_") for name in WANTED]
    machine.run("dpkg", "--purge", *packages)
    judge("purged: the configuration is removed, the recordings stay", not (machine.root / CONF).exists() and recordings(machine))
    changed = other_default(new, machine.folder / "changed")
    machine.install(old)
    judge("a new installation does not start: it must be configured first", not machine.alive())
    code, output = machine.run("iwheel-gateway", "--print-config", "-c", "/etc/iwheel/gateway.conf")
    judge("the default configuration of the previous version is accepted", code == 0, output[-300:])
    code, output = machine.install([changed], "--force-depends")
    judge("an unedited configuration is replaced without a question", code == 0 and "A line that is new." in (machine.root / CONF).read_text(), output[-300:])
    machine.install(old, "--force-downgrade")
    (machine.root / CONF).write_text(EDITED)
    code, output = machine.install([changed], *KEEP)
    judge(
        "an edited configuration stays, and the new one is stored next to it",
        code == 0 and (machine.root / CONF).read_text() == EDITED and (machine.root / f"{CONF}.dpkg-dist").exists(),
        output[-300:],
    )


@pytest.fixture
def findings():
    return FINDINGS


@pytest.fixture
def machine():
    if os.geteuid() != 0:
        pytest.skip("only root can install packages, even in a copy of this system")
    if not any(line.split()[4] == "/" for line in Path("/proc/self/mountinfo").read_text().splitlines()):
        pytest.skip("the root folder is no mount point, as in a plain chroot, so its mounts cannot be separated; bind it first: mount --bind DIR DIR")
    for tool in ("systemd-sysusers", "setpriv"):
        if not shutil.which(tool):
            pytest.skip(f"{tool} is missing (scripts/install_tools check brings it)")
    assert ctypes.CDLL(None).unshare(CLONE_NEWNS) == 0
    mount("--make-rprivate", "/")
    one = Machine()
    yield one
    one.close()


@pytest.mark.limit(3600)
def test_upgrade(findings, machine, record_property):
    try:
        old, new = of_both()
    except Missing as why:
        pytest.skip(str(why))
    versions = [re.search(r"iwheel-gateway_([^_]+)_", " ".join(files))[1] for files in (old, new)]
    code, output = machine.install(old)
    judge(f"{versions[0]} is installed", code == 0, output[-800:])
    (machine.root / CONF).write_text(EDITED)
    machine.start("iwheel-sim", "--quiet", "--can", "unix:/run/wheels/bus", "--estop", "/run/wheels/button", "--control", "/run/wheels/control")
    while not (machine.root / "run/wheels/button").exists():
        time.sleep(0.05)
    machine.run("chmod", "-R", "a+rwX", "/run/wheels")
    bus = Bus(str(machine.root / "run/wheels/bus"))
    machine.run("systemctl", "start", "iwheel-gateway.service")
    live_some(machine)
    before = facts(machine)
    old_tool, new_tool = keep_tool(machine, old, "old"), keep_tool(machine, new, "new")
    talk_across(machine, new_tool, f"iwheelctl {versions[1]} with the gateway {versions[0]}")
    change_in_motion(machine, bus, new, versions[1], "upgrade")
    check_preserved(machine, "upgrade", before)
    replays = [machine.run("iwheelctl", "replay", f"/var/lib/iwheel/{name}") for name in before["recordings"] if name.endswith(".log")]
    same = bool(replays) and all(code == 0 for code, _ in replays)
    judge(
        "upgrade: the new version replays the old recordings, with the same decisions",
        same,
        (sorted(before["recordings"]), [output[-500:] for _, output in replays]),
    )
    talk_across(machine, old_tool, f"iwheelctl {versions[0]} with the gateway {versions[1]}")
    before = facts(machine)
    change_in_motion(machine, bus, old, versions[0], "downgrade")
    check_preserved(machine, "downgrade", before)
    killed_in_motion(machine, bus, new, "upgrade")
    killed_in_motion(machine, bus, old, "downgrade")
    refused_now(machine, old, new)
    track_is_missing(machine, old, new)
    bus.close()
    conffiles(machine, old, new)
    record_property("tests", len(JUDGED))
