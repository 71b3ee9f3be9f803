# SPDX-License-Identifier: MIT
"""Two machines for one scenario: separate network namespaces, joined by a cable. And RTPS packets, recorded and sent again."""

import ctypes
import json
import os
import re
import socket
import struct
import subprocess
import sys
import threading
import time

from scenario import Skip

HERE_ADDRESS, THERE_ADDRESS = "10.77.0.1", "10.77.0.2"
CLONE_NEWNET = 0x40000000
PACKET_OUTGOING, ETH_P_IP = 4, 0x0800
ACKNACK, INFO_TS, INFO_DST = 0x06, 0x09, 0x0E
NTP_FRACTION = 1 << 32

SENDER = """
import json, socket, sys, time
sys.path[:0] = sys.argv[3:]
from network import fresh
sender, begin = socket.socket(socket.AF_INET, socket.SOCK_DGRAM), time.monotonic()
for at_s, port, data in json.load(open(sys.argv[2])):
    time.sleep(max(0, begin + at_s - time.monotonic()))
    sender.sendto(fresh(bytes.fromhex(data), time.time()), (sys.argv[1], port))
"""


def leave_network():
    """Moves this thread, and its child processes, into a new network."""
    if ctypes.CDLL(None, use_errno=True).unshare(CLONE_NEWNET) != 0:
        raise OSError(ctypes.get_errno(), "unshare")


def ip(*words):
    subprocess.run(["ip", *words], check=True, capture_output=True, timeout=10)


class Cable:
    """Moves this scenario to the machine HERE_ADDRESS; `there` runs a command on THERE_ADDRESS."""

    def __init__(self, t):
        try:
            leave_network()
            self.other = subprocess.Popen(["sleep", "600"], preexec_fn=leave_network)
            ip("link", "set", "lo", "up")
            ip("link", "add", "cable0", "type", "veth", "peer", "name", "cable1", "netns", str(self.other.pid))
            ip("addr", "add", f"{HERE_ADDRESS}/24", "dev", "cable0")
            ip("link", "set", "cable0", "up")
            for words in (("addr", "add", f"{THERE_ADDRESS}/24", "dev", "cable1"), ("link", "set", "cable1", "up"), ("link", "set", "lo", "up")):
                subprocess.run(self.there("ip", *words), check=True, capture_output=True, timeout=10)
        except (OSError, subprocess.SubprocessError) as error:
            raise Skip(f"no network namespaces here ({error}); they need root, iproute2 and util-linux") from error
        t.check(self.carries(), "packets of the other machine arrive")

    def carries(self):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
            receiver.bind((HERE_ADDRESS, 0))
            receiver.settimeout(5)
            words = f"import socket; socket.socket(socket.AF_INET, socket.SOCK_DGRAM).sendto(b'x', ('{HERE_ADDRESS}', {receiver.getsockname()[1]}))"
            subprocess.run(self.there(sys.executable, "-c", words), check=True, timeout=10)
            return receiver.recv(1) == b"x"

    def there(self, *command):
        return ["nsenter", "-t", str(self.other.pid), "-n", *command]

    def close(self):
        self.other.kill()
        self.other.wait()


def ports_of(pid):
    """UDP ports at which this process receives for every address, from the kernel's table."""
    inodes = set()
    for fd in os.listdir(f"/proc/{pid}/fd"):
        try:
            inodes.update(re.findall(r"^socket:\[(\d+)\]$", os.readlink(f"/proc/{pid}/fd/{fd}")))
        except OSError:
            continue
    with open(f"/proc/{pid}/net/udp", encoding="ascii") as file:
        rows = [line.split() for line in file.readlines()[1:]]
    return sorted(int(row[1].split(":")[1], 16) for row in rows if row[9] in inodes and row[1].startswith("00000000:"))


class Tape(threading.Thread):
    """UDP packets on lo: (seconds since the first, port, bytes)."""

    def __init__(self):
        super().__init__(daemon=True)
        self.packets, self.quit = [], False
        self.socket = socket.socket(socket.AF_PACKET, socket.SOCK_DGRAM, socket.htons(ETH_P_IP))
        self.socket.bind(("lo", ETH_P_IP))
        self.socket.settimeout(0.05)
        self.start()

    def run(self):
        while not self.quit:
            try:
                data, address = self.socket.recvfrom(65535)
            except TimeoutError:
                continue
            if address[2] == PACKET_OUTGOING or data[9] != socket.IPPROTO_UDP:
                continue
            udp = data[(data[0] & 15) * 4 :]
            self.packets.append((time.monotonic(), struct.unpack(">H", udp[2:4])[0], udp[8:]))

    def stop(self):
        self.quit = True
        self.join(2)

    def of(self, prefix, ports):
        """The packets of this participant to these ports, without parts that belong to one conversation."""
        chosen = [(at, port, one_way(data)) for at, port, data in self.packets if port in ports and data[8:20] == prefix]
        return [(at - chosen[0][0], port, data.hex()) for at, port, data in chosen]


def submessages(data):
    """(kind, bytes) of each submessage of an RTPS message."""
    at = 20
    while at + 4 <= len(data):
        order = "<H" if data[at + 1] & 1 else ">H"
        length = struct.unpack_from(order, data, at + 2)[0]
        end = at + 4 + length if length else len(data)
        yield data[at], data[at:end]
        at = end


def one_way(data):
    """The packet without parts that need a receiver: it names no receiver and acknowledges nothing."""
    return data[:20] + b"".join(part for kind, part in submessages(data) if kind not in (ACKNACK, INFO_DST))


def timeless(packets):
    """The same packets without time stamps."""
    return [
        (at, port, (bytes.fromhex(data)[:20] + b"".join(part for kind, part in submessages(bytes.fromhex(data)) if kind != INFO_TS)).hex())
        for at, port, data in packets
    ]


def fresh(data, now):
    """The same packet with the current time in its stamps."""
    made = data[:20]
    for kind, part in submessages(data):
        if kind == INFO_TS and len(part) == 12:
            order = "<" if part[1] & 1 else ">"
            part = part[:4] + struct.pack(order + "II", int(now), int((now % 1) * NTP_FRACTION))
        made += part
    return made


def send_again(cable, packets, path, address):
    """Sends the packets from the other machine (`cable`), or from this one (None), with their original pauses."""
    with open(path, "w", encoding="utf-8") as file:
        json.dump(packets, file)
    command = [sys.executable, "-c", SENDER, address, path, os.path.dirname(os.path.abspath(__file__)), *sys.path]
    subprocess.run(cable.there(*command) if cable else command, check=True, timeout=60)
