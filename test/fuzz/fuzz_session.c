// SPDX-License-Identifier: MIT
// Any sequence of requests, in time, to a whole gateway with its wheels: through the board's host code, whose replies need no socket. Each line of
// the input is one action: `+N` lets N ms pass, `^` and `_` press and release the button, `q` sends a request on channel 1 with all fields that a
// command must quote, `@` is a line of the relay, `2` a client on channel 2, any other line is sent on channel 1 unchanged. For any order of requests: every reply
// is a whole line, an id is answered once, commands stay within the limits, are zero while the gateway listens, and do not rise in a latch.
#include "fuzz_sequence.h"

#include "../support/gateway_rig.h"
#include "host.h"
#include "serial.h"

#define BOOT     0x0123456789abcdefU
#define TOTAL_MS 20000U

static gateway_rig_t rig;
static brd_host_t host;
static char wire[2U * IWN_LINE_BOARD_MAX];
static size_t wire_length, wire_taken;
static uint64_t t_us, seq, spent_ms, answers, asked, moved;

static size_t fuzz_unit(const uint8_t *data, size_t size) {
    return fuzz_until(data, size, '\n');
}

size_t brd_serial_read(char *out, size_t size) {
    const size_t count = (size < wire_length - wire_taken) ? size : wire_length - wire_taken;
    memcpy(out, &wire[wire_taken], count);
    wire_taken += count;
    return count;
}

bool brd_serial_had_error(void) {
    return false;
}

size_t brd_serial_room(void) {
    return BRD_SERIAL_SEND_BYTES;
}

bool brd_serial_write(const char *bytes, size_t length) {
    iwn_line_t line;
    fuzz_require(length > 0U && bytes[length - 1U] == '\n' && memchr(bytes, '\n', length) == &bytes[length - 1U],
                 "one line");
    fuzz_require(iwn_line_read(bytes, length - 1U, true, &line) == IWN_LINE_GOOD, "every line sent is correct");
    fuzz_require(line.t_us >= t_us, "time goes on");
    t_us = line.t_us;
    answers += (line.length >= 6U && line.channel == 1U && memcmp(line.json, "{\"id\":", 6) == 0) ? 1U : 0U;
    return true;
}

bool brd_serial_lend(const char *bytes, size_t length) {
    return brd_serial_write(bytes, length);
}

bool brd_serial_lends(void) {
    return false;
}

bool brd_serial_is_idle(void) {
    return true;
}

bool brd_host_store(const brd_settings_t *settings) {
    (void)settings;
    return true;
}

static brd_assumptions_t stored;
static bool has_kept;

bool brd_host_read_assumptions(brd_assumptions_t *out_learned) {
    *out_learned = stored;
    return has_kept;
}

bool brd_host_write_assumptions(const brd_assumptions_t *learned) {
    stored = *learned;
    has_kept = true;
    return true;
}

static void send_line(uint8_t channel, const char *json, size_t length) {
    const iwn_line_t line = {.json = json, .length = length, .channel = channel};
    wire_taken = 0;
    wire_length = iwn_line_write(&line, wire, IWN_LINE_BOARD_MAX);
    while (brd_host_receive(&host, rig.now_us)) {
    }
    wire_length = wire_taken = 0;
}

/// Sends a line of the relay.
static void send_text(const char *json) {
    send_line(0, json, strlen(json));
}

static void judge(const int32_t before[IW_SIDES], bool was_latched) {
    const iw_state_t state = iw_gateway_state(&rig.gateway);
    fuzz_require(rig.gateway.sender.envelope.stopped == 0U && rig.gateway.sender.sent.clamped == 0U,
                 "the gate has nothing to stop");
    for (size_t side = 0; side < IW_SIDES; side++) {
        const int32_t commanded = rig.bus.commanded_mm_s[side];
        fuzz_require(abs(commanded) <= rig.config.max_speed_mm_s, "within the limits");
        fuzz_require(!was_latched || state != IW_STATE_LATCHED || abs(commanded) <= abs(before[side]),
                     "a latch never goes faster");
        moved += (commanded != 0) ? 1U : 0U;
    }
}

