// The map of the moment that is shown: meshes again the blocks that differ from what is drawn, a few
// milliseconds' worth at a time.
import type { MapEpoch } from "../map_history";
import type { History, Moment } from "../history";
import { blockCounts, Grid, kBlockSide, Point, World } from "../messages";
import { BlockBits, blockBits, borderDiffers, meshBlock, Neighbours, QuadList, Surface } from "../meshing";
import type { Layer, Palette } from "./layer";
import { type QuadMesh, UnknownMesh, VoxelMesh } from "./quads";

interface Sheet {
  surface: Surface;
  mesh: QuadMesh;
  shown: boolean;
  /** Blocks whose rectangles are not what the bits say. */
  dirty: Set<number>;
}

/** Along -x, +x, -y, +y, -z, +z. */
const kSteps: readonly Point[] = [[-1, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0], [0, 0, -1], [0, 0, 1]];

export class MapView {
  private readonly voxels = new VoxelMesh();
  private readonly unknown = new UnknownMesh();
  private readonly sheets: Sheet[] = [
    { surface: "occupied", mesh: this.voxels, shown: true, dirty: new Set() },
    { surface: "frontier", mesh: this.unknown, shown: false, dirty: new Set() },
  ];
  private epoch: MapEpoch | null = null;
  private shown_s = 0;
  private readonly bits = new Map<number, BlockBits>();
  private counts: Point = [0, 0, 0];
  private readonly quads = new QuadList();

  /** As layers, which can be shown apart. */
  readonly voxelLayer = this.layer(0);
  readonly unknownLayer = this.layer(1);

  get grid(): Grid | null {
    return this.epoch?.grid ?? null;
  }

  get busy(): boolean {
    return this.sheets.some((sheet) => sheet.shown && sheet.dirty.size > 0);
  }

  /** Rectangles drawn of occupied voxels. */
  get voxelQuads(): number {
    return this.voxels.arena.count;
  }

  cutAbove(z_m: number): void {
    for (const sheet of this.sheets) sheet.mesh.cutAbove(z_m);
  }

  show(moment: Moment, history: History): void {
    const epoch = history.map.at(moment.time_s);
    if (epoch !== this.epoch) return this.renew(epoch, moment.time_s);
    if (epoch === null || moment.time_s === this.shown_s) return;
    this.take(epoch, epoch.changedBetween(this.shown_s, moment.time_s), moment.time_s);
  }

  /** Meshes what is due for at most `budget_ms`. */
  work(budget_ms: number): void {
    const end_ms = performance.now() + budget_ms;
    for (const sheet of this.sheets) {
      if (!sheet.shown || sheet.dirty.size === 0) continue;
      for (const block of sheet.dirty) {
        sheet.dirty.delete(block);
        this.mesh(sheet, block);
        if (performance.now() >= end_ms) break;
      }
      sheet.mesh.upload();
    }
  }

  private renew(epoch: MapEpoch | null, time_s: number): void {
    this.epoch = epoch;
    this.bits.clear();
    for (const sheet of this.sheets) {
      sheet.dirty.clear();
      if (epoch !== null) sheet.mesh.begin(epoch.grid);
      else sheet.mesh.arena.reset();
      sheet.mesh.upload();
    }
    if (epoch === null) return;
    this.counts = blockCounts(epoch.grid);
    this.take(epoch, epoch.blocks(), time_s);
  }

  private take(epoch: MapEpoch, blocks: Iterable<number>, time_s: number): void {
    this.shown_s = time_s;
    for (const block of blocks) {
      const bytes = epoch.block(block, time_s);
      const before = this.bits.get(block) ?? null;
      const after = bytes === null ? null : blockBits(bytes);
      if (after === null) this.bits.delete(block);
      else this.bits.set(block, after);
      this.mark(block);
      kSteps.forEach((step, side) => {
        const next = this.neighbour(block, step);
        if (next !== null && this.bits.has(next) && borderDiffers(before, after, side)) this.mark(next);
      });
    }
  }

  private mark(block: number): void {
    for (const sheet of this.sheets) sheet.dirty.add(block);
  }

  private place(block: number): Point {
    const [nx, ny] = this.counts;
    return [block % nx, Math.floor(block / nx) % ny, Math.floor(block / (nx * ny))];
  }

  /** Null outside of the grid. */
  private neighbour(block: number, step: Point): number | null {
    const [x, y, z] = this.place(block).map((value, i) => value + step[i]);
    const [nx, ny, nz] = this.counts;
    if (x < 0 || y < 0 || z < 0 || x >= nx || y >= ny || z >= nz) return null;
    return x + nx * (y + ny * z);
  }

  private mesh(sheet: Sheet, block: number): void {
    this.quads.count = 0;
    const bits = this.bits.get(block);
    if (bits !== undefined && this.epoch !== null) {
      const size = this.epoch.grid.size_vox;
      const corner = this.place(block).map((value) => kBlockSide * value) as Point;
      const extent = corner.map((value, i) => Math.min(kBlockSide, size[i] - value)) as Point;
      const neighbours: Neighbours = kSteps.map((step) => {
        const next = this.neighbour(block, step);
        return next === null ? "outside" : (this.bits.get(next) ?? null);
      });
      meshBlock(bits, neighbours, sheet.surface, corner, extent, this.quads);
    }
    sheet.mesh.arena.set(block, this.quads.quads);
  }

  private layer(index: number): Layer {
    const sheet = this.sheets[index];
    return {
      object: sheet.mesh.mesh,
      begin: (_world: World) => this.renew(null, 0),
      show: (moment, history) => this.show(moment, history),
      recolour: (palette: Palette) => (index === 0 ? this.voxels : this.unknown).recolour(palette),
      toggle: (shown) => {
        sheet.shown = shown;
      },
    };
  }
}
