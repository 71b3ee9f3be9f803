#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Writes the software bill of materials of built Debian packages, as SPDX 2.3 JSON: what is in them, what they link, what built them.

usage: sbom.py FOLDER          the folder of the .deb files and their .buildinfo; writes iwheel-gateway_VERSION_ARCH.spdx.json there
       sbom.py --check FOLDER  fail unless it names every package there with its checksum and every library its programs link

The same packages give the same bytes. Needs a Debian on which the linked libraries are installed.
"""

import datetime
import glob
import hashlib
import json
import os
import re
import subprocess
import sys
import tempfile
import uuid

TOOLS = ("gcc-[0-9]+", "binutils", "cmake", "debhelper", "dpkg-dev", "scdoc")


def output(*command):
    return subprocess.run(command, check=True, capture_output=True, text=True, env={**os.environ, "LC_ALL": "C.UTF-8"}).stdout


def checksum(path):
    with open(path, "rb") as file:
        return hashlib.sha256(file.read()).hexdigest()


def debs(folder):
    return sorted(path for path in glob.glob(os.path.join(folder, "*.deb")) if "-dbgsym" not in path)


def linked_libraries(deb):
    """The sonames that the programs in the package need."""
    with tempfile.TemporaryDirectory() as root:
        subprocess.run(["dpkg-deb", "-x", deb, root], check=True)
        found = set()
        for program in glob.glob(os.path.join(root, "usr/bin/*")):
            found |= set(re.findall(r"\(NEEDED\).*\[(.+)\]", output("readelf", "-d", program)))
    return found


def package_of(soname, architecture):
    """(name, version) of the Debian package that brings a library."""
    lines = output("dpkg", "-S", f"*/{soname}").splitlines()
    names = sorted(line.split(": ")[0] for line in lines)
    name = next((name for name in names if name.endswith(f":{architecture}")), names[0])
    return name.split(":")[0], output("dpkg-query", "-W", "-f=${Version}", name)


def build_tools(buildinfo):
    with open(buildinfo, encoding="utf-8") as file:
        installed = re.findall(r"^ ([a-z0-9.+-]+)(?::\w+)? \(= ([^)]+)\)", file.read(), re.MULTILINE)
    return sorted({(name, version) for name, version in installed if any(re.fullmatch(tool, name) for tool in TOOLS)})


def package(name, version, **more):
    return {
        "SPDXID": "SPDXRef-" + re.sub(r"[^A-Za-z0-9.-]", "-", name),
        "name": name,
        "versionInfo": version,
        "downloadLocation": "NOASSERTION",
        "filesAnalyzed": False,
        "licenseConcluded": "NOASSERTION",
        "licenseDeclared": "NOASSERTION",
        "copyrightText": "NOASSERTION",
        **more,
    }


def relation(one, kind, other):
    return {"spdxElementId": one["SPDXID"], "relationshipType": kind, "relatedSpdxElement": other["SPDXID"]}


def describe(folder):
    """The document."""
    ours, others, relations, created = [], {}, [], ""
    document = {"SPDXID": "SPDXRef-DOCUMENT"}
    buildinfo = glob.glob(os.path.join(folder, "*.buildinfo"))[0]
    for deb in debs(folder):
        name, version, architecture = (output("dpkg-deb", "-f", deb, field).strip() for field in ("Package", "Version", "Architecture"))
        mine = package(
            name,
            version,
            packageFileName=os.path.basename(deb),
            checksums=[{"algorithm": "SHA256", "checksumValue": checksum(deb)}],
            licenseConcluded="MIT",
            licenseDeclared="MIT",
            supplier="Organization: iWheel gateway maintainers",
        )
        ours.append(mine)
        relations.append(relation(document, "DESCRIBES", mine))
        for soname in sorted(linked_libraries(deb)):
            library, its_version = package_of(soname, architecture)
            other = others.setdefault(library, package(library, its_version, supplier="Organization: Debian"))
            if relation(mine, "DYNAMIC_LINK", other) not in relations:
                relations.append(relation(mine, "DYNAMIC_LINK", other))
    for name, version in build_tools(buildinfo):
        tool = others.setdefault(name, package(name, version, supplier="Organization: Debian"))
        relations.extend(relation(tool, "BUILD_TOOL_OF", mine) for mine in ours)
    epoch = int(re.search(r'SOURCE_DATE_EPOCH="(\d+)"', open(buildinfo, encoding="utf-8").read())[1])
    created = datetime.datetime.fromtimestamp(epoch, datetime.timezone.utc).strftime("%Y-%m-%dT%H:%M:%SZ")
    identity = uuid.uuid5(uuid.NAMESPACE_OID, "".join(mine["checksums"][0]["checksumValue"] for mine in ours))
    return {
        "spdxVersion": "SPDX-2.3",
        "dataLicense": "CC0-1.0",
        "SPDXID": "SPDXRef-DOCUMENT",
        "name": f"iwheel-gateway-{ours[0]['versionInfo']}",
        "documentNamespace": f"urn:uuid:{identity}",
        "creationInfo": {"created": created, "creators": ["Tool: scripts/sbom.py"]},
        "packages": ours + [others[name] for name in sorted(others)],
        "relationships": relations,
    }


def target(folder):
    return re.sub(r"\.buildinfo$", ".spdx.json", glob.glob(os.path.join(folder, "*.buildinfo"))[0])


def check(folder):
    with open(target(folder), encoding="utf-8") as file:
        document = json.load(file)
    names = {entry["name"] for entry in document["packages"]}
    sums = {entry["checksums"][0]["checksumValue"] for entry in document["packages"] if "checksums" in entry}
    missing = [deb for deb in debs(folder) if checksum(deb) not in sums]
    for deb in debs(folder):
        architecture = output("dpkg-deb", "-f", deb, "Architecture").strip()
        missing += [s for s in linked_libraries(deb) if package_of(s, architecture)[0] not in names]
    for what in missing:
        print(f"not in {target(folder)}: {what}", file=sys.stderr)
    return 1 if missing or not sums else 0


def main(arguments):
    if len(arguments) == 2 and arguments[0] == "--check":
        return check(arguments[1])
    if len(arguments) != 1 or arguments[0].startswith("-"):
        print(__doc__.split("\n\n", 1)[1].rstrip())
        return 0 if arguments in (["--help"], ["-h"]) else 64
    with open(target(arguments[0]), "w", encoding="utf-8") as file:
        json.dump(describe(arguments[0]), file, indent=2)
        file.write("\n")
    print(target(arguments[0]))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
