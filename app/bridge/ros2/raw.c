// SPDX-License-Identifier: MIT
// The functions by which CycloneDDS handles a type. CycloneDDS calls a type sertype and a sample serdata.
#include "raw.h"

#include <dds/ddsi/ddsi_serdata.h>
#include <dds/ddsi/ddsi_sertype.h>
#include <dds/ddsi/q_radmin.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
    struct ddsi_serdata base;
    ros_raw_t raw;
} data_t;

static data_t *data_new(const struct ddsi_sertype *type, enum ddsi_serdata_kind kind) {
    data_t *data = calloc(1, sizeof *data);
    if (data != NULL) {
        ddsi_serdata_init(&data->base, type, kind);
    }
    return data;
}

static const data_t *data_of(const struct ddsi_serdata *base) {
    return (const data_t *)(const void *)base;
}

static bool data_equals(const struct ddsi_serdata *one, const struct ddsi_serdata *other) {
    (void)one;
    (void)other;
    return true; // The type has no key, so all samples belong to one instance.
}

static size_t stored(const ros_raw_t *raw) {
    return (raw->size < ROS_RAW_MAX) ? raw->size : ROS_RAW_MAX;
}

static uint32_t data_size(const struct ddsi_serdata *base) {
    return (uint32_t)stored(&data_of(base)->raw);
}

/// Copies the part of one fragment that is still missing at `*at`, and moves `*at` behind it.
static void copy_fragment(ros_raw_t *raw, size_t *at, const struct nn_rdata *fragment) {
    const size_t end = (fragment->maxp1 < ROS_RAW_MAX) ? fragment->maxp1 : ROS_RAW_MAX;
    if (fragment->min <= *at && end > *at) {
        const uint8_t *payload = NN_RMSG_PAYLOADOFF(fragment->rmsg, NN_RDATA_PAYLOAD_OFF(fragment));
        memcpy(raw->bytes + *at, payload + (*at - fragment->min), end - *at);
        *at = end;
    }
}

static struct ddsi_serdata *data_from_network(const struct ddsi_sertype *type, enum ddsi_serdata_kind kind,
                                              const struct nn_rdata *fragments, size_t size) {
    data_t *data = data_new(type, kind);
    size_t at = 0;
    if (data == NULL) {
        return NULL;
    }
    data->raw.size = size;
    // The size of the chunk is that of the message plus the data that CycloneDDS stores behind it.
    (void)ros_service_identify(NN_RMSG_PAYLOAD(fragments->rmsg), fragments->rmsg->chunk.u.size,
                               NN_RDATA_SUBMSG_OFF(fragments), &data->raw.caller);
    for (; fragments != NULL; fragments = fragments->nextfrag) {
        copy_fragment(&data->raw, &at, fragments);
    }
    return &data->base;
}

static struct ddsi_serdata *data_from_parts(const struct ddsi_sertype *type, enum ddsi_serdata_kind kind,
                                            ddsrt_msg_iovlen_t count, const ddsrt_iovec_t *parts, size_t size) {
    data_t *data = data_new(type, kind);
    size_t at = 0;
    if (data == NULL) {
        return NULL;
    }
    data->raw.size = size;
    for (size_t i = 0; i < (size_t)count && at < ROS_RAW_MAX; i++) {
        const size_t space = ROS_RAW_MAX - at;
        const size_t length = (parts[i].iov_len < space) ? parts[i].iov_len : space;
        memcpy(data->raw.bytes + at, parts[i].iov_base, length);
        at += length;
    }
    return &data->base;
}

static struct ddsi_serdata *data_from_key(const struct ddsi_sertype *type, const struct ddsi_keyhash *hash) {
    (void)hash;
    data_t *data = data_new(type, SDK_KEY);
    return (data != NULL) ? &data->base : NULL;
}

static struct ddsi_serdata *data_from_sample(const struct ddsi_sertype *type, enum ddsi_serdata_kind kind,
                                             const void *sample) {
    data_t *data = data_new(type, kind);
    if (data == NULL) {
        return NULL;
    }
    data->raw = *(const ros_raw_t *)sample;
    return &data->base;
}

static void data_write(const struct ddsi_serdata *base, size_t from, size_t size, void *out) {
    memcpy(out, data_of(base)->raw.bytes + from, size);
}

static struct ddsi_serdata *data_lend(const struct ddsi_serdata *base, size_t from, size_t size, ddsrt_iovec_t *out) {
    const union {
        const uint8_t *lent;
        void *unwritten; // CycloneDDS only reads it.
    } bytes = {.lent = data_of(base)->raw.bytes + from};
    out->iov_base = bytes.unwritten;
    out->iov_len = (ddsrt_iov_len_t)size;
    return ddsi_serdata_ref(base);
}

