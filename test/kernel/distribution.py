# SPDX-License-Identifier: MIT
"""The distribution's own kernel in an emulated machine with two CAN controllers on one bus: SJA1000 (Kvaser PCI cards), or CTU CAN FD.

That kernel has the distribution's configuration, and a driver that real boards use: bit timing over netlink, IFF_ECHO, restart-ms. Its clock
counts instructions (2 ns each) and jumps while the machine is idle, so that no load on this machine makes it late. Neither bus errors nor the
duration of a frame are modelled, and Debian 12's kernel has no gpio-sim: the e-stop's button is the local one.

Also for another architecture: then all files in that machine are Debian's for it, and the programs are those of the packages that
test/cross/run has built.
"""

import os
import re
import shutil
import subprocess
import sys
import tempfile
from typing import NamedTuple

from boot import HERE, VIRTUAL_NICE, Boot
from harness import die_with_parent

ROOT = os.path.dirname(os.path.dirname(HERE))


class Machine(NamedTuple):
    """An emulated machine. `cards`: two controllers on the bus `bus`. `parts`: the packages of its architecture with its files; default:
    this machine's own files. `built`: a driver that the distribution leaves out: its folder in the kernel's source, and its build options."""

    architecture: str  # as Debian calls it
    emulator: tuple
    console: str
    package: str  # of the emulator
    cards: tuple
    parts: tuple = ()
    compiler: str = "gcc"
    built: tuple = ()


PARTS = (
    "linux-image-arm64",
    "libgpiod2",
    "libinih1",
    "libmnl0",
    "libncursesw6",
    "python3",
    "bash",
    "busybox-static",
    "coreutils",
    "iproute2",
    "mount",
    "util-linux",
)
KVASER = ("-device", "kvaser_pci,canbus=bus") * 2
AMD64 = Machine("amd64", ("qemu-system-x86_64", "-vga", "none"), "ttyS0", "qemu-system-x86", KVASER)
CTUCAN = ("drivers/net/can/ctucanfd", "CONFIG_CAN_CTUCANFD=m", "CONFIG_CAN_CTUCANFD_PCI=m")
MACHINES = {
    "amd64": AMD64,
    "ctucan": AMD64._replace(cards=("-device", "ctucan_pci,canbus0=bus,canbus1=bus"), built=CTUCAN),
    "arm64": Machine(
        "arm64", ("qemu-system-aarch64", "-M", "virt", "-cpu", "cortex-a57"), "ttyAMA0", "qemu-system-arm", KVASER, PARTS, "aarch64-linux-gnu-gcc"
    ),
}
HERE_IS = {"x86_64": "amd64"}  # os.uname() and Debian
CONTROLLERS = ("can0", "can1")
# In the order in which they are loaded. A module that is built into the kernel has no file, and is not missing.
MODULES = "virtio_ring virtio virtio_pci_legacy_dev virtio_pci_modern_dev virtio_pci netfs fscache 9pnet 9pnet_virtio 9p can-dev can can-raw sja1000 kvaser_pci ctucanfd ctucanfd_pci"
TOOLS = ("bash", "busybox", "cat", "ip", "ln", "mkdir", "mount", "mountpoint", "sh", "sleep", "sync", "tc")
PACKAGES = {"cpio": "cpio", "busybox": "busybox-static", "ip": "iproute2", "apt-get": "apt", "dpkg-deb": "dpkg"}
PATH = "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin"
OWN = ("app/gateway/iwheel-gateway", "app/sim/iwheel-sim", "app/ctl/iwheelctl", "test/kernel/iwheel-sleeper")
SETTINGS = ("/etc/passwd", "/etc/group", "/etc/nsswitch.conf", "/etc/ld.so.cache")
# The largest parts of Python's standard library, which no test needs.
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
    """Returns the output of the command. Raises RuntimeError with its end if the command fails."""
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False, **options)
    if done.returncode != 0:
        raise RuntimeError(f"{' '.join(command)}: {done.stdout.strip()[-300:]}")
    return done.stdout


def here():
    """Debian's name of this machine's architecture. RuntimeError if these tests do not support it."""
    machine = os.uname().machine
    if machine not in HERE_IS:
        raise RuntimeError(f"made for {', '.join(HERE_IS)}, and this machine is {machine}")
    return HERE_IS[machine]


def package_name():
    """The package of the kernel that this distribution installs now."""
    found = re.search(r"Depends: (linux-image-[0-9]\S+)", output("apt-cache", "depends", f"linux-image-{here()}"))
    if not found:
        raise RuntimeError(f"this distribution has no package linux-image-{here()}")
    return found.group(1)


def need(**packages):
    missing = sorted({package for program, package in packages.items() if not shutil.which(program, path=PATH)})
    if missing:
        raise RuntimeError(f"apt-get install {' '.join(missing)}")


