#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Generates files from share/northbound.json, the description of the northbound protocol.

usage: northbound.py --check     fail unless the Python client's types and the C parser's fields are up to date
       northbound.py --update    write them again

The form of the description: `requests`, `events` and `objects` have `fields`, each with

    type       integer, boolean, text, a list of words (`words`, `error`, `cause`) or an object; a list of these: any of them
    list       true: an array of that type
    keys       an object that has each of these words as a key, and that type as value
    null       true: may be null, which means unknown
    optional   true: may be left out
    unit       of an integer whose name does not end in one of `units`
    least, most, default, bytes    of a field of a request

`extends` names an object whose fields precede the own ones. `reply` names the object of a reply, `topic` the topic of an event. In addition each
request has `cmd` and `id`, each reply `id` and `ok`, each event `event`. A refusal is the object `refusal`.

test/northbound checks the form of the description, docs/user/northbound.md and the words of the C sources; python/tests/test_protocol.py checks the
gateway. No tool does it: JSON Schema has neither units nor words with a meaning, and datamodel-code-generator (PyPI), which writes TypedDicts from
it, writes no C.
"""

import json
import keyword
import os
import re
import sys

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
TYPES = os.path.join("python", "src", "iwheel", "_protocol.py")
FIELDS = os.path.join("lib", "northbound", "protocol", "include", "iwheel_northbound", "request_fields.h")
PLAIN = {"integer": "int", "boolean": "bool", "text": "str"}


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
        """Returns all fields of an object, request or event: its own and those that it extends."""
        before = self.fields(self.objects[holder["extends"]]) if "extends" in holder else {}
        return {**before, **holder["fields"]}


# The Python client's types -------------------------------------------------------------------------------------------

HEADER = '''# SPDX-License-Identifier: MIT
"""Types of the gateway's replies and events. Written by scripts/northbound.py from share/northbound.json; None means unknown."""

from __future__ import annotations

from typing import Literal, TypedDict
'''


def docstring(field):
    return '    """' + re.sub(r"\bnull\b", "None", field["what"]) + '"""'


def camel(name):
    return "".join(part.capitalize() for part in name.split("_"))


class Types:
    """The Python source of all types that a reply can contain."""

    def __init__(self, description, replies):
        self.description = description
        self.blocks, self.done = [], set()
        for name in replies:
            self.define(name)

    def define(self, name):
        """Adds the type after the types of its fields."""
        if name in self.done or name in PLAIN:
            return
        self.done.add(name)
        if name in self.description.words:
            words = ", ".join(json.dumps(word) for word in self.description.words[name])
            line = f"{camel(name)} = Literal[{words}]"
            self.blocks.append(line if len(line) <= 160 else wrapped(name, self.description.words[name]))
        else:
            self.define_object(name)

    def define_object(self, name):
        self.define_class(name, camel(name), self.description.objects[name])

    def define_event(self, name):
        """Adds the type of an event; its field `event` is its name, so that mypy knows the fields of the others."""
        self.define_class(f"{name}_event", f"{camel(name)}Event", self.description.events[name], event=name)

    def define_class(self, name, title, holder, event=None):
        for field in self.description.fields(holder).values():
            for kind in [*(field["type"] if isinstance(field["type"], list) else [field["type"]]), field.get("keys", "text")]:
                self.define(kind)
        base = camel(holder["extends"]) if "extends" in holder else "TypedDict"
        if "extends" in holder:
            self.define(holder["extends"])
        own = dict(holder["fields"])
        base = self.set_apart(name, base, "Named", {key: own.pop(key) for key in list(own) if keyword.iskeyword(key)})
        base = self.set_apart(name, base, "Partly", {key: own.pop(key) for key in list(own) if own[key].get("optional")})
        lines = [f"class {title}({base}):"]
        if event is not None:
            lines += [docstring({"what": f"The event `{event}`: {holder['what']}"}), ""]
        elif holder.get("what"):
            lines += [docstring(holder), ""]
        if event is not None:
            lines.append(f"    event: Literal[{json.dumps(event)}]")
        for key, field in own.items():
            lines.append(f"    {key}: {self.type_of(field)}")
            if field.get("what"):
                lines.append(docstring(field))
        self.blocks.append("\n".join(lines))

    def set_apart(self, name, base, kind, fields):
        """Adds a base class for keys that are keywords of Python, or that are optional, because a class cannot have them. Returns its name."""
        if not fields:
            return base
        assert base == "TypedDict", f"{name} already extends a type"
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
    for event in description.events:
        types.define_event(event)
    limits = description.limits
    constants = f"API = {description.api}\nREQUEST_MAX = {limits['request_bytes']}\nLINE_MAX = {limits['line_bytes']}"
    body = "\n\n".join([constants, *types.blocks])
    # Two lines before and after a class, one elsewhere.
    body = re.sub(r"\n\n(?=class )", "\n\n\n", body)
    return HEADER + "\n" + re.sub(r"(\nclass [^\n]*\n(?:    [^\n]*\n|\n(?=    ))*)\n(?=[A-Z_])", r"\1\n\n", body) + "\n"


# The table of the C parser -------------------------------------------------------------------------------------------

FIELDS_HEADER = """// SPDX-License-Identifier: MIT
/// @file
/// The requests and their fields, except cmd and id. Written by scripts/northbound.py from share/northbound.json.
#ifndef IWHEEL_NORTHBOUND_REQUEST_FIELDS_H
#define IWHEEL_NORTHBOUND_REQUEST_FIELDS_H

/// Each request as in iwn_cmd_t, and its name.
"""
KINDS = {"text": "TEXT", "boolean": "FLAG", "topic": "TOPICS", "side": "SIDE", "ledger_item": "ITEM"}
MEMBERS = {
    "side": "sides",
    "recording.name": "file",
    "drive.key": "lease_key",
    "twist.key": "lease_key",
}  # Members of iwn_request_t that have another name than the field.


def c_kind(field):
    if field["type"] == ["text", "integer"]:
        return "VALUE"
    return ("RATE" if field.get("least") == 1 else "INTEGER") if field["type"] == "integer" else KINDS[field["type"]]


def c_macro(name, rows):
    """Returns a macro of several lines in the form of clang-format."""
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
    names = c_macro("IWN_REQUEST_NAMES(NAME)", [f"NAME({cmd.upper()}, {cmd})" for cmd in description.requests])
    comment = "/// Name, member of iwn_request_t, kind, largest size of a text in bytes, required, requests with this field.\n"
    return f"{FIELDS_HEADER}{names}\n\n{comment}{fields}\n\n#endif\n"


def main(arguments):
    if arguments not in (["--check"], ["--update"]):
        print(__doc__.split("\n\n")[1], file=sys.stderr)
        return 64
    description, found = Description(), []
    for path, text in ((TYPES, python_types(description)), (FIELDS, c_fields(description))):
        if arguments == ["--update"]:
            with open(os.path.join(ROOT, path), "w", encoding="utf-8") as file:
                file.write(text)
        elif not os.path.exists(os.path.join(ROOT, path)) or read(path) != text:
            found.append(f"{path} does not match share/northbound.json; fix: scripts/northbound.py --update")
    print("\n".join(found) or "the Python client's types and the C parser's fields match share/northbound.json")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
