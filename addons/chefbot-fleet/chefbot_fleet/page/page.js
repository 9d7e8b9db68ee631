// Draws the fleet once a second. Text from elsewhere is only ever set as text.
const SVG = "http://www.w3.org/2000/svg";
const COLOURS = ["#06c", "#c30", "#080", "#808", "#a60", "#088", "#555", "#c08", "#660", "#00a"];
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

function row(cells) {
  const made = document.createElement("tr");
  for (const cell of cells) {
    const data = document.createElement("td");
    if (cell instanceof Node) data.append(cell); else data.textContent = cell ?? "";
    made.append(data);
  }
  return made;
}

async function command(path, body) {
  const token = byId("order").elements.token.value;
  const headers = { "Content-Type": "application/json", Authorization: `Bearer ${token}` };
  const answer = await fetch(path, { method: "POST", headers, body: JSON.stringify(body) });
  const value = await answer.json();
  byId("message").textContent = answer.ok ? "Done." : value.error;
  return answer.ok;
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
}

async function loadRoadmap() {
  roadmap = await (await fetch("/api/roadmap")).json();
  const xs = roadmap.points.map((point) => point[0]), ys = roadmap.points.map((point) => point[1]);
  const left = Math.min(...xs) - 1, top = Math.max(...ys) + 1;
  byId("map").setAttribute("viewBox", `${left} ${-top} ${Math.max(...xs) + 1 - left} ${top + 1 - Math.min(...ys)}`);
  for (const select of [byId("order").elements.pick, byId("order").elements.drop]) {
    select.replaceChildren(...Object.keys(roadmap.names).map((name) => new Option(name, name)));
  }
}

function draw(fleet) {
  const parts = [];
  const at = (node) => roadmap.points[node];
  for (const [a, b] of roadmap.edges) parts.push(element("line", { class: "edge", x1: at(a)[0], y1: -at(a)[1], x2: at(b)[0], y2: -at(b)[1] }));
  fleet.robots.forEach((robot, k) => {
    const points = robot.reserved.map((node) => `${at(node)[0]},${-at(node)[1]}`).join(" ");
    parts.push(element("polyline", { class: "reserved", points, stroke: COLOURS[k % COLOURS.length] }));
  });
  roadmap.points.forEach((point, node) => {
    const dot = element("circle", { class: chosen.includes(node) ? "node chosen" : "node", cx: point[0], cy: -point[1], r: 0.09 });
    dot.addEventListener("click", (event) => { event.stopPropagation(); choose(node); });
    parts.push(dot);
  });
  for (const [name, node] of Object.entries(roadmap.names)) parts.push(element("text", { class: "label", x: at(node)[0], y: -at(node)[1] - 0.15 }, name));
  fleet.robots.forEach((robot, k) => {
    parts.push(element("circle", { class: robot.lost ? "robot lost" : "robot", cx: robot.x, cy: -robot.y, r: 0.2, fill: COLOURS[k % COLOURS.length] }));
    parts.push(element("text", { class: "label", x: robot.x + 0.25, y: -robot.y }, robot.name));
  });
  byId("map").replaceChildren(...parts);
}

function list(fleet) {
  byId("robots").replaceChildren(...fleet.robots.map((robot) => {
    const remove = document.createElement("button");
    remove.textContent = "It was taken away";
    remove.hidden = !robot.lost;
    remove.addEventListener("click", () => command("/api/robots/remove", { name: robot.name }));
    const waits = [...robot.waits, ...robot.errors].join("; ");
    return row([robot.name, robot.doing, waits, robot.task, robot.battery === null ? "" : `${robot.battery} %`, `${robot.age_s} s`, remove]);
  }));
  byId("orders").replaceChildren(...fleet.orders.map((order) => row([order.id, order.pick, order.drop, order.why ? `${order.stage}: ${order.why}` : order.stage, order.robot, `${order.age_s} s`])));
  byId("ignored").replaceChildren(...Object.entries(fleet.ignored).map(([name, why]) => {
    const item = document.createElement("li");
    item.textContent = `${name} is not in the fleet: ${why}`;
    return item;
  }));
}

async function refresh() {
  try {
    if (roadmap === null) await loadRoadmap();
    const fleet = await (await fetch("/api/fleet")).json();
    draw(fleet);
    list(fleet);
  } catch (error) {
    byId("message").textContent = `The manager does not answer: ${error.message}`;
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
