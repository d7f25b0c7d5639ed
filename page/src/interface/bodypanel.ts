import { Matrix4, Quaternion, Vector3 } from "three";
import type { App } from "../app.ts";
import type { World } from "../scene/world.ts";
import { button, Properties, select } from "./controls.ts";
import { element } from "./element.ts";
import { fixed, formatMass, rollPitchYaw } from "./format.ts";
import { bodyName, type Selected } from "./selection.ts";

const PERIOD = 100;
const DEGREES = 180 / Math.PI;
const UNITS = { free: "", ball: "rad", slide: "m", hinge: "rad" } as const;

type Frame = "world" | "parent" | "root";

/** Adds the panel with what is known of the selected body. */
export function install({ shell, selection, settings }: App): void {
  const content = shell.panel("Selection", { side: "left", icon: "pointer", order: 30, open: true });
  const empty = element(
    "p",
    { className: "hint" },
    "Double-click a body in the scene, press it long on a touch screen, or choose it in the tree.",
  );
  const heading = element("div", { className: "heading" });
  const name = element("strong");
  const deselect = button({ icon: "close", label: "Deselect", className: "bare", run: () => selection.select(null) });
  heading.append(name, deselect.element);
  const facts = new Properties();
  const pose = new Properties();
  const frame = select({
    label: "Pose in",
    options: [],
    change: (value) => {
      settings.set("pose frame", value);
      update();
    },
  });
  const parts = element("div", { className: "parts" });
  const details = element("div", { className: "rows" }, heading, facts.element, frame.element, pose.element, parts);
  content.append(empty, details);

  function show(selected: Selected | null): void {
    empty.hidden = selected !== null;
    details.hidden = selected === null;
    if (selected === null) return;
    const { world, body } = selected;
    const { bodies, moving } = world.pack.header;
    const entry = bodies[body]!;
    name.textContent = bodyName(world, body);
    name.title = `${world.name}: body ${body}`;
    facts.clear();
    facts.set("Mass", formatMass(entry.mass), "Of this body alone, without its children");
    facts.set("Subtree mass", formatMass(subtreeMass(world, body)), "Of this body and all bodies below it");
    if (body !== 0) facts.set("Parent", bodyName(world, entry.parent));
    facts.set("Motion", entry.mocap ? "mocap" : moving.includes(body) ? "moves" : "fixed to the world");
    const choices = [{ value: "world", text: "world frame" }];
    if (entry.parent !== 0) choices.push({ value: "parent", text: `frame of ${bodyName(world, entry.parent)}` });
    if (entry.root !== body && entry.root !== entry.parent) {
      choices.push({ value: "root", text: `frame of ${bodyName(world, entry.root)}` });
    }
    frame.set(choices);
    const wanted = settings.get<string>("pose frame", "world");
    frame.value = choices.some(({ value }) => value === wanted) ? wanted : "world";
    parts.replaceChildren(...describeParts(world, body));
    update();
  }
  function update(): void {
    const { current } = selection;
    if (current === null) return;
    const { position, quaternion } = poseIn(current, frame.value as Frame);
    const [roll, pitch, yaw] = rollPitchYaw([quaternion.w, quaternion.x, quaternion.y, quaternion.z]);
    for (const axis of ["x", "y", "z"] as const) pose.set(axis, `${fixed(position[axis], 4)} m`);
    pose.set("roll", `${fixed(roll * DEGREES, 2)}°`, "Rotation about the x axis of the frame");
    pose.set("pitch", `${fixed(pitch * DEGREES, 2)}°`, "Rotation about the y axis of the frame, after roll");
    pose.set("yaw", `${fixed(yaw * DEGREES, 2)}°`, "Rotation about the z axis of the frame, after roll and pitch");
  }
  selection.listen(show);
  show(selection.current);
  setInterval(() => content.parentElement!.hasAttribute("open") && update(), PERIOD);
}

/** Returns the pose of a body in the world frame of its server, or in that of its parent or root. */
export function poseIn({ world, body }: Selected, frame: Frame): { position: Vector3; quaternion: Quaternion } {
  const { parent, root } = world.pack.header.bodies[body]!;
  const matrix = matrixOf(world, body);
  if (frame !== "world") matrix.premultiply(matrixOf(world, frame === "parent" ? parent : root).invert());
  const [position, quaternion] = [new Vector3(), new Quaternion()];
  matrix.decompose(position, quaternion, new Vector3());
  return { position, quaternion };
}

function matrixOf(world: World, body: number): Matrix4 {
  const { position, quaternion } = world.bodies[body]!;
  return new Matrix4().compose(position, quaternion, new Vector3(1, 1, 1));
}

function subtreeMass(world: World, body: number): number {
  const { bodies } = world.pack.header;
  const inside = new Set([body]);
  let mass = 0;
  // A parent comes before its children.
  bodies.forEach((entry, id) => {
    if (id !== body && id !== 0 && inside.has(entry.parent)) inside.add(id);
    if (inside.has(id)) mass += entry.mass;
  });
  return mass;
}

function describeParts(world: World, body: number): HTMLElement[] {
  const { joints, geoms } = world.pack.header;
  const own = joints.filter((joint) => joint.body === body);
  const shapes = geoms.filter((geom) => geom.body === body);
  const result: HTMLElement[] = [];
  if (own.length > 0) {
    const table = new Properties();
    own.forEach(({ name, type, range }, index) => {
      const limits = range?.map((limit) => fixed(limit, 2)).join(" … ");
      const text =
        limits === undefined ? (type === "free" ? "free" : `${type}, unlimited`) : `${limits} ${UNITS[type]}`;
      table.set(name || `joint ${index}`, text, `${type} joint`);
    });
    result.push(element("h3", {}, "Joints"), table.element);
  }
  if (shapes.length > 0) {
    const table = new Properties();
    for (const { id, name, type, group } of shapes) table.set(name || `geom ${id}`, `${type}, group ${group}`);
    result.push(element("h3", {}, "Geoms"), table.element);
  }
  return result;
}