static void pass(uint32_t span_ms) {
    for (uint32_t ms = 0; ms < span_ms && spent_ms < TOTAL_MS; ms += 5U, spent_ms += 5U) {
        const int32_t before[IW_SIDES] = {rig.bus.commanded_mm_s[IW_LEFT], rig.bus.commanded_mm_s[IW_RIGHT]};
        const bool was_latched = iw_gateway_state(&rig.gateway) == IW_STATE_LATCHED;
        if (ms % 100U == 0U) {
            send_text("{\"cmd\":\"alive\"}"); // Otherwise the board closes all channels after 500 ms.
        }
        gateway_rig_step(&rig);
        const iw_snapshot_t seen = gateway_rig_snapshot(&rig);
        (void)brd_host_report(&host, &seen, false);
        rig.judge.violation = NULL; // The judge does not know the requests of this target.
        gateway_rig_run(&rig, 5000);
        judge(before, was_latched);
    }
}

/// Sends a request with boot, number and time stamp before its fields.
static void send_quoted(const uint8_t *text, size_t size) {
    static char json[IWN_LINE_BOARD_MAX];
    const int head = snprintf(json, sizeof json, "{\"boot\":\"%016llx\",\"seq\":%llu,\"t_us\":%llu,",
                              (unsigned long long)BOOT, (unsigned long long)++seq, (unsigned long long)t_us);
    const size_t skip = (size > 0U && text[0] == '{') ? 1U : 0U;
    const size_t length = (size_t)head + size - skip;
    if (length < sizeof json) {
        memcpy(&json[head], &text[skip], size - skip);
        send_line(1, json, length);
    }
}

static void act(const uint8_t *text, size_t size) {
    asked++;
    if (size > 0U && text[0] == '+') {
        char number[8] = "";
        memcpy(number, &text[1], (size - 1U < sizeof number - 1U) ? size - 1U : sizeof number - 1U);
        pass((uint32_t)strtoul(number, NULL, 10) % 3000U);
    } else if (size > 0U && (text[0] == '^' || text[0] == '_')) {
        gateway_rig_press(&rig, text[0] == '^');
        pass(10);
    } else if (size > 0U && text[0] == 'q') {
        send_quoted(&text[1], size - 1U);
    } else if (size > 0U && (text[0] == '@' || text[0] == '2')) {
        send_line((text[0] == '2') ? 2 : 0, (const char *)&text[1], (size < IWN_LINE_BOARD_MAX - 32U) ? size - 1U : 0U);
    } else if (size < IWN_LINE_BOARD_MAX - 32U) {
        send_line(1, (const char *)text, size);
    }
    pass(5);
}

/// Begins with wheels that have been at standstill for a while. Made once: every input begins with a copy.
static void prepare(void) {
    gateway_rig_init(&rig);
    memset(&host, 0, sizeof host);
    wire_length = wire_taken = 0;
    t_us = seq = 0;
    const brd_host_place_t place = {.gateway = &rig.gateway,
                                    .version = "0.0.0",
                                    .bus = "can",
                                    .estop = "PB0",
                                    .bitrate_hz = 1000000,
                                    .sample_point_permille = 625,
                                    .settings = brd_settings_from(&rig.config),
                                    .rate_max_hz = 10,
                                    .boot = BOOT};
    brd_host_init(&host, &place, rig.now_us);
    gateway_rig_run(&rig, 600000);
    send_text("{\"cmd\":\"link\"}");
    send_text("{\"cmd\":\"open\",\"channel\":1,\"watch\":false}");
    pass(20);
}

static void begin(void) {
    static gateway_rig_t first_rig;
    static brd_host_t first_host;
    static uint64_t first_us;
    if (first_us == 0U) {
        prepare();
        first_rig = rig;
        first_host = host;
        first_us = t_us;
    }
    rig = first_rig;
    host = first_host;
    t_us = first_us;
    wire_length = wire_taken = 0;
    seq = spent_ms = answers = asked = moved = 0;
    has_kept = false;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    begin();
    for (size_t at = 0, unit; at < size && spent_ms < TOTAL_MS; at += unit) {
        unit = fuzz_unit(&data[at], size - at);
        act(&data[at], unit - ((data[at + unit - 1U] == '\n') ? 1U : 0U));
    }
    pass(100);
    fuzz_require(answers <= asked, "a request is answered once");
    fuzz_position((moved > 0U) ? "accepted" : "refused");
    return 0;
}
