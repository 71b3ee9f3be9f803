// SPDX-License-Identifier: MIT
"use strict";
// A recording as an MCAP file (version 0 of the format, mcap.dev/spec) for Foxglove and PlotJuggler: JSON messages with schemas, in chunks that are
// not compressed, and an index. Topics and fields are those of `iwheelctl export --to mcap`, apart from raw_force_N.

const MCAP = { magic: [0x89, 77, 67, 65, 80, 48, 13, 10], header: 1, footer: 2, schema: 3, channel: 4, message: 5, chunk: 6, message_index: 7, chunk_index: 8,
  statistics: 11, data_end: 15, chunk_bytes: 1 << 20 };
const UTF8 = new TextEncoder();
const MCAP_FIELDS = { wheel: { commanded_m_s: "number", applied_m_s: "number", measured_m_s: "number", raw_force_N: "number" },
  state: { state: "string" }, event: { event: "string", text: "string" } };
const MCAP_TOPICS = [["/left", "wheel"], ["/right", "wheel"], ["/state", "state"], ["/event", "event"]];

// Bytes that grow, little endian.
class Bytes {
  constructor() {
    this.use(new Uint8Array(4096));
    this.length = 0;
  }
  use(array) {
    this.array = array;
    this.view = new DataView(array.buffer);
  }
  // Reserves `count` bytes. Returns their place.
  room(count) {
    const at = this.length;
    this.length += count;
    if (this.length > this.array.length) {
      const larger = new Uint8Array(2 * this.length);
      larger.set(this.array.subarray(0, at));
      this.use(larger);
    }
    return at;
  }
  set(at, size, value) {
    if (size === 8) this.view.setBigUint64(at, BigInt(value), true);
    else if (size === 4) this.view.setUint32(at, value, true);
    else if (size === 2) this.view.setUint16(at, value, true);
    else this.view.setUint8(at, value);
  }
  number(size, value) { this.set(this.room(size), size, value); return this; }
  bytes(bytes) { const at = this.room(bytes.length); this.array.set(bytes, at); return this; }
  text(text) { return this.sized(4, (to) => to.bytes(UTF8.encode(text))); }
  // The content that `write` adds, after its length.
  sized(size, write) {
    const at = this.room(size);
    write(this);
    this.set(at, size, this.length - at - size);
    return this;
  }
  record(kind, write) { return this.number(1, kind).sized(8, write); }
  get done() { return this.array.subarray(0, this.length); }
}

function mcapSchemas(out) {
  const names = Object.keys(MCAP_FIELDS);
  names.forEach((name, i) => out.record(MCAP.schema, (to) => {
    const properties = Object.fromEntries(Object.entries(MCAP_FIELDS[name]).map(([field, type]) => [field, { type }]));
    to.number(2, i + 1).text(`iwheel.${name}`).text("jsonschema").text(JSON.stringify({ type: "object", properties }));
  }));
  MCAP_TOPICS.forEach(([topic, name], i) => out.record(MCAP.channel, (to) => to.number(2, i + 1).number(2, names.indexOf(name) + 1).text(topic).text("json").number(4, 0)));
}

// Seconds, number of the topic, and the values of a wheel or the message itself.
function* mcapRows(recording) {
  const { states, happened } = recording;
  yield* rowsOf(recording);
  for (const [n, { t, state }] of states.entries()) if (state !== states[n - 1]?.state) yield [t, 2, { state }];
  for (const { t, type, state, cause } of happened) yield [t, 3, { event: type, text: [state, cause].filter(Boolean).join(" ") }];
}

// The message of a wheel, or null. An unknown value is not in it.
function mcapWheel([, , ...values]) {
  const fields = Object.keys(MCAP_FIELDS.wheel), known = values.map((value, n) => [fields[n], value === null ? null : Number((n < 3 ? value / 1000 : value).toFixed(n < 3 ? 6 : 3))]);
  const found = known.filter(([, value]) => value !== null);
  return found.length ? Object.fromEntries(found) : null;
}

