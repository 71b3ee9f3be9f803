#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Builds the Debian packages of these sources and of the previous version. Its sources are the commit in this repository that introduced its number.

usage: test/upgrade/packages.py      into build/upgrade, where they stay; uses the packages of test/debian/run if they are of these sources
"""

import fcntl
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
OUT = ROOT / "build/upgrade"
WANTED = ("iwheel-gateway_", "iwheel-tools_", "libiwheel-client0_", "libiwheel-dev_", "python3-iwheel_")


class Missing(Exception):
    """The reason why no upgrade can be tested here."""


def git(*arguments):
    done = subprocess.run(["git", *arguments], cwd=ROOT, capture_output=True, text=True, check=False)
    return done.stdout if done.returncode == 0 else ""


def version_before():
    versions = re.findall(r"^iwheel-gateway \(([^)]+)\)", (ROOT / "debian/changelog").read_text(), re.MULTILINE)
    if len(versions) < 2:
        raise Missing("debian/changelog has only one version")
    return versions[1]


def release_of(version):
    """The commit in which debian/changelog first has this version at its head."""
    for commit in git("log", "--reverse", "--format=%H", "--", "debian/changelog").split():
        if git("show", f"{commit}:debian/changelog").startswith(f"iwheel-gateway ({version})"):
            return commit
    raise Missing(f"this history does not contain {version}; a full clone contains it (git fetch --unshallow)")


def build(folder, fill):
    """Builds, unless it is done already, the packages of the sources that `fill` writes into a folder. Returns their paths."""
    if not (folder / "built").exists():
        shutil.rmtree(folder, ignore_errors=True)
        (folder / "iwheel").mkdir(parents=True)
        fill(folder / "iwheel")
        # Installed packages have no debug information. These packages are never downloaded.
        environment = dict(
            os.environ,
            LC_ALL="C.UTF-8",
            DPKG_DEB_COMPRESSOR_TYPE="none",
            DEB_CFLAGS_STRIP="-g",
            DEB_BUILD_OPTIONS=f"nocheck noautodbgsym parallel={os.cpu_count()}",
            DEB_BUILD_PROFILES="pkg.iwheel.nomqtt pkg.iwheel.noros2 pkg.iwheel.noweb",
        )
        with open(folder / "log", "w", encoding="utf-8") as log:
            done = subprocess.run(
                ["dpkg-buildpackage", "--unsigned-changes", "--build=binary"], cwd=folder / "iwheel", env=environment, stdout=log, stderr=log, check=False
            )
        if done.returncode != 0:
            raise RuntimeError(f"{(folder / 'log').read_text()[-3000:]}\nthe packages in {folder} are not built: the end of the log is above")
        shutil.rmtree(folder / "iwheel")
        (folder / "built").touch()
    return [str(path) for path in sorted(folder.glob("*.deb")) if path.name.startswith(WANTED)]


def packages_of_commit(commit):
    def fill(folder):
        archive = subprocess.run(["git", "archive", commit], cwd=ROOT, capture_output=True, check=True).stdout
        subprocess.run(["tar", "-x", "-C", folder], input=archive, check=True)

    return build(OUT / commit[:12], fill)


def packages_of_these_sources():
    built = ROOT / "build/debian"
    fingerprint = subprocess.run([ROOT / "scripts/fingerprint"], capture_output=True, text=True, check=False).stdout.strip()
    if (built / "built").exists() and (built / "built").read_text().split()[:1] == [fingerprint]:
        return [str(path) for path in sorted(built.glob("first/*.deb")) if path.name.startswith(WANTED)]
    files = [
        name for name in git("ls-files", "-z", "-co", "--exclude-standard").split("\0") if name and (ROOT / name).is_file() and not (ROOT / name).is_symlink()
    ]
    folder = OUT / f"now-{fingerprint[:12]}"
    for other in OUT.glob("now-*"):
        if other != folder:
            shutil.rmtree(other)

    def fill(target):
        subprocess.run(["xargs", "-0", "cp", "-p", "--parents", "-t", target], cwd=ROOT, input="\0".join(files).encode(), check=True)

    return build(folder, fill)


def of_both():
    """(packages of the previous version, packages of these sources)"""
    for tool in ("dh", "dpkg-buildpackage"):
        if not shutil.which(tool):
            raise Missing(f"{tool} is missing (scripts/install_tools check brings it)")
    commit = release_of(version_before())
    OUT.mkdir(parents=True, exist_ok=True)
    with open(OUT / "lock", "w", encoding="utf-8") as lock:  # Another process may still build them.
        fcntl.flock(lock, fcntl.LOCK_EX)
        return packages_of_commit(commit), packages_of_these_sources()


if __name__ == "__main__":
    try:
        of_both()
    except Missing as why:
        print(f"skip: {why}")
        sys.exit(77)
