// The surroundings from above, x forward to the right at first: layers, ranges and robot; zoom and pan.

import { $ } from "./dom.js";
import { Gestures } from "./gestures.js";
import { t } from "./language.js";
import { Layers } from "./layers.js";
import { PoseHistory } from "./poses.js";

const TRAIL_STEP_M = 0.05;
const TRAIL_POINTS = 2000;
const [MIN_SCALE, MAX_SCALE] = [5, 600];
const WHOLE = 0.9; // of the room, for the whole map
const [NARROW_PX, TOOLS_PX] = [600, 56]; // in a narrow room the buttons at its right would lie over the map

export class View {
  #colours = new Map();
  #bounds = () => null;
  #poses = new PoseHistory(); // of what ``robot`` says
  #layers;

  // ``room`` is the part of the canvas that nothing covers.
  constructor(canvas, room) {
    this.canvas = canvas;
    this.room = room;
    this.context = canvas.getContext("2d");
    this.scale = 90; // pixels a metre
    this.centre = [0, 0];
    this.angle = 0; // by which the map is turned, counter-clockwise
    this.middle = [0, 0]; // where the centre is drawn, in pixels
    this.size = [0, 0]; // of the room
    this.corner = [0, 0]; // where the scale stands, left and below
    this.follow = true;
    this.gesture = "pan";
    this.onPose = () => {}; // a mouse has aimed at a pose
    this.onProposal = () => {}; // a finger has proposed one, which is to be confirmed; null: not any more
    this.onColours = []; // called when it gets dark or light
    this.mounts = new Map();
    this.body = { radius: 0.18 };
    this.pose = this.mapPose = this.aim = null;
    this.scans = new Map();
    this.ranges = [];
    this.trail = [];
    this.#layers = new Layers(() => this.draw());
    this.trailLayer = this.addLayer("trail", t("layer.trail"), (c) => this.line(this.trail, this.colour("trail"), 2), { order: 60 });
    this.rangeLayer = this.addLayer("range", t("layer.range"), (c) => this.#fromRobot(c, () => this.#paintRanges()), { order: 80 });
    this.scanLayer = this.addLayer("scan", t("layer.scan"), (c) => this.#paintScans(c), { order: 90 });
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
      this.#colours.clear();
      for (const changed of this.onColours) changed();
      this.draw();
    });
    const sizes = new ResizeObserver(() => this.measure());
    for (const part of [canvas, room, $("pose")]) sizes.observe(part);
    this.gestures = new Gestures(this);
    $("whole-map").addEventListener("click", () => this.showWholeMap());
  }

  // A layer over the map. ``draw`` paints with the context in metres of the map, or with ``isInPixels`` in pixels, where
  // ``at(pose)`` says where a pose is. The legend has it once it is known (``setKnown``); its sign there has the class ``name``.
  // A higher ``order`` is drawn above. ``onSwitch`` is called with whether it is drawn.
  addLayer(name, title, draw, { order = 50, isInPixels = false, isOn = true, isInLegend = true, onSwitch = () => {} } = {}) {
    return this.#layers.make({ name, title, draw, order, isInPixels, isOn, isInLegend, onSwitch });
  }

  // What *Show the whole map* shows: ``bounds`` answers with corners in metres, or with null where there is nothing yet.
  setBounds(bounds) {
    this.#bounds = bounds;
    $("whole-map").hidden = bounds() === null;
  }

  // A choice above the view, such as what a click means.
  addTool(tool) {
    $("modes").append(tool);
  }

  // What lies over the map for a while, such as a question about a point that was touched.
  addOverlay(overlay) {
    $("overlays").append(overlay);
  }

  // A bar of its own room below the map, for while something is done on the map.
  addBar(bar) {
    $("bars").append(bar);
  }

  // A colour of the page's style sheets by the name of its variable, as the scheme has it.
  colour(name) {
    if (!this.#colours.has(name)) {
      const colour = getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
      if (!colour) return "#888"; // its style sheet is not there yet
      this.#colours.set(name, colour);
    }
    return this.#colours.get(name);
  }

