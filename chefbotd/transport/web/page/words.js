// What the page says: the daemon's names for states and errors in words, in this file only.
// The daemon's own sentences are for people already; here clients and wheels get the names that people know.

export const me = `page #${Math.random().toString(36).slice(2, 6)}`;

// A wheel's name for people: "front left" for front_left_wheel.
export const wheelName = (wheel) => wheel.replace(/_wheel$/, "").replaceAll("_", " ");

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

// A sentence of the daemon: of pages only "this page" and "another page", and wheels without underscores.
export function plain(reason) {
  return (reason ?? "")
    .replace(/\bpage #([a-z0-9]+)( \([^)]*\))?/g, (_, name) => (`page #${name}` === me ? "this page" : "another page"))
    .replace(/\b[a-z]+(?:_[a-z]+)*_wheel\b/g, (wheel) => `the ${wheelName(wheel)} wheel`);
}

const FIELDS = {
  x_m: "x", y_m: "y", heading_rad: "the heading", name: "the name", place: "the place", token: "the token",
  kp: "kp", ki: "ki", kd: "kd", reason: "the reason", linear_m_s: "the speed", angular_rad_s: "the turning speed",
};
const REFUSED = {
  not_connected: () => "The robot is not connected, so nothing was done.",
  forbidden: () => "Your token does not allow this.",
  unauthenticated: () => "Log in first.",
  rate_limited: () => "Too many commands at once: this one was not carried out.",
  too_many_jobs: () => "Too much is going on at once: wait until something has ended.",
  too_many_clients: () => "Too many clients are connected to this robot.",
  cancelled: () => "Cancelled.",
  method_not_found: () => "This robot cannot do that.",
  unknown_topic: () => "This robot does not have that.",
  lease_held: ({ data }) => `${sentence(plain(data.holder))} drives.`,
  stopped: ({ data, message }) => (data.stopped_by ? `Stopped by ${plain(data.stopped_by)}. Let go, then drive again.` : sentence(plain(message))),
  invalid_params: ({ data }) => (data.fields ?? []).map(field).join(" ") || "This is not accepted.",
};

function field({ field: name, expected, got }) {
  const last = name.split(".").at(-1);
  const what = FIELDS[last] ?? "the value";
  return `${sentence(what)}: ${expected.replace(/^(Input|Value|String|Number) /, "it ").replace(/^it should/, "this should")}, got ${got}.`;
}

// A refusal, as it is shown.
export function refusal(error) {
  return REFUSED[error.kind]?.(error) ?? sentence(plain(error.message));
}

// What holds the robot back, by the name that the daemon has for it.
export function limit(by) {
  const [what, name] = by.split(":");
  if (what === "obstacle") return `there is an obstacle (${name.replaceAll("_", " ")})`;
  if (what === "silent") return `${name.replaceAll("_", " ")} sees nothing at present`;
  if (by === "dead_man") return "the driver's commands have stopped";
  if (by === "no_echo") return "nothing is in reach of the sensor that its board waits for";
  if (by === "encoders_stale") return "the wheels are not measured at present";
  return "the robot's top speed";
}

// The board's link is down: why, if the daemon says more than that.
export function unplugged(reason) {
  const why = plain(reason);
  return why && why !== "closed" ? full(`The board is not connected: ${why}`) : "The board is not connected.";
}

// The board in a few words.
export function board({ state, healthy, reason }) {
  if (state === "up") return healthy === false ? `has a problem: ${plain(reason)}` : "connected";
  return reason && reason !== "closed" ? `not connected: ${plain(reason)}` : "not connected";
}

// What the safety card says where nobody knows what the motors do; ``deadman_ms`` of a board that stops by itself.
export function doubt(why, deadman_ms) {
  const itself = deadman_ms === null ? "" : ` If its daemon has ended, its board stops by itself after ${deadman_ms} ms; `
    + "if only this page has lost it, it may drive on to a goal, or for another driver.";
  return ["bad", "The robot may still be driving", `Hold it or switch its motors off: its speed is not known. ${why}${itself}`];
}

// What a gamepad may promise: browsers give none to a page without https, and of a layout that is not standard no button is known.
export const GAMEPAD = {
  none: "A gamepad drives too: press one of its buttons.",
  unavailable: "Gamepad: the browser gives none to this page. By https, or on the robot's own computer as localhost, it does.",
  unknown: "Gamepad: the browser does not know the layout of this one, so that it neither drives nor stops the robot.",
  standard: "Gamepad: hold LB and move the left stick; X stops, B is the emergency stop.",
};

const CLASSIC = "classic, not known to stop by itself";

// The board's firmware in a few words; of a classic sketch nothing is known.
export function firmware(told) {
  if (!told?.version) return CLASSIC;
  return `${told.version}, ${told.deadman_ms === null ? "does not stop by itself now" : `stops by itself after ${told.deadman_ms} ms`}`;
}

// Its figures, in a sentence.
export function firmwareFigures({ board, reset_cause: cause, crc_errors: damaged, refused, deadman_stops: stops, round_trip_s: trip }) {
  const delay = trip === null ? "" : `, ${(1000 * trip).toFixed(0)} ms from a command to its echo`;
  return `${board}, started by ${cause.replaceAll("_", " ")}: ${damaged} lines damaged, ${refused} refused, stopped by itself ${stops} times${delay}`;
}

export const MODES = {
  armed: ["good", "Ready to drive"],
  disarmed: ["bad", "Stopped by a fault"],
  estopped: ["bad", "Emergency stop"],
  no_board: ["warn", "Waiting for the board"],
};

const DEVICE = {
  unknown: "not known yet", healthy: "works", silent: "sends nothing", wrong_baud: "speaks at another speed", wrong_device: "is another device",
  lines_refused: "writes lines in another format", wrong_time_unit: "tells the time in another unit",
  shared_port: "is read by another program too",
  echo_stuck: "does not confirm commands", motor_stalled: "does not turn", frozen: "repeats itself", device_error: "reports an error",
  down: "not connected",
};
const RANGE = { too_near: "too near", too_far: "nothing near", no_echo: "no echo", ambiguous: "near or far, it cannot tell" };
const BATTERY = { low: "low", critical: "almost empty" };

export const device = ({ healthy, condition, reason }) => (
  healthy === false ? [DEVICE[condition] ?? "does not work", plain(reason)].filter(Boolean).join(": ") : "works");
export const range = ({ status, range_m }) => (range_m === null ? RANGE[status] ?? "no reading" : `${range_m.toFixed(2)} m`);
export const battery = ({ voltage_v, percentage, status }) => (
  [`${voltage_v.toFixed(1)} V, ${percentage.toFixed(0)} %`, BATTERY[status]].filter(Boolean).join(", "));

// What a daemon's reason adds to a state: it may begin with the state's own name, or with its verb.
export function because(state, reason) {
  return plain((reason ?? "").replace(new RegExp(`^(${state}[:,]? ?)+`), "").replace(/^drives (?=to )/, ""));
}
