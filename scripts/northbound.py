#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Keeps what is derived from share/northbound.json, the description of the northbound protocol, true to it.

usage: northbound.py --check     fail unless the Python client's types, the C reader's fields, docs/northbound.md, the words and limits agree with it
       northbound.py --update    write the Python client's types and the C reader's fields anew

The form of the description: `requests`, `events` and `objects` have `fields`, each with

    type       integer, boolean, text, a list of words (`words`, `error`, `cause`) or an object; a list of these: any of them
    list       true: an array of that type
    keys       an object that has each of these words as a key, and that type as value
    null       true: may be null, which means unknown
    optional   true: may be left out
    unit       of an integer whose name does not end in one of `units`
    least, most, default, bytes    of a field of a request

`extends` names an object whose fields come before. `reply` of a request and `topic` of an event say the rest. What is sent beside that is
`cmd` and `id` of a request, `id` and `ok` of a reply, `event` of an event. A refusal is the object `refusal`.

The gateway itself is compared with it by python/tests/test_protocol.py, through Description.complaints.
"""

import json
import keyword
import os
import re
import sys

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
TYPES = os.path.join("python", "src", "iwheel", "_protocol.py")
FIELDS = os.path.join("lib", "northbound", "protocol", "src", "request_fields.h")
DOCUMENT = os.path.join("docs", "northbound.md")
PLAIN = {"integer": "int", "boolean": "bool", "text": "str"}
FIELD_KEYS = {"type", "list", "keys", "null", "optional", "unit", "what", "least", "most", "default", "bytes"}
# Where the words are kept: the function whose texts they are, and what else is among them; or several of these.
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
    "memory_state": ("app/gateway/assumptions/assumptions_json.c", "write_memory", {"memory", "file", "state", "reason"}),
    "fault_alone": [("lib/northbound/server/src/observe.c", "observe_faults", set()), ("lib/northbound/server/src/observe.c", "observe_rolling_fault", set()),
                    ("app/gateway/answers/answers_events.c", "observe_health", set())],
}


def read(path):
    with open(os.path.join(ROOT, path), encoding="utf-8") as file:
        return file.read()


class Description:
    """The description, read and resolved."""

    def __init__(self):
        self.raw = json.loads(read(os.path.join("share", "northbound.json")))
        self.api, self.limits, self.units = self.raw["api"], self.raw["limits"], self.raw["units"]
        self.words = {**self.raw["words"], "error": self.raw["errors"], "cause": self.raw["causes"]}
        self.objects, self.requests, self.events = self.raw["objects"], self.raw["requests"], self.raw["events"]

    def fields(self, holder):
        """All fields of an object, request or event: its own and those it extends."""
        before = self.fields(self.objects[holder["extends"]]) if "extends" in holder else {}
        return {**before, **holder["fields"]}

    def reply(self, cmd):
        return self.fields(self.objects[self.requests[cmd]["reply"]])

    def event(self, name):
        return self.fields(self.events[name])

    def unit(self, name, field):
        """In words; None: it has none."""
        if "unit" in field:
            return field["unit"]
        ends = [end for end in self.units if name == end or name.endswith("_" + end)]
        return self.units[max(ends, key=len)] if ends and field["type"] == "integer" else None

    # What fits -------------------------------------------------------------------------------------------------------

    def complaints(self, value, fields, where, complete=True):
        """What about an object does not fit these fields, as sentences. `complete`: a field that is missing is one of them."""
        if not isinstance(value, dict):
            return [f"{where}: {value!r} is no object"]
        found = [f"{where}.{name} is not in share/northbound.json" for name in value if name not in fields]
        for name, field in fields.items():
            if name in value:
                found += self._field(value[name], field, f"{where}.{name}")
            elif complete and not field.get("optional"):
                found.append(f"{where}.{name} is in share/northbound.json, but is not sent")
        return found

    def _field(self, value, field, where):
        if value is None:
            return [] if field.get("null") else [f"{where} is null"]
        if field.get("list"):
            if not isinstance(value, list):
                return [f"{where}: {value!r} is no list"]
            return [text for one in value for text in self._one(one, field["type"], f"{where}[]")]
        if "keys" in field:
            keys = {key: {"type": field["type"]} for key in self.words[field["keys"]]}
            return self.complaints(value, keys, where)
        return self._one(value, field["type"], where)

    def _one(self, value, kind, where):
        if isinstance(kind, list):
            tried = [self._one(value, one, where) for one in kind]
            return [] if [] in tried else tried[0]
        if kind in self.objects:
            return self.complaints(value, self.fields(self.objects[kind]), where)
        if kind in self.words:
            return [] if value in self.words[kind] else [f"{where}: {value!r} is not among the words of {kind}"]
        fits = {"integer": type(value) is int, "boolean": type(value) is bool, "text": type(value) is str}[kind]
        return [] if fits else [f"{where}: {value!r} is no {kind}"]

    # Its own form ----------------------------------------------------------------------------------------------------

    def faults(self):
        """What is wrong with the description itself."""
        holders = [("objects", self.objects), ("requests", self.requests), ("events", self.events), ("serial", self.raw["serial"])]
        for group, members in holders:
            for member, holder in members.items():
                for name, field in holder["fields"].items():
                    yield from self._field_faults(f"{group}.{member}.{name}", name, field)
        for cmd, request in self.requests.items():
            if request["reply"] not in self.objects:
                yield f"requests.{cmd}: the reply {request['reply']} is no object"
        for name, event in self.events.items():
            if event["topic"] is not None and event["topic"] not in self.words["topic"]:
                yield f"events.{name}: {event['topic']} is no topic"

    def _field_faults(self, where, name, field):
        kinds = field["type"] if isinstance(field["type"], list) else [field["type"]]
        for key in set(field) - FIELD_KEYS:
            yield f"{where}: what is {key}?"
        for kind in kinds:
            if kind not in PLAIN and kind not in self.words and kind not in self.objects:
                yield f"{where}: {kind} is no type"
        if kinds == ["integer"] and self.unit(name, field) is None:
            yield f"{where}: an integer without a unit"


# The Python client's types -------------------------------------------------------------------------------------------

HEADER = '''# SPDX-License-Identifier: MIT
"""What the gateway answers, as types. Written by scripts/northbound.py from share/northbound.json; None means unknown."""

from __future__ import annotations

from typing import Literal, TypedDict
'''


def docstring(told):
    return '    """' + re.sub(r"\bnull\b", "None", told["what"]) + '"""'


def camel(name):
    return "".join(part.capitalize() for part in name.split("_"))


class Types:
    """Python's text of all that a reply can hold."""

    def __init__(self, description, replies):
        self.description = description
        self.blocks, self.done = [], set()
        for name in replies:
            self.define(name)

    def define(self, name):
        """After what it is made of."""
        if name in self.done or name in PLAIN:
            return
        self.done.add(name)
        if name in self.description.words:
            words = ", ".join(json.dumps(word) for word in self.description.words[name])
            line = f"{camel(name)} = Literal[{words}]"
            self.blocks.append(line if len(line) <= 120 else wrapped(name, self.description.words[name]))
        else:
            self.define_object(name)

    def define_object(self, name):
        holder = self.description.objects[name]
        for field in self.description.fields(holder).values():
            for kind in [*(field["type"] if isinstance(field["type"], list) else [field["type"]]), field.get("keys", "text")]:
                self.define(kind)
        base = camel(holder["extends"]) if "extends" in holder else "TypedDict"
        if "extends" in holder:
            self.define(holder["extends"])
        own = dict(holder["fields"])
        base = self.set_apart(name, base, "Named", {key: own.pop(key) for key in list(own) if keyword.iskeyword(key)})
        base = self.set_apart(name, base, "Partly", {key: own.pop(key) for key in list(own) if own[key].get("optional")})
        lines = [f"class {camel(name)}({base}):"]
        if holder.get("what"):
            lines += [docstring(holder), ""]
        for key, field in own.items():
            lines.append(f"    {key}: {self.type_of(field)}")
            if field.get("what"):
                lines.append(docstring(field))
        self.blocks.append("\n".join(lines))

    def set_apart(self, name, base, kind, fields):
        """A class cannot have keys that are Python's own words, nor some that may be missing. What the class extends then."""
        if not fields:
            return base
        assert base == "TypedDict", f"{name} extends something already"
        apart = f"_{camel(name)}{kind}"
        if kind == "Partly":
            self.blocks.append("\n".join([f"class {apart}(TypedDict, total=False):", *(f"    {key}: {self.type_of(field)}" for key, field in fields.items())]))
        else:
            pairs = ", ".join(f"{json.dumps(key)}: {self.type_of(field)}" for key, field in fields.items())
            self.blocks.append(f'{apart} = TypedDict("{apart}", {{{pairs}}})')
        return apart

    def type_of(self, field):
        kinds = field["type"] if isinstance(field["type"], list) else [field["type"]]
        names = [PLAIN.get(kind, camel(kind)) for kind in kinds]
        text = " | ".join(names)
        text = f"list[{text}]" if field.get("list") else text
        text = f"dict[{camel(field['keys'])}, {text}]" if "keys" in field else text
        return f"{text} | None" if field.get("null") else text


