# SPDX-License-Identifier: MIT
"""share/northbound.json for tests: whether what a program sends, or a page shows, fits the description of the protocol."""
import os
import sys

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
sys.path.insert(0, os.path.join(ROOT, "scripts"))
import northbound


class Description(northbound.Description):
    """The description, with a judge."""

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
