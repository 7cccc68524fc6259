// Shapes and poses of the protocol as three has them.
import {
  BoxGeometry,
  BufferAttribute,
  BufferGeometry,
  CapsuleGeometry,
  CylinderGeometry,
  Matrix4,
  Object3D,
  Quaternion,
  SphereGeometry,
  Vector3,
} from "three";
import type { Pose, Shape } from "../messages";

/** Nothing of what has no bounds. */
export function shapeGeometry(shape: Shape): BufferGeometry {
  switch (shape.type) {
    case "sphere":
      return new SphereGeometry(shape.radius_m, 32, 20);
    case "box":
      return new BoxGeometry(...shape.size_m);
    case "cylinder":
      // three has its cylinders along y.
      return new CylinderGeometry(shape.radius_m, shape.radius_m, shape.length_m, 40).rotateX(Math.PI / 2);
    case "capsule":
      return new CapsuleGeometry(shape.radius_m, shape.length_m, 10, 32).rotateX(Math.PI / 2);
    case "half_space":
      return new BufferGeometry().setAttribute("position", new BufferAttribute(new Float32Array(0), 3));
    case "mesh": {
      const indexed = new BufferGeometry();
      indexed.setAttribute("position", new BufferAttribute(shape.vertices, 3));
      indexed.setIndex(new BufferAttribute(shape.triangles, 1));
      // Corners of its own for each triangle: edges stay edges.
      const geometry = indexed.toNonIndexed();
      geometry.computeVertexNormals();
      return geometry;
    }
  }
}

/** Places an object at the pose that begins at `offset`. */
export function place(object: Object3D, pose: ArrayLike<number>, offset = 0): void {
  object.position.set(pose[offset], pose[offset + 1], pose[offset + 2]);
  object.quaternion.set(pose[offset + 3], pose[offset + 4], pose[offset + 5], pose[offset + 6]);
}

const position = new Vector3();
const rotation = new Quaternion();
const unit = new Vector3(1, 1, 1);

export function poseMatrix(pose: ArrayLike<number>, offset: number, into: Matrix4): Matrix4 {
  position.set(pose[offset], pose[offset + 1], pose[offset + 2]);
  rotation.set(pose[offset + 3], pose[offset + 4], pose[offset + 5], pose[offset + 6]);
  return into.compose(position, rotation, unit);
}

/** Poses of single bodies as states have them: 7 numbers each. */
export function flatten(poses: readonly Pose[]): Float32Array {
  return Float32Array.from(poses.flat());
}

/** Gives back what a removed object held on the graphics card. */
export function dispose(object: Object3D): void {
  object.traverse((part) => {
    const { geometry, material } = part as { geometry?: BufferGeometry; material?: { dispose(): void } };
    geometry?.dispose();
    material?.dispose();
  });
  object.clear();
}
