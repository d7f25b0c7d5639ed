import type { Lights } from "./lights.ts";
import type { MaterialEntry, PackHeader, Vector } from "./pack.ts";
import { type Look, Shading, type ShadingOptions } from "./shading.ts";
import type { Textures } from "./textures.ts";

/** What MuJoCo uses without a material. */
const PLAIN = { emission: 0, specular: 0.5, shininess: 0.5 };

interface Colored {
  readonly rgba: Vector;
  readonly material: number;
}

/** Makes the materials of one world; shapes that look equal share one. */
export class Looks {
  readonly #known = new Map<string, Shading>();
  readonly #all: Shading[] = [];

  constructor(
    readonly header: PackHeader,
    readonly textures: Textures,
    readonly lights: Lights,
  ) {}

  material(index: number): MaterialEntry | undefined {
    return this.header.materials[index];
  }

  /** Returns a key that is equal for entries that look equal. */
  key({ rgba, material }: Colored): string {
    return `${rgba.join(" ")} ${material}`;
  }

  /** Returns the material of an entry; entries with equal keys share it. */
  shared(entry: Colored, options: ShadingOptions, variant: string): Shading {
    const key = `${this.key(entry)} ${variant}`;
    const known = this.#known.get(key);
    if (known !== undefined) return known;
    const made = this.own(entry, options);
    this.#known.set(key, made);
    return made;
  }

  /** Returns a material of its own for an entry. */
  own(entry: Colored, options: ShadingOptions): Shading {
    const made = new Shading(this.look(entry), this.lights, options);
    this.#all.push(made);
    return made;
  }

  look({ rgba, material }: Colored): Look {
    const [red = 0.5, green = 0.5, blue = 0.5, alpha = 1] = rgba;
    const { emission, specular, shininess } = this.material(material) ?? PLAIN;
    return { rgba: [red, green, blue, alpha], emission, specular, shininess };
  }

  setWireframe(on: boolean): void {
    for (const shading of this.#all) shading.wireframe = on;
  }

  dispose(): void {
    for (const shading of this.#all) shading.dispose();
  }
}
