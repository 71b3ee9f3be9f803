// SPDX-License-Identifier: MIT
/// Users who may run a gateway on this machine, and folders in which no other user can replace a file.
///
/// A gateway may be run by root, by the user of the service (the owner of the runtime directory), and by the user of
/// this process. Locks, markers, sockets and folders of other users are foreign.
#ifndef GATEWAY_OWNERS_H
#define GATEWAY_OWNERS_H

#include <stdbool.h>
#include <sys/stat.h>
#include <sys/types.h>

/// Folder of locks and markers of interfaces. It disappears when the machine is switched off.
#define SOCK_RUNTIME_DIRECTORY "/run/iwheel"

/// Size of a path of a unix socket, with its terminator; the same after `unix:`.
#define SOCK_PATH_SIZE    108U
#define SOCK_ADDRESS_SIZE 113U

/// The users who may run a gateway, in addition to root.
typedef struct {
    uid_t own;     ///< Effective user of this process.
    uid_t service; ///< User of the service; root if there is none.
} sock_owners_t;

/// Reasons to refuse a folder, in addition to errno values.
enum {
    SOCK_FOLDER_FOREIGN = 0x10000, ///< The owner is not one of the allowed users.
    SOCK_FOLDER_SHARED,            ///< Users other than its owner may write to it.
    SOCK_FOLDER_FILE,              ///< A file in it has another owner, has a second name, or is not a regular file.
};

/// An open folder. `sock_folder_open` fills it, and its owner closes it.
typedef struct {
    int fd;      ///< Descriptor (O_PATH); -1 if not open.
    bool shared; ///< All users may create files in it, but only their owners can remove them (sticky, like /tmp).
} sock_folder_t;

/// Returns the users who may run a gateway. `runtime_directory` is SOCK_RUNTIME_DIRECTORY except in tests. Its owner
/// counts only if no other user may write to it.
sock_owners_t sock_owners_of(const char *runtime_directory);

/// Returns true for root and for the users of `self`.
bool sock_owners_have(const sock_owners_t *self, uid_t uid);

/// Returns true for a regular file with one name that one of the users owns.
bool sock_owners_wrote(const sock_owners_t *self, const struct stat *status);

/// Opens a folder, not through a symbolic link, and checks it: one of the users owns it, and no other user may write to
/// it or it is sticky. Returns 0, an errno, or one of the reasons above; then `fd` is -1. Use `fd` to access its files.
/// The caller closes an open folder with `sock_folder_close`. Only one thread of a process may call it.
int sock_folder_open(sock_folder_t *self, const char *path, const sock_owners_t *owners);

/// Closes an open folder and sets `fd` to -1. A closed folder is allowed.
void sock_folder_close(sock_folder_t *self);

/// Opens a folder for reading and writing files to which no other user may write, sticky or not. Returns a descriptor,
/// which the caller closes, or -1 and errno, which may be one of the reasons above.
int sock_folder_open_own(const char *path);

/// Copies the folder of `path` to `out_folder`, cut to `size` bytes with its terminator: "." for a name without a
/// slash, "/" for a path in the root.
void sock_folder_of(const char *path, char *out_folder, size_t size);

/// Returns the fault in one clause, for an errno or one of the reasons above. Valid until the next call.
const char *sock_folder_fault(int error);
/// Returns the fix of that fault in one clause. The text is static.
const char *sock_folder_fix(int error);

#endif