function mcapAdd(chunk, t_us, topic, value) {
  const { records } = chunk, time = BigInt(t_us) * 1000n, at = records.length;
  chunk.first ??= time;
  chunk.last = time;
  chunk.index[topic].push([time, at]);
  records.record(MCAP.message, (to) => to.number(2, topic + 1).number(4, 0).number(8, time).number(8, time).bytes(UTF8.encode(JSON.stringify(value))));
  chunk.crc = crc32(records.done.subarray(at), chunk.crc);
}

// A chunk with the index of its messages. `chunk` then has what the summary has of it.
function mcapChunk(out, chunk) {
  const { records, first, last } = chunk, begin = out.length;
  out.record(MCAP.chunk, (to) => to.number(8, first).number(8, last).number(8, records.length).number(4, chunk.crc).text("").sized(8, () => to.bytes(records.done)));
  const places = [], length = out.length - begin;
  chunk.index.forEach((entries, topic) => {
    if (!entries.length) return;
    places.push([topic + 1, chunk.at + out.length]);
    out.record(MCAP.message_index, (to) => to.number(2, topic + 1).sized(4, () => entries.forEach(([time, at]) => to.number(8, time).number(8, at))));
  });
  Object.assign(chunk, { places, length, index_length: out.length - begin - length, bytes: records.length, counts: chunk.index.map((one) => one.length), records: null, index: null });
}

function mcapSummary(out, chunks, count) {
  const counts = MCAP_TOPICS.map((_, topic) => chunks.reduce((sum, chunk) => sum + chunk.counts[topic], 0));
  mcapSchemas(out);
  for (const one of chunks) {
    out.record(MCAP.chunk_index, (to) => to.number(8, one.first).number(8, one.last).number(8, one.at).number(8, one.length)
      .sized(4, () => one.places.forEach(([topic, at]) => to.number(2, topic).number(8, at))).number(8, one.index_length).text("").number(8, one.bytes).number(8, one.bytes));
  }
  out.record(MCAP.statistics, (to) => to.number(8, count).number(2, Object.keys(MCAP_FIELDS).length)
    .number(4, MCAP_TOPICS.length).number(4, 0).number(4, 0).number(4, chunks.length).number(8, chunks[0]?.first ?? 0).number(8, chunks.at(-1)?.last ?? 0)
    .sized(4, () => counts.forEach((one, topic) => to.number(2, topic + 1).number(8, one))));
}

// Returns the parts of the file.
function* recordingMcap(recording) {
  const parts = [], chunks = [];
  let out = new Bytes(), length = 0, chunk = null, count = 0, n = 0;
  const endPart = () => { parts.push(out.done); length += out.length; out = new Bytes(); };
  const endChunk = () => { chunk.at = length; mcapChunk(out, chunk); chunks.push(chunk); endPart(); chunk = null; };
  out.bytes(MCAP.magic).record(MCAP.header, (to) => to.text("").text("iwheel-web"));
  mcapSchemas(out);
  endPart();
  const seconds = yield* bySecond(mcapRows(recording));
  for (const rows of seconds) {
    for (const row of rows.sort(byTime)) {
      const [t, topic] = row, value = topic < 2 ? mcapWheel(row) : row[2];
      if (!value) continue;
      chunk ??= { records: new Bytes(), index: MCAP_TOPICS.map(() => []), crc: 0 };
      mcapAdd(chunk, Math.round(t * 1e6) + recording.stop_us, topic, value);
      if (++count % 64 === 0) yield n / seconds.length;
      if (chunk.records.length >= MCAP.chunk_bytes) endChunk();
    }
    n++;
  }
  if (chunk) endChunk();
  out.record(MCAP.data_end, (to) => to.number(4, 0));
  const at = out.length;
  mcapSummary(out, chunks, count);
  // The checksum of the summary includes the footer up to itself.
  out.number(1, MCAP.footer).number(8, 20).number(8, length + at).number(8, 0);
  out.number(4, crc32(out.done.subarray(at))).bytes(MCAP.magic);
  endPart();
  return parts;
}