def wrapped(name, words):
    return "\n".join([f"{camel(name)} = Literal[", *(f"    {json.dumps(word)}," for word in words), "]"])


def python_types(description):
    replies = list(dict.fromkeys(request["reply"] for request in description.requests.values()))
    types = Types(description, [name for name in replies if name not in ("terms", "applied", "new_state")])
    limits = description.limits
    constants = f"API = {description.api}\nREQUEST_MAX = {limits['request_bytes']}\nLINE_MAX = {limits['line_bytes']}"
    body = "\n\n".join([constants, *types.blocks])
    # Two lines before and after a class, one elsewhere.
    body = re.sub(r"\n\n(?=class )", "\n\n\n", body)
    return HEADER + "\n" + re.sub(r"(\nclass [^\n]*\n(?:    [^\n]*\n|\n(?=    ))*)\n(?=[A-Z_])", r"\1\n\n", body) + "\n"


# The C reader's table ------------------------------------------------------------------------------------------------

FIELDS_HEADER = """// SPDX-License-Identifier: MIT
// The requests and their fields, beside cmd and id. Written by scripts/northbound.py from share/northbound.json.
#ifndef IWHEEL_NORTHBOUND_REQUEST_FIELDS_H
#define IWHEEL_NORTHBOUND_REQUEST_FIELDS_H

/// In the order of iwn_cmd_t.
"""
KINDS = {"text": "TEXT", "boolean": "FLAG", "topic": "TOPICS", "side": "SIDE", "ledger_item": "ITEM"}
MEMBERS = {"side": "sides", "recording.name": "file", "drive.key": "lease_key", "twist.key": "lease_key"}  # Of iwn_request_t, where it is called otherwise.


