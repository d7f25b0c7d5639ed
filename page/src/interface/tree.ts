/** A visible line of a tree. */
export interface TreeRow {
  readonly id: number;
  readonly depth: number;
  readonly parent: number;
  readonly children: number;
  readonly open: boolean;
  /** Whether it matches the search itself, rather than one of its descendants. */
  readonly match: boolean;
}

/**
 * Returns the visible lines of a tree, each parent before its children.
 *
 * @param parents - Parent of each node; a root is its own parent.
 * @param names - Name of each node.
 * @param search - Only nodes whose name contains it, and their ancestors; case does not matter. Nothing is folded then.
 * @param folded - Nodes whose children are hidden.
 */
export function treeRows(
  parents: readonly number[],
  names: readonly string[],
  search: string,
  folded: ReadonlySet<number>,
): TreeRow[] {
  const wanted = search.trim().toLowerCase();
  const children: number[][] = parents.map(() => []);
  parents.forEach((parent, id) => parent !== id && children[parent]?.push(id));
  const matches = names.map((name) => name.toLowerCase().includes(wanted));
  const kept = new Set<number>();
  matches.forEach((match, id) => {
    for (let node = id; match && !kept.has(node); node = parents[node]!) kept.add(node);
  });
  const rows: TreeRow[] = [];
  const stack = parents.flatMap((parent, id) => (parent === id ? [{ id, depth: 0 }] : [])).reverse();
  while (stack.length > 0) {
    const { id, depth } = stack.pop()!;
    if (!kept.has(id)) continue;
    const below = children[id]!.filter((child) => kept.has(child));
    const open = wanted !== "" || !folded.has(id);
    rows.push({ id, depth, parent: parents[id]!, children: below.length, open, match: matches[id]! });
    if (open) stack.push(...below.map((child) => ({ id: child, depth: depth + 1 })).reverse());
  }
  return rows;
}
