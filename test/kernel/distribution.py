# SPDX-License-Identifier: MIT
"""The distribution's own kernel in an emulated machine with two CAN controllers (SJA1000, Kvaser PCI cards) on one bus.

Nobody here configured that kernel, and its driver is one that boards have: bit timing over netlink, IFF_ECHO, restart-ms. Its clock
counts instructions (2 ns each) and jumps while nobody works, so that no load on this machine makes it late. Neither bus errors nor the
time that a frame takes are modelled, and Debian 12's kernel has no gpio-sim: the e-stop's button is the local one.
"""

import os
import re
import shutil
import subprocess
import sys
import tempfile

from boot import HERE, VIRTUAL_NICE, Boot
from harness import die_with_parent

ROOT = os.path.dirname(os.path.dirname(HERE))
MACHINES = {"x86_64": "amd64"}
EMULATOR = "qemu-system-x86_64"
CONTROLLERS = ("can0", "can1")
# In the order in which they are loaded; what a kernel has built in is no file, and nothing is missing then.
MODULES = "virtio_ring virtio virtio_pci_legacy_dev virtio_pci_modern_dev virtio_pci netfs fscache 9pnet 9pnet_virtio 9p can-dev can can-raw sja1000 kvaser_pci"
TOOLS = ("bash", "busybox", "cat", "ip", "ln", "mkdir", "mount", "mountpoint", "sh", "sleep", "sync", "tc")
PACKAGES = {EMULATOR: "qemu-system-x86", "cpio": "cpio", "busybox": "busybox-static", "ip": "iproute2", "apt-get": "apt", "dpkg-deb": "dpkg"}
PATH = "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin"
OWN = ("app/gateway/iwheel-gateway", "app/sim/iwheel-sim", "app/ctl/iwheelctl", "test/kernel/iwheel-sleeper")
SETTINGS = ("/etc/passwd", "/etc/group", "/etc/nsswitch.conf", "/etc/ld.so.cache")
# Of Python's own library: what no test needs, and most of its bytes.
NOT_NEEDED = ("test", "tests", "idlelib", "lib2to3", "ensurepip", "dist-packages", "site-packages", "tkinter", "turtledemo", "pydoc_data")
FIRST = """#!/bin/bash
cd /modules || exit 1
for module in {modules}; do [ ! -e "$module.ko" ] || busybox insmod "$module.ko"; done
mkdir -p /proc /sys /dev /run /tmp {folder}
mount -t 9p -o trans=virtio,version=9p2000.L,msize=262144 results {folder}
exec {init}
"""


def cache():
    return os.path.join(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache"), "iwheel")


def output(*command, **options):
    """What it says. Raises RuntimeError with the end of that if it fails."""
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False, **options)
    if done.returncode != 0:
        raise RuntimeError(f"{' '.join(command)}: {done.stdout.strip()[-300:]}")
    return done.stdout


def package_name():
    """The kernel's package that this distribution installs today."""
    machine = os.uname().machine
    if machine not in MACHINES:
        raise RuntimeError(f"made for {', '.join(MACHINES)}, and this machine is {machine}")
    found = re.search(r"Depends: (linux-image-[0-9]\S+)", output("apt-cache", "depends", f"linux-image-{MACHINES[machine]}"))
    if not found:
        raise RuntimeError(f"this distribution has no package linux-image-{MACHINES[machine]}")
    return found.group(1)


def find_kernel():
    """A folder with `vmlinuz` and the modules that are needed, fetched once for each version. RuntimeError: why there is none."""
    missing = sorted({package for program, package in PACKAGES.items() if not shutil.which(program, path=PATH)})
    if missing:
        raise RuntimeError(f"apt-get install {' '.join(missing)}")
    package = package_name()
    version = re.search(r"Candidate: (\S+)", output("apt-cache", "policy", package)).group(1)
    folder = os.path.join(cache(), f"{package}-{version}")
    if not os.path.exists(os.path.join(folder, "vmlinuz")):
        os.makedirs(cache(), exist_ok=True)
        with tempfile.TemporaryDirectory(dir=cache()) as work:
            fetch(package, work)
            shutil.rmtree(folder, ignore_errors=True)
            os.rename(os.path.join(work, "kept"), folder)
    return folder


def why_not_emulated():
    """What keeps that machine from being had, and the cure; None if nothing does."""
    try:
        find_kernel()
    except RuntimeError as error:
        return f"no distribution's kernel: {error}"
    return None


def fetch(package, work):
    """Downloads and unpacks it; what is needed lies in `work`/kept then. Nothing is installed."""
    output("apt-get", "-q", "-o", "APT::Sandbox::User=root", "download", package, cwd=work)
    archive = next(name for name in os.listdir(work) if name.endswith(".deb"))
    output("dpkg-deb", "-x", os.path.join(work, archive), os.path.join(work, "all"))
    kept = os.path.join(work, "kept")
    os.makedirs(os.path.join(kept, "modules"))
    boot = os.path.join(work, "all", "boot")
    shutil.copy(os.path.join(boot, next(name for name in os.listdir(boot) if name.startswith("vmlinuz"))), os.path.join(kept, "vmlinuz"))
    for folder, _, files in os.walk(os.path.join(work, "all")):
        for name in files:
            module, _, ending = name.partition(".ko")
            if module in MODULES.split() and ending in ("", ".xz", ".zst"):
                place = shutil.copy(os.path.join(folder, name), os.path.join(kept, "modules", name))
                if ending:
                    output({".xz": "xz", ".zst": "zstd"}[ending], "-dq", place)


