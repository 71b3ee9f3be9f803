// SPDX-License-Identifier: MIT
// The forms of other tools are written by libraries of Python: the module iwheel.export of package python3-iwheel.
#include "talk/ctl.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define PATH_SIZE 4096

int verb_export(ctl_t *self, int count, char **words) {
    static char python[] = "python3";
    static char option[] = "-c";
    static char code[] = "import sys\n"
                         "try:\n"
                         "    from iwheel.export import main\n"
                         "except ImportError as error:\n"
                         "    print(f'iwheelctl: export needs the Python package iwheel ({error}); install it: "
                         "apt-get install ./python3-iwheel_*.deb', file=sys.stderr)\n"
                         "    sys.exit(69)\n"
                         "sys.exit(main())\n";
    static char path[PATH_SIZE];
    (void)self;
    char **all = (char **)calloc((size_t)count + 4U, sizeof *all);
    const ssize_t length = readlink("/proc/self/exe", path, sizeof path - 1U);
    if (all == NULL || length < 0 || setenv("IWHEELCTL", path, 1) != 0) {
        free((void *)all);
        return ctl_fail(CTL_INTERNAL, "cannot prepare the export: %s", strerror(errno));
    }
    all[0] = python;
    all[1] = option;
    all[2] = code;
    memcpy((void *)&all[3], (const void *)words, (size_t)count * sizeof *all);
    (void)execvp(python, all);
    free((void *)all);
    return ctl_fail(CTL_UNAVAILABLE, "python3 cannot be started (%s); install it: apt-get install python3",
                    strerror(errno));
}
