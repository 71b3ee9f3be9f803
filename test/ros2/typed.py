# SPDX-License-Identifier: MIT
"""Run by ROS 2's own Python: carries out commands of `ros2` like ros2cli, through rclpy, if ros2cli itself is not installed.

usage: typed.py WORD...     the words after `ros2`; options of ros2cli that docs/user/ros2.md uses. The printed lines are those of ros2cli.
"""

import argparse
import importlib
import time

import rclpy
import yaml
from rclpy.duration import Duration
from rclpy.parameter_client import AsyncParameterClient
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

DISCOVERY_S = 2.0
WAIT_S = 8.0


def interface(name):
    package, kind, short = name.split("/")
    return getattr(importlib.import_module(f"{package}.{kind}"), short)


def fill(message, values):
    """The fields of a YAML mapping at any depth."""
    for name, value in (values or {}).items():
        if isinstance(value, dict):
            fill(getattr(message, name), value)
        else:
            setattr(message, name, type(getattr(message, name))(value))
    return message


def spin(node, seconds, until=lambda: False):
    end = time.monotonic() + seconds
    while time.monotonic() < end and not until():
        rclpy.spin_once(node, timeout_sec=0.05)
    return until()


def node_list(node, _):
    spin(node, DISCOVERY_S)
    for name, space in sorted(node.get_node_names_and_namespaces()):
        if name != node.get_name():
            print(space.rstrip("/") + "/" + name)


def node_info(node, options):
    spin(node, DISCOVERY_S)
    space, _, name = options.words[0].rpartition("/")
    for title, read in (
        ("Subscribers", node.get_subscriber_names_and_types_by_node),
        ("Publishers", node.get_publisher_names_and_types_by_node),
        ("Service Servers", node.get_service_names_and_types_by_node),
    ):
        print(f"  {title}:")
        for topic, types in read(name, space or "/"):
            print(f"    {topic}: {', '.join(types)}")


def topic_list(node, _):
    spin(node, DISCOVERY_S)
    for name, types in node.get_topic_names_and_types():
        print(f"{name} [{', '.join(types)}]")


def topic_info(node, options):
    spin(node, DISCOVERY_S)
    for found in node.get_publishers_info_by_topic(options.words[0]) + node.get_subscriptions_info_by_topic(options.words[0]):
        qos = found.qos_profile
        print(f"Node name: {found.node_name}\nTopic type: {found.topic_type}\nEndpoint type: {found.endpoint_type.name}")
        print(f"  Reliability: {qos.reliability.name}\n  Durability: {qos.durability.name}\n")


def await_type(node, topic):
    def types():
        return dict(node.get_topic_names_and_types()).get(topic)

    if not spin(node, WAIT_S, types):
        raise SystemExit(f"WARNING: topic [{topic}] does not appear to be published yet")
    if len(types()) > 1:
        raise SystemExit(f"Cannot echo topic '{topic}', as it contains more than one type: {types()}")
    return interface(types()[0])


def listen(node, options, react):
    """Subscribes with the QoS of the first publisher, as ros2cli does, or with the requested one."""
    topic = options.words[0]
    kind = await_type(node, topic)
    spin(node, WAIT_S, lambda: node.get_publishers_info_by_topic(topic))
    offered = node.get_publishers_info_by_topic(topic)[0].qos_profile
    durability = DurabilityPolicy[options.qos_durability.upper()] if options.qos_durability else offered.durability
    return node.create_subscription(kind, topic, react, QoSProfile(depth=10, durability=durability, reliability=ReliabilityPolicy.RELIABLE))


def topic_echo(node, options):
    came = []
    listen(node, options, came.append)
    if spin(node, WAIT_S, lambda: came):
        message = came[0]
        print(message.data if hasattr(message, "data") and isinstance(message.data, str) else message)
        print(f"data: {str(message.data).lower()}" if hasattr(message, "data") else "", "---", sep="\n")


def topic_hz(node, options):
    came = []
    listen(node, options, lambda _: came.append(time.monotonic()))
    spin(node, WAIT_S, lambda: len(came) > 60)
    if len(came) > 1:
        print(f"average rate: {(len(came) - 1) / (came[-1] - came[0]):.3f}")


def topic_pub(node, options):
    topic, kind, text = options.words
    publisher = node.create_publisher(interface(kind), topic, 10)
    message = fill(interface(kind)(), yaml.safe_load(text))
    print("publisher: beginning loop", flush=True)
    timer = node.create_timer(1.0 / options.rate, lambda: publisher.publish(message))
    while rclpy.ok():
        rclpy.spin_once(node)
    node.destroy_timer(timer)


def service_list(node, _):
    spin(node, DISCOVERY_S)
    for name, types in node.get_service_names_and_types():
        print(f"{name} [{', '.join(types)}]")


def service_call(node, options):
    kind = interface(options.words[1])
    client = node.create_client(kind, options.words[0])
    print("waiting for service to become available...", flush=True)
    if not client.wait_for_service(WAIT_S):
        raise SystemExit(1)
    begin_us = time.monotonic_ns() // 1000
    future = client.call_async(kind.Request())
    rclpy.spin_until_future_complete(node, future, timeout_sec=WAIT_S)
    print(f"requested at {begin_us} us\nresponse:\n{future.result()}")


def param_list(node, options):
    client = AsyncParameterClient(node, options.words[0])
    if not client.wait_for_services(timeout_sec=2.0):
        raise SystemExit(f"Wait for service timed out waiting for parameter services for node {options.words[0]}")


COMMANDS = {
    "node list": node_list, "node info": node_info, "topic list": topic_list, "topic info": topic_info, "topic echo": topic_echo, "topic hz": topic_hz,
    "topic pub": topic_pub, "service list": service_list, "service call": service_call, "param list": param_list,
}  # fmt: skip


def main():
    parser = argparse.ArgumentParser(prog="ros2")
    parser.add_argument("command", nargs=2)
    parser.add_argument("words", nargs="*")
    parser.add_argument("-r", "--rate", type=float, default=1.0)
    parser.add_argument("--qos-durability", default="")
    for flag in ("-t", "-v", "--once", "--no-daemon"):
        parser.add_argument(flag, action="store_true")
    options = parser.parse_intermixed_args()
    rclpy.init(args=[])
    node = rclpy.create_node("typed_by_a_user")
    node.get_clock().sleep_for(Duration(seconds=0.1))
    COMMANDS[" ".join(options.command)](node, options)


main()
