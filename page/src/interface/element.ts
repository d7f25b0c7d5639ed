type Child = Node | string;

/** Creates an HTML element with properties and children. */
export function element<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  properties: Partial<HTMLElementTagNameMap[K]> = {},
  ...children: Child[]
): HTMLElementTagNameMap[K] {
  const created = Object.assign(document.createElement(tag), properties);
  created.append(...children);
  return created;
}

/** Sets a text only if it differs, so that a line that is updated often costs nothing while it stays the same. */
export function setText(target: Node, text: string): void {
  if (target.textContent !== text) target.textContent = text;
}

let ids = 0;

/** Returns an id that no other element has, for labels. */
export function uniqueId(prefix: string): string {
  ids += 1;
  return `${prefix}-${ids}`;
}
