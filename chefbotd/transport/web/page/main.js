// Puts the page together: what the daemon can do is shown, the rest is not there.

import { Connection } from "./connection.js";
import { Driver, joystick } from "./drive.js";
import { Costs } from "./costs.js";
import { Gains, shown } from "./gains.js";
import { Goal } from "./goal.js";
import { Maps } from "./maps.js";
import { Places } from "./places.js";
import { Plot } from "./plot.js";
import { permitted } from "./roles.js";
import { SafetyCard } from "./safety.js";
import { View, scanPoints } from "./view.js";

const RATE_HZ = 10;
const FAST = ["odometry", "wheels", "ranges", "scan", "map_pose"];
const SLOW = ["safety", "battery", "link", "lidars", "depth_cameras", "worker", "localization", "mapping", "reset", "map", "navigation", "path"];
const COUNTED = ["stats"];
const TOKEN_KEY = "chefbotd-token";

const $ = (id) => document.getElementById(id);
const text = (id, words) => { if ($(id).textContent !== words) $(id).textContent = words; };
const scheme = location.protocol === "https:" ? "wss" : "ws";
const connection = new Connection(`${scheme}://${location.host}/socket`);
const view = new View($("view"));
const plot = new Plot($("plot"));
const speeds = { linear_m_s: 0.2, angular_rad_s: 0.8 };
const driver = new Driver(connection, speeds);
const ask = (method, params) => connection.request(method, params).then((answer) => (say(""), answer), (error) => say(error.message));
const maps = new Maps(connection, view, say);
const costs = new Costs(connection, ask, view);
const gains = new Gains(ask, row);
const places = new Places(ask, say);
const me = `page ${Math.random().toString(36).slice(2, 6)}`;
const safety = new SafetyCard(connection, me);
new Goal(connection, ask, view);
const sensors = new Map();
let can = new Set();
let token = sessionStorage.getItem(TOKEN_KEY);

function say(words) {
  text("alert", words);
}

// Coming in

connection.addEventListener("hello", async ({ detail: hello }) => {
  can = new Set(hello.capabilities);
  text("robot", hello.robot);
  document.title = hello.robot;
  if (hello.auth === "token" && token === null) return askForToken("");
  const role = await logIn();
  if (role === null) return undefined;
  connection.settled();
  text("connection", "connected");
  can = await permitted(connection, can, role);
  show();
  await connection.request("set_client_name", { client: me }).catch(() => {});
  for (const [topics, rate] of [[FAST, { max_rate_hz: RATE_HZ }], [SLOW, {}], [COUNTED, { max_rate_hz: 1 }]]) {
    const there = topics.filter((name) => can.has(`topic.${name}`));
    connection.request("subscribe", { topics: there, ...rate }).catch((error) => say(error.message));
  }
  gains.begin(can);
  places.begin(can);
  costs.begin(can);
  if (can.has("method.get_description")) connection.request("get_description").then(readDescription, () => {});
  maps.begin(can);
  return undefined;
});

// The role that the daemon gives, with or without a token; null where it lets nobody in.
async function logIn() {
  try {
    const { role } = await connection.request("authenticate", { token: token ?? "" });
    if (token !== null) sessionStorage.setItem(TOKEN_KEY, token);
    return role;
  } catch (error) {
    if (error.kind !== "wrong_token") return null;
    token = null;
    sessionStorage.removeItem(TOKEN_KEY);
    askForToken("This token opens nothing here.");
    return null;
  }
}

function askForToken(told) {
  connection.disconnect();
  text("login-told", told);
  if (!$("login").open) $("login").showModal();
}

// Without a token there is nothing else to do here: the dialog comes back.
$("login").addEventListener("close", () => { if (token === null) $("login").showModal(); });

$("login-form").addEventListener("submit", () => {
  token = $("token").value.trim().split(/\s+/).at(-1); // a line of a token file, or the token alone
  $("token").value = "";
  text("login-told", "");
  connection.connect();
});

