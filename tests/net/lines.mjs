// Transcripts: lines of "ADDRESS = VALUE", masked and rounded.
import { isLeftOut, masks, textMasks } from "./masks.mjs";

const kDigits = 6;
const kNoise = 1e-9;
// Numbers of arrays are stored in 32 bits.
const kArrayDigits = 5;
const kArrayNoise = 1e-6;

function round(number, digits, noise) {
  if (!Number.isFinite(number) || Number.isSafeInteger(number)) return String(number);
  return String(Math.abs(number) < noise ? 0 : Number(number.toPrecision(digits)));
}

export const rounded = (number) => round(number, kDigits, kNoise);
export const roundedOfArray = (number) => round(number, kArrayDigits, kArrayNoise);

/// "(NAME)" where a mask lies on the address, else nothing.
export function maskOf(address) {
  const mask = masks.find(({ pattern }) => pattern.test(address));
  return mask && `(${mask.as})`;
}

/// Text without what is masked within it.
export function plain(text) {
  return textMasks.reduce((left, { pattern, as }) => left.replace(pattern, as), text);
}

/// A value as it is compared. Absent values stay visible where values are masked.
export function shown(address, value) {
  if (value === null || value === "" || value === "-") return JSON.stringify(value);
  const mask = maskOf(address);
  if (mask) return mask;
  if (typeof value === "number") return rounded(value);
  return JSON.stringify(typeof value === "string" ? plain(value) : value);
}

/// A table's cell, with single spaces, and 0 for numbers below the noise.
export function shownCell(address, cell) {
  const quiet = cell.replace(/\s+/g, " ").replace(/\d+(\.\d+)?e-\d+/g,
    (number) => (Number(number) < kNoise ? "0" : number));
  return shown(address, quiet);
}

/// The lines of one file, without those that the comparison leaves out.
export class Lines {
  constructor(comparison) {
    this.comparison = comparison;
    this.lines = [];
  }
  say(line) {
    if (!isLeftOut(line, this.comparison)) this.lines.push(line);
  }
  add(address, value) {
    const isLong = typeof value === "string" && value.includes("\n");
    if (!isLong) return this.say(`${address} = ${shown(address, value)}`);
    for (const line of value.trimEnd().split("\n")) this.say(`${address}: ${plain(line)}`);
  }
}
