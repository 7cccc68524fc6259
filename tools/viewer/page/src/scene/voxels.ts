// Occupied voxels, coloured by height.
import { Color } from "three";
import type { Grid } from "../messages";
import type { Palette } from "./palette";
import { QuadMesh } from "./quads";

const kPaint = /* glsl */ `
  uniform vec3 low;
  uniform vec3 middle;
  uniform vec3 high;
  uniform float bottom;
  uniform float top;

  vec4 paint() {
    float height = clamp((vWorld.z - bottom) / (top - bottom), 0.0, 1.0);
    vec3 base = height < 0.5 ? mix(low, middle, 2.0 * height) : mix(middle, high, 2.0 * height - 1.0);
    return vec4(mix(base * kLight[vFace], edgeColour, 0.35 * edge()), 1.0);
  }
`;

export class VoxelMesh extends QuadMesh {
  constructor() {
    super({
      paint: kPaint,
      transparent: false,
      uniforms: {
        low: { value: new Color() },
        middle: { value: new Color() },
        high: { value: new Color() },
        bottom: { value: 0 },
        top: { value: 1 },
      },
    });
  }

  override begin(grid: Grid): void {
    super.begin(grid);
    this.mesh.material.uniforms["bottom"].value = grid.origin_m[2];
    this.mesh.material.uniforms["top"].value = grid.origin_m[2] + grid.voxel_m * grid.size_vox[2];
  }

  recolour(palette: Palette): void {
    (this.uniform("low") as Color).copy(palette["voxel-low"]);
    (this.uniform("middle") as Color).copy(palette["voxel-middle"]);
    (this.uniform("high") as Color).copy(palette["voxel-high"]);
    (this.uniform("edgeColour") as Color).copy(palette["voxel-edge"]);
  }
}
