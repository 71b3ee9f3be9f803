// SPDX-License-Identifier: MIT
#include "lan.h"

#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <gnutls/crypto.h>
#include <gnutls/x509.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sysexits.h>
#include <time.h>
#include <unistd.h>

/// Days of validity. Phones refuse a certificate that is valid for more than 825 days.
#define DAYS_VALID 820
#define DAY_S      86400
#define NAME_SIZE  65U

#define NO_WRITE "set token_file to a file in a folder to which the bridge may write"
#define NO_MAKE  "set certificate and key in the configuration, or leave out --lan"

static int complain(const char *what, const char *why, const char *fix) {
    (void)fprintf(stderr, "iwheel-web: %s: %s; %s\n", what, why, fix);
    return EX_CANTCREAT;
}

bool web_lan_address(char out[INET_ADDRSTRLEN]) {
    // An address for documentation: the kernel only selects the interface, and no packet is sent.
    struct sockaddr_in there = {.sin_family = AF_INET, .sin_port = htons(9)};
    struct sockaddr_in here = {.sin_family = AF_INET};
    socklen_t size = sizeof here;
    (void)inet_pton(AF_INET, "192.0.2.1", &there.sin_addr);
    const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    const bool good = fd >= 0 && connect(fd, (const struct sockaddr *)&there, sizeof there) == 0 &&
                      getsockname(fd, (struct sockaddr *)&here, &size) == 0 &&
                      inet_ntop(AF_INET, &here.sin_addr, out, INET_ADDRSTRLEN) != NULL;
    const int error = errno;
    if (fd >= 0) {
        (void)close(fd);
    }
    errno = error;
    return good;
}

static void host_name(char out[NAME_SIZE]) {
    if (gethostname(out, NAME_SIZE - 1U) != 0 || out[0] == '\0') {
        (void)snprintf(out, NAME_SIZE, "iwheel");
    }
    out[NAME_SIZE - 1U] = '\0';
}

/// Writes a new file and renames it, so that no program reads an incomplete file. Only the owner may read it. Returns 0,
/// or an exit code with a line on stderr.
static int write_file(const char *path, const gnutls_datum_t *data) {
    char temporary[128];
    (void)snprintf(temporary, sizeof temporary, "%s.new", path);
    (void)unlink(temporary);
    const int file = open(temporary, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, 0600);
    if (file < 0) {
        return complain(temporary, strerror(errno), NO_WRITE);
    }
    errno = ENOSPC; // A short write sets no errno.
    const bool written = write(file, data->data, data->size) == (ssize_t)data->size;
    const int error = errno;
    (void)close(file);
    if (!written) {
        return complain(temporary, strerror(error),
                        "delete files on this disk, or set token_file to a folder on another one");
    }
    return (rename(temporary, path) == 0) ? 0
                                          : complain(path, strerror(errno), "remove it, and start the bridge again");
}

/// Adds the names and addresses by which a browser may call this machine.
static int name_subject(gnutls_x509_crt_t certificate) {
    char name[NAME_SIZE];
    char local[NAME_SIZE + 6U];
    char text[INET_ADDRSTRLEN];
    struct in_addr address;
    const unsigned flags = GNUTLS_FSAN_APPEND;
    host_name(name);
    (void)snprintf(local, sizeof local, "%s.local", name);
    int error =
        gnutls_x509_crt_set_dn_by_oid(certificate, GNUTLS_OID_X520_COMMON_NAME, 0, name, (unsigned)strlen(name));
    const char *const names[] = {name, local, "localhost"};
    for (size_t i = 0; i < sizeof names / sizeof names[0] && error == 0; i++) {
        error = gnutls_x509_crt_set_subject_alt_name(certificate, GNUTLS_SAN_DNSNAME, names[i],
                                                     (unsigned)strlen(names[i]), flags);
    }
    if (error == 0 && web_lan_address(text) && inet_pton(AF_INET, text, &address) == 1) {
        error =
            gnutls_x509_crt_set_subject_alt_name(certificate, GNUTLS_SAN_IPADDRESS, &address, sizeof address, flags);
    }
    return error;
}

static int fill(gnutls_x509_crt_t certificate, gnutls_x509_privkey_t key) {
    unsigned char serial[16];
    const time_t now = time(NULL);
    int error = gnutls_rnd(GNUTLS_RND_NONCE, serial, sizeof serial);
    serial[0] = (unsigned char)((serial[0] & 0x7FU) | 0x40U); // Positive, and no leading zero.
    if (error == 0) {
        error = gnutls_x509_crt_set_version(certificate, 3);
    }
    if (error == 0) {
        error = gnutls_x509_crt_set_serial(certificate, serial, sizeof serial);
    }
    if (error == 0) {
        error = gnutls_x509_crt_set_activation_time(certificate, now - DAY_S);
    }
    if (error == 0) {
        error = gnutls_x509_crt_set_expiration_time(certificate, now + (time_t)DAYS_VALID * DAY_S);
    }
    if (error == 0) {
        error = name_subject(certificate);
    }
    if (error == 0) {
        error = gnutls_x509_crt_set_basic_constraints(certificate, 0, -1);
    }
    if (error == 0) {
        error = gnutls_x509_crt_set_key_usage(certificate, GNUTLS_KEY_DIGITAL_SIGNATURE);
    }
    if (error == 0) {
        error = gnutls_x509_crt_set_key_purpose_oid(certificate, GNUTLS_KP_TLS_WWW_SERVER, 0);
    }
    if (error == 0) {
        error = gnutls_x509_crt_set_key(certificate, key);
    }
    if (error == 0) {
        error = gnutls_x509_crt_sign2(certificate, certificate, key, GNUTLS_DIG_SHA256, 0);
    }
    return error;
}