def find_kernel(name):
    """A folder with `vmlinuz` and the modules that are needed, fetched once for each version; of another architecture, also `root`. RuntimeError: the reason why there is none."""
    machine = MACHINES[name]
    need(**PACKAGES, **{machine.emulator[0]: machine.package})
    if machine.architecture != here():
        return find_foreign(machine)
    package = package_name()
    version = re.search(r"Candidate: (\S+)", output("apt-cache", "policy", package)).group(1)
    folder = os.path.join(cache(), "-".join([package, version, *(os.path.basename(path) for path in machine.built[:1])]))
    if not os.path.exists(os.path.join(folder, "vmlinuz")):
        os.makedirs(cache(), exist_ok=True)
        with tempfile.TemporaryDirectory(dir=cache()) as work:
            fetch(package, work)
            if machine.built:
                build_modules(package, version, machine.built, work)
            shutil.rmtree(folder, ignore_errors=True)
            os.rename(os.path.join(work, "stored"), folder)
    return folder


def find_foreign(machine):
    """The same for another architecture, with all files of such a machine."""
    folder = os.path.join(cache(), f"distribution-{machine.architecture}")
    root = os.path.join(folder, "root")
    fresh = not os.path.exists(os.path.join(root, "wanted"))
    output(os.path.join(ROOT, "scripts/from_debian"), "root", machine.architecture, root, *machine.parts)
    if fresh or not os.path.exists(os.path.join(folder, "vmlinuz")):
        store(root, folder)
    return folder


def packages_of(architecture):
    """The packages of this project for that architecture. RuntimeError: the command that builds them."""
    folder = os.path.join(ROOT, "build", "cross", architecture)
    names = [
        name
        for part in ("gateway", "tools")
        for name in (os.listdir(folder) if os.path.isdir(folder) else ())
        if re.match(f"iwheel-{part}_.*_{architecture}.deb$", name)
    ]
    if len(names) != 2:
        raise RuntimeError(f"no packages for {architecture}: ./check cross builds them")
    return [os.path.join(folder, name) for name in names]


def why_not_emulated(name):
    """Reason why that machine is not available, and the fix; None if it is available."""
    machine = MACHINES[name]
    try:
        find_kernel(name)
        if machine.parts:
            need(**{machine.compiler: f"gcc-{machine.compiler.removesuffix('-gcc')}"})
            packages_of(machine.architecture)
    except RuntimeError as error:
        return f"no distribution's kernel: {error}"
    return None


def download(packages, work):
    """Unpacks them without installing; returns their folder."""
    output("apt-get", "-q", "-o", "APT::Sandbox::User=root", "download", *packages, cwd=work)
    return [os.path.join(work, name) for name in sorted(os.listdir(work)) if name.endswith(".deb")]


def fetch(package, work):
    """Downloads and unpacks it into `work`/stored. Nothing is installed."""
    output("dpkg-deb", "-x", *download([package], work), os.path.join(work, "all"))
    store(os.path.join(work, "all"), os.path.join(work, "stored"))


def build_modules(image, version, built, work):
    """A driver from the source of the distribution's kernel, with its headers and its compiler, next to the modules in `work`/stored."""
    need(make="make", gcc="gcc")
    release, series = image.removeprefix("linux-image-"), ".".join(version.split(".")[:2])
    headers = [f"linux-headers-{release}", f"linux-headers-{release.rsplit('-', 1)[0]}-common", f"linux-kbuild-{series}"]
    folder, source = os.path.join(work, "build"), f"linux-source-{series}"
    os.mkdir(folder)
    for archive in download([*headers, source], folder):
        output("dpkg-deb", "-x", archive, folder)
    output("tar", "-xJf", os.path.join(folder, "usr", "src", f"{source}.tar.xz"), f"{source}/{built[0]}", cwd=folder)
    tree = os.path.join(folder, "usr", "src", headers[0])
    with open(os.path.join(tree, "Makefile"), "r+", encoding="ascii") as makefile:  # It contains the path at which its package is installed.
        text = makefile.read().replace("/usr/src", os.path.join(folder, "usr", "src"))
        makefile.seek(0)
        makefile.write(text)
    output("make", "-C", tree, f"M={os.path.join(folder, source, built[0])}", *built[1:], "modules")
    for name in os.listdir(os.path.join(folder, source, built[0])):
        if name.endswith(".ko"):
            shutil.copy(os.path.join(folder, source, built[0], name), os.path.join(work, "stored", "modules"))


def store(root, stored):
    """Kernel and modules of that root, into that folder."""
    os.makedirs(os.path.join(stored, "modules"), exist_ok=True)
    boot = os.path.join(root, "boot")
    shutil.copy(os.path.join(boot, next(name for name in os.listdir(boot) if name.startswith("vmlinuz"))), os.path.join(stored, "vmlinuz"))
    for folder, _, files in os.walk(root):
        for name in files:
            module, _, ending = name.partition(".ko")
            if module in MODULES.split() and ending in ("", ".xz", ".zst"):
                place = shutil.copy(os.path.join(folder, name), os.path.join(stored, "modules", name))
                if ending:
                    output({".xz": "xz", ".zst": "zstd"}[ending], "-dq", place)


