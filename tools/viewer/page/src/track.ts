// What was told of one thing over time, in order of time.

export interface Timed {
  time_s: number;
}

export class Track<T extends Timed> {
  readonly items: T[] = [];
  private size_bytes = 0;

  /** `bytesOf` says what an item holds beside itself, for budgets. */
  constructor(private readonly bytesOf: (item: T) => number = () => 0) {}

  get bytes(): number {
    return this.size_bytes;
  }
  get last(): T | null {
    return this.items.length > 0 ? this.items[this.items.length - 1] : null;
  }

  /** Behind all that are not later. */
  add(item: T): void {
    this.items.splice(this.countUntil(item.time_s), 0, item);
    this.size_bytes += this.bytesOf(item);
  }

  /** In place of one of the same time, if there is one. */
  put(item: T): void {
    const count = this.countUntil(item.time_s);
    if (count > 0 && this.items[count - 1].time_s === item.time_s) {
      this.size_bytes += this.bytesOf(item) - this.bytesOf(this.items[count - 1]);
      this.items[count - 1] = item;
    } else {
      this.add(item);
    }
  }

  /** How many are not later than `time_s`. */
  countUntil(time_s: number): number {
    let low = 0;
    let high = this.items.length;
    if (high === 0 || this.items[high - 1].time_s <= time_s) return high;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.items[middle].time_s <= time_s) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  /** The newest that is not later than `time_s`, or the `back`-th before it. */
  at(time_s: number, back = 0): T | null {
    return this.items[this.countUntil(time_s) - 1 - back] ?? null;
  }

  /** The first that is later than `time_s`. */
  after(time_s: number): T | null {
    return this.items[this.countUntil(time_s)] ?? null;
  }

  /** The last that is earlier than `time_s`. */
  before(time_s: number): T | null {
    let count = this.countUntil(time_s);
    while (count > 0 && this.items[count - 1].time_s >= time_s) --count;
    return this.items[count - 1] ?? null;
  }

  /** Forgets what is earlier than `time_s`, but the `keep` that hold at that time. */
  forgetBefore(time_s: number, keep = 1): void {
    this.drop(this.countUntil(time_s) - keep);
  }

  /** Forgets the oldest while all hold more than `most_bytes`, but for the newest. */
  forgetBeyond(most_bytes: number): void {
    let count = 0;
    let bytes = this.size_bytes;
    while (bytes > most_bytes && count < this.items.length - 1) bytes -= this.bytesOf(this.items[count++]);
    this.drop(count);
  }

  private drop(count: number): void {
    if (count <= 0) return;
    for (const item of this.items.splice(0, count)) this.size_bytes -= this.bytesOf(item);
  }
}
