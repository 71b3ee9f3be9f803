// SPDX-License-Identifier: MIT
#include "credentials.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sysexits.h>
#include <unistd.h>

static int complain(int code, const char *path, const char *what) {
    (void)fprintf(stderr, "iwheel: %s: %s\n", path, what);
    return code;
}

/// Judges a file with a secret. Returns 0, or an exit code.
static int judge_secret(int file, const char *path) {
    struct stat status = {0};
    const bool known = fstat(file, &status) == 0;
    const bool ours = known && (status.st_uid == geteuid() || status.st_uid == 0U);
    // A file of root may be readable by the group of the bridge: the administrator provides it in this way.
    const mode_t others = (status.st_uid == 0U) ? 0037U : 0077U;
    return (ours && (status.st_mode & others) == 0U)
               ? 0
               : complain(EX_NOPERM, path,
                          "other users may read or change it; chown it to iwheel-mqtt and chmod it to 600");
}

static int read_credentials(const char *path, char **out_user, char **out_password) {
    char line[512];
    FILE *file = fopen(path, "re");
    if (file == NULL) {
        return complain(EX_NOPERM, path, strerror(errno));
    }
    const int code = judge_secret(fileno(file), path);
    const bool read = code == 0 && fgets(line, sizeof line, file) != NULL;
    (void)fclose(file);
    if (code != 0) {
        return code;
    }
    line[read ? strcspn(line, "\r\n") : 0U] = '\0';
    char *colon = strchr(line, ':');
    if (colon == NULL || colon == line) {
        return complain(EX_CONFIG, path, "its first line is not USER:PASSWORD");
    }
    *colon = '\0';
    *out_user = strdup(line);
    *out_password = strdup(colon + 1);
    explicit_bzero(line, sizeof line);
    return (*out_user != NULL && *out_password != NULL) ? 0 : EX_OSERR;
}

static int check_files(const mqtt_settings_t *settings) {
    const char *const files[] = {settings->broker.ca, settings->broker.certificate, settings->broker.key};
    for (size_t i = 0; i < sizeof files / sizeof files[0]; i++) {
        if (mqtt_settings_given(files[i]) && access(files[i], R_OK) != 0) {
            return complain(EX_NOPERM, files[i], strerror(errno));
        }
    }
    const int key = mqtt_settings_given(settings->broker.key) ? open(settings->broker.key, O_RDONLY | O_CLOEXEC) : -1;
    const int code = (key >= 0) ? judge_secret(key, settings->broker.key) : 0;
    if (key >= 0) {
        (void)close(key);
    }
    return code;
}

int mqtt_credentials_read(const mqtt_settings_t *settings, char **out_user, char **out_password) {
    const int code = check_files(settings);
    return (code != 0 || !mqtt_settings_given(settings->broker.credentials))
               ? code
               : read_credentials(settings->broker.credentials, out_user, out_password);
}
