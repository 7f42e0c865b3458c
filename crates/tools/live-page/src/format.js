"use strict";

// The format of a row, as in a watch table: of the value where that has bits of its own, and of the raw value.

const format = (() => {
  const NAMES = ["", "decimal", "hex", "binary", "scientific"];
  const INTEGER = /^(BYTE|WORD|DWORD|LWORD|U?(S|D|L)?INT)$/;

  /** The bits of a raw value such as `16#6C00`, and their number; null without a raw value. */
  function bitsOf({ raw }) {
    return /^16#[0-9A-F]+$/.test(raw) ? { bits: BigInt(`0x${raw.slice(3)}`), size: 4 * (raw.length - 3) } : null;
  }

  function binary({ bits, size }) {
    return `2#${bits.toString(2).padStart(size, "0").replace(/\B(?=(....)+$)/g, "_")}`;
  }

  /** True if the value is the number of its bits: an integer without a scale. */
  function isOfBits(signal, raw) {
    if (!INTEGER.test(signal.type) || signal.value === null || !/^-?\d+$/.test(String(signal.value))) return false;
    return BigInt.asUintN(raw.size, BigInt(signal.value)) === raw.bits;
  }

  /** The value of a signal without its unit. */
  function value(signal) {
    const name = watch.formatOf(signal);
    if (!name || signal.isBool || signal.value === null) return words.value(signal);
    const raw = bitsOf(signal);
    if (name === "scientific") return Number(signal.value).toExponential().replaceAll("-", "−");
    if (name !== "decimal" && raw && isOfBits(signal, raw)) return name === "hex" ? signal.raw : binary(raw);
    return name === "decimal" ? String(signal.value).replaceAll("-", "−") : words.value(signal);
  }

  /** The raw value of a signal. */
  function raw(signal) {
    const name = watch.formatOf(signal);
    const bits = name && bitsOf(signal);
    if (!bits) return signal.isBool ? "" : signal.raw;
    if (name === "binary") return binary(bits);
    const isSigned = /^[SDL]?INT$/.test(signal.type);
    if (name === "decimal" && INTEGER.test(signal.type)) return String(isSigned ? BigInt.asIntN(bits.size, bits.bits) : bits.bits).replace("-", "−");
    return signal.raw;
  }

  /** A BOOL has no other format. */
  const next = (signal) => { if (!signal.isBool) watch.setFormat(signal, NAMES[(NAMES.indexOf(watch.formatOf(signal)) + 1) % NAMES.length]); };

  return { value, raw, next };
})();