def c_kind(field):
    if field["type"] == ["text", "integer"]:
        return "VALUE"
    return ("RATE" if field.get("least") == 1 else "INTEGER") if field["type"] == "integer" else KINDS[field["type"]]


def c_macro(name, rows):
    """A macro of several lines, as clang-format sets them."""
    lines = [f"#define {name}", *(f"    {row}" for row in rows)]
    return "\n".join([*(f"{line:119}\\" for line in lines[:-1]), lines[-1]])


def c_fields(description):
    rows = {}
    for cmd in description.requests:
        for name, field in description.fields(description.requests[cmd]).items():
            required = "false" if field.get("optional") else "true"
            member = MEMBERS.get(f"{cmd}.{name}", MEMBERS.get(name, name))
            row = (name, member, c_kind(field), str(field.get("bytes", 0)), required)
            rows.setdefault(row, []).append(f"BIT({cmd.upper()})")
    fields = c_macro("IWN_REQUEST_FIELDS(ROW)", [f"ROW({', '.join(row)}, {' | '.join(bits)})" for row, bits in rows.items()])
    names = c_macro("IWN_REQUEST_NAMES(NAME)", [f"NAME({cmd})" for cmd in description.requests])
    told = "/// Name, member of iwn_request_t, kind, bytes of a text at most, whether it must be there, requests that have it.\n"
    return f"{FIELDS_HEADER}{names}\n\n{told}{fields}\n\n#endif\n"


