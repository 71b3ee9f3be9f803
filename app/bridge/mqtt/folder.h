// SPDX-License-Identifier: MIT
/// Opens a directory and a file in it only if no other user can put anything there; root and the own user are no others.
#ifndef MQTT_FOLDER_H
#define MQTT_FOLDER_H

/// Not through a symbolic link. A descriptor; -1 with errno: EPERM if it belongs to another user, or if others may write to it.
int mqtt_folder_open(const char *directory);

/// A file in it, for reading. A descriptor; -1 with errno: ENOENT if there is none, EPERM if it is no plain file with one name, or belongs
/// to another user.
int mqtt_folder_open_file(int folder, const char *name);

/// Whether the directory or the file in it would be refused; locks and changes nothing. 0, or the errno of the two above; a missing file is
/// no error. `*out_unwritten`: why nothing could be written there, else 0.
int mqtt_folder_judge(const char *directory, const char *name, int *out_unwritten);

#endif
