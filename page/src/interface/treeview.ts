import { element, uniqueId } from "./element.ts";
import { icon } from "./icons.ts";
import { type TreeRow, treeRows } from "./tree.ts";

/** A tree that is searched and walked with the keyboard. */
export class TreeView {
  readonly element = element("div", { className: "tree", tabIndex: 0, role: "tree" });
  readonly #folded = new Set<number>();
  readonly #prefix = uniqueId("tree");
  #parents: readonly number[] = [];
  #names: readonly string[] = [];
  #rows: readonly TreeRow[] = [];
  #search = "";
  #selected: number | null = null;
  #active = 0;

  /** @param onSelect - Called with the node that the user chose. */
  constructor(
    label: string,
    readonly onSelect: (id: number) => void,
  ) {
    this.element.setAttribute("aria-label", label);
    this.element.addEventListener("keydown", (event) => this.#key(event));
    this.element.addEventListener("click", (event) => this.#click(event));
  }

  /** Shows other nodes; a root is its own parent. */
  show(parents: readonly number[], names: readonly string[]): void {
    this.#parents = parents;
    this.#names = names;
    this.#folded.clear();
    this.#active = 0;
    this.#draw();
  }

  search(text: string): void {
    this.#search = text;
    this.#draw();
    const first = this.#rows.find(({ match }) => match);
    if (text !== "" && first !== undefined) this.#activate(first.id);
  }

  /** Marks a node, unfolds its ancestors and scrolls to it. */
  select(id: number | null): void {
    this.#selected = id;
    if (id !== null) {
      for (let node = this.#parents[id]!; ; node = this.#parents[node]!) {
        this.#folded.delete(node);
        if (this.#parents[node] === node) break;
      }
      this.#active = id;
    }
    this.#draw();
    if (id !== null) this.#scroll(id);
  }

  /** Chooses the node that the keyboard is at. */
  choose(): void {
    if (this.#rows.some(({ id }) => id === this.#active)) this.onSelect(this.#active);
  }

  #draw(): void {
    this.#rows = treeRows(this.#parents, this.#names, this.#search, this.#folded);
    const lines = this.#rows.map((row) => this.#line(row));
    if (lines.length === 0) lines.push(element("p", { className: "hint" }, `No name contains "${this.#search}".`));
    this.element.replaceChildren(...lines);
    this.#activate(this.#rows.some(({ id }) => id === this.#active) ? this.#active : (this.#rows[0]?.id ?? 0));
  }

  #line({ id, depth, children, open, match }: TreeRow): HTMLElement {
    const fold = element("span", { className: "fold" });
    if (children > 0) fold.append(icon("chevron"));
    const line = element("div", { id: `${this.#prefix}-${id}`, className: match ? "line" : "line other" }, fold);
    line.append(element("span", { className: "name" }, this.#names[id]!));
    line.style.paddingLeft = `${4 + 12 * depth}px`;
    line.setAttribute("role", "treeitem");
    line.setAttribute("aria-level", `${depth + 1}`);
    line.setAttribute("aria-selected", String(id === this.#selected));
    if (children > 0) line.setAttribute("aria-expanded", String(open));
    line.dataset["id"] = `${id}`;
    return line;
  }

  #activate(id: number): void {
    this.element.querySelector(".active")?.classList.remove("active");
    this.#active = id;
    const line = document.getElementById(`${this.#prefix}-${id}`);
    line?.classList.add("active");
    this.element.setAttribute("aria-activedescendant", line?.id ?? "");
  }

  #scroll(id: number): void {
    document.getElementById(`${this.#prefix}-${id}`)?.scrollIntoView({ block: "nearest" });
  }

  #fold(id: number, folded: boolean): void {
    folded ? this.#folded.add(id) : this.#folded.delete(id);
    this.#draw();
    this.#scroll(id);
  }

  #click(event: MouseEvent): void {
    const target = event.target as HTMLElement;
    const line = target.closest<HTMLElement>(".line");
    if (line === null) return;
    const id = Number(line.dataset["id"]);
    if (target.closest(".fold .icon, .fold:has(.icon)") !== null) this.#fold(id, !this.#folded.has(id));
    else this.onSelect(id);
  }

  #key(event: KeyboardEvent): void {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const index = this.#rows.findIndex(({ id }) => id === this.#active);
    const row = this.#rows[index];
    if (row === undefined) return;
    const go = (to: number) => {
      const { id } = this.#rows[Math.max(0, Math.min(this.#rows.length - 1, to))]!;
      this.#activate(id);
      this.#scroll(id);
    };
    const actions: Record<string, () => void> = {
      ArrowDown: () => go(index + 1),
      ArrowUp: () => go(index - 1),
      Home: () => go(0),
      End: () => go(this.#rows.length - 1),
      ArrowRight: () => (row.children > 0 && !row.open ? this.#fold(row.id, false) : go(index + 1)),
      ArrowLeft: () =>
        row.children > 0 && row.open && this.#search === ""
          ? this.#fold(row.id, true)
          : go(this.#rows.findIndex(({ id }) => id === row.parent)),
      Enter: () => this.onSelect(row.id),
      " ": () => this.onSelect(row.id),
    };
    const action = actions[event.key];
    if (action === undefined) return;
    event.preventDefault();
    action();
  }
}
