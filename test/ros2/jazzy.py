# SPDX-License-Identifier: MIT
"""A real ROS 2: rclpy of Jazzy or Kilted as ./check installs it, with ros2cli and rmw_cyclonedds_cpp if they are installed.

IWHEEL_ROS: its folder (default build/ros-jazzy; build/ros-kilted is Kilted). IWHEEL_ROS2CLI: a folder of Python modules with ros2cli and its commands; without it the
commands go through rclpy (typed.py). IWHEEL_RMW_CYCLONEDDS: librmw_cyclonedds_cpp.so of Jazzy; without it that vendor's tests are skipped.
"""

import json
import os
import shlex
import signal
import subprocess

from peer import LOOPBACK
from scenario import Skip

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.dirname(os.path.dirname(HERE))
PROFILE = os.path.join(ROOT, "share", "ros2", "fastdds-loopback.xml")
SHARE = "/usr/share/iwheel-ros2/"  # The path in the pages; in the tree it is share/ros2.
PROFILES = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")  # Fast DDS 2 (Jazzy) and 3 (Kilted).
CLI = "import sys; from ros2cli.cli import main; sys.exit(main())"


def compiled(t, name, sources, *options, newer=()):
    """The path of a C++ program in the build, compiled if a source or another file is newer."""
    program = os.path.join(os.path.abspath(t.build), name)
    if not os.path.exists(program) or os.path.getmtime(program) < max(map(os.path.getmtime, [*sources, *newer])):
        own = f"{program}.{os.getpid()}"  # Another scenario may compile it in parallel.
        done = subprocess.run(["c++", "-std=c++17", "-o", own, *sources, *options], capture_output=True, text=True, timeout=100, check=False)
        t.check(done.returncode == 0, f"it does not compile: {done.stderr[-800:]}")
        os.replace(own, program)
    return program


class Jazzy:
    def __init__(self, domain, vendor="fastrtps", profile=True):
        self.folder = os.path.abspath(os.environ.get("IWHEEL_ROS", os.path.join(ROOT, "build", "ros-jazzy")))
        release = os.path.basename(self.folder)
        self.python = os.path.join(self.folder, "bin", "python")
        if not os.path.exists(os.path.join(self.folder, "lib", "librmw_fastrtps_cpp.so")):
            raise Skip(
                f"no ROS 2 in {self.folder}: PYTHON=python3.11 scripts/python_packages build/{release} requirements/{release}.txt installs it in a minute"
            )
        dropped = ("PYTHONPATH", "CYCLONEDDS_URI", *PROFILES, "ROS_DOMAIN_ID")
        self.environment = {
            **{name: value for name, value in os.environ.items() if name not in dropped},
            "ROS_DOMAIN_ID": str(domain), "AMENT_PREFIX_PATH": self.folder, "LD_LIBRARY_PATH": os.path.join(self.folder, "lib"),
            "RMW_IMPLEMENTATION": f"rmw_{vendor}_cpp", "PYTHONUNBUFFERED": "1",
        }  # fmt: skip
        if profile:
            self.environment.update(dict.fromkeys(PROFILES, PROFILE))
        if vendor == "cyclonedds":
            library = os.environ.get("IWHEEL_RMW_CYCLONEDDS", "")
            if not os.path.exists(library):
                raise Skip("rmw_cyclonedds_cpp is in no package index: IWHEEL_RMW_CYCLONEDDS names its library")
            self.environment.update(LD_PRELOAD=library, CYCLONEDDS_URI=LOOPBACK)
        self.cli = os.environ.get("IWHEEL_ROS2CLI")

    def words(self, command):
        """The program to start for a command as a person types it."""
        typed = [word.replace(SHARE, os.path.join(ROOT, "share", "ros2") + "/") for word in shlex.split(command)]
        if typed[0] == "python3":
            return [self.python, *typed[1:]]
        return [self.python, *(("-c", CLI) if self.cli else (os.path.join(HERE, "typed.py"),)), *typed[1:]]

    def start(self, command, **environment):
        typed = {**self.environment, **environment, **({"PYTHONPATH": self.cli} if self.cli else {})}
        return subprocess.Popen(self.words(command), env=typed, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True)

    def type(self, command, seconds=20, **environment):
        """The output of the command; it is interrupted like by Ctrl-C if it has not ended in this time."""
        child = self.start(command, **environment)
        try:
            return child.communicate(timeout=seconds)[0]
        except subprocess.TimeoutExpired:
            return finish(child)

    def call(self, ride, *services):
        """The replies that jazzy_caller.py prints."""
        command = [self.python, os.path.join(HERE, "jazzy_caller.py"), *services]
        done = subprocess.run(command, env=self.environment, capture_output=True, text=True, timeout=60, check=False, cwd=ride.rig.folder)
        answers = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]
        return answers or [{"success": None, "message": done.stderr[-600:]}]


def finish(child):
    """Sends Ctrl-C; returns the output."""
    os.killpg(child.pid, signal.SIGINT)
    try:
        return child.communicate(timeout=5)[0]
    except subprocess.TimeoutExpired:
        os.killpg(child.pid, signal.SIGKILL)
        return child.communicate()[0]
