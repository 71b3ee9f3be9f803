#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Every call of the gateway that reaches the system is led into the virtual kernel: nothing else may be asked of the C library.

usage: test/daemon/calls.py NM TEST_DAEMON

A new one belongs into `calls` of CMakeLists.txt and, with what it means, into kernel*.c; or below, with the reason why not.
"""

import subprocess
import sys

# They ask the system for nothing; or what they ask is the same in every run.
PURE = """__ctype_b_loc __errno_location abort bcmp bsearch getenv getopt_long ini_parse_stream longjmp _setjmp memchr memcmp memcpy memmem memmove memset mmap munmap qsort
    optarg opterr optind setenv sigaddset sigemptyset snprintf strchr strcmp strcspn strerror strlen strncmp strpbrk strrchr strsignal strspn strstr strtod strtol
    strtoul strtoull unsetenv vsnprintf"""
# To a stream of the test's own or in memory; stderr is nowhere.
STREAMS = "stderr stdin stdout fclose ferror fflush fmemopen fopen fprintf fputs freopen fwrite printf puts"
# Of child processes, which are played; of --check; of a bus or an e-stop unix:PATH; of kernels without epoll_pwait2; of a configured group.
NOT_CALLED = """_exit access close_range closedir dup2 faccessat fallocate fchmod fchownat fdopen fdopendir fileno fsync getgrnam glob globfree ppoll readdir
    realpath renameat rewind setpriority sleep"""
# The real ones, called by the kernel itself.
BEHIND = "calloc free"


def main():
    names = subprocess.run([sys.argv[1], "-u", sys.argv[2]], capture_output=True, text=True, check=True).stdout.split()
    asked = {name.split("@")[0] for name in names if len(name) > 1}
    known = set(" ".join((PURE, STREAMS, NOT_CALLED, BEHIND)).split())
    new = sorted(name for name in asked - known if not name.startswith(("_ITM_", "__cxa", "__gmon", "__libc", "mnl_attr", "mnl_nlmsg")))
    for name in new:
        print(f"failed: {name} would be asked of the real system: see the head of test/daemon/calls.py")
    return 1 if new else 0


if __name__ == "__main__":
    sys.exit(main())
