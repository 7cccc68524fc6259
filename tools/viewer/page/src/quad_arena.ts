// Rectangles of many blocks in one buffer that is drawn at once: each block has pages of its own, so
// that a change of one rewrites its pages only.

export const kQuadsPerPage = 32;
const kNumbersPerPage = 4 * kQuadsPerPage;

/** A range of `data`, in numbers. */
export interface Range {
  start: number;
  count: number;
}

export class QuadArena {
  /** 4 numbers a rectangle; all 0 where there is none. */
  data: Uint16Array;
  private readonly pagesOf = new Map<number, number[]>();
  private readonly free: number[] = [];
  private readonly dirty = new Set<number>();
  private pages = 0;
  private quads = 0;

  constructor(initialPages = 64) {
    this.data = new Uint16Array(initialPages * kNumbersPerPage);
  }

  /** Slots to draw, empty ones included. */
  get slots(): number {
    return this.pages * kQuadsPerPage;
  }
  /** Rectangles there are. */
  get count(): number {
    return this.quads;
  }

  /** In place of what the block had. */
  set(block: number, quads: Uint16Array): void {
    const pages = this.pagesOf.get(block) ?? [];
    for (const page of pages) this.clear(page);
    const needed = Math.ceil(quads.length / kNumbersPerPage);
    while (pages.length > needed) this.free.push(pages.pop() as number);
    while (pages.length < needed) pages.push(this.free.pop() ?? this.grow());
    pages.forEach((page, i) => {
      const part = quads.subarray(i * kNumbersPerPage, (i + 1) * kNumbersPerPage);
      this.data.set(part, page * kNumbersPerPage);
      this.quads += part.length / 4;
      this.dirty.add(page);
    });
    if (needed > 0) this.pagesOf.set(block, pages);
    else this.pagesOf.delete(block);
  }

  reset(): void {
    this.data.fill(0);
    this.pagesOf.clear();
    this.free.length = 0;
    this.dirty.clear();
    this.pages = 0;
    this.quads = 0;
  }

  /** What has changed since the last call, neighbouring pages as one range. */
  takeChanges(): Range[] {
    const ranges: Range[] = [];
    for (const page of [...this.dirty].sort((a, b) => a - b)) {
      const start = page * kNumbersPerPage;
      const last = ranges[ranges.length - 1];
      if (last !== undefined && last.start + last.count === start) last.count += kNumbersPerPage;
      else ranges.push({ start, count: kNumbersPerPage });
    }
    this.dirty.clear();
    return ranges;
  }

  private clear(page: number): void {
    const start = page * kNumbersPerPage;
    for (let i = start + 3; i < start + kNumbersPerPage; i += 4) if (this.data[i] !== 0) --this.quads;
    this.data.fill(0, start, start + kNumbersPerPage);
    this.dirty.add(page);
  }

  private grow(): number {
    const page = this.pages++;
    if (this.data.length < this.pages * kNumbersPerPage) {
      const larger = new Uint16Array(2 * this.data.length);
      larger.set(this.data);
      this.data = larger;
    }
    return page;
  }
}
