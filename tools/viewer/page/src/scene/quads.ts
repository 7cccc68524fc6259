// Draws the rectangles of a QuadArena in one call: four corners, instanced.
import {
  BufferAttribute,
  BufferGeometry,
  Color,
  GLSL3,
  InstancedBufferAttribute,
  InstancedBufferGeometry,
  Mesh,
  ShaderMaterial,
  Vector3,
} from "three";
import type { Grid } from "../messages";
import { QuadArena } from "../quad_arena";
import type { Palette } from "./layer";

const kVertexShader = /* glsl */ `
  in vec4 quad;
  uniform vec3 origin;
  uniform float voxel;
  out vec3 vWorld;
  out vec2 vCell;
  flat out int vFace;

  void main() {
    int packed_ = int(quad.w + 0.5);
    int face = packed_ & 7;
    vec2 size = vec2(float((packed_ >> 3) & 31), float(packed_ >> 8));
    int axis = face >> 1;
    bool back = (face & 1) == 1;
    // Corners run counterclockwise as seen from outside.
    vec2 corner = position.xy;
    if ((axis == 1) != back) corner.x = 1.0 - corner.x;
    vec2 along = corner * size;
    float off = back ? 0.0 : 1.0;
    vec3 local = axis == 0 ? vec3(off, along) : axis == 1 ? vec3(along.x, off, along.y) : vec3(along, off);
    vWorld = origin + voxel * (quad.xyz + local);
    vCell = along;
    vFace = face;
    gl_Position = projectionMatrix * viewMatrix * vec4(vWorld, 1.0);
  }
`;

const kFragmentHead = /* glsl */ `
  precision highp float;
  in vec3 vWorld;
  in vec2 vCell;
  flat in int vFace;
  uniform float cut;
  uniform vec3 edgeColour;
  out vec4 colour;

  const float kLight[6] = float[6](0.86, 0.74, 0.80, 0.68, 1.0, 0.55);

  /** 1 on the lines between voxels, fading out where they are too fine to be told apart. */
  float edge() {
    vec2 width = fwidth(vCell);
    vec2 nearest = abs(fract(vCell - 0.5) - 0.5) / max(width, vec2(1e-5));
    float line = 1.0 - min(min(nearest.x, nearest.y), 1.0);
    return line * (1.0 - smoothstep(0.12, 0.4, max(width.x, width.y)));
  }
`;

export interface QuadColours {
  /** GLSL: `vec4 paint()`, which may use vWorld, vCell, vFace, kLight, edge() and the uniforms. */
  paint: string;
  uniforms: Record<string, { value: unknown }>;
  transparent: boolean;
}

export class QuadMesh {
  readonly arena = new QuadArena();
  readonly mesh: Mesh<BufferGeometry, ShaderMaterial>;
  private readonly geometry = new InstancedBufferGeometry();
  private attribute: InstancedBufferAttribute;

  constructor(colours: QuadColours) {
    const corners = new Float32Array([0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0]);
    this.geometry.setAttribute("position", new BufferAttribute(corners, 3));
    this.geometry.setIndex([0, 1, 2, 0, 2, 3]);
    this.geometry.instanceCount = 0;
    this.attribute = this.renewAttribute();
    const material = new ShaderMaterial({
      glslVersion: GLSL3,
      uniforms: {
        origin: { value: new Vector3() },
        voxel: { value: 1 },
        cut: { value: 1e9 },
        edgeColour: { value: new Color() },
        ...colours.uniforms,
      },
      vertexShader: kVertexShader,
      fragmentShader: `${kFragmentHead}${colours.paint}
        void main() {
          if (vWorld.z > cut) discard;
          colour = linearToOutputTexel(paint());
        }`,
      transparent: colours.transparent,
      depthWrite: !colours.transparent,
    });
    this.mesh = new Mesh(this.geometry as BufferGeometry, material);
    this.mesh.frustumCulled = false;
  }

  begin(grid: Grid): void {
    this.arena.reset();
    this.geometry.instanceCount = 0;
    (this.uniform("origin") as Vector3).set(...grid.origin_m);
    this.mesh.material.uniforms["voxel"].value = grid.voxel_m;
  }

  /** Hides what lies above, in metres. */
  cutAbove(z_m: number): void {
    this.mesh.material.uniforms["cut"].value = z_m;
  }

  uniform(name: string): unknown {
    return this.mesh.material.uniforms[name].value;
  }

  /** Sends the graphics card what has changed in the arena. */
  upload(): void {
    const changes = this.arena.takeChanges();
    if (this.attribute.array !== this.arena.data) {
      this.attribute = this.renewAttribute();
    } else if (changes.length > 0) {
      for (const { start, count } of changes) this.attribute.addUpdateRange(start, count);
      this.attribute.needsUpdate = true;
    }
    this.geometry.instanceCount = this.arena.slots;
  }

  private renewAttribute(): InstancedBufferAttribute {
    this.geometry.deleteAttribute("quad");
    const attribute = new InstancedBufferAttribute(this.arena.data, 4);
    this.geometry.setAttribute("quad", attribute);
    return attribute;
  }
}

const kVoxelPaint = /* glsl */ `
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

/** Occupied voxels, coloured by height. */
export class VoxelMesh extends QuadMesh {
  constructor() {
    super({
      paint: kVoxelPaint,
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

const kVeilPaint = /* glsl */ `
  uniform vec3 veil;

  vec4 paint() {
    float stripe = fract((vWorld.x + vWorld.y + vWorld.z) * 14.0);
    float line = 1.0 - smoothstep(0.10, 0.16, min(stripe, 1.0 - stripe));
    return vec4(veil, mix(0.10, 0.20, line) * mix(0.8, 1.0, kLight[vFace]));
  }
`;

/** Where known free space ends and nobody has looked yet: a hatched veil. */
export class UnknownMesh extends QuadMesh {
  constructor() {
    super({ paint: kVeilPaint, transparent: true, uniforms: { veil: { value: new Color() } } });
    this.mesh.renderOrder = 3;
  }

  recolour(palette: Palette): void {
    (this.uniform("veil") as Color).copy(palette["unknown"]);
  }
}