# The documentation ---------------------------------------------------------------------------------------------------


def section(text, heading):
    """What stands under a heading, down to the next of its level or above."""
    level = heading.split(" ")[0]
    match = re.search(rf"^{re.escape(heading)}\n(.*?)(?=^#{{1,{len(level)}}} |\Z)", text, re.MULTILINE | re.DOTALL)
    return match.group(1) if match else ""


def tokens(text):
    """Single words out of what stands in backquotes."""
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
    """docs/northbound.md beside the description: what disagrees, as sentences."""

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
        if cmd != "status":  # Its fields have tables of their own.
            yield from (f"{DOCUMENT}: {cmd} does not speak of {name}" for name in {**wanted, **replied} if name not in shown)

    def limits(self):
        """Numbers that hold for all requests and replies, before the first of them."""
        text = " ".join(self.text.split("## Requests")[0].split())
        limits = self.description.limits
        told = {"request_bytes": f"A request has at most {limits['request_bytes']} bytes", "line_bytes": f"a reply or event at most {limits['line_bytes']}",
                "id_text_bytes": f"a string of up to {limits['id_text_bytes']} bytes", "depth": f"nested at most {limits['depth']} deep"}
        yield from (f"{DOCUMENT}: the limit {name} is not told as {words!r}" for name, words in told.items() if words not in text)

    def ranges(self, cmd, part):
        """Lengths, ranges and defaults of a request's fields."""
        text = " ".join(part.split())
        for name, field in self.description.fields(self.description.requests[cmd]).items():
            wanted = [f"up to {field['bytes']} bytes"] if "bytes" in field else []
            wanted += [f"{field['least']}..{field['most']}"] if "most" in field else []
            wanted += [f"default {field['default']}"] if "default" in field else []
            yield from (f"{DOCUMENT}: {name} of {cmd} is not told as {words!r}" for words in wanted if words not in text)

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
            yield f"{DOCUMENT}: {name} is of the topic {topic}, not of {event['topic']}"
        known = {"rate_hz", *self.description.events, *self.description.requests}
        for key, field in self.description.event(name).items():
            nested = self.nested(field)
            known |= {key, *nested}
            if key in event["fields"]:
                yield from (f"{DOCUMENT}: event {name} lacks {word}" for word in sorted({key, *nested} - shown))
        yield from (f"{DOCUMENT}: event {name}: what is {word}?" for word in sorted(shown - known))

    def nested(self, field):
        """What a row of a table must name beside the field: fields of its object, or its words."""
        kind = field["type"] if isinstance(field["type"], str) else field["type"][-1]
        if kind in self.description.objects and kind != "wheel_status":
            inner = self.description.fields(self.description.objects[kind])
            return set(inner) | {word for one in inner.values() for word in self.words_in_place(one["type"])}
        return self.words_in_place(kind)

    def words_in_place(self, kind):
        """Words that have no table of their own."""
        told_elsewhere = ("cause", "error", "provenance", "force_validity", "side")
        return set(self.description.words[kind]) if kind in self.description.words and kind not in told_elsewhere else set()

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
        told = {name.strip("`"): means.replace("`", "") for name, means, _ in rows(section(self.text, "## Errors"))[1:]}
        yield from differences("errors", set(told), set(self.description.words["error"]))
        for name, means in self.description.raw["errors"].items():
            if told.get(name, means) != means:
                yield f"{DOCUMENT}: {name} is {told[name]!r}, in share/northbound.json {means!r}"

    def causes(self):
        told = {}
        for names, latches, _ in rows(section(self.text, "## Causes"))[1:]:
            told.update(dict.fromkeys(tokens(names), latches))
        yield from differences("causes", set(told), set(self.description.words["cause"]))
        for name, cause in self.description.raw["causes"].items():
            if told.get(name, cause["latches"]) != cause["latches"]:
                yield f"{DOCUMENT}: {name} latches {told[name]}, in share/northbound.json {cause['latches']}"


