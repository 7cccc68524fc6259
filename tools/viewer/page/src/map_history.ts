// The map at any time that is kept: of every block the versions it has had.
import { Grid, kBlockBytes, MapUpdate } from "./messages";
import { Timed, Track } from "./track";

/** A block's bits from a time on; null before anything was seen in it. */
interface Version extends Timed {
  bits: Uint8Array | null;
}

/** Blocks that changed at a time. */
interface Change extends Timed {
  blocks: number[];
}

/** As long as the grid stays where it is. */
export class MapEpoch implements Timed {
  readonly changes = new Track<Change>();
  private readonly versions = new Map<number, Track<Version>>();
  private size_bytes = 0;

  constructor(
    readonly time_s: number,
    readonly grid: Grid,
  ) {}

  /** kBlockBytes, or null where nothing has been seen at `time_s`. */
  block(index: number, time_s: number): Uint8Array | null {
    return this.versions.get(index)?.at(time_s)?.bits ?? null;
  }

  /** Every block that has ever been told of. */
  blocks(): Iterable<number> {
    return this.versions.keys();
  }

  /** Blocks that may differ between two times, in either order. */
  changedBetween(a_s: number, b_s: number): Set<number> {
    const from = this.changes.countUntil(Math.min(a_s, b_s));
    const to = this.changes.countUntil(Math.max(a_s, b_s));
    const changed = new Set<number>();
    for (const change of this.changes.items.slice(from, to)) for (const block of change.blocks) changed.add(block);
    return changed;
  }

  add(map: MapUpdate, time_s: number): void {
    const changed: number[] = [];
    map.blocks.forEach((block, i) => {
      const bits = map.data.subarray(i * kBlockBytes, (i + 1) * kBlockBytes);
      if (this.put(block, time_s, bits)) changed.push(block);
    });
    if (map.full) {
      const told = new Set(map.blocks);
      for (const block of this.versions.keys()) {
        if (!told.has(block) && this.put(block, time_s, null)) changed.push(block);
      }
    }
    if (changed.length > 0) this.changes.add({ time_s, blocks: changed });
  }

  forgetBefore(time_s: number): void {
    const past = this.changes.items.slice(0, this.changes.countUntil(time_s));
    for (const change of past) {
      for (const block of change.blocks) {
        const track = this.versions.get(block) as Track<Version>;
        this.size_bytes -= track.bytes;
        track.forgetBefore(time_s);
        this.size_bytes += track.bytes;
      }
    }
    this.changes.forgetBefore(time_s, 0);
  }

  /** What the bits of all versions take. */
  get bytes(): number {
    return this.size_bytes;
  }

  private put(block: number, time_s: number, bits: Uint8Array | null): boolean {
    let track = this.versions.get(block);
    if (track === undefined) {
      track = new Track<Version>((version) => version.bits?.length ?? 0);
      this.versions.set(block, track);
    }
    if (sameBits(track.last?.bits ?? null, bits)) return false;
    this.size_bytes -= track.bytes;
    track.put({ time_s, bits });
    this.size_bytes += track.bytes;
    return true;
  }
}

function sameBits(a: Uint8Array | null, b: Uint8Array | null): boolean {
  if (a === null || b === null) return a === b;
  for (let i = 0; i < kBlockBytes; ++i) if (a[i] !== b[i]) return false;
  return true;
}

function sameGrid(a: Grid, b: Grid): boolean {
  return (
    a.voxel_m === b.voxel_m &&
    a.origin_m.every((value, i) => value === b.origin_m[i]) &&
    a.size_vox.every((value, i) => value === b.size_vox[i])
  );
}

export class MapHistory {
  private readonly epochs = new Track<MapEpoch>();
  private last_s = -Infinity;

  get bytes(): number {
    return this.epochs.items.reduce((sum, epoch) => sum + epoch.bytes, 0);
  }

  add(map: MapUpdate): void {
    // Maps come in order; an older one is of a recording that is told again.
    const time_s = map.time_s;
    if (time_s < this.last_s) return;
    this.last_s = time_s;
    let epoch = this.epochs.last;
    if (epoch === null || !sameGrid(epoch.grid, map.grid)) {
      if (!map.full) return; // It is about a grid that has not been told of.
      epoch = new MapEpoch(time_s, map.grid);
      this.epochs.add(epoch);
    }
    epoch.add(map, time_s);
  }

  at(time_s: number): MapEpoch | null {
    return this.epochs.at(time_s);
  }

  forgetBefore(time_s: number): void {
    this.epochs.forgetBefore(time_s);
    for (const epoch of this.epochs.items) epoch.forgetBefore(time_s);
  }
}
