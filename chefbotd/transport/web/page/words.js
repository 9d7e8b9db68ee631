// What the page says of the daemon's states and errors: their names in words of the reader's language.
// The daemon's own sentences are for people already; here clients and wheels get the names that people know.

import { figure, isTranslated, knows, named, t } from "./language.js";

export const me = `page #${Math.random().toString(36).slice(2, 6)}`;

// A wheel's name for people: "front left" for front_left_wheel.
export function wheelName(wheel) {
  const name = wheel.replace(/_wheel$/, "");
  return knows(`wheel.${name}`) ? t(`wheel.${name}`) : name.replaceAll("_", " ");
}

// A parameter's key for people: "radius (left)" for chassis.wheels.left_wheel.radius_m.
export function parameter(key) {
  const [section, ...parts] = key.split(".");
  const name = (parts.pop() ?? section).replace(/_(?:rad_s2?|m_s2?|rad|m|s|v)$/, "").replaceAll("_", " ");
  const owner = parts.filter((part) => part !== "wheels").at(-1) ?? section;
  return `${name} (${wheelName(owner)})`;
}

export const sentence = (words) => (words ? words[0].toUpperCase() + words.slice(1) : "");

// With the sign that ends a sentence, if it has none yet.
export const full = (words) => (words && !/[.?!]$/.test(words.trim()) ? `${words.trim()}.` : words.trim());

// A message of the daemon. Of a text that has an id (`said`) whoever reads it gets the words of the reader's language.
export function read(text) {
  const message = JSON.parse(text);
  if (text.includes('"said":')) sayInWords(message);
  return message;
}

function inWords(words, sentence) {
  if (Array.isArray(sentence)) return words.map((each, index) => inWords(each, sentence[index]));
  return sentence ? told({ ...sentence, message: words }) : words;
}

function sayInWords(value) {
  if (value === null || typeof value !== "object") return;
  for (const item of Object.values(value)) sayInWords(item);
  for (const [name, sentence] of Object.entries(value.said ?? {})) {
    const words = value[name];
    Object.defineProperty(value, name, { enumerable: true, get: () => inWords(words, sentence) }); // the language may come later
  }
}

