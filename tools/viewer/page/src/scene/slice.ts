// A plane through the distance field: coloured by distance, with a line every ten centimetres.
import {
  BufferAttribute,
  BufferGeometry,
  Color,
  DataTexture,
  DoubleSide,
  FloatType,
  GLSL3,
  Group,
  Mesh,
  NearestFilter,
  RedFormat,
  ShaderMaterial,
} from "three";
import type { Moment } from "../history";
import { Axis, kNeverObserved, Point, Slice, World } from "../messages";
import type { Layer, Palette } from "./layer";

const kVertexShader = /* glsl */ `
  out vec2 vUv;
  void main() {
    vUv = uv;
    gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
  }
`;

const kFragmentShader = /* glsl */ `
  precision highp float;
  in vec2 vUv;
  uniform sampler2D field;
  uniform float most;
  uniform vec3 ramp[4];
  uniform vec3 unseen;
  out vec4 colour;

  const float kNever = -30.0;

  float sampleAt(ivec2 at) {
    return texelFetch(field, clamp(at, ivec2(0), textureSize(field, 0) - 1), 0).r;
  }

  vec3 rampAt(float share) {
    float at = 3.0 * clamp(share, 0.0, 1.0);
    if (at < 1.0) return mix(ramp[0], ramp[1], at);
    return at < 2.0 ? mix(ramp[1], ramp[2], at - 1.0) : mix(ramp[2], ramp[3], at - 2.0);
  }

  void main() {
    vec2 at = vUv * vec2(textureSize(field, 0)) - 0.5;
    ivec2 low = ivec2(floor(at));
    vec2 share = fract(at);
    float a = sampleAt(low), b = sampleAt(low + ivec2(1, 0));
    float c = sampleAt(low + ivec2(0, 1)), d = sampleAt(low + ivec2(1, 1));
    float nearest = sampleAt(ivec2(floor(at + 0.5)));
    if (nearest < kNever) {
      float stripe = fract((gl_FragCoord.x + gl_FragCoord.y) / 9.0);
      colour = vec4(unseen, stripe < 0.25 ? 0.45 : 0.12);
    } else {
      bool whole = min(min(a, b), min(c, d)) > kNever;
      float distance_ = whole ? mix(mix(a, b, share.x), mix(c, d, share.x), share.y) : nearest;
      vec3 base = rampAt(distance_ / most);
      float level = distance_ * 10.0;
      float line = 1.0 - smoothstep(0.6, 1.4, abs(fract(level - 0.5) - 0.5) / max(fwidth(level), 1e-4));
      bool within = distance_ < 0.995 * most;
      colour = vec4(mix(base, vec3(0.0), within ? 0.4 * line : 0.0), distance_ <= 0.0 ? 0.95 : 0.82);
    }
    colour = linearToOutputTexel(colour);
  }
`;

/** The axes along which columns and rows run. */
export function acrossAxes(axis: Axis): [number, number, number] {
  const normal = "xyz".indexOf(axis);
  return normal === 0 ? [0, 1, 2] : normal === 1 ? [1, 0, 2] : [2, 0, 1];
}

export class SliceLayer implements Layer {
  readonly object = new Group();
  readonly plane: Mesh<BufferGeometry, ShaderMaterial>;
  private drawn: Slice | null = null;

  constructor() {
    const material = new ShaderMaterial({
      glslVersion: GLSL3,
      uniforms: {
        field: { value: null },
        most: { value: 1 },
        ramp: { value: [new Color(), new Color(), new Color(), new Color()] },
        unseen: { value: new Color() },
      },
      vertexShader: kVertexShader,
      fragmentShader: kFragmentShader,
      transparent: true,
      side: DoubleSide,
      depthWrite: false,
    });
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new BufferAttribute(new Float32Array(12), 3));
    geometry.setAttribute("uv", new BufferAttribute(Float32Array.of(0, 0, 1, 0, 1, 1, 0, 1), 2));
    geometry.setIndex([0, 1, 2, 0, 2, 3]);
    this.plane = new Mesh(geometry, material);
    this.plane.frustumCulled = false;
    this.object.add(this.plane);
  }

  begin(_world: World): void {
    this.drawn = null;
    this.plane.visible = false;
  }

  show(moment: Moment): void {
    const slice = moment.slice;
    this.plane.visible = slice !== null;
    if (slice === null || slice === this.drawn) return;
    this.drawn = slice;
    this.setCorners(slice);
    this.setField(slice);
  }

  recolour(palette: Palette): void {
    const { ramp, unseen } = this.plane.material.uniforms;
    (ramp.value as Color[]).forEach((colour, i) => colour.copy(palette[`distance-${i as 0 | 1 | 2 | 3}`]));
    (unseen.value as Color).copy(palette["unseen"]);
  }

  private setCorners(slice: Slice): void {
    const [, u, v] = acrossAxes(slice.axis);
    const positions = this.plane.geometry.getAttribute("position") as BufferAttribute;
    [[0, 0], [1, 0], [1, 1], [0, 1]].forEach(([atU, atV], i) => {
      const corner = [...slice.first_m] as Point;
      corner["xyz".indexOf(slice.axis)] = slice.position_m;
      corner[u] += slice.step_m * (atU * slice.columns - 0.5);
      corner[v] += slice.step_m * (atV * slice.rows - 0.5);
      positions.setXYZ(i, ...corner);
    });
    positions.needsUpdate = true;
  }

  private setField(slice: Slice): void {
    const uniforms = this.plane.material.uniforms;
    const metres = new Float32Array(slice.distance_mm.length);
    slice.distance_mm.forEach((mm, i) => (metres[i] = mm === kNeverObserved ? -100 : mm / 1000));
    (uniforms["field"].value as DataTexture | null)?.dispose();
    const texture = new DataTexture(metres, slice.columns, slice.rows, RedFormat, FloatType);
    texture.minFilter = texture.magFilter = NearestFilter;
    texture.needsUpdate = true;
    uniforms["field"].value = texture;
    uniforms["most"].value = slice.max_m;
  }
}
