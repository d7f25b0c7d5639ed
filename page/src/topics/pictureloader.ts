/** What the loader needs of an image element. */
export type Target = Pick<HTMLImageElement, "src" | "hidden" | "onload" | "onerror">;

/**
 * Shows the newest of the pictures that arrive.
 *
 * A browser that decodes more slowly than pictures arrive gets the next one only after it has decoded the one before;
 * pictures between them are left out, and the memory of each is freed.
 */
export class PictureLoader {
  #shown = "";
  #loading = "";
  #next: Blob | null = null;

  constructor(readonly target: Target) {}

  show(file: Blob): void {
    if (this.#loading !== "") {
      this.#next = file;
      return;
    }
    const { target } = this;
    this.#loading = URL.createObjectURL(file);
    target.onload = target.onerror = () => this.#loaded();
    target.src = this.#loading;
    target.hidden = false;
  }

  close(): void {
    this.target.onload = this.target.onerror = null;
    this.#next = null;
    for (const url of [this.#shown, this.#loading]) URL.revokeObjectURL(url);
    this.#shown = this.#loading = "";
  }

  #loaded(): void {
    URL.revokeObjectURL(this.#shown);
    this.#shown = this.#loading;
    this.#loading = "";
    const next = this.#next;
    this.#next = null;
    if (next !== null) this.show(next);
  }
}
