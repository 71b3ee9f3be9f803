// SPDX-License-Identifier: MIT
/// usage: codec decode|encode ROUNDS
#include "bench_codec.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

int main(int argc, char **argv) {
    if (argc != 3) {
        fprintf(stderr, "usage: %s decode|encode ROUNDS\n", argv[0]);
        return 64;
    }
    const uint32_t rounds = (uint32_t)strtoul(argv[2], NULL, 10);
    bench_fill();
    return (((strcmp(argv[1], "decode") == 0) ? bench_decode(rounds) : bench_encode(rounds)) == 0U) ? 0 : 1;
}