class Image:
    """The first root file system of that machine: this machine's files that the tests need, at the same places."""

    def __init__(self):
        self.files = set()

    def add(self, path):
        """Copies it with the folders above it, and the target of a link."""
        path = os.path.join(os.path.realpath(os.path.dirname(path)), os.path.basename(path))
        while path != "/" and path not in self.files:
            self.files.add(path)
            if os.path.islink(path):
                self.add(os.path.join(os.path.dirname(path), os.readlink(path)))
            path = os.path.dirname(path)

    def add_program(self, path):
        """Copies it with the libraries that it is linked with."""
        self.add(path)
        self.add(os.path.realpath(path))
        for library in re.findall(
            r"(/\S+) \(0x", subprocess.run(["ldd", path], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, check=False).stdout
        ):
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


def own_files(build):
    """This machine's own files that the tests need, and the programs of that build."""
    image = Image()
    image.files |= set(filter(os.path.islink, ("/bin", "/sbin", "/lib", "/lib64")))
    for name in TOOLS:
        program = shutil.which(name, path=PATH)
        if program:
            image.add_program(program)
    image.add_program(os.path.realpath(sys.executable))
    image.add_tree(os.path.dirname(os.__file__), (*NOT_NEEDED, *(name for name in os.listdir(os.path.dirname(os.__file__)) if name.startswith("config-"))))
    for name in OWN:
        image.add_program(os.path.join(build, name))
    return image


def all_files(root, leave_out=()):
    """Copies everything below that folder."""
    image = Image()
    for folder, folders, files in os.walk(root):
        folders[:] = [name for name in folders if name not in leave_out]
        image.files |= {os.path.join(folder, name) for name in folders + files}
    return image


def write_foreign(file, machine, kernel, work):
    """Debian's files of that architecture, and over them the programs of this project's packages, at their places under /usr."""
    root = os.path.join(kernel, "root")
    all_files(root, (*NOT_NEEDED, "boot", "modules", "doc", "man", "locale", "include", "shlibs.local")).write(file, root)
    with tempfile.TemporaryDirectory() as unpacked:  # Their /lib is a folder, that of the system is a link.
        for package in packages_of(machine.architecture):
            output("dpkg-deb", "-x", package, unpacked)
        shutil.copytree(os.path.join(unpacked, "usr", "bin"), os.path.join(work, "usr", "bin"))
    sleeper = os.path.join(work, "usr", "test", "kernel", "iwheel-sleeper")
    os.makedirs(os.path.dirname(sleeper))
    output(machine.compiler, "-O2", "-static", os.path.join(HERE, "sleeper.c"), "-o", sleeper)


def write_image(path, machine, build, kernel, results):
    """The image for tests of that build; the results are written to that folder of this machine."""
    tests = Image()
    for folder in ("test/support", "test/system", "test/kernel", "share"):
        tests.add_tree(os.path.join(ROOT, folder), ("__pycache__",))
    for name in filter(os.path.exists, SETTINGS):
        tests.add(name)
    with tempfile.TemporaryDirectory() as work, open(path, "wb") as file:
        if machine.parts:
            write_foreign(file, machine, kernel, work)
        else:
            own_files(build).write(file)
        tests.write(file)
        first = os.path.join(work, "init")
        with open(first, "w", encoding="ascii") as script:
            script.write(FIRST.format(modules=MODULES, folder=results, init=os.path.join(HERE, "init")))
        os.chmod(first, 0o755)
        shutil.copytree(os.path.join(kernel, "modules"), os.path.join(work, "modules"))
        all_files(work).write(file, work)


class EmulatedBoot(Boot):
    """One boot of that machine, with the same plan and results as Boot."""

    def __init__(self, machine, folder, name, plan, processors):
        self.machine, self.distribution = MACHINES[machine], find_kernel(machine)
        self.image = os.path.join(folder, f"{name}.image")
        self.python = "/usr/bin/python3" if self.machine.parts else os.path.realpath(sys.executable)
        plan = {**plan, "build": "/usr"} if self.machine.parts else plan
        write_image(self.image, self.machine, plan["build"], self.distribution, folder)
        super().__init__(None, folder, name, plan, processors)

    def prepare(self):
        die_with_parent()
        os.sched_setaffinity(0, self.processors)
        os.nice(VIRTUAL_NICE)

    def command(self, kernel):
        words = [f"console={self.machine.console}", "quiet", "rdinit=/init", "panic=-1", f"iwheel_python={self.python}"]
        words += [f"iwheel_guest={os.path.join(HERE, 'guest.py')}", f"iwheel_plan={self.path('json')}"]
        command = [*self.machine.emulator, "-accel", "tcg", "-icount", "shift=1,sleep=off", "-m", "1024", "-display", "none", "-nic", "none"]
        command += ["-no-reboot", "-serial", "stdio", "-kernel", os.path.join(self.distribution, "vmlinuz"), "-initrd", self.image]
        command += ["-append", " ".join(words), "-virtfs", f"local,path={self.folder},mount_tag=results,security_model=none"]
        return [*command, "-object", "can-bus,id=bus", *self.machine.cards]
