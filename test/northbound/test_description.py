#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Compares docs/user/northbound.md, and the words and limits of the C sources, with share/northbound.json, the description of the protocol.

usage: test_description.py [unittest's arguments]

The gateway itself is compared with the description by python/tests/test_protocol.py.
"""

import json
import os
import re
import unittest

from described import ROOT, Description

# The sources of the words: file, function that contains them, and its other texts; or several of these.
SOURCES = {
    "error": ("lib/northbound/protocol/src/words.c", "iwn_error_name", {"ok"}),
    "topic": ("lib/northbound/protocol/src/words.c", "iwn_topic_name", set()),
    "state": ("lib/northbound/protocol/src/states.c", "iwn_state_name", set()),
    "cause": ("lib/northbound/protocol/src/states.c", "iwn_cause_name", {"none"}),
    "bus_state": ("lib/northbound/protocol/src/states.c", "iwn_bus_state_name", set()),
    "estop_state": ("lib/northbound/protocol/src/words.c", "iwn_estop_name", set()),
    "sides": ("lib/northbound/protocol/src/words.c", "iwn_sides_name", set()),
    "provenance": ("lib/northbound/protocol/src/words.c", "iwn_provenance_name", set()),
    "window": ("lib/northbound/protocol/src/words.c", "iwn_window_name", set()),
    "unit_evidence": ("lib/northbound/protocol/src/words.c", "iwn_unit_observation_name", set()),
    "force_validity": ("lib/northbound/protocol/src/words.c", "iwn_force_validity_name", set()),
    "ledger_item": ("lib/northbound/protocol/src/words.c", "iwn_assumption_item_name", set()),
    "ledger_state": ("lib/northbound/protocol/src/words.c", "iwn_assumption_state_name", set()),
    "evidence": ("lib/northbound/protocol/src/words.c", "iwn_source_name", set()),
    "timing": ("app/gateway/bus/bus_facts.c", "gw_bus_facts_timing", set()),
    "memory_state": ("app/gateway/assumptions/assumptions_json.c", "write_store", {"memory", "file", "state", "reason"}),
    "fault_alone": [
        ("lib/northbound/server/src/observe.c", "observe_faults", set()),
        ("lib/northbound/server/src/observe.c", "observe_rolling_fault", set()),
        ("app/gateway/answers/answers_events.c", "observe_health", set()),
    ],
}
DOCUMENT = os.path.join("docs", "user", "northbound.md")


def read(path):
    with open(os.path.join(ROOT, path), encoding="utf-8") as file:
        return file.read()


def section(text, heading):
    """The text under a heading, until the next heading of its level or above."""
    level = heading.split(" ")[0]
    match = re.search(rf"^{re.escape(heading)}\n(.*?)(?=^#{{1,{len(level)}}} |\Z)", text, re.MULTILINE | re.DOTALL)
    return match.group(1) if match else ""


def tokens(text):
    """Single words of the texts in backquotes."""
    return {word for quoted in re.findall(r"`([^`]+)`", text) for word in re.split(r"[\s,:.\[\]{}\"]+", quoted) if word}


def rows(text):
    """The cells of every row of the tables, without head and rule."""
    lines = [line for line in text.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if not re.match(r"\|[-|]+\|$", line)]


def examples(text):
    """The JSON values of the indented blocks."""
    decoder = json.JSONDecoder()
    for block in re.findall(r"(?:^    .*\n)+", text, re.MULTILINE):
        rest = " ".join(line.strip() for line in block.splitlines())
        while rest.startswith("{"):
            value, end = decoder.raw_decode(rest)
            yield value
            rest = rest[end:].strip()


class Document:
    """Compares docs/user/northbound.md with the description; yields each difference as a sentence."""

    def __init__(self, description):
        self.description = description
        self.text = read(DOCUMENT)

    def complaints(self):
        yield from self.requests()
        yield from self.limits()
        yield from self.events()
        yield from self.snapshot()
        yield from self.errors()
        yield from self.causes()

    def requests(self):
        text = section(self.text, "## Requests")
        sections = {}
        for heading in re.findall(r"^### .+$", text, re.MULTILINE):
            for cmd in heading[4:].split(", "):
                sections[cmd] = section(text, heading)
        yield from differences("requests", set(sections), set(self.description.requests))
        for cmd, part in sections.items():
            if cmd in self.description.requests:
                yield from self.request(cmd, part)

    def request(self, cmd, part):
        wanted = self.description.fields(self.description.requests[cmd])
        replied = self.description.reply(cmd)
        shown = tokens(part)
        for value in examples(part):
            body = {name: one for name, one in value.items() if name not in ("cmd", "id", "ok")}
            shown |= set(value)
            if "cmd" in value:
                yield from self.description.complaints(body, wanted, f"example of {cmd}")
            elif value["ok"]:
                yield from self.description.complaints(body, replied, f"example of a reply to {cmd}", complete=False)
            else:
                refusal = self.description.objects["refusal"]["fields"]
                yield from self.description.complaints(body, refusal, f"example of a refusal of {cmd}")
        yield from self.ranges(cmd, part)
        if cmd != "status":  # Its fields have separate tables.
            yield from (f"{DOCUMENT}: {cmd} does not mention {name}" for name in {**wanted, **replied} if name not in shown)

    def limits(self):
        """Limits of all requests and replies, before the first of them."""
        text = " ".join(self.text.split("## Requests")[0].split())
        limits = self.description.limits
        documented = {
            "request_bytes": f"A request has at most {limits['request_bytes']} bytes",
            "line_bytes": f"a reply or event at most {limits['line_bytes']}",
            "id_text_bytes": f"a string of up to {limits['id_text_bytes']} bytes",
            "depth": f"nested at most {limits['depth']} deep",
        }
        yield from (f"{DOCUMENT}: the limit {name} is not documented as {words!r}" for name, words in documented.items() if words not in text)

    def ranges(self, cmd, part):
        """Lengths, ranges and defaults of a request's fields."""
        text = " ".join(part.split())
        for name, field in self.description.fields(self.description.requests[cmd]).items():
            wanted = [f"up to {field['bytes']} bytes"] if "bytes" in field else []
            wanted += [f"{field['least']}..{field['most']}"] if "most" in field else []
            wanted += [f"default {field['default']}"] if "default" in field else []
            yield from (f"{DOCUMENT}: {name} of {cmd} is not documented as {words!r}" for words in wanted if words not in text)

    def events(self):
        text = section(self.text, "## Events")
        found = {}
        for topic, event, when, fields in rows(text)[1:]:
            found[event.strip("`")] = (topic, tokens(when + fields))
        yield from differences("events", set(found) | {"hello"}, set(self.description.events))
        for name, event in self.description.events.items():
            if name in found:
                yield from self.event(name, event, *found[name])
        for value in examples(text):
            name = value.pop("event")
            yield from self.description.complaints(value, self.description.event(name), f"example of {name}")

    def event(self, name, event, topic, shown):
        if topic != (event["topic"] or "any"):
            yield f"{DOCUMENT}: {name} has the topic {topic}, not {event['topic']}"
        known = {"rate_hz", *self.description.events, *self.description.requests}
        for key, field in self.description.event(name).items():
            nested = self.nested(field)
            known |= {key, *nested}
            if key in event["fields"]:
                yield from (f"{DOCUMENT}: event {name} lacks {word}" for word in sorted({key, *nested} - shown))
        yield from (f"{DOCUMENT}: event {name}: what is {word}?" for word in sorted(shown - known))

    def nested(self, field):
        """The words that a row of a table must name besides the field: fields of its object, or its words."""
        kind = field["type"] if isinstance(field["type"], str) else field["type"][-1]
        if kind in self.description.objects and kind != "wheel_status":
            inner = self.description.fields(self.description.objects[kind])
            return set(inner) | {word for one in inner.values() for word in self.words_in_place(one["type"])}
        return self.words_in_place(kind)

    def words_in_place(self, kind):
        """Words without a separate table."""
        described_elsewhere = ("cause", "error", "provenance", "force_validity", "side")
        return set(self.description.words[kind]) if kind in self.description.words and kind not in described_elsewhere else set()

    def snapshot(self):
        text = section(self.text, "## The snapshot")
        above, below = text.split("A wheel:", 1)
        for name, part in (("status", above), ("wheel_status", below)):
            fields = self.description.fields(self.description.objects[name])
            shown = {}
            for first, second in rows(part)[1:]:
                shown.update({word: tokens(second) for word in tokens(first)})
            yield from differences(name, set(shown), set(fields))
            for key, field in fields.items():
                missing = self.nested(field) - shown.get(key, set())
                yield from (f"{DOCUMENT}: {key} of {name} lacks {word}" for word in sorted(missing))
        shown = tokens(below)
        for kind in ("provenance", "force_validity"):
            yield from (f"{DOCUMENT}: {kind} lacks {word}" for word in self.description.words[kind] if word not in shown)

    def errors(self):
        documented = {name.strip("`"): means.replace("`", "") for name, means, _ in rows(section(self.text, "## Errors"))[1:]}
        yield from differences("errors", set(documented), set(self.description.words["error"]))
        for name, means in self.description.raw["errors"].items():
            if documented.get(name, means) != means:
                yield f"{DOCUMENT}: {name} is {documented[name]!r}, in share/northbound.json {means!r}"

    def causes(self):
        documented = {}
        for names, latches, _ in rows(section(self.text, "## Causes"))[1:]:
            documented.update(dict.fromkeys(tokens(names), latches))
        yield from differences("causes", set(documented), set(self.description.words["cause"]))
        for name, cause in self.description.raw["causes"].items():
            if documented.get(name, cause["latches"]) != cause["latches"]:
                yield f"{DOCUMENT}: {name} latches {documented[name]}, in share/northbound.json {cause['latches']}"


def differences(what, documented, wanted):
    yield from (f"{DOCUMENT}: {what}: {name} is not in share/northbound.json" for name in sorted(documented - wanted))
    yield from (f"{DOCUMENT}: {what}: {name} is missing" for name in sorted(wanted - documented))


def gateway_words(description):
    """Words that a C source has and the description does not, and the reverse."""
    for kind, sources in SOURCES.items():
        known, wanted = {}, set(description.words[kind])
        for path, function, others in sources if isinstance(sources, list) else [sources]:
            match = re.search(rf"^(?:const char \*|static void ){function}\(.*?^}}", read(path), re.MULTILINE | re.DOTALL)
            if match is None:
                yield f"{path}: {function} is missing; update SOURCES with the function that has the words of {kind}"
            known.update(dict.fromkeys(set(re.findall(r'"([^"]*)"', match[0] if match else "")) - others, path))
        yield from (f"share/northbound.json: {kind} lacks {word}, which {known[word]} has" for word in sorted(known.keys() - wanted))
        yield from (f"share/northbound.json: {kind} has {word}, which {path} has not" for word in sorted(wanted - known.keys()))


def c_limits(description):
    """Numbers and orders that a header has and the description does not, and the reverse."""
    path = "lib/northbound/protocol/include/iwheel_northbound/{}.h"
    limits, watch = description.limits, description.fields(description.requests["watch"])
    wanted = {
        "IWN_LINE_MAX": limits["request_bytes"],
        "IWN_ID_TEXT_MAX": limits["id_text_bytes"],
        "IWN_RATE_MAX_HZ": limits["granted_rate_hz"],
        "IWN_RATE_DEFAULT_HZ": watch["rate_hz"]["default"],
        "IWN_DEPTH_MAX": limits["depth"],
    }
    for name, number in wanted.items():
        header = path.format("json_in" if name == "IWN_DEPTH_MAX" else "request")
        found = re.search(rf"^#define {name} +(\d+)U?(?: +//.*)?$", read(header), re.MULTILINE)
        if found is None or int(found[1]) != number:
            yield f"{header}: {name} is {found and found[1]}, in share/northbound.json {number}"
    topics = [name.lower() for name in re.findall(r"^    IWN_TOPIC_(\w+)", read(path.format("words")), re.MULTILINE)]
    if topics != list(description.words["topic"]):
        yield f"{path.format('words')}: IWN_TOPIC_... are {topics}, in share/northbound.json {list(description.words['topic'])}"


class TestDescription(unittest.TestCase):
    def setUp(self):
        self.description = Description()

    def test_form_of_description_is_complete(self):
        self.assertEqual([*self.description.faults()], [])

    def test_document_requests_events_errors_agree(self):
        self.assertEqual([*Document(self.description).complaints()], [])

    def test_gateway_words_agree(self):
        self.assertEqual([*gateway_words(self.description)], [])

    def test_reader_limits_and_orders_agree(self):
        self.assertEqual([*c_limits(self.description)], [])


if __name__ == "__main__":
    unittest.main()
