/** What the user chose, kept in the browser's local storage. */
export class Settings {
  /** @param prefix - Starts the names in the local storage. */
  constructor(readonly prefix: string) {}

  /** Returns a setting, or `fallback` if there is none of this type. */
  get<T extends string | number | boolean>(name: string, fallback: T): T {
    try {
      const value: unknown = JSON.parse(localStorage.getItem(this.prefix + name) ?? "null");
      return typeof value === typeof fallback ? (value as T) : fallback;
    } catch {
      // Local storage may be switched off, for example in a frame of another site.
      return fallback;
    }
  }

  set(name: string, value: string | number | boolean): void {
    try {
      localStorage.setItem(this.prefix + name, JSON.stringify(value));
    } catch {
      // As above; the setting then lasts as long as the page.
    }
  }
}
