/** Outlines of the icons in a square of 16, drawn with lines of width 1.5; "f" before a path fills it. */
const PATHS = {
  play: ["fM5 3.2v9.6l7.5-4.8z"],
  pause: ["fM4 3h3v10H4z", "fM9 3h3v10H9z"],
  step: ["fM3.5 3.5v9L9.5 8z", "fM10.5 3.5h2v9h-2z"],
  reset: ["M3.2 8a4.8 4.8 0 1 0 1.6-3.6", "M3 2.5v3h3"],
  keyframe: ["M8 2.5 13.5 8 8 13.5 2.5 8z"],
  speed: ["M2.5 11.5a5.7 5.7 0 1 1 11 0", "M8 10.5l2.8-3.6"],
  fit: ["M2.5 6V2.5H6", "M10 2.5h3.5V6", "M13.5 10v3.5H10", "M6 13.5H2.5V10", "fM6.2 6.2h3.6v3.6H6.2z"],
  follow: ["M8 5a3 3 0 1 0 0 6 3 3 0 0 0 0-6z", "M8 1.5V4", "M8 12v2.5", "M1.5 8H4", "M12 8h2.5"],
  camera: ["M2 4.5h8.5v7H2z", "M10.5 7.2 14 5.2v5.6l-3.5-2"],
  home: ["M2.5 8 8 3l5.5 5", "M4 7v6h8V7"],
  grab: [
    "M5 9V4.5a1 1 0 0 1 2 0V7 3.2a1 1 0 0 1 2 0V7 4a1 1 0 0 1 2 0v5.5c0 2.5-1.5 4-3.6 4S4.7 12.5 3.3 9.9a1 1 0 0 1 1.7-.9z",
  ],
  turn: ["M13 8a5 5 0 1 1-1.6-3.7", "M13.2 2.2v2.9h-2.9", "fM8 6.6a1.4 1.4 0 1 0 0 2.8 1.4 1.4 0 0 0 0-2.8z"],
  pointer: ["M4 2.5 12.5 8l-3.8.7L11 13l-1.8.8-2.2-4.3L4 12z"],
  system: ["M8 2.5a5.5 5.5 0 1 0 0 11 5.5 5.5 0 0 0 0-11z", "fM8 2.5a5.5 5.5 0 0 1 0 11z"],
  light: [
    "M8 5.2a2.8 2.8 0 1 0 0 5.6 2.8 2.8 0 0 0 0-5.6z",
    "M8 1.5v1.5M8 13v1.5M1.5 8H3M13 8h1.5M3.4 3.4l1 1M11.6 11.6l1 1M12.6 3.4l-1 1M4.4 11.6l-1 1",
  ],
  dark: ["M13 9.5A5.5 5.5 0 1 1 6.5 3a4.5 4.5 0 0 0 6.5 6.5z"],
  help: [
    "M8 2.2a5.8 5.8 0 1 0 0 11.6A5.8 5.8 0 0 0 8 2.2z",
    "M6.3 6.5A1.7 1.7 0 1 1 8 8.2v1",
    "fM7.3 10.4h1.4v1.4H7.3z",
  ],
  left: ["M2.5 3h11v10h-11z", "M6 3v10", "fM2.5 3H6v10H2.5z"],
  right: ["M2.5 3h11v10h-11z", "M10 3v10", "fM10 3h3.5v10H10z"],
  panels: ["M2.5 3h11v10h-11z", "fM2.5 8.5h11V13h-11z"],
  close: ["M4 4l8 8M12 4l-8 8"],
  search: ["M7 3a4 4 0 1 0 0 8 4 4 0 0 0 0-8z", "M10 10l3.5 3.5"],
  chevron: ["M6 4l4 4-4 4"],
  warning: ["M8 2.5 14 13H2z", "M8 6.5v3", "fM7.3 10.6h1.4v1.2H7.3z"],
  tree: ["M3 3.5h4", "M4.5 3.5v8H7", "M4.5 7.5H7", "M9 7.5h4.5", "M9 11.5h4.5"],
  eye: ["M1.5 8S4 3.8 8 3.8 14.5 8 14.5 8 12 12.2 8 12.2 1.5 8 1.5 8z", "M8 6a2 2 0 1 0 0 4 2 2 0 0 0 0-4z"],
  layers: ["M8 2.5 14 5.8 8 9 2 5.8z", "M2 9l6 3.3L14 9"],
  joint: ["M4.5 9.5a2 2 0 1 0 0 4 2 2 0 0 0 0-4z", "M6 10l5-5", "M11.5 2.5a2 2 0 1 0 0 4 2 2 0 0 0 0-4z"],
  topic: ["M3 8a5 5 0 0 1 5-5", "M13 8a5 5 0 0 1-5 5", "M8 6.2a1.8 1.8 0 1 0 0 3.6 1.8 1.8 0 0 0 0-3.6z"],
  plot: ["M2.5 2.5v11h11", "M4.5 10.5l2.7-3.5 2.3 2L13 4.5"],
  image: ["M2.5 3.5h11v9h-11z", "M2.5 10.5l3.3-3 2.6 2.5 2-1.8 3.1 2.5", "fM9.8 5.5h1.6v1.6H9.8z"],
  push: ["M2 8h9", "M8 4.5 11.5 8 8 11.5", "M13.8 3.5v9"],
  drive: ["M3 5.5h10v5H3z", "M5 3.5v9M11 3.5v9"],
  record: ["fM8 4a4 4 0 1 0 0 8 4 4 0 0 0 0-8z"],
  download: ["M8 2.5v7.5", "M5 7l3 3 3-3", "M3 13h10"],
  add: ["M8 3v10M3 8h10"],
  server: ["M3 3h10v4H3z", "M3 9h10v4H3z", "fM5 4.4h1.2v1.2H5z", "fM5 10.4h1.2v1.2H5z"],
} as const;

export type IconName = keyof typeof PATHS;

const SVG = "http://www.w3.org/2000/svg";

/** Returns an icon in the colour of the text around it. Readers of the screen skip it. */
export function icon(name: IconName): SVGSVGElement {
  const svg = document.createElementNS(SVG, "svg");
  svg.setAttribute("viewBox", "0 0 16 16");
  svg.setAttribute("class", "icon");
  svg.setAttribute("aria-hidden", "true");
  for (const path of PATHS[name]) {
    const shape = document.createElementNS(SVG, "path");
    const filled = path.startsWith("f");
    shape.setAttribute("d", filled ? path.slice(1) : path);
    if (filled) shape.setAttribute("class", "filled");
    svg.append(shape);
  }
  return svg;
}
