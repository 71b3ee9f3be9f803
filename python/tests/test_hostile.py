# SPDX-License-Identifier: MIT
"""Both clients with a peer that is no gateway, or a broken one."""

import asyncio
import json
import os
import resource
import shutil
import socket
import tempfile
import threading
import time
import unittest
from unittest import mock

import rig  # noqa: F401  This adds the path to the package.

from iwheel import AsyncGateway, Gateway, GatewayUnavailable, NoAnswer, ProtocolError, default_socket

HELLO = b'{"event":"hello","api":1,"client":1}\n'
NEWER = b'{"event":"hello","version":"9.1.0","api":2,"client":1}\n'
CLOCK = b'{"id":1,"ok":true,"t_us":1}\n'
"""Reply to the status that precedes an arm."""


class Impostor:
    """Accepts one connection after another and sends its answer after the first request of each; with `before`, sends that first."""

    def __init__(self, answer, close=False, hello=HELLO, before=b""):
        self.hello, self.before = hello, before
        self.folder = tempfile.TemporaryDirectory()
        self.path = os.path.join(self.folder.name, "socket")
        self.answer, self.close, self.received = answer, close, []
        self.listener = socket.socket(socket.AF_UNIX)
        self.listener.bind(self.path)
        self.listener.listen()
        self.connections = []
        threading.Thread(target=self.run, daemon=True).start()

    def run(self):
        while True:
            try:
                connection, _ = self.listener.accept()
            except OSError:
                return
            self.connections.append(connection)
            try:
                connection.sendall(self.hello)
                self.received.append(connection.recv(5000))
                if self.before:
                    connection.sendall(self.before)
                    self.received.append(connection.recv(5000))
                connection.sendall(self.answer)
            except OSError:
                pass
            if self.close:
                connection.close()

    def end(self):
        for connection in self.connections:
            connection.close()
        self.listener.close()
        self.folder.cleanup()


def as_stranger(call):
    """The text of the exception that the call raises in a child without root's rights."""
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            if os.geteuid() == 0:
                os.setgroups([])
                os.setgid(65534)
                os.setuid(65534)
            call()
        except Exception as error:  # noqa: BLE001
            os.write(writing, str(error).encode())
        os._exit(0)
    os.close(writing)
    os.waitpid(child, 0)
    with open(reading, encoding="utf-8") as pipe:
        return pipe.read()


def backlog():
    """A backlog: 900 snapshots, and among them events that must not be lost with them."""
    events = [{"event": "state", "number": number} for number in range(900)]
    events[100:100] = [{"event": "fault", "cause": "bus_down"}, {"event": "fault", "cause": "overspeed"}, {"event": "lost", "count": 40}]
    return b"".join(json.dumps(event).encode() + b"\n" for event in [{"id": 1, "ok": True}, *events])


class Slow(unittest.TestCase):
    """A client that reads slowly and wants the latest values."""

    def judge(self, events):
        states = [event["number"] for event in events if event["event"] == "state"]
        self.assertEqual(states, sorted(states))
        self.assertEqual(states[-1], 899)
        self.assertLess(len(states), 50)  # One per read.
        self.assertEqual({event["cause"] for event in events if event["event"] == "fault"}, {"bus_down", "overspeed"})
        self.assertEqual(sum(event["count"] for event in events if event["event"] == "lost"), 900 - len(states) + 40)

    def test_the_latest_values_and_how_many_were_left_out(self):
        impostor = Impostor(backlog())
        self.addCleanup(impostor.end)
        with Gateway(impostor.path) as gateway:
            gateway.watch("state")
            time.sleep(0.3)
            self.judge(list(gateway.events(timeout=0.2, latest=True)))

    def test_the_latest_values_with_asyncio(self):
        impostor = Impostor(backlog())
        self.addCleanup(impostor.end)

        async def story():
            async with AsyncGateway(impostor.path) as gateway:
                await gateway.watch("state")
                await asyncio.sleep(0.3)
                return [event async for event in gateway.events(timeout=0.2, latest=True)]

        self.judge(asyncio.run(story()))

    def test_the_end_of_the_connection_comes_after_the_latest_values(self):
        impostor = Impostor(backlog(), close=True)
        self.addCleanup(impostor.end)
        with Gateway(impostor.path) as gateway:
            gateway.watch("state")
            time.sleep(0.3)
            names = []
            for event in gateway.events(timeout=0.2, latest=True):
                names.append(event["event"])
                if "disconnected" in names:
                    break
        self.assertEqual([name for name in names if name != "lost"], ["fault", "fault", "state", "disconnected"])


