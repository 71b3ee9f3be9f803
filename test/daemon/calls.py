#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Checks that every system call of the gateway goes to the virtual kernel: the gateway may use no other call of the C library.

usage: test/daemon/calls.py NM TEST_DAEMON

Add a new call to `calls` of CMakeLists.txt and its behaviour to kernel*.c; or add it below, with the reason why not.
"""

import subprocess
import sys

# These call no system function, or one whose result is the same in every run.
PURE = """__ctype_b_loc __errno_location abort bcmp bsearch getenv getopt_long ini_parse_stream longjmp _setjmp memchr memcmp memcpy memmem memmove memset mmap munmap qsort
    optarg opterr optind setenv sigaddset sigemptyset snprintf strchr strcmp strcspn strerror strlen strncmp strpbrk strrchr strsignal strspn strstr strtod strtol
    strtoul strtoull unsetenv vsnprintf"""
# These write to a stream of the test or to memory; stderr is discarded.
STREAMS = "stderr stdin stdout fclose ferror fflush fmemopen fopen fprintf fputs freopen fwrite printf puts"
# Only these use them: child processes, which are simulated; --check; a bus or an e-stop unix:PATH; kernels without epoll_pwait2; a configured group.
NOT_CALLED = """_exit access closedir closefrom dup2 faccessat fallocate fchmod fchownat fdopen fdopendir fileno fsync getgrnam glob globfree ppoll readdir
    realpath renameat rewind setpriority sleep"""
# The virtual kernel itself calls the real functions.
BEHIND = "calloc free"


def main():
    names = subprocess.run([sys.argv[1], "-u", sys.argv[2]], capture_output=True, text=True, check=True).stdout.split()
    asked = {name.split("@")[0] for name in names if len(name) > 1}
    known = set(" ".join((PURE, STREAMS, NOT_CALLED, BEHIND)).split())
    new = sorted(name for name in asked - known if not name.startswith(("_ITM_", "__cxa", "__gmon", "__libc", "mnl_attr", "mnl_nlmsg")))
    for name in new:
        print(f"failed: {name} would call the real system; see the head of test/daemon/calls.py")
    return 1 if new else 0


if __name__ == "__main__":
    sys.exit(main())