  // Red, green and blue of a colour, from 0 to 255.
  rgb(name) {
    const hex = this.colour(name).slice(1);
    return (hex.length === 3 ? [...hex].map((digit) => digit + digit) : hex.match(/../g)).map((digits) => parseInt(digits, 16));
  }

  // Where the robot is in what is drawn: in the map if that is known, else in odom.
  get robot() {
    return this.mapPose ?? this.pose;
  }

  // ``stamp_s`` is the daemon's time of the pose.
  setPose(pose, inMap, stamp_s) {
    if (inMap && (!this.mapPose || this.mapPose.map !== pose?.map)) {
      this.trail = [];
      this.#poses.clear();
    }
    if (inMap) this.mapPose = pose;
    else this.pose = pose;
    if (!this.robot) return;
    if (this.robot === pose) this.#poses.add(stamp_s, pose);
    const robot = this.robot;
    const last = this.trail.at(-1);
    if (!last || Math.hypot(robot.x_m - last[0], robot.y_m - last[1]) > TRAIL_STEP_M) {
      this.trail.push([robot.x_m, robot.y_m]);
      if (this.trail.length > TRAIL_POINTS) this.trail.shift();
      if (this.trail.length > 1) this.trailLayer.setKnown(true);
    }
    this.draw();
  }

  // Once per animation frame, however much comes in; a hidden page draws nothing.
  draw() {
    this.pending ??= requestAnimationFrame(() => {
      this.pending = null;
      this.#paint();
    });
  }

  zoom(factor, x = this.middle[0], y = this.middle[1]) {
    const before = this.toWorld(x, y);
    this.scale = Math.max(MIN_SCALE, Math.min(MAX_SCALE, this.scale * factor));
    const after = this.toWorld(x, y);
    if (!this.follow) this.centre = [this.centre[0] + before[0] - after[0], this.centre[1] + before[1] - after[1]];
    this.draw();
  }

  // What is drawn is turned by this, counter-clockwise; what it means in metres stays.
  setAngle(angle) {
    this.angle = angle;
    this.draw();
  }

  // A step on the screen, to the right and upwards in pixels, in metres of the map.
  toStep(right, up) {
    return turned([right / this.scale, up / this.scale], -this.angle);
  }

  toWorld(x, y) {
    const [dx, dy] = this.toStep(x - this.middle[0], this.middle[1] - y);
    return [this.centre[0] + dx, this.centre[1] + dy];
  }

  // All that is known of the map, with a margin; the robot is not followed any more.
  showWholeMap() {
    const corners = this.#bounds();
    if (corners) this.#fit(corners, MAX_SCALE);
  }

  // These points in metres. What is shown moves only where one of them is out of sight, and gets smaller only where they do not fit.
  showPoints(points) {
    const [across, up] = this.size.map((size) => (WHOLE * size) / 2 / this.scale);
    const isSeen = ([x, y]) => {
      const [right, above] = turned([x - this.centre[0], y - this.centre[1]], this.angle);
      return Math.abs(right) < across && Math.abs(above) < up;
    };
    if (points.every(isSeen)) this.draw();
    else this.#fit(points, this.scale);
  }

