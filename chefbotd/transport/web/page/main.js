// Puts the page together: what the daemon can do is shown, the rest is not there.

import { addComponents } from "./components.js";
import { Connection } from "./connection.js";
import { Costs } from "./costs.js";
import { $, text } from "./dom.js";
import { Driver, joystick } from "./drive.js";
import { Goal } from "./goal.js";
import { History } from "./history.js";
import { Lately } from "./lately.js";
import { Login } from "./login.js";
import { Maps } from "./maps.js";
import { Places } from "./places.js";
import { Route } from "./route.js";
import { Proposal } from "./proposal.js";
import { SafetyCard } from "./safety.js";
import { Sensors } from "./sensors.js";
import { Stopping } from "./stopping.js";
import { View } from "./view.js";
import { Wheels } from "./wheels.js";
import { battery, board, firmware, firmwareFigures, GAMEPAD, GESTURE, limit, plain, refusal, sentence } from "./words.js";

// Beside the page, wherever a proxy shows it.
const connection = new Connection(new URL("socket", location.href).href.replace(/^http/, "ws"));
const lately = new Lately(connection);
const view = new View($("view"));
const speeds = { linear_m_s: 0.2, angular_rad_s: 0.8 };
const driver = new Driver(connection, speeds);
const safety = new SafetyCard(connection, ask, driver, (isInDoubt) => showDoubt(isInDoubt));
const stopping = new Stopping(connection, driver, say, () => safety.isInDoubt);
const route = new Route(connection, ask, say, view);
const goal = new Goal(connection, ask, view);
const places = new Places(ask, say, route);
const sensors = new Sensors(connection, view);
const wheels = new Wheels(connection, ask);
const parts = [safety, stopping, goal, places, sensors, wheels, new Costs(connection, ask, view),
  new Maps(connection, view, say)];

function say(words) {
  text("alert", words);
  if (words) lately.add("refused", words, performance.now());
}

// The answer; where there is none the page has said why.
async function ask(method, params) {
  try {
    const answer = await connection.request(method, params);
    say("");
    return answer;
  } catch (error) {
    say(refusal(error));
    return undefined;
  }
}

let permitted = null;
addComponents({ connection, ask, say, view }, (part) => {
  parts.push(part);
  if (permitted) part.begin(permitted);
});

new Login(connection, (can) => {
  permitted = can;
  driver.allowed = can.has("method.drive");
  $("driving").hidden = !driver.allowed;
  $("goal-part").hidden = !can.has("method.navigate_to");
  offerGestures(can);
  connection.begin(can).catch((error) => say(refusal(error)));
  for (const part of parts) part.begin(can);
  if (can.has("method.get_description")) connection.request("get_description").then((answer) => sensors.describe(answer), () => {});
});

// How it is

const voltage = new History("battery-history", { name: "Battery", unit: "V", digits: 1, span_s: 10, most: 720, least_range: 0.5 });
const delay = new History("latency-history", { name: "Delay", unit: "ms", digits: 0, span_s: 1, most: 300, least_range: 10 });

connection.addEventListener("closed", () => {
  text("connection", "not connected");
  for (const id of ["latency", "link", "battery", "clients", "drivers"]) text(id, "–"); // nothing of it is known any more
  voltage.gap();
  delay.gap();
});
connection.addEventListener("ended", ({ detail: error }) => { if (error.kind !== "wrong_token") say(refusal(error)); });
connection.addEventListener("stalled", ({ detail: stalled }) => text("connection", stalled ? "no answer" : "connected"));
connection.addEventListener("latency", ({ detail }) => {
  text("latency", `${detail.toFixed(0)} ms`);
  delay.add(detail);
});
connection.on("link", (link) => {
  text("link", board(link));
  const { state } = link;
  if (state === "up" && $("firmware").textContent === "–") text("firmware", firmware(null));
});
connection.on("firmware", (told) => {
  text("firmware", firmware(told));
  $("firmware").title = told.version ? firmwareFigures(told) : "";
});
connection.on("stats", (stats) => text("clients", String(stats.clients)));
connection.on("localization", ({ map }) => places.show(map));
connection.on("battery", (state) => {
  text("battery", battery(state));
  voltage.add(state.voltage_v);
});
connection.on("reset", ({ reason }) => say(sentence(plain(reason))));

// Driving

// Where nobody knows what the motors do, no speed is shown.
function showDoubt(isInDoubt) {
  sensors.doubt(isInDoubt);
  wheels.doubt(isInDoubt);
  if (!isInDoubt) stopping.settled();
}

const LET_GO = "You have let go.";
driver.addEventListener("gamepad", ({ detail: state }) => {
  text("gamepad", GAMEPAD[state]);
  $("gamepad").classList.toggle("connected", ["standard", "unknown"].includes(state));
});
joystick($("joystick"), $("knob"), driver);
driver.addEventListener("driven", ({ detail: { limited_by: by } }) => {
  $("take").hidden = true;
  text("drive-told", by ? `Slower than asked: ${limit(by)}.` : "You are driving.");
});
driver.addEventListener("refused", ({ detail: error }) => {
  $("take").hidden = error.kind !== "lease_held";
  text("drive-told", refusal(error));
});
driver.addEventListener("released", () => { if ($("take").hidden) text("drive-told", safety.isInDoubt ? LET_GO : `${LET_GO} The robot brakes.`); });
$("take").addEventListener("click", async () => {
  if (await ask("take_control")) {
    $("take").hidden = true;
    text("drive-told", "You may drive now.");
  }
});
for (const [id, key, unit, digits] of [["linear", "linear_m_s", "m/s", 2], ["angular", "angular_rad_s", "rad/s", 1]]) {
  $(id).addEventListener("input", () => {
    speeds[key] = Number($(id).value);
    text(`${id}-value`, `${speeds[key].toFixed(digits)} ${unit}`);
  });
}

// The view's buttons, and what a click in it means

const GESTURES = [["pan", "moves the view"], ["navigate_to", "sends the robot there"], ["follow_waypoints", "adds a goal to the list"],
  ["set_pose", "says where the robot is"]];

function offerGestures(can) {
  const there = GESTURES.filter(([method]) => method === "pan" || can.has(`method.${method}`));
  $("gesture-label").hidden = there.length === 1;
  text("gesture-words", GESTURE);
  $("gesture").replaceChildren(...there.map(([value, words]) => new Option(words, value)));
  view.gesture = $("gesture").value = can.has("method.navigate_to") ? "navigate_to" : "pan";
}

$("zoom-in").addEventListener("click", () => view.zoom(1.25));
$("zoom-out").addEventListener("click", () => view.zoom(0.8));
$("follow").addEventListener("change", () => view.setFollow($("follow").checked));
view.onFollow = (follow) => { $("follow").checked = follow; };
$("gesture").addEventListener("change", () => { view.gestures.cancel(); view.gesture = $("gesture").value; });
function usePose({ x_m, y_m, heading_rad }) {
  const pose = { x_m, y_m, ...(heading_rad === null ? {} : { heading_rad }) };
  if (view.gesture === "follow_waypoints") route.add(`x ${x_m.toFixed(2)} m, y ${y_m.toFixed(2)} m`, pose, pose);
  else ask(view.gesture, pose);
}
view.onPose = usePose;
new Proposal(view, usePose);
driver.addEventListener("dead", () => view.gestures.cancel()); // a stop: what is aimed at is not wanted any more

connection.connect(); // no card keeps the page from its stop button: one that comes late is told what it has missed
