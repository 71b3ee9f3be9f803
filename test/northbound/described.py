# SPDX-License-Identifier: MIT
"""share/northbound.json for tests: compares what a program sends, or a page shows, with the description of the protocol."""

import os
import sys

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
sys.path.insert(0, os.path.join(ROOT, "scripts"))
import northbound

FIELD_KEYS = {"type", "list", "keys", "null", "optional", "unit", "what", "least", "most", "default", "bytes"}


class Description(northbound.Description):
    """The description, with checks of its form and of its use."""

    def reply(self, cmd):
        return self.fields(self.objects[self.requests[cmd]["reply"]])

    def event(self, name):
        return self.fields(self.events[name])

    def unit(self, name, field):
        """The unit as text; None: the field has no unit."""
        if "unit" in field:
            return field["unit"]
        ends = [end for end in self.units if name == end or name.endswith("_" + end)]
        return self.units[max(ends, key=len)] if ends and field["type"] == "integer" else None

    def faults(self):
        """Mistakes of the description itself."""
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
            yield f"{where}: the key {key} is unknown"
        for kind in kinds:
            if kind not in northbound.PLAIN and kind not in self.words and kind not in self.objects:
                yield f"{where}: {kind} is no type"
        if kinds == ["integer"] and self.unit(name, field) is None:
            yield f"{where}: an integer without a unit"

    def complaints(self, value, fields, where, complete=True):
        """The differences between an object and these fields, as sentences. `complete`: a missing field is a difference."""
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
