// SPDX-License-Identifier: MIT
/// Who may run a gateway on this machine, and folders in which nobody else can put one thing in another's place.
///
/// A gateway is run by root, by the service's user (to whom systemd gives the runtime directory) or by whoever runs this
/// one. What belongs to anybody else is a stranger's: a lock, a marker, a socket, a folder.
#ifndef GATEWAY_OWNERS_H
#define GATEWAY_OWNERS_H

#include <stdbool.h>
#include <sys/stat.h>
#include <sys/types.h>

/// Where locks and markers of interfaces are. It vanishes when the machine is switched off, and the wheels with it.
#define SOCK_RUNTIME_DIRECTORY "/run/iwheel"

/// A path that fits a unix socket address, with its terminator; the same behind `unix:`.
#define SOCK_PATH_SIZE    108U
#define SOCK_ADDRESS_SIZE 113U

typedef struct {
    uid_t own;
    uid_t service; ///< Root's if there is no service.
} sock_owners_t;

/// Reasons why a folder is not used, beside an errno.
enum {
    SOCK_FOLDER_FOREIGN = 0x10000, ///< It belongs to a stranger.
    SOCK_FOLDER_SHARED,            ///< Others than its owner may write there.
    SOCK_FOLDER_FILE,              ///< A file in it belongs to a stranger, has a second name, or is none.
};

typedef struct {
    int fd;      ///< O_PATH; -1: not open.
    bool shared; ///< Anybody may put files there, but only their owners can take them away (sticky, like /tmp).
} sock_folder_t;

/// `runtime_directory` is SOCK_RUNTIME_DIRECTORY but in tests. Its owner counts only if nobody else may write there.
sock_owners_t sock_owners_of(const char *runtime_directory);

bool sock_owners_have(const sock_owners_t *self, uid_t uid);

/// True of a plain file with one name that belongs to one of them.
bool sock_owners_wrote(const sock_owners_t *self, const struct stat *status);

/// Opens a folder, not through a symbolic link, and judges it: it belongs to one of the owners, and nobody else may write
/// to it or it is sticky. 0, an errno, or one of the reasons above; then `fd` is -1. Files are reached from `fd` only.
int sock_folder_open(sock_folder_t *self, const char *path, const sock_owners_t *owners);

void sock_folder_close(sock_folder_t *self);

/// Opens a folder for reading and writing files, in which nobody else may put anything, sticky or not. A descriptor, or -1 with
/// errno, which may be one of the reasons above.
int sock_folder_open_own(const char *path);

void sock_folder_of(const char *path, char *out_folder, size_t size);

/// What is wrong, and what mends it, of an errno or one of the reasons.
const char *sock_folder_fault(int error);
const char *sock_folder_cure(int error);

#endif
