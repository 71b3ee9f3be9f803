# SPDX-License-Identifier: MIT
"""What a build from blank costs, and the size of each package when it is installed.

Processor time does not grow with other load on the machine as elapsed time does. The build has neither a compiler cache nor earlier results.
"""

import os
import resource
import subprocess
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
PACKAGES = ROOT / "build/debian/first"
BUILDS = {"the core alone": ["--target", "iwheel_core"], "everything": []}
KIB_PER_MIB = 1024


def spent_s():
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def build(name, jobs):
    """Row of one build: processor time and elapsed time."""
    with tempfile.TemporaryDirectory(prefix="iwheel-build-") as folder:
        environment = {name: value for name, value in os.environ.items() if not name.startswith(("CMAKE_", "CCACHE_"))}
        environment["CCACHE_DISABLE"] = "1"
        begin, before_s = time.monotonic(), spent_s()
        configure = ["cmake", "-S", ROOT, "-B", folder, "-DCMAKE_BUILD_TYPE=RelWithDebInfo", "-DCMAKE_C_FLAGS_RELWITHDEBINFO=-O2 -g1 -DNDEBUG"]
        for command in (configure, ["cmake", "--build", folder, "-j", str(jobs), *BUILDS[name]]):
            subprocess.run(command, env=environment, check=True, stdout=subprocess.DEVNULL)
        return [f"build of {name}", f"{spent_s() - before_s:.0f} s of processor time, {time.monotonic() - begin:.0f} s elapsed (-j{jobs})"]


def field(package, name):
    return subprocess.run(["dpkg-deb", "-f", package, name], capture_output=True, text=True, check=True).stdout.strip()


def documents_kib(package):
    """Size of the files in /usr/share/doc."""
    contents = subprocess.run(["dpkg-deb", "-c", package], capture_output=True, text=True, check=True).stdout
    rows = [line.split(maxsplit=5) for line in contents.splitlines()]
    return sum(int(size) for _, _, size, _, _, name in rows if name.startswith("./usr/share/doc/")) / KIB_PER_MIB


def packages():
    """Rows of the packages that test/debian/run has built; none if there are none."""
    found = sorted(path for path in PACKAGES.glob("*.deb") if "-dbgsym_" not in path.name)
    return [
        [
            f"package {field(path, 'Package')}",
            f"{int(field(path, 'Installed-Size')) / KIB_PER_MIB:.2f} MiB installed, {documents_kib(path) / KIB_PER_MIB:.2f} MiB of it documents; {path.stat().st_size / KIB_PER_MIB:.0f} KiB file",
        ]
        for path in found
    ]


def rows():
    jobs = os.cpu_count()
    return [*[build(name, jobs) for name in BUILDS], *packages()]
