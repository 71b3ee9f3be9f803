#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Writes the software bill of materials of the shipped files, as SPDX 2.3 JSON: their contents, linked libraries, dependencies and build tools.

usage: sbom.py FOLDER          FOLDER has the .deb files with their .buildinfo, the Python wheel, and in images/ the firmware (.elf, .bin, .hex, and
                               the linker's .map); writes iwheel-gateway_VERSION_ARCH.spdx.json there

The same files result in the same bytes. test/debian/judge_bill.py compares them. Needs a Debian on which the linked libraries are installed. No tool
does it: distro2sbom (PyPI) lists the packages of a machine or the dependencies of a package, not the libraries of a program in a .deb, nor those
in firmware; spdx-tools (PyPI) only reads and writes the form.
"""

import base64
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
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
TOOLS = ("gcc-[0-9]+", "binutils", "cmake", "debhelper", "dpkg-dev", "ninja-build", "scdoc")
IMAGE_TOOLS = ("gcc-arm-none-eabi", "binutils-arm-none-eabi", "cmake")
PAGE = "usr/share/iwheel-web"
# Files of the page from other projects: the name in scripts/web_assets, and the names in the npm package.
UPLOT = ("uplot", {"uPlot.iife.min.js": "dist/uPlot.iife.min.js", "uPlot.min.css": "dist/uPlot.min.css", "uPlot.LICENSE": "LICENSE"})


def output(*command):
    return subprocess.run(command, check=True, capture_output=True, text=True, env={**os.environ, "LC_ALL": "C.UTF-8"}).stdout


def checksum(path):
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()


# ---- contents of the files ------------------------------------------------------------------------------------------


def shipped(folder):
    """Returns the files that people install or flash."""
    found = [path for kind in ("*.deb", "*.whl", "images/*") for path in glob.glob(f"{folder}/{kind}")]
    return sorted(path for path in found if "-dbgsym" not in path and not path.endswith(".map"))


def field(deb, name):
    return output("dpkg-deb", "-f", deb, name).strip()


def depends(deb):
    """Returns {name: (relation, version), or None} of the package's dependencies; the first one of alternatives."""
    found = {}
    for part in f"{field(deb, 'Pre-Depends')}, {field(deb, 'Depends')}".split(","):
        match = re.match(r"\s*([a-z0-9.+-]+)(?::any)?\s*(?:\((\S+) ([^)]+)\))?", part)
        if match:
            found[match[1]] = (match[2], match[3]) if match[2] else found.get(match[1])
    return found


def linked_libraries(root):
    """Returns the sonames that the programs and libraries in that folder need."""
    found = set()
    for path in (path for path in Path(root).rglob("*") if path.is_file() and not path.is_symlink()):
        with open(path, "rb") as file:
            if file.read(4) == b"\x7fELF":
                found |= set(re.findall(r"\(NEEDED\).*\[(.+)\]", output("readelf", "-d", str(path))))
    return found


def package_of(name, architecture):
    """Returns the installed Debian package that contains a library or archive, named by soname or path."""
    lines = output("dpkg", "-S", name if name.startswith("/") else f"*/{name}").splitlines()
    names = sorted(line.split(": ")[0] for line in lines)
    return next((name for name in names if name.endswith(f":{architecture}")), names[0]).split(":")[0]


def version_of(name):
    """Returns the version of an installed package; NOASSERTION if it is not installed."""
    done = subprocess.run(["dpkg-query", "-W", "-f=${Version}", name], capture_output=True, text=True, check=False)
    return done.stdout if done.returncode == 0 and done.stdout else "NOASSERTION"


def archives(linker_map):
    """Returns the Debian packages of the archives that the linker has used."""
    text = Path(linker_map).read_text().partition("Discarded input sections")[0]
    paths = {os.path.realpath(path) for path in re.findall(r"^(/\S+\.a)\(", text, re.M)}
    return {package_of(path, "") for path in paths if path.startswith("/usr/lib/")}


def foreign_files(root):
    """Returns {file of the page: checksum} of the files from other projects."""
    own = {checksum(path) for path in (ROOT / "app/bridge/web/page").iterdir()}
    # Its texts are one file when it is installed, and each file has a compressed form of the same bytes, which the bridge compares.
    page = list(Path(root, PAGE).glob("*"))
    made = {"strings.js", *(f"{path.name}.gz" for path in page)}
    return {path.name: checksum(path) for path in page if path.name not in made and checksum(path) not in own}


def facts(folder):
    """Returns {file: its facts}, by the file's name, read from the files alone."""
    found, own = {}, {field(path, "Package") for path in shipped(folder) if path.endswith(".deb")}
    for path in shipped(folder):
        name = os.path.basename(path)
        fact = found[name] = {"checksum": checksum(path), "depends": {}, "libraries": set(), "archives": set(), "foreign": {}}
        if name.endswith(".deb"):
            with tempfile.TemporaryDirectory() as root:
                subprocess.run(["dpkg-deb", "-x", path, root], check=True)
                fact["depends"] = depends(path)
                fact["libraries"] = {
                    package_of(soname, field(path, "Architecture"))
                    for soname in linked_libraries(root)
                    if not any(soname.startswith(f"{one.rstrip('0123456789')}.so") for one in own)
                }
                fact["foreign"] = foreign_files(root)
        elif os.path.basename(os.path.dirname(path)) == "images":
            fact["archives"] = archives(re.sub(r"\.\w+$", ".map", path))
    return found


# ---- the document ---------------------------------------------------------------------------------------------------


def identifier(name):
    return "SPDXRef-" + re.sub(r"[^A-Za-z0-9.-]", "-", name)


def package(name, version, **more):
    return {
        "SPDXID": identifier(name),
        "name": name,
        "versionInfo": version,
        "downloadLocation": "NOASSERTION",
        "filesAnalyzed": False,
        "licenseConcluded": "NOASSERTION",
        "licenseDeclared": "NOASSERTION",
        "copyrightText": "NOASSERTION",
        **more,
    }


def uplot(files):
    """Returns the plot library in the page with the pins of scripts/web_assets."""
    name, paths = UPLOT
    version, pinned = re.search(rf"^bring {name} (\S+) (\S+)", (ROOT / "scripts/web_assets").read_text(), re.M).groups()
    comment = "; ".join(f"{PAGE}/{file} is {paths[file]}, sha256 {files[file]}" for file in sorted(files) if file in paths)
    return package(
        name,
        version,
        checksums=[{"algorithm": "SHA512", "checksumValue": base64.b64decode(pinned).hex()}],
        licenseConcluded="MIT",
        licenseDeclared="MIT",
        comment=comment,
        externalRefs=[{"referenceCategory": "PACKAGE-MANAGER", "referenceType": "purl", "referenceLocator": f"pkg:npm/{name}@{version}"}],
    )


def build_tools(buildinfo):
    installed = re.findall(r"^ ([a-z0-9.+-]+)(?::\w+)? \(= ([^)]+)\)", Path(buildinfo).read_text(), re.MULTILINE)
    return sorted({(name, version) for name, version in installed if any(re.fullmatch(tool, name) for tool in TOOLS)})


class Bill:
    def __init__(self):
        self.ours, self.others, self.relations = [], {}, []

    def relate(self, one, kind, other):
        row = {"spdxElementId": one, "relationshipType": kind, "relatedSpdxElement": other}
        if row not in self.relations:
            self.relations.append(row)

    def debian(self, name, version=None):
        """Returns the entry of a package of the distribution."""
        return self.others.setdefault(name, package(name, version or version_of(name), supplier="Organization: Debian"))["SPDXID"]

    def add(self, name, version, file, fact):
        """Returns the entry of a package of this project, with the facts of its file."""
        mine = package(
            name,
            version,
            packageFileName=file,
            checksums=[{"algorithm": "SHA256", "checksumValue": fact["checksum"]}],
            licenseConcluded="MIT",
            licenseDeclared="MIT",
            supplier="Organization: iWheel gateway maintainers",
        )
        self.ours.append(mine)
        self.relate("SPDXRef-DOCUMENT", "DESCRIBES", mine["SPDXID"])
        for library in sorted(fact["libraries"]):
            self.relate(mine["SPDXID"], "DYNAMIC_LINK", self.debian(library))
        for library in sorted(fact["archives"]):
            self.relate(mine["SPDXID"], "STATIC_LINK", self.debian(library))
        if fact["foreign"]:
            other = self.others.setdefault(UPLOT[0], uplot(fact["foreign"]))
            self.relate(mine["SPDXID"], "CONTAINS", other["SPDXID"])
        return mine["SPDXID"]


def describe(folder, found):
    """Returns the document."""
    bill, buildinfo = Bill(), glob.glob(f"{folder}/*.buildinfo")[0]
    debs = {file: os.path.join(folder, file) for file in found if file.endswith(".deb")}
    names = {field(path, "Package") for path in debs.values()}
    version = field(next(iter(debs.values())), "Version")
    for file, fact in found.items():
        mine = bill.add(field(debs[file], "Package") if file in debs else file, version, file, fact)
        for name in sorted(set(fact["depends"]) - fact["libraries"]):
            bill.relate(mine, "DEPENDS_ON", identifier(name) if name in names else bill.debian(name))
        tools = [(name, None) for name in IMAGE_TOOLS] if fact["archives"] else build_tools(buildinfo) if file in debs else []
        for tool in tools:
            bill.relate(bill.debian(*tool), "BUILD_TOOL_OF", mine)
    epoch = int(re.search(r'SOURCE_DATE_EPOCH="(\d+)"', Path(buildinfo).read_text())[1])
    identity = uuid.uuid5(uuid.NAMESPACE_OID, "".join(fact["checksum"] for fact in found.values()))
    return {
        "spdxVersion": "SPDX-2.3",
        "dataLicense": "CC0-1.0",
        "SPDXID": "SPDXRef-DOCUMENT",
        "name": f"iwheel-gateway-{version}",
        "documentNamespace": f"urn:uuid:{identity}",
        "creationInfo": {
            "created": datetime.datetime.fromtimestamp(epoch, datetime.timezone.utc).strftime("%Y-%m-%dT%H:%M:%SZ"),
            "creators": ["Tool: scripts/sbom.py"],
        },
        "packages": bill.ours + [bill.others[name] for name in sorted(bill.others)],
        "relationships": bill.relations,
    }


def target(folder):
    return re.sub(r"\.buildinfo$", ".spdx.json", glob.glob(os.path.join(folder, "*.buildinfo"))[0])


def main(arguments):
    if len(arguments) != 1 or arguments[0].startswith("-"):
        print(__doc__.split("\n\n", 1)[1].rstrip())
        return 0 if arguments in (["--help"], ["-h"]) else 64
    text = json.dumps(describe(arguments[0], facts(arguments[0])), indent=2)
    Path(target(arguments[0])).write_text(text + "\n")
    print(target(arguments[0]))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
