// The run, and its signals' changes, unpacked one signal at a time. code.rs has the format.

const run = JSON.parse(document.getElementById("run").textContent);
run.signals.forEach((signal, number) => { signal.number = number; });

const canUnpack = typeof DecompressionStream === "function";

/** One packed block, as bytes. */
async function bytesOf(number) {
  const text = document.getElementById("b" + number).textContent;
  const packed = Uint8Array.fromBase64
    ? Uint8Array.fromBase64(text)
    : Uint8Array.from(atob(text), (digit) => digit.charCodeAt(0));
  const bytes = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(bytes).arrayBuffer());
}

/** The changes in a block: their times in units since the run began, and their values. */
function unpack(signal, bytes) {
  const count = signal.count;
  let at = 0;
  function varint() {
    let byte = bytes[at++];
    if (byte < 128) return byte;
    let number = byte & 127;
    let weight = 128;
    do {
      byte = bytes[at++];
      number += (byte & 127) * weight;
      weight *= 128;
    } while (byte > 127);
    return number;
  }
  const times = run.end < 2 ** 32 ? new Uint32Array(count) : new Float64Array(count);
  for (let i = 0, time = 0; i < count; i++) {
    time += varint();
    times[i] = time;
  }
  if (signal.coding === "toggle") return { times, first: bytes[at], values: null };
  if (signal.coding === "table") {
    const table = new Float64Array(varint());
    const numbers = new DataView(bytes.buffer, bytes.byteOffset);
    for (let i = 0; i < table.length; i++, at += 8) table[i] = numbers.getFloat64(at, true);
    const values = new Float64Array(count);
    for (let i = 0, place = 0; i < count; i++) {
      const step = varint();
      place += step % 2 ? -(step + 1) / 2 : step / 2;
      values[i] = table[place];
    }
    return { times, values };
  }
  // Planes of bytes, each exclusive-or with the previous one.
  const width = signal.coding === "single" ? 4 : 8;
  const raw = new Uint8Array(count * width);
  for (let plane = 0; plane < width; plane++) {
    let last = 0;
    for (let i = plane; i < raw.length; i += width) {
      last ^= bytes[at++];
      raw[i] = last;
    }
  }
  const numbers = new DataView(raw.buffer);
  const values = width === 4 ? new Float32Array(count) : new Float64Array(count);
  for (let i = 0; i < count; i++) {
    values[i] = width === 4 ? numbers.getFloat32(4 * i, true) : numbers.getFloat64(8 * i, true);
  }
  return { times, values };
}

/** Unpacks a signal, once; sets its `data`. */
function load(number) {
  const signal = run.signals[number];
  signal.loading ??= bytesOf(number).then(
    (bytes) => {
      const data = unpack(signal, bytes);
      if (data.values && data.values.length > 4 * BLOCK) data.pyramid = pyramid(data.values);
      signal.data = data;
    },
    (error) => { signal.failure = String(error); },
  );
  return signal.loading;
}
