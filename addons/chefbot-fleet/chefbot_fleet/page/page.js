// Draws the fleet once a second. Text from elsewhere is only ever set as text.
import { onContact } from "./stops.js";

const SVG = "http://www.w3.org/2000/svg";
const COLOURS = ["#06c", "#c30", "#080", "#808", "#a60", "#088", "#555", "#c08", "#660", "#00a"];
const ANSWER_MS = 5000;
const CANCELLABLE = ["waiting", "assigned", "picked"];
const byId = (id) => document.getElementById(id);
let roadmap = null;
let chosen = [];
let placing = null;

function element(name, attributes, text) {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  if (text !== undefined) made.textContent = text;
  return made;
}

// One row for each key, changed in place: what is being clicked or has the focus must not be replaced every second.
function fill(body, rows) {
  const kept = new Map([...body.rows].map((row) => [row.dataset.key, row]));
  body.replaceChildren(...rows.map(({ key, cells }) => {
    const made = kept.get(key) ?? document.createElement("tr");
    made.dataset.key = key;
    cells.forEach((cell, k) => {
      const data = made.cells[k] ?? made.insertCell();
      if (cell.title) data.dataset.title = cell.title;
      data.className = cell.wide ? "wide" : "";
      if (cell.node) { if (!data.firstChild) data.append(cell.node()); } else if (data.textContent !== cell.text) data.textContent = cell.text;
    });
    return made;
  }));
}

async function command(path, body) {
  const token = byId("order").elements.token.value;
  const headers = { "Content-Type": "application/json", Authorization: `Bearer ${token}` };
  try {
    const answer = await fetch(path, { method: "POST", headers, body: JSON.stringify(body), signal: AbortSignal.timeout(ANSWER_MS) });
    const value = await answer.json();
    byId("message").textContent = answer.ok ? "Done." : value.error;
    return answer.ok;
  } catch (error) {
    byId("message").textContent = `The manager does not answer: ${error.message}`;
    return false;
  }
}

async function cancel(order) {
  const isDone = await command("/api/orders/cancel", { id: order.id });
  byId("unreached").hidden = isDone;
  byId("unreached").textContent = isDone ? "" : `Order ${order.id} is not cancelled: its robot may drive on. Stop the robot itself.`;
}

async function correct(correction) {
  if (await command("/api/corrections", correction)) await loadRoadmap();
  choose(null);
}

function choose(node) {
  chosen = node === null ? [] : [...chosen, node].slice(-2);
  const [addEdge, removeEdge, addPlace] = byId("correct").querySelectorAll("button");
  addEdge.disabled = removeEdge.disabled = chosen.length < 2 || chosen[0] === chosen[1];
  addPlace.disabled = chosen.length === 0;
  byId("chosen").textContent = chosen.length ? `Nodes ${chosen.join(" and ")}` : "Click a node, then another, to correct lanes.";
  drawLanes();
}

async function loadRoadmap() {
  roadmap = await (await fetch("/api/roadmap")).json();
  const xs = roadmap.points.map((point) => point[0]), ys = roadmap.points.map((point) => point[1]);
  const left = Math.min(...xs) - 1, top = Math.max(...ys) + 1;
  byId("map").setAttribute("viewBox", `${left} ${-top} ${Math.max(...xs) + 1 - left} ${top + 1 - Math.min(...ys)}`);
  const { pick, drop } = byId("order").elements;
  for (const select of [pick, drop]) select.replaceChildren(...Object.keys(roadmap.names).map((name) => new Option(name, name)));
  drop.selectedIndex = Math.min(1, drop.options.length - 1);
  drawLanes();
}

const at = (node) => roadmap.points[node];
const colour = (k) => COLOURS[k % COLOURS.length];

// What does not move: drawn once, and when lanes or what is chosen change.
function drawLanes() {
  const parts = [];
  if (roadmap.walls) {
    const [x, bottom, width, height] = roadmap.walls;
    parts.push(element("image", { href: "/walls.png", x, y: -bottom - height, width, height }));
  }
  for (const [a, b] of roadmap.edges) parts.push(element("line", { class: "edge", x1: at(a)[0], y1: -at(a)[1], x2: at(b)[0], y2: -at(b)[1] }));
  roadmap.points.forEach((point, node) => {
    const dot = element("circle", { class: chosen.includes(node) ? "node chosen" : "node", cx: point[0], cy: -point[1], r: 0.1 });
    dot.append(element("title", {}, `node ${node}`));
    dot.addEventListener("click", (event) => { event.stopPropagation(); choose(node); });
    parts.push(dot);
  });
  for (const [name, node] of Object.entries(roadmap.names)) parts.push(element("text", { class: "label place", x: at(node)[0], y: -at(node)[1] - 0.25 }, name));
  byId("lanes").replaceChildren(...parts);
}