// A sentence of the daemon: of pages only "this page" and "another page", and wheels without underscores.
export function plain(reason) {
  return (reason ?? "")
    .replace(/^by (page #[a-z0-9]+)$/, (_, page) => t("page.by", { page }))
    .replace(/\bpage #([a-z0-9]+)( \([^)]*\))?/g, (_, name) => (t(`page #${name}` === me ? "page.this" : "page.another")))
    .replace(/\b[a-z]+(?:_[a-z]+)*_wheel\b/g, (wheel) => t("wheel.the", { name: wheelName(wheel) }));
}

// Who drives, or has stopped the robot: a client by its own name, the robot's own sources by the reader's words.
export const driverName = (name) => named("drives", plain(name).replace(OWN, ""));

const OWN = /^the robot's own (?=[a-z]+$)/; // what the daemon calls its own drivers

const DRIVERS = new Set(["source", "holder", "stopped_by", "by", "who"]); // the arguments that name one

// What is refused for a kind alone; those that say more are below.
const REFUSED = {
  lease_held: ({ data }) => t("refused.lease_held", { driver: sentence(driverName(data.holder)) }),
  stopped: ({ data, message }) => (data.stopped_by ? t("refused.stopped", { by: driverName(data.stopped_by) }) : sentence(told({ ...data, message }))),
  invalid_params: ({ data }) => (data.fields ?? []).map(field).join(" ") || t("refused.invalid_params"),
};

function field({ field: name, expected, got }) {
  const last = name.split(".").at(-1);
  const what = knows(`field.${last}`) ? t(`field.${last}`) : t("field.other");
  const wanted = expected.replace(/^(Input|Value|String|Number) /, "it ").replace(/^it should/, "this should");
  return t("refused.field", { what: sentence(what), wanted, got });
}

// A refusal, as it is shown.
export function refusal(error) {
  const { kind } = error;
  if (REFUSED[kind]) return REFUSED[kind](error);
  return knows(`refused.${kind}`) ? t(`refused.${kind}`) : sentence(told({ ...error.data, message: error.message }));
}

// A sentence of the daemon by its id, where the language has it, else its English words. An argument may be a sentence, too.
export function told({ id, arguments: args = {}, message }) {
  if (!isTranslated(`refusal.${id}`)) return plain(message);
  return t(`refusal.${id}`, Object.fromEntries(Object.entries(args).map(([name, value]) => [name, argument(name, value)])));
}

function argument(name, value) {
  if (typeof value === "number") return value;
  if (typeof value !== "string") return told(value);
  return DRIVERS.has(name) ? driverName(value) : plain(value);
}

// What holds the robot back, by the name that the daemon has for it.
export function limit(by) {
  const [what, name = ""] = by.split(":");
  const group = ["obstacle", "silent", "dead_man", "no_echo", "encoders_stale"].includes(what) ? what : "top_speed";
  return t(`limit.${group}`, { name: name.replaceAll("_", " ") });
}

// The board's link is down: why, if the daemon says more than that.
export function unplugged(reason) {
  const why = plain(reason);
  return why && why !== "closed" ? full(t("board.unplugged_because", { why })) : t("board.unplugged");
}

// The board in a few words.
export function board({ state, healthy, reason }) {
  if (state === "up") return healthy === false ? t("board.problem", { why: plain(reason) }) : t("board.connected");
  return reason && reason !== "closed" ? t("board.not_connected_because", { why: plain(reason) }) : t("board.not_connected");
}

// What the safety card says where nobody knows what the motors do; ``deadman_ms`` of a board that stops by itself.
export function doubt(why, deadman_ms) {
  const itself = deadman_ms === null ? "" : ` ${t("doubt.itself", { deadman_ms })}`;
  return ["bad", t("doubt.title"), `${t("doubt.hold")} ${why}${itself}`];
}

// The board's firmware in a few words; of a classic sketch nothing is known.
export function firmware(told) {
  if (!told?.version) return t("firmware.classic");
  const { version, deadman_ms } = told;
  return deadman_ms === null ? t("firmware.no_deadman", { version }) : t("firmware.deadman", { version, deadman_ms });
}

// Its figures, in a sentence.
export function firmwareFigures({ board: kind, reset_cause: cause, crc_errors: damaged, refused, deadman_stops: stops, round_trip_s: trip }) {
  const figures = t("firmware.figures", { kind, cause: cause.replaceAll("_", " "), damaged, refused, stops });
  return trip === null ? figures : t("firmware.delay", { figures, delay_ms: figure(1000 * trip, 0) });
}

// How bad a safety mode is, and its words.
const MODES = { armed: "good", disarmed: "bad", estopped: "bad", no_board: "warn" };
export const mode = (name) => [MODES[name] ?? "warn", named("mode", name)];

export function device({ healthy, condition, reason }) {
  if (healthy !== false) return t("device.healthy");
  const words = knows(`device.${condition}`) ? t(`device.${condition}`) : t("device.unhealthy");
  return [words, plain(reason)].filter(Boolean).join(": ");
}

export function range({ status, range_m }) {
  if (range_m !== null) return `${figure(range_m, 2)} m`;
  return knows(`range.${status}`) ? t(`range.${status}`) : t("range.none");
}

export const battery = ({ voltage_v, percentage, status }) => (
  [t("battery.figures", { voltage_v: figure(voltage_v, 1), percent: figure(percentage, 0) }), knows(`battery.${status}`) ? t(`battery.${status}`) : ""].filter(Boolean).join(", "));

// What a daemon's reason adds to a state: it may begin with the state's own name, or with its verb.
export function because(state, reason) {
  return plain((reason ?? "").replace(new RegExp(`^(${state}[:,]? ?)+`), "").replace(/^drives (?=to )/, ""));
}
