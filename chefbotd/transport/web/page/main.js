// Puts the page together: what the daemon can do is shown, the rest is not there.

import { addComponents } from "./components.js";
import { Connection } from "./connection.js";
import { $, text } from "./dom.js";
import { Driver, joystick } from "./drive.js";
import { History } from "./history.js";
import { Lately } from "./lately.js";
import { Login } from "./login.js";
import { Panels } from "./panels.js";
import { SafetyCard } from "./safety.js";
import { Sensors } from "./sensors.js";
import { Stopping } from "./stopping.js";
import { View } from "./view.js";
import { Wheels } from "./wheels.js";
import { figure, offerLanguages, ready, t, tell } from "./language.js";
import { battery, board, firmware, firmwareFigures, limit, plain, refusal, sentence } from "./words.js";

// Beside the page, wherever a proxy shows it.
const connection = new Connection(new URL("socket", location.href).href.replace(/^http/, "ws"));
let cardsAreLoaded;
const lately = new Lately(connection, new Promise((resolve) => { cardsAreLoaded = resolve; }));
const view = new View($("view"), $("room"));
const panels = new Panels();
const speeds = { linear_m_s: 0.2, angular_rad_s: 0.8 };
const driver = new Driver(connection, speeds);
const safety = new SafetyCard(connection, ask, driver, (isInDoubt) => showDoubt(isInDoubt));
const stopping = new Stopping(connection, driver, say, () => safety.isInDoubt);
const sensors = new Sensors(connection, view);
const wheels = new Wheels(connection, ask);
const parts = [safety, stopping, sensors, wheels];

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
addComponents({ connection, ask, say, view, panels, lately }, panels, (part) => {
  parts.push(part);
  if (permitted) part.begin(permitted);
}).then(cardsAreLoaded);

new Login(connection, (can) => {
  permitted = can;
  driver.allowed = can.has("method.drive");
  $("driving").hidden = !driver.allowed;
  ready.then(() => { if (connection.open && permitted === can) connection.begin(can).catch((error) => say(refusal(error))); });
  for (const part of parts) part.begin(can);
  panels.begin();
  if (can.has("method.get_description")) connection.request("get_description").then((answer) => sensors.describe(answer), () => {});
});

offerLanguages($("language"), say);

// How it is

const voltage = new History("battery-history", { name: "history.battery", unit: "V", digits: 1, span_s: 10, most: 720, least_range: 0.5 });
const delay = new History("latency-history", { name: "history.delay", unit: "ms", digits: 0, span_s: 1, most: 300, least_range: 10 });

connection.addEventListener("closed", () => {
  tell($("connection"), "connection.not_connected");
  for (const id of ["latency", "link", "battery", "clients", "drivers"]) text(id, "–"); // nothing of it is known any more
  voltage.gap();
  delay.gap();
});
connection.addEventListener("ended", ({ detail: error }) => { if (error.kind !== "wrong_token") say(refusal(error)); });
connection.addEventListener("stalled", ({ detail: stalled }) => tell($("connection"), stalled ? "connection.no_answer" : "connection.connected"));
connection.addEventListener("latency", ({ detail }) => {
  text("latency", `${figure(detail, 0)} ms`);
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

let isRefused = false;
// What a gamepad may promise: browsers give none to a page without https, and of a layout that is not standard no button is known.
driver.addEventListener("gamepad", ({ detail: state }) => {
  tell($("gamepad"), `gamepad.${state}`);
  $("gamepad").classList.toggle("connected", ["standard", "unknown"].includes(state));
});
joystick($("joystick"), $("knob"), driver);
driver.addEventListener("driven", ({ detail: { limited_by: by } }) => {
  $("take").hidden = true;
  text("drive-told", by ? t("mode.slower_sentence", { why: limit(by) }) : t("drive.driving"));
  if (isRefused) say("");
  isRefused = false;
});
driver.addEventListener("refused", ({ detail: error }) => {
  $("take").hidden = error.kind !== "lease_held";
  text("drive-told", refusal(error));
  if (panels.isOpen("drive")) return;
  isRefused = true; // by a key, while what the card says is not seen
  say(refusal(error));
});
driver.addEventListener("released", () => { if ($("take").hidden) text("drive-told", t(safety.isInDoubt ? "drive.let_go" : "drive.brakes")); });
$("take").addEventListener("click", async () => {
  if (await ask("take_control")) {
    $("take").hidden = true;
    text("drive-told", t("drive.taken"));
  }
});
for (const [id, key, unit, digits] of [["linear", "linear_m_s", "m/s", 2], ["angular", "angular_rad_s", "rad/s", 1]]) {
  $(id).addEventListener("input", () => {
    speeds[key] = Number($(id).value);
    text(`${id}-value`, `${figure(speeds[key], digits)} ${unit}`);
  });
}

// The view's buttons

$("zoom-in").addEventListener("click", () => view.zoom(1.25));
$("zoom-out").addEventListener("click", () => view.zoom(0.8));
$("follow").addEventListener("change", () => view.setFollow($("follow").checked));
view.onFollow = (follow) => { $("follow").checked = follow; };
addEventListener("keydown", (event) => { // Space is the stop: a switch is pressed by Enter
  if (event.key !== "Enter" || event.target.type !== "checkbox") return;
  event.preventDefault();
  event.target.click();
});
driver.addEventListener("dead", () => view.gestures.cancel()); // a stop: what is aimed at is not wanted any more

connection.connect(); // no card keeps the page from its stop button: one that comes late is told what it has missed
