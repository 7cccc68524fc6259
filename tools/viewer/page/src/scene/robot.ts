// The robot by the shapes that it is checked with, its collision spheres, and where it is to end up.
import {
  Color,
  Group,
  IcosahedronGeometry,
  InstancedMesh,
  Matrix4,
  Mesh,
  MeshBasicMaterial,
  MeshStandardMaterial,
} from "three";
import type { History, Moment } from "../history";
import type { World } from "../messages";
import { dispose, flatten, place, poseMatrix, shapeGeometry } from "./geometry";
import type { Layer, Palette } from "./layer";

/** A body for every link, each with a material of its own. */
class Bodies {
  readonly group = new Group();
  readonly materials: MeshStandardMaterial[] = [];

  begin(world: World): void {
    dispose(this.group);
    this.materials.length = 0;
    for (const _ of world.links) {
      this.group.add(new Group());
      this.materials.push(new MeshStandardMaterial({ roughness: 0.62, metalness: 0.05 }));
    }
    for (const { link, shape, pose } of world.shapes) {
      const mesh = new Mesh(shapeGeometry(shape), this.materials[link]);
      place(mesh, pose);
      this.group.children[link].add(mesh);
    }
  }

  place(poses: Float32Array): void {
    this.group.children.forEach((body, link) => place(body, poses, 7 * link));
  }
}

export class RobotLayer implements Layer {
  private readonly bodies = new Bodies();
  readonly object = this.bodies.group;
  private world: World | null = null;
  private colour = new Color();
  private highlight = new Color();

  begin(world: World): void {
    this.world = world;
    this.bodies.begin(world);
    this.paint(null);
  }

  show(moment: Moment): void {
    for (const body of this.object.children) body.visible = moment.state !== null;
    if (moment.state === null) return;
    this.bodies.place(moment.state.poses);
    this.paint(moment.state.clearance?.link ?? null);
  }

  recolour(palette: Palette): void {
    this.colour = palette["robot"];
    this.highlight = palette["clearance"];
    this.paint(null);
  }

  /** The link that is closest to something stands out a little. */
  private paint(link: string | null): void {
    this.bodies.materials.forEach((material, i) => {
      const isClosest = link !== null && this.world?.links[i] === link;
      material.color.copy(this.colour);
      if (isClosest) material.color.lerp(this.highlight, 0.4);
    });
  }
}

export class GoalLayer implements Layer {
  private readonly bodies = new Bodies();
  readonly object = this.bodies.group;
  private colour = new Color();

  begin(world: World): void {
    this.bodies.begin(world);
    this.bodies.place(flatten(world.goal));
    for (const material of this.bodies.materials) {
      material.transparent = true;
      material.opacity = 0.22;
      material.depthWrite = false;
    }
    this.paint();
  }

  show(): void {
    // It stays where it is.
  }

  recolour(palette: Palette): void {
    this.colour = palette["goal"];
    this.paint();
  }

  private paint(): void {
    for (const material of this.bodies.materials) material.color.copy(this.colour);
  }
}

export class SpheresLayer implements Layer {
  readonly object = new Group();
  private world: World | null = null;
  private mesh: InstancedMesh | null = null;
  private colour = new Color();

  begin(world: World): void {
    dispose(this.object);
    this.world = world;
    const material = new MeshBasicMaterial({ wireframe: true, transparent: true, opacity: 0.32, depthWrite: false });
    material.color.copy(this.colour);
    this.mesh = new InstancedMesh(new IcosahedronGeometry(1, 2), material, world.spheres.length);
    this.mesh.frustumCulled = false;
    this.object.add(this.mesh);
    this.mesh.count = 0;
  }

  show(moment: Moment, _history: History): void {
    if (this.mesh === null || this.world === null || moment.state === null) return;
    this.mesh.count = this.world.spheres.length;
    placeSpheres(this.mesh, 0, this.world, moment.state.poses, 0);
    this.mesh.instanceMatrix.needsUpdate = true;
  }

  recolour(palette: Palette): void {
    this.colour = palette["spheres"];
    (this.mesh?.material as MeshBasicMaterial | undefined)?.color.copy(this.colour);
  }
}

const linkMatrix = new Matrix4();
const sphereMatrix = new Matrix4();

/** Writes the world's spheres as instances from `first` on, at the links' poses from `offset` on. */
export function placeSpheres(
  mesh: InstancedMesh,
  first: number,
  world: World,
  poses: Float32Array,
  offset: number,
): void {
  world.spheres.forEach(({ link, centre_m, radius_m }, i) => {
    poseMatrix(poses, offset + 7 * link, linkMatrix);
    sphereMatrix.makeScale(radius_m, radius_m, radius_m).setPosition(...centre_m);
    mesh.setMatrixAt(first + i, sphereMatrix.premultiply(linkMatrix));
  });
}