function drawRobots(fleet) {
  const parts = [];
  fleet.robots.forEach((robot, k) => {
    const points = robot.reserved.map((node) => `${at(node)[0]},${-at(node)[1]}`).join(" ");
    parts.push(element("polyline", { class: "reserved", points, stroke: colour(k) }));
  });
  fleet.robots.forEach((robot, k) => parts.push(element("circle", { class: robot.lost ? "robot lost" : "robot", cx: robot.x, cy: -robot.y, r: 0.2, fill: colour(k) })));
  const known = fleet.strangers.filter((one) => one.x !== null);
  for (const one of known) parts.push(element("circle", { class: "robot lost", cx: one.x, cy: -one.y, r: 0.2, fill: "#555" }));
  for (const robot of [...fleet.robots, ...known]) parts.push(element("text", { class: "label", x: robot.x + 0.26, y: -robot.y + 0.12 }, robot.name.split("/").at(-1)));
  byId("robots-drawn").replaceChildren(...parts);
}

function nameOf(robot, k) {
  const made = document.createElement("span"), swatch = document.createElement("span");
  swatch.className = "swatch";
  swatch.style.background = colour(k);
  made.append(swatch, robot.name);
  return made;
}

function removeButton(robot) {
  const made = document.createElement("button");
  made.textContent = "It was taken away";
  made.addEventListener("click", () => command("/api/robots/remove", { name: robot.name }));
  return made;
}

function cancelButton(order) {
  const made = document.createElement("button");
  made.textContent = "Cancel";
  made.className = "cancel";
  made.setAttribute("aria-label", `Cancel the order ${order.id}`);
  onContact(made, () => cancel(order));
  return made;
}

const percent = (charge) => (charge === null ? "" : `${Math.round(charge)} %`);

// Sentences, and a button for each robot that is silent and not in the fleet: a list that stays where it is.
function fillList(list, sentences, gone) {
  const shown = JSON.stringify([sentences, gone.map((one) => one.name)]);
  if (list.dataset.shown === shown) return;
  list.dataset.shown = shown;
  list.replaceChildren(...sentences.map((text) => {
    const item = document.createElement("li");
    item.textContent = text;
    return item;
  }), ...gone.map((one) => {
    const item = document.createElement("li");
    item.append(`${one.name} is silent. `, removeButton(one));
    return item;
  }));
}

function list(fleet) {
  fill(byId("robots"), fleet.robots.map((robot, k) => ({
    key: `${robot.name} ${robot.lost}`,
    cells: [
      { node: () => nameOf(robot, k) },
      { text: robot.doing },
      { text: [...robot.waits, ...robot.errors].join("; "), wide: true },
      { text: robot.task ?? "", wide: true },
      { text: percent(robot.battery), title: "Battery" },
      { text: `${Math.round(robot.age_s)} s`, title: "Last state" },
      robot.lost ? { node: () => removeButton(robot), wide: true } : { text: "" },
    ],
  })));
  fill(byId("orders"), fleet.orders.map((order) => ({
    key: `${order.id} ${CANCELLABLE.includes(order.stage)}`,
    cells: [
      { text: order.id },
      { text: order.stage },
      { text: order.pick, title: "From" },
      { text: order.drop, title: "To" },
      { text: order.robot ?? "" },
      { text: `${order.age_s} s`, title: "Age" },
      { text: order.why ?? "", wide: true },
      CANCELLABLE.includes(order.stage) ? { node: () => cancelButton(order) } : { text: "" },
    ],
  })));
  const gone = fleet.strangers.filter((one) => one.lost);
  fillList(byId("ignored"), [...Object.entries(fleet.ignored), ...Object.entries(fleet.managers)].map(([name, why]) => `${name}: ${why}`), gone);
}

async function refresh() {
  try {
    if (roadmap === null) await loadRoadmap();
    const fleet = await (await fetch("/api/fleet")).json();
    drawRobots(fleet);
    list(fleet);
  } catch (error) {
    byId("message").textContent = `The manager does not answer, so what is shown is old and robots may still be driving: ${error.message}`;
  }
  setTimeout(refresh, 1000);
}

byId("order").addEventListener("submit", (event) => {
  event.preventDefault();
  const form = event.target.elements;
  command("/api/orders", { id: `page-${Date.now()}-${Math.floor(Math.random() * 1e6)}`, pick: form.pick.value, drop: form.drop.value });
});
byId("correct").addEventListener("submit", (event) => {
  event.preventDefault();
  const kind = event.submitter.value;
  if (kind === "add place") { placing = chosen.at(-1); byId("message").textContent = "Click where the place is."; return; }
  correct({ kind, a: chosen[0], b: chosen[1] });
});
byId("map").addEventListener("click", (event) => {
  if (placing === null) return;
  const map = byId("map");
  const point = new DOMPoint(event.clientX, event.clientY).matrixTransform(map.getScreenCTM().inverse());
  correct({ kind: "add place", a: placing, x_m: point.x, y_m: -point.y });
  placing = null;
});
refresh();
