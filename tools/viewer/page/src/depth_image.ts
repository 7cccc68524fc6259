// The newest depth image: near is light, far is dark, and where nothing was measured there is nothing.
import { byId, setText } from "./dom";
import type { DepthFrame } from "./messages";

const kNearest_mm = 300;
const kFarthest_mm = 5000;

export class DepthImage {
  private readonly canvas = byId<HTMLCanvasElement>("depth-image");
  private drawn: DepthFrame | null = null;

  show(frame: DepthFrame | null): void {
    byId("depth").hidden = frame === null || frame.columns * frame.rows === 0;
    if (frame === null || frame === this.drawn || frame.columns * frame.rows === 0) return;
    this.drawn = frame;
    const context = this.canvas.getContext("2d");
    if (context === null) return;
    this.canvas.width = frame.columns;
    this.canvas.height = frame.rows;
    const image = context.createImageData(frame.columns, frame.rows);
    frame.depth_mm.forEach((mm, i) => image.data.set(colourOf(mm), 4 * i));
    context.putImageData(image, 0, 0);
    setText(byId("depth-caption"), `${kNearest_mm / 1000} to ${kFarthest_mm / 1000} m`);
  }
}

/** Red, green, blue, opacity: from pale yellow through teal to night blue, even in lightness. */
function colourOf(mm: number): [number, number, number, number] {
  if (mm === 0) return [0, 0, 0, 0];
  const share = Math.min(1, Math.max(0, (mm - kNearest_mm) / (kFarthest_mm - kNearest_mm)));
  const stops = [[250, 240, 190], [96, 178, 160], [38, 92, 130], [22, 28, 62]];
  const at = 3 * Math.sqrt(share);
  const i = Math.min(2, Math.floor(at));
  const [r, g, b] = stops[i].map((value, channel) => value + (at - i) * (stops[i + 1][channel] - value));
  return [r, g, b, 255];
}
