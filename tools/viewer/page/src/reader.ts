// Reads JSON that somebody else wrote: what is missing, or not what it should be, is a ProtocolError
// that names it.

export class ProtocolError extends Error {}

export class Reader {
  constructor(
    private readonly object: Record<string, unknown>,
    private readonly where: string,
  ) {}

  static of(value: unknown, where: string): Reader {
    if (typeof value !== "object" || value === null || Array.isArray(value)) {
      throw new ProtocolError(`${where} is no object`);
    }
    return new Reader(value as Record<string, unknown>, where);
  }

  number(key: string): number {
    return asNumber(this.object[key], this.path(key));
  }

  positive(key: string): number {
    const value = this.number(key);
    if (value <= 0) throw new ProtocolError(`${this.path(key)} is not positive: ${value}`);
    return value;
  }

  /** A count or an index of 0 to `end` - 1. */
  index(key: string, end: number): number {
    return asIndex(this.object[key], end, this.path(key));
  }

  numberOrNull(key: string): number | null {
    return this.isNull(key) ? null : this.number(key);
  }

  text(key: string): string {
    return asText(this.object[key], this.path(key));
  }

  /** Empty where it is missing. */
  textOrEmpty(key: string): string {
    return this.isNull(key) ? "" : this.text(key);
  }

  /** False where it is missing. */
  flag(key: string): boolean {
    const value = this.object[key] ?? false;
    if (typeof value !== "boolean") throw new ProtocolError(`${this.path(key)} is neither true nor false`);
    return value;
  }

  oneOf<T extends string>(key: string, values: readonly T[]): T {
    const value = this.text(key);
    if (!(values as readonly string[]).includes(value)) {
      throw new ProtocolError(`${this.path(key)} is "${value}", not one of ${values.join(", ")}`);
    }
    return value as T;
  }

  list<T>(key: string, item: (value: unknown, where: string) => T): T[] {
    const value = this.object[key];
    if (!Array.isArray(value)) throw new ProtocolError(`${this.path(key)} is no list`);
    return value.map((one, i) => item(one, `${this.path(key)}[${i}]`));
  }

  /** Of any length, or of exactly `length`. */
  numbers(key: string, length?: number): number[] {
    return asNumbers(this.object[key], this.path(key), length);
  }

  child(key: string): Reader {
    return Reader.of(this.object[key], this.path(key));
  }

  isNull(key: string): boolean {
    return this.object[key] === undefined || this.object[key] === null;
  }

  private path(key: string): string {
    return `${this.where}.${key}`;
  }
}

export function asNumber(value: unknown, where: string): number {
  if (typeof value !== "number" || !Number.isFinite(value)) {
    throw new ProtocolError(`${where} is no finite number`);
  }
  return value;
}

export function asIndex(value: unknown, end: number, where: string): number {
  const index = asNumber(value, where);
  if (!Number.isInteger(index) || index < 0 || index >= end) {
    throw new ProtocolError(`${where} is ${index}, not a whole number of 0 to ${end - 1}`);
  }
  return index;
}

export function asText(value: unknown, where: string): string {
  if (typeof value !== "string") throw new ProtocolError(`${where} is no text`);
  return value;
}

export function asNumbers(value: unknown, where: string, length?: number): number[] {
  if (!Array.isArray(value)) throw new ProtocolError(`${where} is no list`);
  if (length !== undefined && value.length !== length) {
    throw new ProtocolError(`${where} has ${value.length} numbers, not ${length}`);
  }
  return value.map((one, i) => asNumber(one, `${where}[${i}]`));
}
