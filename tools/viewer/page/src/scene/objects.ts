// Objects as they truly are, where somebody knows: those that move, and those that do not.
import { Color, EdgesGeometry, Group, LineBasicMaterial, LineSegments, Mesh, MeshStandardMaterial } from "three";
import type { Moment } from "../history";
import type { World } from "../messages";
import { dispose, place, shapeGeometry } from "./geometry";
import type { ColourName, Layer, Palette } from "./layer";

/** Below this angle, degrees, two triangles have no edge between them. */
const kEdgeAngle_deg = 25;

abstract class ObjectsLayer implements Layer {
  readonly object = new Group();
  protected names: string[] = [];
  private colour = new Color();

  constructor(
    private readonly moves: boolean,
    private readonly colourName: ColourName,
    private readonly opacity: number,
  ) {}

  begin(world: World): void {
    dispose(this.object);
    const objects = world.objects.filter((object) => object.moves === this.moves);
    this.names = objects.map((object) => object.name);
    for (const { shape, pose } of objects) {
      const body = new Group();
      const geometry = shapeGeometry(shape);
      const face = new MeshStandardMaterial({
        ...{ color: this.colour, roughness: 0.9, transparent: true, opacity: this.opacity, depthWrite: false },
      });
      const edge = new LineBasicMaterial({ color: this.colour, transparent: true, opacity: 0.8 });
      body.add(new Mesh(geometry, face), new LineSegments(new EdgesGeometry(geometry, kEdgeAngle_deg), edge));
      place(body, pose);
      this.object.add(body);
    }
  }

  abstract show(moment: Moment): void;

  recolour(palette: Palette): void {
    this.colour = palette[this.colourName];
    this.object.traverse((part) => {
      const { material } = part as Mesh<never, MeshStandardMaterial | LineBasicMaterial>;
      material?.color.copy(this.colour);
    });
  }
}

export class MovingObjectsLayer extends ObjectsLayer {
  private links = 0;

  constructor() {
    super(true, "moving", 0.42);
  }

  override begin(world: World): void {
    super.begin(world);
    this.links = world.links.length;
  }

  override show(moment: Moment): void {
    const poses = moment.state?.poses;
    if (poses === undefined) return;
    this.object.children.forEach((body, i) => place(body, poses, 7 * (this.links + i)));
  }
}

export class FixedObjectsLayer extends ObjectsLayer {
  constructor() {
    super(false, "fixed", 0.12);
  }

  override show(): void {
    // They stay where they are.
  }
}
