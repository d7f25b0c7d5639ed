import { select, slider, type Control } from "../../interface/controls.ts";
import type { Fields } from "../../wire/protocol.ts";
import { cloudPoints, type PointCloud2, valueFields } from "../cloud.ts";
import { stampOf, type Header } from "../messages.ts";
import { type LaserScan, type Points, scanPoints } from "../scan.ts";
import type { Display, DisplayContext } from "./display.ts";
import { type Colouring, PointCloud } from "./points.ts";

interface Choice {
  readonly value: Colouring;
  readonly text: string;
}

/** What scans and clouds have in common: points with a size and colours. */
abstract class PointsDisplay implements Display {
  readonly cloud: PointCloud;
  #points: Points | null = null;
  #ranged = false;

  constructor(
    readonly context: DisplayContext,
    readonly defaults: { readonly colouring: Colouring; readonly size: number },
  ) {
    this.cloud = new PointCloud(context.colour);
    context.group.add(this.cloud.object);
  }

  abstract show(message: Fields): void;

  protected abstract choices(): Choice[];

  protected draw(header: Header, points: Points): void {
    this.#points = points;
    this.#ranged = false;
    this.cloud.set(points);
    this.cloud.style(this.colouring(), this.context.option("size", this.defaults.size));
    this.context.placement.set(this.cloud.object, header.frame_id, stampOf(header));
  }

  protected colouring(): Colouring {
    const chosen = this.context.option<string>("colouring", this.defaults.colouring);
    const usable = (wanted: string) =>
      (wanted !== "rgb" || this.#points?.colours !== null) && (wanted !== "value" || this.#points?.values !== null);
    return usable(chosen) ? (chosen as Colouring) : "height";
  }

  update(): boolean {
    if (this.#points === null || this.#ranged || !this.cloud.object.visible) return false;
    const colouring = this.colouring();
    if (colouring === "height" || colouring === "value") this.cloud.fitRange(colouring);
    this.#ranged = true;
    return true;
  }

  summary(): string {
    if (this.#points === null) return "";
    const shown = this.#points.positions.length / 3;
    return shown === this.#points.total ? `${shown} points` : `${shown} of ${this.#points.total} points`;
  }

  controls(): Control[] {
    const restyle = () => {
      this.#ranged = false;
      this.cloud.style(this.colouring(), this.context.option("size", this.defaults.size));
    };
    return [
      select({
        label: "Colour",
        options: this.choices(),
        value: this.context.option("colouring", this.defaults.colouring),
        change: (value) => {
          this.context.setOption("colouring", value);
          restyle();
        },
      }),
      slider({
        label: "Size",
        unit: "px",
        min: 1,
        max: 12,
        step: 1,
        decimals: 0,
        value: this.context.option("size", this.defaults.size),
        change: (value) => {
          this.context.setOption("size", value);
          restyle();
        },
      }),
    ];
  }

  dispose(): void {
    this.context.placement.delete(this.cloud.object);
    this.cloud.dispose();
  }
}

export class ScanDisplay extends PointsDisplay {
  constructor(context: DisplayContext) {
    super(context, { colouring: "one", size: 5 });
  }

  show(message: Fields): void {
    const scan = message as unknown as LaserScan;
    this.draw(scan.header, scanPoints(scan));
  }

  protected choices(): Choice[] {
    return [
      { value: "one", text: "one colour" },
      { value: "value", text: "intensity" },
      { value: "height", text: "height" },
    ];
  }
}

/** Choices for the maximum number of points of a cloud. */
const MOST = [10_000, 50_000, 200_000, 1_000_000];

export class CloudDisplay extends PointsDisplay {
  #fields: string[] = [];

  constructor(context: DisplayContext) {
    super(context, { colouring: "height", size: 3 });
  }

  show(message: Fields): void {
    const cloud = message as unknown as PointCloud2;
    this.#fields = valueFields(cloud);
    const value = this.#fields.includes("intensity") ? "intensity" : (this.#fields[0] ?? "intensity");
    this.draw(cloud.header, cloudPoints(cloud, Number(this.context.option<string>("most", "200000")), value));
  }

  protected choices(): Choice[] {
    return [
      { value: "height", text: "height" },
      { value: "value", text: this.#fields[0] === undefined ? "intensity" : this.#fields.join(", ") },
      { value: "rgb", text: "own colours (rgb)" },
      { value: "one", text: "one colour" },
    ];
  }

  override controls(): Control[] {
    const most = select({
      label: "At most",
      options: MOST.map((count) => ({ value: `${count}`, text: `${count.toLocaleString("en")} points` })),
      value: this.context.option<string>("most", "200000"),
      change: (value) => this.context.setOption("most", value),
    });
    return [...super.controls(), most];
  }
}
