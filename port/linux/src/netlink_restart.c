// SPDX-License-Identifier: MIT
#include "netlink_restart.h"

#include "netlink.h"

#include <errno.h>
#include <limits.h>
#include <sys/wait.h>
#include <unistd.h>

#define TRIES_MAX 60
#define PAUSE_S   1U

/// An interface that we took down must not stay down because its adapter is slow to answer: setting it up is tried
/// again. ENODEV: it is gone, there is nothing to bring up.
static int restart(int interface) {
    iw_netlink_t netlink;
    int error = iw_netlink_open(&netlink);
    if (error == 0) {
        error = iw_netlink_set_up(&netlink, interface, false);
    }
    if (error != 0) {
        return error;
    }
    error = iw_netlink_set_up(&netlink, interface, true);
    for (int i = 1; i < TRIES_MAX && error != 0 && error != ENODEV; i++) {
        (void)sleep(PAUSE_S);
        error = iw_netlink_set_up(&netlink, interface, true);
    }
    return error;
}

/// A process and not a thread: the kernel's lock on interface configuration can hold it for seconds, and it must
/// outlive a gateway that is killed between down and up.
int iw_netlink_restart_start(int interface, pid_t *out_process) {
    const pid_t process = fork();
    if (process < 0) {
        return errno;
    }
    if (process == 0) {
        (void)close_range(STDERR_FILENO + 1, UINT_MAX, 0); // Else clients and the lock file would stay open in it.
        const int error = restart(interface);
        _exit((error <= UCHAR_MAX) ? error : EIO);
    }
    *out_process = process;
    return 0;
}

int iw_netlink_restart_poll(pid_t process) {
    int status = 0;
    const pid_t ended = waitpid(process, &status, WNOHANG);
    if (ended == 0) {
        return IW_NETLINK_RESTART_RUNNING;
    }
    if (ended < 0) {
        return 0; // Somebody else has taken its status; whether the interface is up will be seen.
    }
    return WIFEXITED(status) ? WEXITSTATUS(status) : EIO;
}
