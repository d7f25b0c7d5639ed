import {
  BoxGeometry,
  BufferAttribute,
  BufferGeometry,
  Color,
  CylinderGeometry,
  DoubleSide,
  Group,
  InstancedMesh,
  Matrix4,
  Mesh,
  MeshPhongMaterial,
  type Object3D,
  Quaternion,
  SphereGeometry,
  Vector3,
} from "three";
import type { Header, PoseFields, Time, Vector3Fields } from "../messages.ts";
import { arrow, arrowBetween } from "./arrow.ts";
import { unpickable } from "./display.ts";
import { label } from "./label.ts";
import { Lines, strip } from "./lines.ts";

interface Rgba {
  readonly r: number;
  readonly g: number;
  readonly b: number;
  readonly a: number;
}

/** visualization_msgs/Marker. */
export interface Marker {
  readonly header: Header;
  readonly ns: string;
  readonly id: number;
  readonly type: number;
  readonly action: number;
  readonly pose: PoseFields;
  readonly scale: Vector3Fields;
  readonly color: Rgba;
  readonly lifetime: Time;
  readonly frame_locked: boolean;
  readonly points: readonly Vector3Fields[];
  readonly colors: readonly Rgba[];
  readonly text: string;
}

const NAMES = [
  "arrow",
  "cube",
  "sphere",
  "cylinder",
  "line strip",
  "line list",
  "cube list",
  "sphere list",
  "points",
  "text",
  "mesh",
  "triangle list",
  "arrow strip",
];
const BOX = new BoxGeometry();
const SPHERE = new SphereGeometry(0.5, 24, 16);
const CYLINDER = new CylinderGeometry(0.5, 0.5, 1, 24).rotateX(Math.PI / 2);

/**
 * Returns the shape of a marker in the frame of its header.
 *
 * @throws Error with a sentence if the page cannot draw this type.
 */
export function markerShape(marker: Marker): Object3D {
  const { position, orientation } = marker.pose;
  const posed = new Group();
  posed.position.set(position.x, position.y, position.z);
  const rotation = new Quaternion(orientation.x, orientation.y, orientation.z, orientation.w);
  if (rotation.length() > 0) posed.quaternion.copy(rotation.normalize());
  posed.add(shape(marker));
  const outer = new Group();
  outer.add(posed);
  return outer;
}

function shape(marker: Marker): Object3D {
  const { type, scale, points } = marker;
  const solid = (geometry: BufferGeometry) => {
    const mesh = unpickable(new Mesh(geometry, material(marker)));
    mesh.scale.set(scale.x, scale.y, scale.z);
    return mesh;
  };
  if (type === 0 && points.length >= 2) return arrows(marker, points.slice(0, 2));
  if (type === 0) {
    // RViz: x is the length, y and z are the diameters of the head; the shaft has half of that.
    const size = { length: scale.x, shaft: 0.5 * scale.y, head: scale.y, headLength: 0.23 * scale.x };
    return arrow(size, material(marker));
  }
  if (type === 1) return solid(BOX);
  if (type === 2) return solid(SPHERE);
  if (type === 3) return solid(CYLINDER);
  if (type === 4) return lines(marker, strip(coordinates(points)), (segment) => segment);
  if (type === 5) return lines(marker, coordinates(points.slice(0, points.length & ~1)), (segment) => 2 * segment);
  if (type === 6) return instances(marker, BOX);
  if (type === 7) return instances(marker, SPHERE);
  if (type === 8) return instances({ ...marker, scale: { ...scale, z: Math.min(scale.x, scale.y) } }, BOX);
  if (type === 9) return label(marker.text, { height: scale.z, colour: css(marker.color) });
  if (type === 11) return triangles(marker);
  if (type === 12) return arrows(marker, points);
  throw new Error(`Markers of type ${NAMES[type] ?? type} are not shown.`);
}

function material({ color, type, colors }: Marker): MeshPhongMaterial {
  // Lists with a colour for each point get their colours from the instances.
  const white = colors.length > 0 && type >= 6;
  const shown = white ? new Color(1, 1, 1) : new Color(color.r, color.g, color.b);
  return new MeshPhongMaterial({
    color: shown,
    opacity: color.a,
    transparent: color.a < 1,
    depthWrite: color.a >= 1,
    shininess: 10,
  });
}

function coordinates(points: readonly Vector3Fields[]): Float32Array {
  const values = new Float32Array(3 * points.length);
  points.forEach(({ x, y, z }, index) => values.set([x, y, z], 3 * index));
  return values;
}

function lines(marker: Marker, segments: Float32Array, first: (segment: number) => number): Object3D {
  const { colors, color, points } = marker;
  const own = colors.length === points.length && colors.length > 0;
  const width = Math.max(marker.scale.x, 1e-4);
  const drawn = new Lines(
    own ? { width, world: true } : { width, world: true, colour: new Color(color.r, color.g, color.b) },
  );
  if (own) {
    const values = new Float32Array(segments.length);
    for (let segment = 0; segment < segments.length / 6; segment += 1) {
      const [from, to] = [colors[first(segment)]!, colors[first(segment) + 1]!];
      values.set([from.r, from.g, from.b, to.r, to.g, to.b], 6 * segment);
    }
    drawn.set(segments, values);
  } else {
    drawn.set(segments);
  }
  drawn.opacity = own ? colors[0]!.a : color.a;
  return drawn.object;
}

function instances(marker: Marker, geometry: BufferGeometry): Object3D {
  const { points, colors, scale } = marker;
  const mesh = unpickable(new InstancedMesh(geometry, material(marker), points.length));
  mesh.frustumCulled = false;
  const matrix = new Matrix4();
  points.forEach(({ x, y, z }, index) => {
    mesh.setMatrixAt(index, matrix.makeScale(scale.x, scale.y, scale.z).setPosition(x, y, z));
    const colour = colors[index];
    if (colors.length > 0)
      mesh.setColorAt(index, colour ? new Color(colour.r, colour.g, colour.b) : new Color(1, 1, 1));
  });
  return mesh;
}

function triangles(marker: Marker): Object3D {
  const { points, colors, scale } = marker;
  const geometry = new BufferGeometry();
  geometry.setAttribute(
    "position",
    new BufferAttribute(coordinates(points.slice(0, points.length - (points.length % 3))), 3),
  );
  geometry.computeVertexNormals();
  const drawn = material(marker);
  drawn.side = DoubleSide;
  if (colors.length > 0 && colors.length === points.length) {
    const values = new Float32Array(3 * colors.length);
    colors.forEach(({ r, g, b }, index) => values.set([r, g, b], 3 * index));
    geometry.setAttribute("color", new BufferAttribute(values, 3));
    drawn.vertexColors = true;
  }
  const mesh = unpickable(new Mesh(geometry, drawn));
  mesh.scale.set(scale.x, scale.y, scale.z);
  mesh.userData["own"] = true;
  return mesh;
}

function arrows(marker: Marker, points: readonly Vector3Fields[]): Object3D {
  const shown = material(marker);
  const group = new Group();
  const { x, y, z } = marker.scale;
  const size = new Vector3(x, y, z);
  const at = points.map((point) => new Vector3(point.x, point.y, point.z));
  for (let index = 0; index + 1 < at.length; index += 1) {
    group.add(arrowBetween(at[index]!, at[index + 1]!, size, shown));
  }
  return group;
}

function css({ r, g, b, a }: Rgba): string {
  return `rgb(${255 * r} ${255 * g} ${255 * b} / ${a})`;
}
