# SPDX-License-Identifier: MIT
"""Network interfaces, queueing disciplines and capabilities, with the programs that an administrator uses."""

import contextlib
import ctypes
import os
import socket
import subprocess

PR_CAPBSET_DROP = 24
CAP_NET_ADMIN = 12
IFF_UP, IFF_ECHO = 1, 1 << 18


def command(*words):
    """Runs it; raises RuntimeError with its output if it fails."""
    done = subprocess.run(words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
    if done.returncode != 0:
        raise RuntimeError(f"{' '.join(words)}: {done.stdout.strip()}")
    return done.stdout


def add_vcan(name):
    """Sets the interface up, with space for CAN FD frames. It uses one call, because each call needs long in such a kernel."""
    command("ip", "link", "add", name, "up", "mtu", "72", "type", "vcan")


def up(name):
    command("ip", "link", "set", name, "up")


def down(name):
    command("ip", "link", "set", name, "down")


def delete(name):
    command("ip", "link", "delete", name)


def exists(name):
    return name in [found for _, found in socket.if_nameindex()]


def fetch(name):
    """Moves the interface into this network: the interface of a terminal appears in the first network, and --native has one of its own."""
    if not exists(name):
        command("nsenter", "--net=/proc/1/ns/net", "ip", "link", "set", name, "netns", str(os.getpid()))


def flags(name):
    with open(f"/sys/class/net/{name}/flags", encoding="ascii") as file:
        return int(file.read(), 16)


def discipline(name, *words):
    """Replaces the root queueing discipline; without arguments, restores the default."""
    if words:
        command("tc", "qdisc", "replace", "dev", name, "root", *words)
    else:
        subprocess.run(["tc", "qdisc", "delete", "dev", name, "root"], stderr=subprocess.DEVNULL, check=False)


def without_net_admin():
    """For the child between fork and exec: root, but without the right to change interfaces."""
    if ctypes.CDLL(None, use_errno=True).prctl(PR_CAPBSET_DROP, CAP_NET_ADMIN, 0, 0, 0) != 0:
        raise OSError(ctypes.get_errno(), "cannot drop CAP_NET_ADMIN")


def remove_all(names):
    for name in names:
        if exists(name):
            with contextlib.suppress(RuntimeError):  # slcan goes with its tty
                delete(name)
