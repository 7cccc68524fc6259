// A canvas with ground, light and an eye. It is drawn again when something has changed, and only then:
// whoever looks on may share the robot's machine.
import {
  BufferAttribute,
  BufferGeometry,
  Color,
  DirectionalLight,
  HemisphereLight,
  LineBasicMaterial,
  LineSegments,
  Scene,
  WebGLRenderer,
} from "three";
import { Palette, readPalette } from "./layer";
import { Views } from "./views";

export class SceneCanvas {
  readonly scene = new Scene();
  readonly views: Views;
  private readonly renderer: WebGLRenderer;
  private readonly ground = new LineSegments(groundLines(12), new LineBasicMaterial());
  private dirty = true;

  /** Throws where the browser has no WebGL. */
  constructor(readonly canvas: HTMLCanvasElement) {
    this.renderer = new WebGLRenderer({ canvas, antialias: true, powerPreference: "low-power" });
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
    this.views = new Views(canvas, () => this.invalidate());
    const sky = new HemisphereLight(new Color("#ffffff"), new Color("#8a8f98"), 1.7);
    sky.position.set(0, 0, 1);
    const sun = new DirectionalLight(new Color("#ffffff"), 1.6);
    sun.position.set(-2, -3, 5);
    this.scene.add(this.ground, sky, sun);
    new ResizeObserver(() => this.resize()).observe(canvas.parentElement as HTMLElement);
    this.resize();
  }

  invalidate(): void {
    this.dirty = true;
  }

  /** The theme's colours, for what else is drawn. */
  recolour(): Palette {
    const palette = readPalette();
    this.scene.background = palette["scene-bottom"];
    this.ground.material.color.copy(palette["ground"]);
    this.invalidate();
    return palette;
  }

  /** Once per frame of the screen; `before`: what is due before something is drawn. */
  frame(before: () => void): void {
    if (!this.dirty) return;
    this.dirty = false;
    before();
    this.renderer.render(this.scene, this.views.camera);
    this.canvas.dataset["frames"] = String(Number(this.canvas.dataset["frames"] ?? 0) + 1);
  }

  private resize(): void {
    const room = this.canvas.parentElement as HTMLElement;
    const [width_px, height_px] = [Math.max(1, room.clientWidth), Math.max(1, room.clientHeight)];
    this.renderer.setSize(width_px, height_px, false);
    this.views.resize(width_px, height_px);
    this.invalidate();
  }
}

/**
 * Lines a metre apart on z = 0, from -half_m to half_m. In pieces of a metre: a line that passes the
 * eye is drawn wrongly, or not at all, by some drivers.
 */
function groundLines(half_m: number): BufferGeometry {
  const lines: number[] = [];
  for (let across = -half_m; across <= half_m; ++across) {
    for (let along = -half_m; along < half_m; ++along) {
      lines.push(along, across, 0, along + 1, across, 0);
      lines.push(across, along, 0, across, along + 1, 0);
    }
  }
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(Float32Array.from(lines), 3));
  return geometry;
}
