// Where known free space ends and nobody has looked yet: a hatched veil.
import { Color } from "three";
import type { Palette } from "./palette";
import { QuadMesh } from "./quads";

const kPaint = /* glsl */ `
  uniform vec3 veil;

  vec4 paint() {
    float stripe = fract((vWorld.x + vWorld.y + vWorld.z) * 14.0);
    float line = 1.0 - smoothstep(0.10, 0.16, min(stripe, 1.0 - stripe));
    return vec4(veil, mix(0.10, 0.20, line) * mix(0.8, 1.0, kLight[vFace]));
  }
`;

export class UnknownMesh extends QuadMesh {
  constructor() {
    super({ paint: kPaint, transparent: true, uniforms: { veil: { value: new Color() } } });
    this.mesh.renderOrder = 3;
  }

  recolour(palette: Palette): void {
    (this.uniform("veil") as Color).copy(palette["unknown"]);
  }
}
