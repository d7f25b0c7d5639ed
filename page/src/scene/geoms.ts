import { BufferAttribute, type BufferGeometry, Matrix4, Mesh, Quaternion, Vector3 } from "three";
import type { Assets } from "./assets.ts";
import type { Looks } from "./looks.ts";
import { mapTexture, mappingOf } from "./mapping.ts";
import type { GeomEntry, ShapeEntry } from "./pack.ts";
import { type Part, clampGroup } from "./part.ts";
import { shape, sizeOf } from "./shapes.ts";
import { type Mapping, type Placed, type Surface, type Triple, geometryOf, merge } from "./surface.ts";

/** Meshes with more vertices are not merged with others, so that geoms that use the same mesh share its memory. */
const MERGE_LIMIT = 3000;

/** A shape of a body that is still to be merged with others of the same look. */
interface Waiting extends Placed {
  readonly entry: ShapeEntry;
}

interface Batch {
  readonly kind: "geom" | "site";
  readonly entry: ShapeEntry;
  readonly mapping: Mapping;
  readonly flat: boolean;
  readonly waiting: Waiting[];
}

/** Builds the meshes of all geoms and sites except planes; shapes of one body that look equal become one mesh. */
export class GeomBuilder {
  readonly parts: Part[] = [];
  readonly #batches = new Map<string, Batch>();
  readonly #geometries = new Map<string, BufferGeometry>();

  constructor(
    readonly assets: Assets,
    readonly looks: Looks,
    readonly dynamic: ReadonlySet<number>,
  ) {}

  add(kind: "geom" | "site", entry: GeomEntry): void {
    if (entry.rgba[3]! <= 0) return;
    const mapping = mappingOf(this.looks.header.textures[this.looks.material(entry.material)?.texture ?? -1]);
    const asset = entry.mesh !== undefined || entry.hfield !== undefined;
    const size = sizeOf(entry.type, entry.size);
    const surface = this.#surface(entry, size);
    if (surface === null) return;
    const flat = entry.hfield !== undefined;
    const pose = poseOf(entry);
    const mapped = mapTexture(surface, mapping, this.looks.material(entry.material), size, asset);
    if (asset && surface.positions.length / 3 > MERGE_LIMIT) {
      this.#single({ kind, entry, mapping, flat, waiting: [] }, this.#shared(entry, surface, mapped, mapping), pose);
      return;
    }
    const key = `${kind} ${entry.body} ${clampGroup(entry.group)} ${flat} ${this.looks.key(entry)}`;
    const batch = this.#batches.get(key) ?? { kind, entry, mapping, flat, waiting: [] };
    batch.waiting.push({ entry, surface: mapped, pose });
    this.#batches.set(key, batch);
  }

  /** Makes the meshes of all shapes that were added and returns them; they are in the frames of their bodies. */
  finish(): readonly Part[] {
    for (const batch of this.#batches.values()) {
      const geometry = geometryOf(merge(batch.waiting, batch.mapping), batch.mapping);
      let corner = 0;
      const shapes = batch.waiting.map(({ entry, surface }) => {
        const first = corner;
        corner += surface.indices.length;
        return { corner: first, id: entry.id };
      });
      this.#part(batch, geometry, shapes);
    }
    this.#batches.clear();
    return this.parts;
  }

  #surface(entry: GeomEntry, size: Triple): Surface | null {
    if (entry.mesh !== undefined) return this.assets.mesh(entry.mesh);
    if (entry.hfield !== undefined) return this.assets.heightField(entry.hfield);
    return shape(entry.type, size);
  }

  /** Returns a geometry with positions and normals that all geoms of the mesh share. */
  #shared(entry: GeomEntry, surface: Surface, mapped: Surface, mapping: Mapping): BufferGeometry {
    const name = entry.mesh !== undefined ? `mesh ${entry.mesh}` : `hfield ${entry.hfield}`;
    const plain = this.#geometries.get(name) ?? geometryOf(surface, "none");
    this.#geometries.set(name, plain);
    if (mapping === "none") return plain;
    const geometry = geometryOf(mapped, mapping);
    geometry.setAttribute("position", plain.getAttribute("position"));
    geometry.setAttribute("normal", plain.getAttribute("normal"));
    geometry.setIndex(plain.getIndex() as BufferAttribute);
    return geometry;
  }

  #single(batch: Batch, geometry: BufferGeometry, pose: Matrix4): void {
    const { mesh } = this.#part(batch, geometry, [{ corner: 0, id: batch.entry.id }]);
    pose.decompose(mesh.position, mesh.quaternion, mesh.scale);
    mesh.updateMatrix();
  }

  #part({ kind, entry, mapping, flat }: Batch, geometry: BufferGeometry, shapes: Part["shapes"]): Part {
    const texture = this.looks.textures.get(this.looks.material(entry.material)?.texture ?? -1);
    const dynamic = this.dynamic.has(entry.body);
    const shading = this.looks.shared(
      entry,
      { flat, map: mapping === "2d" ? texture : null, cube: mapping === "cube" ? texture : null },
      `${flat} ${dynamic} ${mapping}`,
    );
    const mesh = new Mesh(geometry, shading);
    mesh.matrixAutoUpdate = false;
    const part = { mesh, kind, group: clampGroup(entry.group), body: entry.body, dynamic, shadow: true, shapes };
    this.parts.push(part);
    return part;
  }
}

const UNIT = new Vector3(1, 1, 1);

/** Returns the pose of an entry relative to its body. */
export function poseOf({ pos, quat }: Pick<ShapeEntry, "pos" | "quat">): Matrix4 {
  const [x = 0, y = 0, z = 0] = pos;
  const [qw = 1, qx = 0, qy = 0, qz = 0] = quat;
  return new Matrix4().compose(new Vector3(x, y, z), new Quaternion(qx, qy, qz, qw), UNIT);
}