class Hostile(unittest.TestCase):
    def both(self, answer, error, close=False, ask="status", hello=HELLO):
        impostor = Impostor(answer, close, hello)
        self.addCleanup(impostor.end)

        async def ask_async():
            async with AsyncGateway(impostor.path, timeout=0.2) as gateway:
                await getattr(gateway, ask)()

        with self.assertRaises(error) as first:
            asyncio.run(asyncio.wait_for(ask_async(), 5))
        with self.assertRaises(error) as second, Gateway(impostor.path, timeout=0.2) as gateway:
            getattr(gateway, ask)()
        self.assertEqual(str(first.exception), str(second.exception))
        return impostor, str(first.exception)

    def test_silence_is_no_answer(self):
        self.both(b"", NoAnswer)

    def test_no_answer_ends_the_connection_and_its_lease(self):
        for ask in (self.ask_blocking, self.ask_async):
            for cmd in ("arm", "reset"):
                impostor = Impostor(b"", before=CLOCK if cmd == "arm" else b"")
                self.addCleanup(impostor.end)
                ask(impostor, NoAnswer, cmd)

    def test_half_an_answer_is_no_answer(self):
        self.both(b'{"id":1,"ok":true', NoAnswer)

    def test_an_answer_to_something_else_is_no_answer(self):
        self.both(b'{"id":77,"ok":true}\n', NoAnswer)

    def test_peer_without_hello_is_no_answer_and_gets_no_request(self):
        impostor, text = self.both(b"", NoAnswer, hello=b"")
        self.assertIn("sent no greeting", text)
        self.wait_for_two(impostor)
        self.assertEqual(impostor.received, [b"", b""])

    def wait_for_two(self, impostor):
        deadline = time.monotonic() + 2
        while len(impostor.received) < 2 and time.monotonic() < deadline:
            time.sleep(0.01)

    def test_newer_protocol_in_hello_is_refused_before_any_request(self):
        for ask in ("status", "arm", "watch"):
            with self.subTest(ask):
                impostor, text = self.both(b"", ProtocolError, hello=NEWER, ask=ask)
                self.assertRegex(text, r"\(version 9\.1\.0\) has the northbound protocol 2, this .* supports it up to 1; install")
                self.wait_for_two(impostor)
                self.assertEqual(impostor.received, [b"", b""])

    def test_a_newer_protocol_is_not_waited_for(self):
        impostor = Impostor(b"", hello=NEWER)
        self.addCleanup(impostor.end)
        begin = time.monotonic()
        with self.assertRaises(ProtocolError):
            Gateway(impostor.path, wait=30).status()
        with self.assertRaises(ProtocolError):
            asyncio.run(AsyncGateway(impostor.path, wait=30).status())
        self.assertLess(time.monotonic() - begin, 5)

    def test_newer_protocol_still_gets_stop_and_estop(self):
        for ask in ("stop", "estop"):
            with self.subTest(ask):
                impostor = Impostor(b'{"id":1,"ok":true,"state":"stopping"}\n', hello=NEWER)
                self.addCleanup(impostor.end)
                with Gateway(impostor.path, timeout=0.5) as gateway:
                    self.assertEqual(getattr(gateway, ask)(), "stopping")
                    with self.assertRaises(ProtocolError):
                        gateway.status()
                self.assertEqual(json.loads(impostor.received[0])["cmd"], ask)

    def test_garbage_is_a_protocol_error(self):
        for answer in (b"SSH-2.0-x\r\n", b"[]\n", b'{"a":1}\n', b"\xff\xfe\n", b'{"ok":true,"event":"x"}\n', b"\n"):
            with self.subTest(answer):
                self.both(answer, ProtocolError)

    def test_json_without_end_of_depth_is_a_protocol_error(self):
        for answer in (b"[" * 60000 + b"\n", b'{"event":' * 7000 + b"\n"):
            self.both(answer, ProtocolError)

    def test_a_number_or_name_of_another_type_is_a_protocol_error(self):
        for answer in (b'{"id":[1],"ok":true}\n', b'{"id":{},"ok":true}\n', b'{"event":[]}\n', b'{"event":null}\n'):
            with self.subTest(answer):
                self.both(answer, ProtocolError)

    def test_a_lease_does_not_stay_after_a_reply_that_cannot_be_used(self):
        for answer in (b"[" * 60000 + b"\n", b'{"id":2,"ok":true}\n'):
            for ask in (self.ask_blocking, self.ask_async):
                with self.subTest(answer[:20], ask=ask.__name__):
                    impostor = Impostor(answer, before=CLOCK)
                    self.addCleanup(impostor.end)
                    ask(impostor)

    def ask_blocking(self, impostor, error=ProtocolError, cmd="arm"):
        with Gateway(impostor.path, timeout=0.2) as gateway:
            with self.assertRaises(error):
                getattr(gateway, cmd)()
            self.ended(impostor)

    def ask_async(self, impostor, error=ProtocolError, cmd="arm"):
        async def story():
            async with AsyncGateway(impostor.path, timeout=0.2) as gateway:
                with self.assertRaises(error):
                    await getattr(gateway, cmd)()
                self.ended(impostor)

        asyncio.run(story())

    def ended(self, impostor):
        impostor.connections[0].settimeout(1)
        self.assertEqual(impostor.connections[0].recv(100), b"", "the connection, and with it the lease, is still there")

    def test_a_program_with_2000_open_files_stops(self):
        soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
        if hard < 2100:
            self.skipTest("at most 2100 open files must be permitted")
        resource.setrlimit(resource.RLIMIT_NOFILE, (max(soft, 2100), hard))
        self.addCleanup(resource.setrlimit, resource.RLIMIT_NOFILE, (soft, hard))
        for _ in range(2000):
            self.addCleanup(os.close, os.open("/dev/null", os.O_RDONLY))
        for ask in ("stop", "estop", "reset"):
            impostor = Impostor(b'{"id":1,"ok":true,"state":"stopping"}\n')
            self.addCleanup(impostor.end)
            with Gateway(impostor.path) as gateway:
                self.assertEqual(getattr(gateway, ask)(), "stopping")

    def test_an_endless_line_is_a_protocol_error(self):
        self.both(b"x" * 70000, ProtocolError)

    def test_a_closed_connection_is_unavailable(self):
        self.both(b"", GatewayUnavailable, close=True)

    def test_too_many_clients_is_reported(self):
        answer = b'{"id":null,"ok":false,"error":"too_many_clients","message":"close another one"}\n'
        self.both(answer, GatewayUnavailable, close=True)

    def test_arm_is_never_asked_twice(self):
        impostor = Impostor(b"", close=True, before=CLOCK)
        self.addCleanup(impostor.end)
        with self.assertRaises(GatewayUnavailable):
            Gateway(impostor.path).arm()
        self.assertEqual([json.loads(line)["cmd"] for line in impostor.received], ["status", "arm"])

    def test_reset_is_never_asked_twice(self):
        impostor = Impostor(b"", close=True)
        self.addCleanup(impostor.end)
        with self.assertRaises(GatewayUnavailable):
            Gateway(impostor.path).reset()
        self.assertEqual([json.loads(line)["cmd"] for line in impostor.received], ["reset"])

    def test_status_without_time_is_no_reason_to_arm(self):
        impostor, text = self.both(b'{"id":1,"ok":true}\n', ProtocolError, ask="arm")
        self.assertIn("the reply to status has no t_us", text)
        self.assertEqual([json.loads(line)["cmd"] for line in impostor.received], ["status", "status"])

    def test_missing_gateway_and_missing_rights_name_the_fix(self):
        with self.assertRaisesRegex(GatewayUnavailable, "no gateway listens there; start it"):
            Gateway("/nonexistent/socket").status()
        impostor = Impostor(b"")
        self.addCleanup(impostor.end)
        os.chmod(impostor.path, 0)
        self.assertIn("this user may not use it; join its group", as_stranger(Gateway(impostor.path).status))

    def test_socket_of_the_environment_is_used(self):
        before = os.environ.get("IWHEEL_SOCKET")
        os.environ["IWHEEL_SOCKET"] = "/tmp/somewhere.sock"
        self.addCleanup(lambda: os.environ.pop("IWHEEL_SOCKET") if before is None else None)
        self.assertEqual(default_socket(), "/tmp/somewhere.sock")

    def test_two_sockets_of_gateway_the_permitted_one_is_chosen(self):
        folder = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, folder)
        os.chmod(folder, 0o755)
        os.mkdir(os.path.join(folder, "watch"), 0o755)
        drive, watch = os.path.join(folder, "can0.sock"), os.path.join(folder, "watch", "can0.sock")
        for path, mode in ((drive, 0o600), (watch, 0o666)):
            with socket.socket(socket.AF_UNIX) as one:
                one.bind(path)
            os.chmod(path, mode)
        with mock.patch("iwheel._wire.DEFAULT_FOLDER", folder), mock.patch.dict(os.environ):
            os.environ.pop("IWHEEL_SOCKET", None)
            self.assertEqual(default_socket(), drive)
            if os.geteuid() == 0:
                self.assertIn(watch, as_stranger(Gateway().status))
            os.unlink(drive)
            self.assertEqual(default_socket(), watch)

    def test_stop_does_not_disturb_requests_of_another_thread(self):
        impostor = Impostor(b'{"id":1,"ok":true,"state":"stopping"}\n')
        self.addCleanup(impostor.end)
        with Gateway(impostor.path, timeout=0.3) as gateway:
            gateway.status()
            stopping = threading.Thread(target=gateway.stop)
            stopping.start()
            time.sleep(0.1)
            gateway.status()  # This connection gives no second answer, so a stop through it would still wait.
            stopping.join()

    def test_stop_never_refused_next_to_other_gateways(self):
        folder = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, folder)
        with socket.socket(socket.AF_UNIX) as one:
            one.bind(os.path.join(folder, "a-killed.sock"))
        impostors = [Impostor(b"", hello=b"")] + [Impostor(b'{"id":1,"ok":true,"state":"latched"}\n') for _ in range(2)]
        for name, impostor in zip(("b-hung.sock", "c.sock", "d.sock"), impostors, strict=True):
            self.addCleanup(impostor.end)
            os.symlink(impostor.path, os.path.join(folder, name))
        with mock.patch("iwheel._wire.DEFAULT_FOLDER", folder), mock.patch.dict(os.environ):
            os.environ.pop("IWHEEL_SOCKET", None)
            with self.assertRaisesRegex(GatewayUnavailable, "several gateways run: b-hung.sock, c.sock, d.sock in"):
                Gateway().status()
            for stop in (Gateway(timeout=0.4).estop, lambda: asyncio.run(AsyncGateway(timeout=0.4).estop())):
                for impostor in impostors:
                    impostor.received.clear()
                states = []
                caller = threading.Thread(target=lambda stop=stop, states=states: states.append(stop()))
                caller.start()
                time.sleep(0.2)
                self.assertTrue(caller.is_alive(), "nothing hung")
                for impostor in impostors[1:]:
                    self.assertIn(b"estop", b"".join(impostor.received))
                caller.join()
                self.assertEqual(states, ["latched"])
            for name in ("b-hung.sock", "c.sock"):
                os.unlink(os.path.join(folder, name))
            self.assertEqual(default_socket(), os.path.join(folder, "d.sock"))


if __name__ == "__main__":
    unittest.main()
