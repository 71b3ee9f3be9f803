# SPDX-License-Identifier: MIT
"""Another participant of the DDS domain, with PyPI's cyclonedds: publishes, subscribes and calls services like a ROS 2 node.

Its types are made from ROS's own message definitions in PyPI's rosbags, so nothing here is copied from the bridge.
"""

import os
import time

LOOPBACK = """<CycloneDDS><Domain Id="any"><General><Interfaces><NetworkInterface name="lo" multicast="false"/></Interfaces>
<AllowMulticast>false</AllowMulticast></General><Discovery><ParticipantIndex>auto</ParticipantIndex>
<MaxAutoParticipantIndex>32</MaxAutoParticipantIndex><Peers><Peer address="localhost"/></Peers></Discovery></Domain></CycloneDDS>"""
os.environ["CYCLONEDDS_URI"] = LOOPBACK  # This must precede the import of cyclonedds.

from cyclonedds._clayer import ddspy_take
from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import make_idl_struct, types
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.interfaces import Nodetype

BASES = {
    "bool": bool, "byte": types.uint8, "char": types.uint8, "uint8": types.uint8, "int8": types.int8, "int32": types.int32,
    "uint32": types.uint32, "int64": types.int64, "uint64": types.uint64, "float32": types.float32, "float64": types.float64,
    "string": str,
}  # fmt: skip
HEADER = "uint64 guid\nint64 seq\n"  # rmw_cyclonedds puts this before each request and reply.
ANY = 0x7F  # DDS_ANY_STATE.
SECONDS_MAX = 10


def store(release="JAZZY"):
    typestore = get_typestore(getattr(Stores, f"ROS2_{release}"))
    typestore.register(get_types_from_msg(HEADER + "uint8 structure_needs_at_least_one_member", "std_srvs/msg/TriggerRequest"))
    typestore.register(get_types_from_msg(HEADER + "bool success\nstring message", "std_srvs/msg/TriggerResponse"))
    return typestore


class Types:
    """DDS types by their ROS names, such as nav_msgs/msg/Odometry."""

    ODD = {"std_srvs/msg/TriggerRequest": "std_srvs::srv::dds_::Trigger_Request_", "std_srvs/msg/TriggerResponse": "std_srvs::srv::dds_::Trigger_Response_"}

    def __init__(self, typestore):
        self.store, self.made = typestore, {}

    def of(self, name):
        if name not in self.made:
            package, kind, short = name.split("/")
            fields = {field: self._field(node) for field, node in self.store.fielddefs[name][1]}
            typename = self.ODD.get(name, f"{package}::{kind}::dds_::{short}_")
            self.made[name] = make_idl_struct(short + "_", typename, fields)
        return self.made[name]

    def _field(self, node):
        kind, detail = node
        if kind == Nodetype.BASE:
            return BASES[detail[0]]
        if kind == Nodetype.NAME:
            return self.of(detail)
        inner = self._field(detail[0])
        return types.array[inner, detail[1]] if kind == Nodetype.ARRAY else types.sequence[inner]


def quality(depth=10, reliable=True, transient=False):
    """ROS's default QoS; `transient`: transient local."""
    return Qos(
        Policy.Reliability.Reliable(0) if reliable else Policy.Reliability.BestEffort,
        Policy.History.KeepLast(depth),
        Policy.Durability.TransientLocal if transient else Policy.Durability.Volatile,
        Policy.DataRepresentation(use_cdrv0_representation=True, use_xcdrv2_representation=False),
    )


class Reader:
    """Collects (bytes, message read by rosbags, time of reception in s)."""

    def __init__(self, peer, topic, name, **qos):
        self.peer, self.name, self.all = peer, name, []
        self.reader = DataReader(peer.participant, Topic(peer.participant, topic, peer.types.of(name)), quality(**qos))

    def take(self):
        """All messages since the last call."""
        taken = ddspy_take(self.reader._ref, ANY, 200)
        now, fresh = time.monotonic(), []
        for data, info in taken if isinstance(taken, list) else []:
            if info.valid_data:
                message = self.peer.store.deserialize_cdr(data, self.name)
                fresh.append((bytes(data), message, now))
        self.all += fresh
        return fresh

    def wait(self, wanted=lambda message: True, seconds=3.0):
        """The first message from now on that fulfils the condition; None after that time."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            for _, message, _ in self.take():
                if wanted(message):
                    return message
            time.sleep(0.002)
        return None

    def matched(self):
        return len(self.reader.get_matched_publications())


class Writer:
    def __init__(self, peer, topic, name, **qos):
        self.type = peer.types.of(name)
        self.writer = DataWriter(peer.participant, Topic(peer.participant, topic, self.type), quality(**qos))

    @classmethod
    def of(cls, peer, topic, **qos):
        """Another writer of a topic."""
        made = cls.__new__(cls)
        made.writer = DataWriter(peer.participant, topic, quality(**qos))
        return made

    def write(self, message, at_ns=None):
        self.writer.write(message, at_ns)

    def await_match(self, seconds=SECONDS_MAX):
        end = time.monotonic() + seconds
        while not self.writer.get_matched_subscriptions():
            if time.monotonic() > end:
                raise TimeoutError("this topic has no reader")
            time.sleep(0.005)


class Peer:
    def __init__(self, domain, space="", release="JAZZY"):
        self.participant = DomainParticipant(domain)
        self.space = f"/{space}" if space else ""
        self.store = store(release)
        self.types = Types(self.store)
        self.numbers = 0
        self.clients = {}

    def topic(self, name, prefix="rt"):
        """`/tf` is outside of the namespace, `odom` within."""
        return prefix + (name if name.startswith("/") else f"{self.space}/{name}")

    def reader(self, name, kind, **qos):
        return Reader(self, self.topic(name), kind, **qos)

    def writer(self, name, kind, **qos):
        return Writer(self, self.topic(name), kind, **qos)

    def make(self, kind, **fields):
        return self.types.of(kind)(**fields)

    def twist(self, v=0.0, yaw=0.0):
        vector = self.types.of("geometry_msgs/msg/Vector3")
        return self.make("geometry_msgs/msg/Twist", linear=vector(float(v), 0.0, 0.0), angular=vector(0.0, 0.0, float(yaw)))

    def twist_stamped(self, v, stamp_ns):
        header = self.make("std_msgs/msg/Header", stamp=self.make("builtin_interfaces/msg/Time", sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9), frame_id="")
        return self.make("geometry_msgs/msg/TwistStamped", header=header, twist=self.twist(v))

    def client(self, service):
        if service not in self.clients:
            request = Writer(self, self.topic(service, "rq") + "Request", "std_srvs/msg/TriggerRequest")
            reply = Reader(self, self.topic(service, "rr") + "Reply", "std_srvs/msg/TriggerResponse")
            request.await_match()
            end = time.monotonic() + SECONDS_MAX
            while not reply.matched() and time.monotonic() < end:
                time.sleep(0.005)
            self.clients[service] = (request, reply)
        return self.clients[service]

    def call(self, service, seconds=3.0, at_ns=None):
        """(success, message) of a std_srvs/Trigger; None: no reply."""
        request, reply = self.client(service)
        self.numbers += 1
        number = self.numbers
        request.write(request.type(guid=0x1122334455667788, seq=number, structure_needs_at_least_one_member=0), at_ns)
        answer = reply.wait(lambda message: message.seq == number and message.guid == 0x1122334455667788, seconds)
        return (answer.success, answer.message) if answer else None