def differences(what, told, wanted):
    yield from (f"{DOCUMENT}: {what}: {name} is not in share/northbound.json" for name in sorted(told - wanted))
    yield from (f"{DOCUMENT}: {what}: {name} is missing" for name in sorted(wanted - told))


# The gateway's words -------------------------------------------------------------------------------------------------


def gateway_words(description):
    """What words a source of ours knows and the description does not, or the other way round."""
    for kind, sources in SOURCES.items():
        known, wanted = {}, set(description.words[kind])
        for path, function, others in sources if isinstance(sources, list) else [sources]:
            match = re.search(rf"^(?:const char \*|static void ){function}\(.*?^}}", read(path), re.MULTILINE | re.DOTALL)
            if match is None:
                yield f"{path}: {function} is not there; scripts/northbound.py must know where the words of {kind} are now"
            known.update(dict.fromkeys(set(re.findall(r'"([^"]*)"', match[0] if match else "")) - others, path))
        yield from (f"share/northbound.json: {kind} lacks {word}, which {known[word]} has" for word in sorted(known.keys() - wanted))
        yield from (f"share/northbound.json: {kind} has {word}, which {path} has not" for word in sorted(wanted - known.keys()))


def c_limits(description):
    """Numbers and orders that a header has and the description does not, or the other way round."""
    path = "lib/northbound/protocol/include/iwheel_northbound/{}.h"
    limits, watch = description.limits, description.fields(description.requests["watch"])
    wanted = {"IWN_LINE_MAX": limits["request_bytes"], "IWN_ID_TEXT_MAX": limits["id_text_bytes"], "IWN_RATE_MAX_HZ": limits["granted_rate_hz"],
              "IWN_RATE_DEFAULT_HZ": watch["rate_hz"]["default"], "IWN_DEPTH_MAX": limits["depth"]}
    for name, number in wanted.items():
        header = path.format("json_in" if name == "IWN_DEPTH_MAX" else "request")
        found = re.search(rf"^#define {name} +(\d+)U?(?: +//.*)?$", read(header), re.MULTILINE)
        if found is None or int(found[1]) != number:
            yield f"{header}: {name} is {found and found[1]}, in share/northbound.json {number}"
    for header, prefix, words in (("request", "CMD", description.requests), ("words", "TOPIC", description.words["topic"])):
        found = [name.lower() for name in re.findall(rf"^    IWN_{prefix}_(\w+)", read(path.format(header)), re.MULTILINE)]
        if found != list(words):
            yield f"{path.format(header)}: IWN_{prefix}_... are {found}, in share/northbound.json {list(words)}"


def main(arguments):
    if arguments not in (["--check"], ["--update"]):
        print(__doc__.split("\n\n")[1], file=sys.stderr)
        return 64
    description = Description()
    found = list(description.faults())
    if not found:
        for path, text in ((TYPES, python_types(description)), (FIELDS, c_fields(description))):
            if arguments == ["--update"]:
                with open(os.path.join(ROOT, path), "w", encoding="utf-8") as file:
                    file.write(text)
            elif not os.path.exists(os.path.join(ROOT, path)) or read(path) != text:
                found.append(f"{path} is not what share/northbound.json makes of it; mend: scripts/northbound.py --update")
        found += [*gateway_words(description), *c_limits(description), *Document(description).complaints()]
    print("\n".join(found) or "the description of the northbound protocol, its documentation, types and words agree")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