class Image:
    """The first root file system of that machine: this machine's files that the tests need, at the same places."""

    def __init__(self):
        self.files = set()
        for link in ("/bin", "/sbin", "/lib", "/lib64"):
            if os.path.islink(link):
                self.files.add(link)

    def add(self, path):
        """With the folders above it, and what it links to."""
        path = os.path.join(os.path.realpath(os.path.dirname(path)), os.path.basename(path))
        while path != "/" and path not in self.files:
            self.files.add(path)
            if os.path.islink(path):
                self.add(os.path.join(os.path.dirname(path), os.readlink(path)))
            path = os.path.dirname(path)

    def add_program(self, path):
        """With the libraries it is linked with."""
        self.add(path)
        self.add(os.path.realpath(path))
        for library in re.findall(r"(/\S+) \(0x", subprocess.run(["ldd", path], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, check=False).stdout):
            self.add(library)
            self.add(os.path.realpath(library))

    def add_tree(self, top, leave_out=()):
        for folder, folders, files in os.walk(top):
            folders[:] = [name for name in folders if name not in leave_out]
            for name in files:
                path = os.path.join(folder, name)
                (self.add_program if ".so" in name else self.add)(path)

    def write(self, file, top="/"):
        """Appends it to `file`: the kernel takes several archives in a row."""
        names = "".join(f"{path.removeprefix(top).lstrip('/')}\n" for path in sorted(self.files))
        done = subprocess.run(["cpio", "--quiet", "-o", "-H", "newc"], cwd=top, input=names.encode(), stdout=file, stderr=subprocess.PIPE, check=False)
        if done.returncode != 0:
            raise RuntimeError(f"cpio: {done.stderr.decode().strip()[-300:]}")


def write_image(path, build, kernel, results):
    """The image for tests of that build, whose results go to that folder of this machine's."""
    image = Image()
    for name in TOOLS:
        program = shutil.which(name, path=PATH)
        if program:
            image.add_program(program)
    image.add_program(os.path.realpath(sys.executable))
    image.add_tree(os.path.dirname(os.__file__), (*NOT_NEEDED, *(name for name in os.listdir(os.path.dirname(os.__file__)) if name.startswith("config-"))))
    for name in OWN:
        image.add_program(os.path.join(build, name))
    for folder in ("test/system", "test/kernel", "share"):
        image.add_tree(os.path.join(ROOT, folder), ("__pycache__",))
    for name in filter(os.path.exists, SETTINGS):
        image.add(name)
    with tempfile.TemporaryDirectory() as work, open(path, "wb") as file:
        image.write(file)
        first = os.path.join(work, "init")
        with open(first, "w", encoding="ascii") as script:
            script.write(FIRST.format(modules=MODULES, folder=results, init=os.path.join(HERE, "init")))
        os.chmod(first, 0o755)
        shutil.copytree(os.path.join(kernel, "modules"), os.path.join(work, "modules"))
        own = Image()
        own.files = {os.path.join(folder, name) for folder, folders, files in os.walk(work) for name in folders + files}
        own.write(file, work)


class EmulatedBoot(Boot):
    """One boot of that machine; the same plan, the same results."""

    def __init__(self, kernel, folder, name, plan, processors):
        self.distribution = find_kernel()
        self.image = os.path.join(folder, f"{name}.image")
        write_image(self.image, plan["build"], self.distribution, folder)
        super().__init__(kernel, folder, name, plan, processors)

    def prepare(self):
        die_with_parent()
        os.sched_setaffinity(0, self.processors)
        os.nice(VIRTUAL_NICE)

    def command(self, kernel):
        words = ["console=ttyS0", "quiet", "rdinit=/init", "panic=-1", f"iwheel_python={os.path.realpath(sys.executable)}"]
        words += [f"iwheel_guest={os.path.join(HERE, 'guest.py')}", f"iwheel_plan={self.path('json')}"]
        command = [EMULATOR, "-accel", "tcg", "-icount", "shift=1,sleep=off", "-m", "1024", "-display", "none", "-vga", "none", "-nic", "none"]
        command += ["-no-reboot", "-serial", "stdio", "-kernel", os.path.join(self.distribution, "vmlinuz"), "-initrd", self.image]
        command += ["-append", " ".join(words), "-virtfs", f"local,path={self.folder},mount_tag=results,security_model=none"]
        command += ["-object", "can-bus,id=bus"]
        for _ in CONTROLLERS:
            command += ["-device", "kvaser_pci,canbus=bus"]
        return command