connection.addEventListener("closed", () => text("connection", "not connected"));
connection.addEventListener("ended", ({ detail: error }) => { if (error.kind !== "wrong_token") say(error.message); });
connection.addEventListener("stalled", ({ detail: stalled }) => text("connection", stalled ? "no answer" : "connected"));
connection.addEventListener("latency", ({ detail }) => text("latency", `${detail.toFixed(0)} ms`));

function show() {
  $("wheels-part").hidden = !can.has("topic.wheels");
  $("sensors-part").hidden = !["ranges", "lidars", "depth_cameras"].some((name) => can.has(`topic.${name}`));
  $("driving").hidden = !(driver.allowed = can.has("method.drive"));
  $("arm").hidden = !(safety.mayArm = can.has("method.arm"));
  $("goal-part").hidden = !can.has("method.navigate_to");
  const gestures = [["navigate_to", "sends the robot there"], ["set_pose", "says where the robot is"]];
  const there = gestures.filter(([method]) => can.has(`method.${method}`));
  $("gesture-label").hidden = there.length === 0;
  $("gesture").replaceChildren(...[["pan", "moves the view"], ...there].map(([value, words]) => new Option(words, value)));
  view.gesture = $("gesture").value = can.has("method.navigate_to") ? "navigate_to" : "pan";
}

// How it is, and stopping it

const on = (topic, take) => connection.addEventListener(`topic:${topic}`, ({ detail }) => take(detail.data, detail));

on("link", (link) => text("link", link.state === "up" ? (link.healthy === false ? link.condition : "connected") : `not connected ${link.reason}`));
on("stats", (stats) => text("clients", String(stats.clients)));
on("localization", ({ map }) => places.show(map));
on("battery", (battery) => {
  text("battery", `${battery.voltage_v.toFixed(1)} V, ${battery.percentage.toFixed(0)} %${battery.status === "ok" ? "" : `, ${battery.status}`}`);
});
on("reset", (reset) => say(reset.reason ?? ""));

const estop = () => ask("estop", { reason: `by ${me}` });
const stop = () => ask("stop");
$("estop").addEventListener("click", () => { estop(); driver.dead(); });
$("stop").addEventListener("click", () => { stop(); driver.dead(); });
let latch = null;  // what the person who presses "arm" has seen
let armed = false;
on("safety", (safety) => {
  if (armed && !safety.armed) driver.dead(); // what is still pressed is no wish to go on once it is armed
  ({ latch, armed } = safety);
});
$("arm").addEventListener("click", () => ask("arm", latch === null ? {} : { latch }));
driver.addEventListener("estop", estop);
driver.addEventListener("stop", stop);

// Driving

joystick($("joystick"), $("knob"), driver);
driver.addEventListener("driven", ({ detail }) => {
  $("take").hidden = true;
  text("drive-told", detail.limited_by ? `Slower than asked: ${detail.limited_by}` : "Driving");
});
driver.addEventListener("refused", ({ detail: error }) => {
  $("take").hidden = error.kind !== "lease_held";
  text("drive-told", error.kind === "lease_held" ? `${error.data.holder} drives.` : error.message);
});
driver.addEventListener("released", () => { if ($("drive-told").textContent === "Driving") text("drive-told", "Let go"); });
$("take").addEventListener("click", async () => {
  await ask("take_control");
  $("take").hidden = true;
  text("drive-told", "This page has control for a moment: drive.");
});
for (const [id, key, unit, digits] of [["linear", "linear_m_s", "m/s", 2], ["angular", "angular_rad_s", "rad/s", 1]]) {
  $(id).addEventListener("input", () => {
    speeds[key] = Number($(id).value);
    text(`${id}-value`, `${speeds[key].toFixed(digits)} ${unit}`);
  });
}

// What it sees

