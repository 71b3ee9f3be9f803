// SPDX-License-Identifier: MIT
// Small versions of functions for which the C library and the library of the compiler have larger, faster ones. With
// those the gateway image would not fit into the 62 KiB of an STM32F103. Most copies are shorter than 20 bytes.
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

void *memcpy(void *to, const void *from, size_t size);
void *memmove(void *to, const void *from, size_t size);
void *memset(void *to, int value, size_t size);
int memcmp(const void *one, const void *other, size_t size);
size_t strlen(const char *text);
int strncmp(const char *one, const char *other, size_t size);
int strcmp(const char *one, const char *other);
char *strchr(const char *text, int wanted);
uint64_t __udivmoddi4(uint64_t number, uint64_t divisor, uint64_t *out_rest);

/// Four bytes at any address: these processors read and write them in one instruction.
typedef struct __attribute__((packed, may_alias)) {
    uint32_t value;
} word_t;
#define WORD sizeof(word_t)

/// Copies forward: valid too if `to` is before `from` and they overlap.
void *memcpy(void *to, const void *from, size_t size) {
    uint8_t *const target = to;
    const uint8_t *const source = from;
    const size_t words = size / WORD * WORD;
    size_t i = 0;
    for (; i < words; i += WORD) {
        ((word_t *)(target + i))->value = ((const word_t *)(source + i))->value;
    }
    for (; i < size; i++) {
        target[i] = source[i];
    }
    return to;
}

void *memmove(void *to, const void *from, size_t size) {
    uint8_t *const target = to;
    const uint8_t *const source = from;
    if (target <= source) {
        return memcpy(to, from, size);
    }
    size_t i = size;
    for (; i >= WORD; i -= WORD) {
        ((word_t *)(target + i - WORD))->value = ((const word_t *)(source + i - WORD))->value;
    }
    for (; i > 0U; i--) {
        target[i - 1U] = source[i - 1U];
    }
    return to;
}

void *memset(void *to, int value, size_t size) {
    uint8_t *const target = to;
    size_t i = 0;
    for (; size - i >= WORD; i += WORD) {
        ((word_t *)(target + i))->value = (uint8_t)value * 0x01010101U;
    }
    for (; i < size; i++) {
        target[i] = (uint8_t)value;
    }
    return to;
}

int memcmp(const void *one, const void *other, size_t size) {
    const uint8_t *const left = one;
    const uint8_t *const right = other;
    for (size_t i = 0; i < size; i++) {
        if (left[i] != right[i]) {
            return (int)left[i] - (int)right[i];
        }
    }
    return 0;
}

size_t strlen(const char *text) {
    size_t length = 0;
    while (text[length] != '\0') {
        length++;
    }
    return length;
}

int strncmp(const char *one, const char *other, size_t size) {
    for (size_t i = 0; i < size; i++) {
        if (one[i] != other[i] || one[i] == '\0') {
            return (int)(uint8_t)one[i] - (int)(uint8_t)other[i];
        }
    }
    return 0;
}

int strcmp(const char *one, const char *other) {
    return strncmp(one, other, SIZE_MAX);
}

char *strchr(const char *text, int wanted) {
    for (; *text != (char)wanted; text++) {
        if (*text == '\0') {
            return NULL;
        }
    }
    return (char *)(uintptr_t)text;
}

/// Divides 16 bits at a time, for which the processor has a division. The divisor must be 1..65535.
static uint64_t divide_by_small(uint64_t number, uint32_t divisor, uint32_t *out_rest) {
    uint64_t quotient = 0;
    uint32_t rest = 0;
    for (unsigned shift = 64; shift > 0U; shift -= 16U) {
        const uint32_t part = rest << 16U | (uint32_t)(number >> (shift - 16U) & 0xFFFFU);
        quotient = quotient << 16U | part / divisor;
        rest = part % divisor;
    }
    *out_rest = rest;
    return quotient;
}

/// Divides one bit at a time. The quotient by 0 is 0.
static uint64_t divide_by_large(uint64_t number, uint64_t divisor, uint64_t *out_rest) {
    uint64_t quotient = 0;
    uint64_t rest = 0;
    for (unsigned bit = 64; bit > 0U && divisor != 0U; bit--) {
        const uint64_t carry = rest >> 63U;
        rest = rest << 1U | number >> 63U;
        number <<= 1U;
        quotient <<= 1U;
        if (carry != 0U || rest >= divisor) {
            rest -= divisor;
            quotient |= 1U;
        }
    }
    *out_rest = rest;
    return quotient;
}

/// Serves the run-time functions for 64-bit division. Most divisors here are 1000, and the main loop waits for each
/// call.
uint64_t __udivmoddi4(uint64_t number, uint64_t divisor, uint64_t *out_rest) {
    uint64_t rest = 0;
    uint32_t small = 0;
    const bool is_small = divisor != 0U && divisor < 65536U;
    const uint64_t quotient =
        is_small ? divide_by_small(number, (uint32_t)divisor, &small) : divide_by_large(number, divisor, &rest);
    if (out_rest != NULL) {
        *out_rest = is_small ? small : rest;
    }
    return quotient;
}
