// The numbers that are plotted: which ones a message has, and what has come of each in the last minutes.

const LONGEST_S = 300;
const MOST_ENTRIES = 32; // of a list: a scan has hundreds of numbers that nobody plots
const UNITS = [
  ["_rad_s2", "rad/s²"], ["_m_s2", "m/s²"], ["_rad_s", "rad/s"], ["_m_s", "m/s"], ["_rad", "rad"], ["_m", "m"], ["_ms", "ms"],
  ["_s", "s"], ["_v", "V"], ["_a", "A"], ["_hz", "Hz"], ["_mb", "MB"], ["_ppm", "ppm"], ["_px", "px"],
];

// Every number in a value, as the keys that lead to it. The entries of a list are named by the list of names beside it.
export function numbersIn(value, keys = [], names = null) {
  if (typeof value === "number") return [{ keys, label: label(keys, names) }];
  if (Array.isArray(value)) return value.slice(0, MOST_ENTRIES).flatMap((entry, index) => numbersIn(entry, [...keys, index], names));
  if (value === null || typeof value !== "object") return [];
  const own = Array.isArray(value.name) ? value.name : names;
  return Object.entries(value).flatMap(([key, entry]) => numbersIn(entry, [...keys, key], own));
}

function label(keys, names) {
  return keys.map((key) => (typeof key === "number" ? names?.[key] ?? String(key + 1) : key)).join(" ").replaceAll("_", " ");
}

function unitOf(keys) {
  const name = keys.findLast((key) => typeof key === "string") ?? "";
  return UNITS.find(([suffix]) => name.endsWith(suffix))?.[1] ?? "";
}

export class Line {
  constructor({ topic, keys, label: words }) {
    Object.assign(this, { topic, keys, label: words, unit: unitOf(keys), stamps: [], values: [] });
  }

  get isSame() {
    return ({ topic, keys }) => topic === this.topic && keys.join() === this.keys.join();
  }

  // A number that came, or that none came for (null): nothing is drawn there.
  add(stamp_s, data) {
    const { stamps, values } = this;
    if (stamps.length && stamp_s < stamps.at(-1)) this.clear(); // the daemon was started again
    const value = data === null ? null : this.keys.reduce((inner, key) => inner?.[key], data);
    stamps.push(stamp_s);
    values.push(typeof value === "number" ? value : null);
    const old = stamps.findIndex((stamp) => stamp >= stamp_s - LONGEST_S - 1);
    if (old > 0) for (const list of [stamps, values]) list.splice(0, old);
  }

  clear() {
    this.stamps.length = this.values.length = 0;
  }

  // The value that held at a time; null: there was none.
  at(stamp_s) {
    const index = this.stamps.findLastIndex((stamp) => stamp <= stamp_s);
    return index < 0 ? null : this.values[index];
  }

  // The values from one time to another, with the one that holds at the beginning.
  between(from_s, to_s) {
    const first = Math.max(this.stamps.findLastIndex((stamp) => stamp <= from_s), 0);
    const points = [];
    for (let index = first; index < this.stamps.length && this.stamps[index] <= to_s; index++) points.push([this.stamps[index], this.values[index]]);
    return points;
  }
}
