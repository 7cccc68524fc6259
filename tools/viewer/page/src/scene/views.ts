// Where the eye is: free, with the robot, or above.
import { PerspectiveCamera, Vector3 } from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import type { Moment } from "../history";
import type { World } from "../messages";
import { flatten } from "./geometry";

export type ViewMode = "free" | "follow" | "top";

const kDirection = new Vector3(-0.78, -0.92, 0.72).normalize();

export class Views {
  readonly camera = new PerspectiveCamera(42, 1, 0.02, 200);
  readonly controls: OrbitControls;
  mode: ViewMode = "free";
  private world: World | null = null;
  private readonly robot = new Vector3();
  private readonly middle = new Vector3();
  private reach_m = 1;
  private fresh = true;

  constructor(canvas: HTMLElement, changed: () => void) {
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.enableDamping = false;
    this.controls.minDistance = 0.2;
    this.controls.maxDistance = 60;
    this.controls.addEventListener("change", changed);
    this.reset();
  }

  begin(world: World): void {
    this.world = world;
    this.fresh = true;
  }

  /** Begins so that the first state and the goal are in view; then follows, where that is wished. */
  show(moment: Moment): void {
    if (this.world === null || moment.state === null) return;
    const now = centre(this.world, moment.state.poses);
    const moved = now.clone().sub(this.robot);
    this.robot.copy(now);
    if (this.fresh) this.frame(this.world, moment.state.poses);
    else if (this.mode === "follow" && moved.lengthSq() > 0) this.shift(moved);
  }

  choose(mode: ViewMode): void {
    const wasTop = this.mode === "top";
    this.mode = mode;
    this.controls.maxPolarAngle = mode === "top" ? 0 : Math.PI;
    this.controls.enableRotate = mode !== "top";
    if (mode === "top") this.lookFrom(new Vector3(0, 0, 1), 1.7);
    else if (wasTop || mode === "follow") this.lookFrom(kDirection, 1);
  }

  /** To where the view began. */
  reset(): void {
    this.choose("free");
    this.lookFrom(kDirection, 1);
  }

  resize(width_px: number, height_px: number): void {
    this.camera.aspect = width_px / height_px;
    this.camera.updateProjectionMatrix();
  }

  private shift(by: Vector3): void {
    this.camera.position.add(by);
    this.controls.target.add(by);
    this.controls.update();
  }

  private frame(world: World, poses: Float32Array): void {
    this.fresh = false;
    const goal = flatten(world.goal);
    this.middle.copy(this.robot).add(centre(world, goal)).multiplyScalar(0.5);
    this.reach_m = Math.max(0.5, reach(world, poses, this.middle), reach(world, goal, this.middle));
    if (this.mode === "free") this.reset();
    else this.choose(this.mode);
  }

  private lookFrom(direction: Vector3, farther: number): void {
    const distance_m = (1.2 + 1.7 * this.reach_m) * farther;
    const target = this.mode === "follow" ? this.robot : this.middle;
    this.controls.target.copy(target);
    this.camera.position.copy(target).addScaledVector(direction, distance_m);
    // Straight from above there is no telling what is up: a hair from the south.
    if (direction.z === 1) this.camera.position.y -= 1e-3 * distance_m;
    this.controls.update();
  }
}

/** Where the links that have a body are. */
function bodies(world: World, poses: Float32Array): Vector3[] {
  const links = new Set([...world.spheres, ...world.shapes].map((part) => part.link));
  return [...links].map((link) => new Vector3().fromArray(poses, 7 * link));
}

function centre(world: World, poses: Float32Array): Vector3 {
  const places = bodies(world, poses);
  const sum = places.reduce((total, one) => total.add(one), new Vector3());
  return sum.divideScalar(Math.max(1, places.length));
}

function reach(world: World, poses: Float32Array, from: Vector3): number {
  return Math.max(0, ...bodies(world, poses).map((one) => one.distanceTo(from)));
}
