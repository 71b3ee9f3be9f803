#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Compares a bill of materials with the files: checksums, Depends, linked libraries, linked archives, and the origin of each file of
the web page. It also fails unless this test notices each entry that is missing, changed or superfluous.

usage: judge_bill.py FOLDER     with the bill of scripts/sbom.py
"""

import copy
import functools
import json
import subprocess
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent.parent / "scripts"))
from sbom import PAGE, facts, target

NEEDS = ("DYNAMIC_LINK", "DEPENDS_ON", "STATIC_LINK", "CONTAINS")


@functools.cache
def at_least(version, relation, least):
    """True if that version fulfils the relation of a Depends."""
    how = {">=": "ge", "=": "eq", ">>": "gt", "<=": "le", "<<": "lt"}[relation]
    return version != "NOASSERTION" and subprocess.run(["dpkg", "--compare-versions", version, how, least], check=False).returncode == 0


def judge_needs(file, fact, listed, packages):
    """Differences between the file and the needs that the document lists: {kind: names}. dpkg-shlibdeps wrote its Depends, not this program."""
    named = listed["DYNAMIC_LINK"] | listed["DEPENDS_ON"]
    wrong = [f"{file} depends on {name}, which is not listed" for name in sorted(set(fact["depends"]) - named)]
    wrong += [f"{file} is listed with {name}, on which it does not depend" for name in sorted(named - set(fact["depends"]))]
    for kind, key in (("DYNAMIC_LINK", "libraries"), ("STATIC_LINK", "archives")):
        wrong += [f"{file}: {kind} {name}: listed or true, not both" for name in sorted(listed[kind] ^ fact[key])]
    for name, least in fact["depends"].items():
        version = packages.get(name, {}).get("versionInfo", "NOASSERTION")
        if name in fact["libraries"] and least and not at_least(version, *least):
            wrong.append(f"{file} depends on {name} {' '.join(least)}, and {version} is listed")
    comments = " ".join(packages[name].get("comment", "") for name in listed["CONTAINS"] if name in packages)
    wrong += [f"{file}: {PAGE}/{name} is neither this project's nor listed" for name, its_sum in fact["foreign"].items() if its_sum not in comments]
    return wrong + [f"{file} is listed as containing {name}" for name in listed["CONTAINS"] if not fact["foreign"]]


def judge(document, found):
    """The faults of the document."""
    packages = {entry["name"]: entry for entry in document["packages"]}
    names = {entry["SPDXID"]: entry["name"] for entry in document["packages"]}
    by_file = {entry.get("packageFileName"): entry for entry in document["packages"]}
    wrong = [f"{file} is not listed" for file in found if file not in by_file]
    wrong += [f"{file} is listed, but does not exist" for file in by_file if file and file not in found]
    ends = [(row["spdxElementId"], row["relationshipType"], row["relatedSpdxElement"]) for row in document["relationships"]]
    wrong += [f"{end} is not described" for one, _, other in ends for end in (one, other) if end not in names and end != "SPDXRef-DOCUMENT"]
    for file, fact in found.items():
        entry = by_file.get(file, {"SPDXID": None, "checksums": [{}]})
        mine = entry["SPDXID"]
        listed = {kind: {names.get(other, other) for one, its_kind, other in ends if one == mine and its_kind == kind} for kind in NEEDS}
        wrong += [] if entry["checksums"][0].get("checksumValue") == fact["checksum"] else [f"{file} has another checksum"]
        wrong += [] if ("SPDXRef-DOCUMENT", "DESCRIBES", mine) in ends else [f"{file} is not what the document describes"]
        wrong += (
            []
            if any(one in names and kind == "BUILD_TOOL_OF" and other == mine for one, kind, other in ends) or file.endswith(".whl")
            else [f"the builder of {file} is not listed"]
        )
        wrong += judge_needs(file, fact, listed, packages)
    return wrong


def unnoticed(document, found):
    """Yields the spoilt documents in which the judge finds no fault: each entry left out, each checksum changed, a superfluous entry."""
    for key in ("packages", "relationships"):
        for at, row in enumerate(document[key]):
            kind = row.get("relationshipType")
            tools = [
                other
                for other in document["relationships"]
                if other["relationshipType"] == kind == "BUILD_TOOL_OF" and other["relatedSpdxElement"] == row["relatedSpdxElement"]
            ]
            if len(tools) < 2 and not judge({**document, key: document[key][:at] + document[key][at + 1 :]}, found):
                yield f"without {row.get('name') or list(row.values())}"
    for at, row in enumerate(document["packages"]):
        spoilt = copy.deepcopy(document)
        if "packageFileName" in row:
            spoilt["packages"][at]["checksums"][0]["checksumValue"] = "0" * 64
            if not judge(spoilt, found):
                yield f"another checksum of {row['name']}"
            spoilt = {
                **document,
                "relationships": [
                    *document["relationships"],
                    {"spdxElementId": row["SPDXID"], "relationshipType": "DEPENDS_ON", "relatedSpdxElement": row["SPDXID"]},
                ],
            }
            if not judge(spoilt, found):
                yield f"{row['name']} needs itself"


def main(folder):
    document, found = json.loads(Path(target(folder)).read_text()), facts(folder)
    wrong = judge(document, found)
    if not wrong:
        wrong = [f"this check does not notice a fault: {what}" for what in unnoticed(document, found)]
    for what in wrong:
        print(f"{target(folder)}: {what}", file=sys.stderr)
    print(f"{len(found)} files, {len(document['packages'])} packages, {len(document['relationships'])} relations")
    return 1 if wrong or not found else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:2]) if len(sys.argv) == 2 else __doc__)