  #fit(points, mostScale) {
    const corners = points.map((corner) => turned(corner, this.angle));
    const [left, right, bottom, top] = [0, 1].flatMap((axis) => [Math.min, Math.max].map((most) => most(...corners.map((corner) => corner[axis]))));
    this.setFollow(false);
    this.centre = turned([(left + right) / 2, (bottom + top) / 2], -this.angle);
    const covered_px = this.size[0] < NARROW_PX ? TOOLS_PX : 0;
    const fits = Math.min((this.size[0] - covered_px) / (right - left), this.size[1] / (top - bottom));
    this.scale = Math.max(MIN_SCALE, Math.min(mostScale, WHOLE * fits));
    const [dx, dy] = this.toStep(covered_px / 2, 0);
    this.centre = [this.centre[0] + dx, this.centre[1] + dy];
    this.draw();
  }

  // How large what nothing covers is, and where; by itself it is measured with the next frame.
  measure() {
    const [canvas, room] = [this.canvas.getBoundingClientRect(), this.room.getBoundingClientRect()];
    this.size = [room.width, room.height];
    this.middle = [room.left - canvas.left + room.width / 2, room.top - canvas.top + room.height / 2];
    this.corner = [room.left - canvas.left, room.bottom - canvas.top - $("pose").offsetHeight];
    this.draw();
  }

  #paint() {
    const { canvas, context: c } = this;
    const ratio = devicePixelRatio || 1;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    if (canvas.width !== Math.round(width * ratio)) canvas.width = Math.round(width * ratio);
    if (canvas.height !== Math.round(height * ratio)) canvas.height = Math.round(height * ratio);
    if (this.follow && this.robot) this.centre = [this.robot.x_m, this.robot.y_m];
    c.setTransform(ratio, 0, 0, ratio, 0, 0);
    c.fillStyle = this.colour("paper");
    c.fillRect(0, 0, width, height);
    c.translate(...this.middle);
    c.scale(this.scale, -this.scale);
    c.rotate(this.angle);
    c.translate(-this.centre[0], -this.centre[1]);
    this.#paintGrid(width, height);
    for (const layer of this.#layers.drawn(false)) layer.draw(c);
    const inMetres = c.getTransform();
    c.setTransform(ratio, 0, 0, ratio, 0, 0);
    const at = ({ x_m, y_m }) => {
      const [right, up] = turned([x_m - this.centre[0], y_m - this.centre[1]], this.angle);
      return [this.middle[0] + right * this.scale, this.middle[1] - up * this.scale];
    };
    for (const layer of this.#layers.drawn(true)) layer.draw(c, at);
    c.setTransform(inMetres);
    this.#fromRobot(c, () => this.#paintBody());
    if (this.aim) this.#paintAim(this.aim);
    c.setTransform(ratio, 0, 0, ratio, 0, 0);
    if (this.gesture !== "pan" && canvas.matches(":focus-visible")) this.#paintCross();
    this.#paintScaleBar();
  }

  #paintGrid(width, height) {
    const { context: c } = this;
    const corners = [[0, 0], [width, 0], [0, height], [width, height]].map((corner) => this.toWorld(...corner));
    const [left, right, bottom, top] = [0, 1].flatMap((axis) => [Math.min, Math.max].map((most) => most(...corners.map((corner) => corner[axis]))));
    const step = this.scale < 20 ? 5 : 1;
    c.strokeStyle = this.colour("grid");
    c.lineWidth = 1 / this.scale;
    c.beginPath();
    for (let x = Math.ceil(left / step) * step; x < right; x += step) c.moveTo(x, bottom), c.lineTo(x, top);
    for (let y = Math.ceil(bottom / step) * step; y < top; y += step) c.moveTo(left, y), c.lineTo(right, y);
    c.stroke();
  }

  // A line through points in metres; ``width`` in pixels.
  line(points, colour, width) {
    const { context: c } = this;
    c.strokeStyle = colour;
    c.lineWidth = width / this.scale;
    c.beginPath();
    for (const [x, y] of points) c.lineTo(x, y);
    c.stroke();
  }

  #fromRobot(c, paint, robot = this.robot) {
    if (!robot) return;
    const { x_m, y_m, heading_rad } = robot;
    c.save();
    c.translate(x_m, y_m);
    c.rotate(heading_rad);
    paint();
    c.restore();
  }

  // Each where the robot was when its last beam was measured: it may have turned since then.
  #paintScans(c) {
    c.fillStyle = this.colour("scan");
    const dot = Math.max(0.02, 2 / this.scale);
    for (const { points, stamp_s } of this.scans.values()) {
      this.#fromRobot(c, () => points.forEach(([x, y]) => c.fillRect(x - dot / 2, y - dot / 2, dot, dot)), this.#poses.at(stamp_s) ?? this.robot);
    }
  }

  #paintBody() {
    const { context: c, body } = this;
    c.beginPath();
    if (body.size) c.rect(-body.size[0] / 2, -body.size[1] / 2, ...body.size);
    else c.arc(0, 0, body.radius, 0, 2 * Math.PI);
    c.fillStyle = this.colour("card");
    c.fill();
    c.strokeStyle = c.fillStyle = this.colour("robot");
    c.lineWidth = 2 / this.scale;
    c.stroke();
    c.beginPath();
    for (const [x, y] of [[0.13, 0], [-0.08, 0.08], [-0.03, 0], [-0.08, -0.08]]) c.lineTo(x, y);
    c.fill();
  }

  #paintRanges() {
    const { context: c } = this;
    c.strokeStyle = this.colour("range");
    for (const { sensor, status, range_m, max_range_m, field_of_view_rad } of this.ranges) {
      const mount = this.mounts.get(sensor) ?? { x: 0, y: 0, yaw: 0 };
      const reach = range_m ?? (status === "too_near" ? 0.03 : max_range_m);
      const half = Math.max(field_of_view_rad, 0.05) / 2;
      c.save();
      c.translate(mount.x, mount.y);
      c.rotate(mount.yaw);
      c.lineWidth = (range_m === null ? 1 : 3) / this.scale;
      c.setLineDash(range_m === null ? [4 / this.scale, 6 / this.scale] : []);
      c.beginPath();
      c.arc(0, 0, reach, -half, half);
      c.stroke();
      c.restore();
    }
  }

  #paintAim({ from, to }) {
    const { context: c } = this;
    c.strokeStyle = this.colour("robot");
    c.lineWidth = 3 / this.scale;
    c.beginPath();
    c.arc(...from, 6 / this.scale, 0, 2 * Math.PI);
    c.moveTo(...from);
    c.lineTo(...to);
    c.stroke();
  }

  // Where Enter points at.
  #paintCross() {
    const { context: c, middle: [x, y] } = this;
    for (const [colour, width] of [["card", 5], ["accent", 2]]) {
      c.strokeStyle = this.colour(colour);
      c.lineWidth = width;
      c.beginPath();
      for (const [dx, dy] of [[1, 0], [-1, 0], [0, 1], [0, -1]]) c.moveTo(x + 5 * dx, y + 5 * dy), c.lineTo(x + 16 * dx, y + 16 * dy);
      c.stroke();
    }
  }

  #paintScaleBar() {
    const { context: c, corner: [left, bottom] } = this;
    const metres = [0.1, 0.2, 0.5, 1, 2, 5, 10].find((each) => each * this.scale > 40) ?? 20;
    c.fillStyle = this.colour("paper"); // the bar may lie on a wall
    c.fillRect(left + 8, bottom - 44, Math.max(metres * this.scale, 30) + 12, 27);
    c.fillStyle = this.colour("soft");
    c.fillRect(left + 14, bottom - 24, metres * this.scale, 3);
    c.font = "12px system-ui, sans-serif";
    c.fillText(`${metres} m`, left + 14, bottom - 30);
  }

  setFollow(follow) {
    this.follow = follow;
    this.onFollow?.(follow);
    this.draw();
  }
}

function turned([x, y], angle) {
  const [cos, sin] = [Math.cos(angle), Math.sin(angle)];
  return [cos * x - sin * y, sin * x + cos * y];
}

// A scan of the socket as points in the robot's frame.
export function scanPoints(scan) {
  const { x_m, y_m, yaw_rad, bearing_start_rad, bearing_step_rad, bearing_mrad, range_mm } = scan;
  const points = [];
  range_mm.forEach((range, index) => {
    if (!range) return;
    const bearing = yaw_rad + (bearing_step_rad === null ? bearing_mrad[index] / 1000 : bearing_start_rad + index * bearing_step_rad);
    points.push([x_m + (range / 1000) * Math.cos(bearing), y_m + (range / 1000) * Math.sin(bearing)]);
  });
  return points;
}