on("odometry", (pose) => {
  view.setPose(pose, false);
  const robot = view.robot;
  text("pose", `x ${robot.x_m.toFixed(2)} m, y ${robot.y_m.toFixed(2)} m, heading ${((robot.heading_rad * 180) / Math.PI).toFixed(0)}°, `
    + `${pose.linear_m_s.toFixed(2)} m/s, ${pose.angular_rad_s.toFixed(2)} rad/s`);
});
on("map_pose", (pose) => view.setPose(pose, true));
on("scan", (scan) => {
  view.scans.set(scan.lidar, scanPoints(scan));
  $("legend-scan").hidden = false;
  view.draw();
});
on("ranges", ({ ranges }) => {
  view.ranges = ranges;
  $("legend-range").hidden = ranges.length === 0;
  for (const { sensor, status, range_m } of ranges) sensors.set(sensor, range_m === null ? status.replace("_", " ") : `${range_m.toFixed(2)} m`);
  showSensors();
  view.draw();
});
on("lidars", ({ lidars }) => showDevices(lidars, "lidar"));
on("depth_cameras", ({ cameras }) => showDevices(cameras, "camera"));

function showDevices(devices, key) {
  for (const device of devices) sensors.set(device[key], device.healthy === false ? `${device.condition ?? "not healthy"}: ${device.reason}` : "works");
  showSensors();
}

function showSensors() {
  const lines = [...sensors].map(([name, words]) => `${name}: ${words}`);
  const items = $("sensors").children;
  if (items.length !== lines.length) $("sensors").replaceChildren(...lines.map(() => document.createElement("li")));
  lines.forEach((line, index) => { if (items[index].textContent !== line) items[index].textContent = line; });
}

on("wheels", (wheels, { stamp_s }) => {
  plot.add(stamp_s, wheels);
  wheels.name.forEach((name, index) => {
    const cells = row(name).children;
    const number = (value, digits) => (value === null || value === undefined ? "–" : value.toFixed(digits));
    cells[0].textContent = wheels.excluded.includes(name) ? `${shown(name)} (excluded)` : shown(name);
    [number(wheels.velocity_rad_s[index], 2), number(wheels.target_rad_s[index], 2), number(wheels.duty[index], 0)]
      .forEach((words, column) => { cells[column + 1].textContent = words; });
  });
});

function row(name) {
  const there = [...$("wheels").children].find((each) => each.dataset.wheel === name);
  if (there) return there;
  const made = document.createElement("tr");
  made.dataset.wheel = name;
  const head = document.createElement("th");
  head.scope = "row";
  head.textContent = shown(name);
  made.append(head, ...Array.from({ length: 6 }, () => document.createElement("td")));
  $("wheels").append(made);
  return made;
}

// The outline and the sensors' places, from the robot's description.
function readDescription({ urdf }) {
  if (!urdf) return;
  const robot = new DOMParser().parseFromString(urdf, "text/xml");
  const numbers = (element, name) => (element?.getAttribute(name) ?? "0 0 0").split(/\s+/).map(Number);
  const body = robot.querySelector('link[name="base_link"] > visual > geometry');
  const [cylinder, box] = [body?.querySelector("cylinder"), body?.querySelector("box")];
  if (cylinder) view.body = { radius: Number(cylinder.getAttribute("radius")) };
  if (box) view.body = { size: numbers(box, "size").slice(0, 2) };
  for (const joint of robot.querySelectorAll("joint")) {
    const origin = joint.querySelector("origin");
    const [[x, y], [, , yaw]] = [numbers(origin, "xyz"), numbers(origin, "rpy")];
    const match = joint.getAttribute("name").match(/^(ultrasonic|infrared)(?:_(.+))?_joint$/);
    if (match) view.mounts.set(match[2] ?? (match[1] === "ultrasonic" ? "front" : "infrared"), { x, y, yaw });
  }
  view.draw();
}

$("zoom-in").addEventListener("click", () => view.zoom(1.25));
$("zoom-out").addEventListener("click", () => view.zoom(0.8));
$("follow").addEventListener("change", () => view.setFollow($("follow").checked));
view.onFollow = (follow) => { $("follow").checked = follow; };
$("gesture").addEventListener("change", () => { view.gesture = $("gesture").value; });
view.onPose = ({ x_m, y_m, heading_rad }) => {
  const heading = heading_rad === null ? {} : { heading_rad };
  ask(view.gesture, { x_m, y_m, ...heading });
};

connection.connect();
