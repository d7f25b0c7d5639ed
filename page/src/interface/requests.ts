import type { Fields } from "../wire/protocol.ts";
import type { Source } from "../wire/source.ts";

/** Type numbers of rcl_interfaces/msg/ParameterType. */
const DOUBLE = 3;
const STRING = 4;

/** Returns a response that reports success; raises what the server says otherwise. */
export function accepted(response: Fields): Fields {
  if (response["success"] === false) {
    throw new Error(sentence(String(response["message"] || "The server refused the request")));
  }
  return response;
}

/** Calls a service whose response has `success` and `message`. */
export async function request(source: Source, server: number, service: string, fields: Fields): Promise<Fields> {
  return accepted(await source.call(server, service, fields));
}

/** Sets one parameter of a server. */
export async function setParameter(
  source: Source,
  server: number,
  name: string,
  value: number | string,
): Promise<void> {
  const typed =
    typeof value === "number" ? { type: DOUBLE, double_value: value } : { type: STRING, string_value: value };
  const response = await source.call(server, "~/set_parameters", { parameters: [{ name, value: typed }] });
  const [result] = response["results"] as { successful: boolean; reason: string }[];
  if (result?.successful !== true) throw new Error(sentence(result?.reason ?? `The server did not set ${name}`));
}

/** Returns a text with a capital letter and a full stop, as the page shows it. */
export function sentence(text: string): string {
  const trimmed = text.trim();
  // A name in quotes or a path stays as it is.
  const start = /^[a-z]+[ ,:]/.test(trimmed) ? trimmed.charAt(0).toUpperCase() + trimmed.slice(1) : trimmed;
  return /[.!?…]$/.test(start) ? start : `${start}.`;
}