static int write_pair(const web_settings_t *settings, gnutls_x509_crt_t certificate, gnutls_x509_privkey_t key) {
    gnutls_datum_t key_text = {NULL, 0};
    gnutls_datum_t text = {NULL, 0};
    int error = gnutls_x509_privkey_generate2(key, GNUTLS_PK_ECDSA,
                                              (unsigned)GNUTLS_CURVE_TO_BITS(GNUTLS_ECC_CURVE_SECP256R1), 0, NULL, 0);
    if (error == 0) {
        error = fill(certificate, key);
    }
    if (error == 0) {
        error = gnutls_x509_privkey_export2(key, GNUTLS_X509_FMT_PEM, &key_text);
    }
    if (error == 0) {
        error = gnutls_x509_crt_export2(certificate, GNUTLS_X509_FMT_PEM, &text);
    }
    int code = (error == 0) ? 0 : complain("the certificate cannot be made", gnutls_strerror(error), NO_MAKE);
    if (code == 0) {
        code = write_file(settings->web.key, &key_text);
    }
    if (code == 0) {
        code = write_file(settings->web.certificate, &text);
    }
    gnutls_memset(key_text.data, 0, key_text.size);
    gnutls_free(key_text.data);
    gnutls_free(text.data);
    return code;
}

static int make_pair(const web_settings_t *settings) {
    gnutls_x509_crt_t certificate = NULL;
    gnutls_x509_privkey_t key = NULL;
    int error = gnutls_x509_crt_init(&certificate);
    if (error == 0) {
        error = gnutls_x509_privkey_init(&key);
    }
    const int code = (error == 0) ? write_pair(settings, certificate, key)
                                  : complain("the certificate cannot be made", gnutls_strerror(error), NO_MAKE);
    gnutls_x509_privkey_deinit(key);
    gnutls_x509_crt_deinit(certificate);
    return code;
}

/// Returns NULL if this is a certificate that has not expired; otherwise why it is not used.
static const char *fault_of(const char *path) {
    gnutls_datum_t text = {NULL, 0};
    gnutls_x509_crt_t certificate = NULL;
    int error = gnutls_load_file(path, &text);
    if (error == 0) {
        error = gnutls_x509_crt_init(&certificate);
    }
    if (error == 0) {
        error = gnutls_x509_crt_import(certificate, &text, GNUTLS_X509_FMT_PEM);
    }
    const char *fault = (error == 0) ? NULL : gnutls_strerror(error);
    if (error == 0 && gnutls_x509_crt_get_expiration_time(certificate) <= time(NULL) + DAY_S) {
        fault = "it has expired";
    }
    if (certificate != NULL) {
        gnutls_x509_crt_deinit(certificate);
    }
    gnutls_free(text.data);
    return fault;
}

/// Returns true if there is a certificate to use. Reports why an existing one is replaced. The start of the bridge
/// checks whether the key matches.
static bool is_good(const web_settings_t *settings) {
    const char *path = settings->web.key;
    const int error = (access(path, R_OK) == 0) ? 0 : errno;
    const char *fault = (error == 0) ? NULL : strerror(error);
    bool exists = error != ENOENT;
    if (fault == NULL) {
        path = settings->web.certificate;
        fault = fault_of(path);
        exists = access(path, F_OK) == 0;
    }
    if (fault != NULL && exists) {
        (void)complain(path, fault, "the bridge makes a new certificate, and each phone warns once more");
    }
    return fault == NULL;
}

/// Adds the names of this machine to `hosts` of the configuration.
static void add_host(web_settings_t *settings) {
    char name[NAME_SIZE];
    char all[sizeof settings->web.hosts + 2U * (size_t)NAME_SIZE + 16U];
    host_name(name);
    (void)snprintf(all, sizeof all, "%s %s %s.local", web_settings_hosts(settings), name, name);
    if (strlen(all) < sizeof settings->web.hosts) {
        memcpy(settings->web.hosts, all, strlen(all) + 1U);
    } else {
        (void)complain("hosts", "the name of this machine does not fit into the list",
                       "shorten hosts in the configuration");
    }
}

int web_lan_prepare(web_settings_t *settings) {
    (void)snprintf(settings->web.listen, sizeof settings->web.listen, "0.0.0.0");
    add_host(settings);
    if (web_settings_has_tls(settings)) {
        return 0;
    }
    const char *end = strrchr(settings->web.token_file, '/');
    const int length = (end != NULL) ? (int)(end - settings->web.token_file) + 1 : 0;
    const int one = snprintf(settings->web.certificate, sizeof settings->web.certificate, "%.*slan-certificate.pem",
                             length, settings->web.token_file);
    const int other =
        snprintf(settings->web.key, sizeof settings->web.key, "%.*slan-key.pem", length, settings->web.token_file);
    if (one >= (int)sizeof settings->web.certificate || other >= (int)sizeof settings->web.key) {
        return complain(settings->web.token_file, "its folder's name is too long", "set token_file to a shorter path");
    }
    return is_good(settings) ? 0 : make_pair(settings);
}