static void data_give_back(struct ddsi_serdata *base, const ddsrt_iovec_t *lent) {
    (void)lent;
    ddsi_serdata_unref(base);
}

static bool data_to_sample(const struct ddsi_serdata *base, void *sample, void **buffer, void *end) {
    (void)buffer;
    (void)end;
    *(ros_raw_t *)sample = data_of(base)->raw;
    return true;
}

static struct ddsi_serdata *data_to_key(const struct ddsi_serdata *base) {
    data_t *data = data_new(base->type, SDK_KEY);
    if (data == NULL) {
        return NULL;
    }
    data->base.type = NULL; // CycloneDDS requires this of an untyped sample.
    return &data->base;
}

static bool key_to_sample(const struct ddsi_sertype *type, const struct ddsi_serdata *base, void *sample, void **buffer,
                          void *end) {
    (void)type;
    (void)base;
    (void)buffer;
    (void)end;
    memset(sample, 0, sizeof(ros_raw_t));
    return true;
}

static void data_free(struct ddsi_serdata *base) {
    free(base);
}

static size_t data_print(const struct ddsi_sertype *type, const struct ddsi_serdata *base, char *out, size_t size) {
    (void)type;
    (void)base;
    out[0] = '\0';
    return (size > 0U) ? 0U : 1U;
}

static void data_key_hash(const struct ddsi_serdata *base, struct ddsi_keyhash *out, bool force_md5) {
    (void)base;
    (void)force_md5;
    memset(out, 0, sizeof *out);
}

static const struct ddsi_serdata_ops data_functions = {
    .eqkey = data_equals,
    .get_size = data_size,
    .from_ser = data_from_network,
    .from_ser_iov = data_from_parts,
    .from_keyhash = data_from_key,
    .from_sample = data_from_sample,
    .to_ser = data_write,
    .to_ser_ref = data_lend,
    .to_ser_unref = data_give_back,
    .to_sample = data_to_sample,
    .to_untyped = data_to_key,
    .untyped_to_sample = key_to_sample,
    .free = data_free,
    .print = data_print,
    .get_keyhash = data_key_hash,
};

static void type_free(struct ddsi_sertype *type) {
    ddsi_sertype_fini(type);
    free(type);
}

static void type_zero(const struct ddsi_sertype *type, void *samples, size_t count) {
    (void)type;
    memset(samples, 0, count * sizeof(ros_raw_t));
}

/// CycloneDDS requires this function, but never calls it: the bridge passes its own sample to every dds_take.
static void type_allocate(void **out, const struct ddsi_sertype *type, void *before, size_t before_count,
                          size_t count) {
    (void)type;
    (void)before_count;
    ros_raw_t *samples = realloc(before, count * sizeof *samples);
    out[0] = samples;
    for (size_t i = 1; samples != NULL && i < count; i++) {
        out[i] = &samples[i];
    }
}

static void type_release(const struct ddsi_sertype *type, void **samples, size_t count, dds_free_op_t what) {
    (void)type;
    if (count > 0U && (what & DDS_FREE_ALL_BIT) != 0) {
        free(samples[0]);
    }
}

/// CycloneDDS compares the type names before it calls this function.
static bool type_equals(const struct ddsi_sertype *one, const struct ddsi_sertype *other) {
    (void)one;
    (void)other;
    return true;
}

static uint32_t type_hash(const struct ddsi_sertype *type) {
    (void)type;
    return 0;
}

static const struct ddsi_sertype_ops type_functions = {
    .version = ddsi_sertype_v0,
    .free = type_free,
    .zero_samples = type_zero,
    .realloc_samples = type_allocate,
    .free_samples = type_release,
    .equal = type_equals,
    .hash = type_hash,
};

dds_entity_t ros_raw_topic(dds_entity_t participant, const char *name, const char *type) {
    struct ddsi_sertype *made = calloc(1, sizeof *made);
    if (made == NULL) {
        return DDS_RETCODE_OUT_OF_RESOURCES;
    }
    ddsi_sertype_init(made, type, &type_functions, &data_functions, true);
    made->allowed_data_representation = DDS_DATA_REPRESENTATION_FLAG_XCDR1;
    const dds_entity_t topic = dds_create_topic_sertype(participant, name, &made, NULL, NULL, NULL);
    if (topic < 0) {
        ddsi_sertype_unref(made);
    }
    return topic;
}
