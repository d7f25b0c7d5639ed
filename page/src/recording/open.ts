import type { Source } from "../wire/source.ts";
import { Recording } from "./recording.ts";

/** Returns the recording that the page contains, or null if it contains none. */
export function openRecording(): Source | null {
  const about = document.getElementById("mjplug-recording")?.textContent;
  return about ? new Recording(about, document) : null;
}
