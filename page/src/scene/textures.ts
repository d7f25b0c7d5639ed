import { CubeTexture, NoColorSpace, RepeatWrapping, SRGBColorSpace, Texture } from "three";
import type { Pack, TextureEntry } from "./pack.ts";

const FACES = 6;

/** The textures of a model. */
export class Textures {
  readonly #textures: readonly (Texture | null)[];

  private constructor(
    readonly entries: readonly TextureEntry[],
    textures: readonly (Texture | null)[],
  ) {
    this.#textures = textures;
  }

  /** Decodes all textures of a pack; one that cannot be decoded is drawn as white. */
  static async load(pack: Pack): Promise<Textures> {
    const { textures } = pack.header;
    const loaded = await Promise.all(
      textures.map(async (entry) => {
        try {
          return await decode(pack, entry);
        } catch (error) {
          console.warn(`Texture ${entry.name} cannot be decoded:`, error);
          return null;
        }
      }),
    );
    return new Textures(textures, loaded);
  }

  get(index: number): Texture | null {
    return this.#textures[index] ?? null;
  }

  /** The first skybox, which MuJoCo draws as the background. */
  get sky(): Texture | null {
    return this.get(this.entries.findIndex(({ type }) => type === "skybox"));
  }

  /** Limits the blur of textures that are seen at a flat angle. */
  setAnisotropy(anisotropy: number): void {
    for (const texture of this.#textures) if (texture !== null) texture.anisotropy = anisotropy;
  }

  dispose(): void {
    for (const texture of this.#textures) {
      texture?.dispose();
      const images: unknown = texture?.image;
      for (const image of Array.isArray(images) ? images : [images]) if (image instanceof ImageBitmap) image.close();
    }
  }
}

async function decode(pack: Pack, entry: TextureEntry): Promise<Texture> {
  const file = new Blob([pack.file(entry.png)], { type: "image/png" });
  const options: ImageBitmapOptions = { colorSpaceConversion: "none", premultiplyAlpha: "none" };
  let texture: Texture;
  if (entry.type === "2d") {
    texture = new Texture(await createImageBitmap(file, options));
    texture.wrapS = texture.wrapT = RepeatWrapping;
  } else {
    const { width } = entry;
    const single = entry.height < FACES * width;
    const faces = Array.from({ length: FACES }, (_, face) =>
      createImageBitmap(file, 0, single ? 0 : face * width, width, width, options),
    );
    texture = new CubeTexture(await Promise.all(faces));
  }
  // Rows are in the order of OpenGL.
  texture.flipY = false;
  texture.colorSpace = entry.srgb === true ? SRGBColorSpace : NoColorSpace;
  texture.needsUpdate = true;
  return texture;
}
