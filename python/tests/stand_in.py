# SPDX-License-Identifier: MIT
"""A stand-in for the gateway in the test's own event loop: it serves thousands of connections, arms and drives in seconds.

Its wheels stop immediately. It stores the requests of each connection, so that a test can judge the end of each permission to drive.
"""

import asyncio
import json
import random

ARMED = {"lease_ms": 200, "first_lease_ms": 1000, "stop_budget_ms": 900, "stop_budget_mm": 400, "warnings": []}
STANDSTILL = {"at_rest": True, "applied_mm_s": 0}
EVENT_S = 0.0005


class Client(asyncio.Protocol):
    """One connection. `asked`: (monotonic seconds, cmd) of each request."""

    def __init__(self, gateway):
        self.gateway = gateway
        self.number = len(gateway.clients) + 1
        self.asked = []
        self.open = False
        self.rest = b""
        gateway.clients.append(self)

    def connection_made(self, transport):
        self.transport, self.open = transport, True
        self.later(lambda: self.send({"event": "hello", "api": 1, "client": self.number}))

    def connection_lost(self, _):
        self.open = False

    def later(self, call):
        """Calls immediately, in the next round of the loop, or up to 1 ms later, so a reply meets a cancellation at every instant."""
        how = self.gateway.random.random()
        loop = asyncio.get_running_loop()
        if how < 0.3:
            call()
        elif how < 0.6:
            loop.call_soon(call)
        else:
            loop.call_later(how / 1000, call)

    def send(self, message):
        if self.open:
            self.transport.write(json.dumps(message).encode() + b"\n")

    def data_received(self, data):
        *lines, self.rest = (self.rest + data).split(b"\n")
        for line in lines:
            self.answer(json.loads(line))

    def answer(self, request):
        self.asked.append((asyncio.get_running_loop().time(), request["cmd"]))
        reply = {"id": request["id"], "ok": True, "state": "armed"}
        if request["cmd"] == "arm":
            reply.update(ARMED)
        elif request["cmd"] == "status":
            reply.update(t_us=1, left=STANDSTILL, right=STANDSTILL, lease={"holder": None})
        elif request["cmd"] == "drive":
            reply.update({key: request.get(key, 0) for key in ("left_mm_s", "right_mm_s", "left_mA", "right_mA")}, limited=False)
        elif request["cmd"] == "watch":
            reply.update(topics=request["topics"], rate_hz=20, limited=False)
            self.tick()
        if request["cmd"] in self.gateway.refused:
            reply = {"id": request["id"], "ok": False, "error": "latched", "message": "a test refuses it"}
        self.later(lambda: self.send(reply))

    def tick(self):
        if self.open:
            self.send({"event": "state", "state": "armed"})
            asyncio.get_running_loop().call_later(EVENT_S, self.tick)

    @property
    def may_drive(self):
        """True if armed since the last stop and still connected."""
        cmds = [cmd for _, cmd in self.asked]
        stops = max((n for n, cmd in enumerate(cmds) if cmd == "stop"), default=-1)
        return self.open and "arm" in cmds[stops + 1 :]

    def drove_since_stop(self):
        cmds = [cmd for _, cmd in self.asked if cmd in ("drive", "stop")]
        return bool(cmds) and cmds[-1] == "drive"

    def drives_since(self, t):
        return sum(cmd == "drive" and at > t for at, cmd in self.asked)


class StandIn:
    def __init__(self, seed, refused=()):
        self.random = random.Random(seed)
        self.clients = []
        self.refused = refused

    async def listen(self, path):
        self.server = await asyncio.get_running_loop().create_unix_server(lambda: Client(self), path)
        return self
