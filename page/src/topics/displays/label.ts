import { CanvasTexture, Sprite, SpriteMaterial } from "three";
import { unpickable } from "./display.ts";

/** Height of the text in the texture [px]; capital letters are 0.72 of it. */
const HEIGHT = 48;
const CAPITAL = 0.72;

export interface LabelOptions {
  /** Height of a capital letter [m]; without it, the label has the same size at any distance. */
  readonly height?: number;
  readonly colour: string;
  /** Colour behind the text, if any. */
  readonly ground?: string;
}

/** Returns a text that faces the camera. */
export function label(text: string, { height, colour, ground }: LabelOptions): Sprite {
  const lines = text.split("\n");
  const canvas = document.createElement("canvas");
  const drawing = canvas.getContext("2d")!;
  const font = `600 ${HEIGHT}px system-ui, "DejaVu Sans", sans-serif`;
  drawing.font = font;
  const padding = HEIGHT / 4;
  canvas.width = Math.ceil(Math.max(...lines.map((line) => drawing.measureText(line).width)) + 2 * padding) || 1;
  canvas.height = Math.ceil(1.25 * HEIGHT * lines.length + padding);
  drawing.font = font;
  if (ground !== undefined) {
    drawing.fillStyle = ground;
    drawing.beginPath();
    drawing.roundRect(0, 0, canvas.width, canvas.height, padding);
    drawing.fill();
  }
  drawing.fillStyle = colour;
  drawing.textBaseline = "middle";
  drawing.textAlign = "center";
  lines.forEach((line, index) => drawing.fillText(line, canvas.width / 2, padding / 2 + 1.25 * HEIGHT * (index + 0.5)));
  const map = new CanvasTexture(canvas);
  const material = new SpriteMaterial({ map, sizeAttenuation: height !== undefined, depthTest: height !== undefined });
  const sprite = unpickable(new Sprite(material));
  const scale = height === undefined ? 0.0135 / HEIGHT : height / (CAPITAL * HEIGHT);
  sprite.scale.set(scale * canvas.width, scale * canvas.height, 1);
  return sprite;
}

export function disposeLabel(sprite: Sprite): void {
  sprite.removeFromParent();
  sprite.material.map?.dispose();
  sprite.material.dispose();
}
