// SPDX-License-Identifier: MIT
/// Opens a directory and a file in it only if no other user can write there. Root and the own user are not others.
#ifndef MQTT_FOLDER_H
#define MQTT_FOLDER_H

/// Opens a directory, not through a symbolic link. Returns a descriptor, or -1 with errno: EPERM if it belongs to
/// another user, or if others may write to it.
int mqtt_folder_open(const char *directory);

/// Opens a file in it for reading. Returns a descriptor, or -1 with errno: ENOENT if it does not exist, EPERM if it is
/// not a regular file with one name, or belongs to another user.
int mqtt_folder_open_file(int folder, const char *name);

/// Checks whether the directory or the file in it would be refused; locks and changes nothing. Returns 0, or the errno
/// of the two functions above; a missing file is not an error. `*out_unwritten`: the errno for which nothing could be
/// written there, otherwise 0.
int mqtt_folder_judge(const char *directory, const char *name, int *out_unwritten);

#endif
