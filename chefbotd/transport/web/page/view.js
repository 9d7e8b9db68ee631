// The surroundings from above, x forward to the right at first: map, trail, scan, ranges and robot; zoom and pan.

import { $, element } from "./dom.js";
import { Gestures } from "./gestures.js";
import { paintMarks } from "./marks.js";

const TRAIL_STEP_M = 0.05;
const TRAIL_POINTS = 2000;
const [MIN_SCALE, MAX_SCALE] = [5, 600];

export class View {
  constructor(canvas) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
    this.scale = 90; // pixels a metre
    this.centre = [0, 0];
    this.follow = true;
    this.gesture = "pan";
    this.onPose = () => {}; // a mouse has aimed at a pose
    this.onProposal = () => {}; // a finger has proposed one, which is to be confirmed; null: not any more
    this.mounts = new Map();
    this.body = { radius: 0.18 };
    this.pose = this.mapPose = this.grid = this.costs = this.obstacles = this.aim = null;
    this.scans = new Map();
    this.ranges = [];
    this.trail = [];
    this.path = null;
    this.layers = []; // what parts of the page paint over the map, in metres
    this.route = []; // where the goals of the page's list are
    this.goals = []; // the robot's goals, which it drives to in this order
    this.places = []; // of the map in use, with their names
    this.#readColours();
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
      this.#readColours();
      this.grid?.repaint(this.rgb);
      this.costs?.repaint(this.rgbOfCosts);
      this.draw();
    });
    new ResizeObserver(() => this.draw()).observe(canvas);
    this.gestures = new Gestures(this);
  }

  #readColours() {
    const style = getComputedStyle(document.documentElement);
    const read = (name) => style.getPropertyValue(`--${name}`).trim();
    this.colours = Object.fromEntries(["paper", "grid", "wall", "free", "scan", "robot", "trail", "range", "soft", "ink"].map((n) => [n, read(n)]));
    const rgb = (hex) => (hex.length === 4 ? [...hex.slice(1)].map((c) => c + c) : hex.slice(1).match(/../g)).map((c) => parseInt(c, 16));
    this.rgb = { wall: rgb(this.colours.wall), free: rgb(this.colours.free) };
    const cost = rgb(this.colours.range);
    this.rgbOfCosts = { wall: cost, free: cost, opacity: (percent) => 1.4 * percent };
  }

  // Where the robot is in what is drawn: in the map if that is known, else in odom.
  get robot() {
    return this.mapPose ?? this.pose;
  }

  setPose(pose, inMap) {
    if (inMap && (!this.mapPose || this.mapPose.map !== pose?.map)) this.trail = [];
    if (inMap) this.mapPose = pose;
    else this.pose = pose;
    if (!this.robot) return;
    const robot = this.robot;
    const last = this.trail.at(-1);
    if (!last || Math.hypot(robot.x_m - last[0], robot.y_m - last[1]) > TRAIL_STEP_M) {
      this.trail.push([robot.x_m, robot.y_m]);
      if (this.trail.length > TRAIL_POINTS) this.trail.shift();
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

  zoom(factor, x = this.canvas.clientWidth / 2, y = this.canvas.clientHeight / 2) {
    const before = this.toWorld(x, y);
    this.scale = Math.max(MIN_SCALE, Math.min(MAX_SCALE, this.scale * factor));
    const after = this.toWorld(x, y);
    if (!this.follow) this.centre = [this.centre[0] + before[0] - after[0], this.centre[1] + before[1] - after[1]];
    this.draw();
  }

  toWorld(x, y) {
    const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight];
    return [this.centre[0] + (x - width / 2) / this.scale, this.centre[1] - (y - height / 2) / this.scale];
  }

  // All that is known of the map, with a margin; the robot is not followed any more.
  showWholeMap() {
    const { grid, canvas } = this;
    if (!grid) return;
    const [length, width, cos, sin] = [grid.columns * grid.resolution_m, grid.rows * grid.resolution_m, Math.cos(grid.heading_rad), Math.sin(grid.heading_rad)];
    const corners = [[0, 0], [length, 0], [0, width], [length, width]].map(([x, y]) => [grid.x_m + x * cos - y * sin, grid.y_m + x * sin + y * cos]);
    const [left, right, bottom, top] = [0, 1].flatMap((axis) => [Math.min, Math.max].map((most) => most(...corners.map((corner) => corner[axis]))));
    this.setFollow(false);
    this.centre = [(left + right) / 2, (bottom + top) / 2];
    const fits = Math.min(canvas.clientWidth / (right - left), canvas.clientHeight / (top - bottom));
    this.scale = Math.max(MIN_SCALE, Math.min(MAX_SCALE, 0.94 * fits));
    this.draw();
  }

  #paint() {
    const { canvas, context: c, colours } = this;
    const ratio = devicePixelRatio || 1;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    if (canvas.width !== Math.round(width * ratio)) canvas.width = Math.round(width * ratio);
    if (canvas.height !== Math.round(height * ratio)) canvas.height = Math.round(height * ratio);
    if (this.follow && this.robot) this.centre = [this.robot.x_m, this.robot.y_m];
    c.setTransform(ratio, 0, 0, ratio, 0, 0);
    c.fillStyle = colours.paper;
    c.fillRect(0, 0, width, height);
    c.translate(width / 2, height / 2);
    c.scale(this.scale, -this.scale);
    c.translate(-this.centre[0], -this.centre[1]);
    this.#paintGrid(width, height);
    if (this.grid) this.#paintMap(this.grid);
    if (this.costs) this.#paintMap(this.costs);
    for (const paint of this.layers) paint(c);
    if (this.obstacles) this.#paintObstacles(this.obstacles);
    this.#line(this.trail, colours.trail, 2);
    if (this.path) this.#line(this.path, colours.robot, 3);
    if (this.robot) this.#paintRobot(this.robot);
    if (this.aim) this.#paintAim(this.aim);
    paintMarks(this, ratio, [width, height]);
    this.#paintScaleBar(ratio, height);
  }

  #paintGrid(width, height) {
    const { context: c } = this;
    const [left, bottom] = this.toWorld(0, height);
    const [right, top] = this.toWorld(width, 0);
    const step = this.scale < 20 ? 5 : 1;
    c.strokeStyle = this.colours.grid;
    c.lineWidth = 1 / this.scale;
    c.beginPath();
    for (let x = Math.ceil(left / step) * step; x < right; x += step) c.moveTo(x, bottom), c.lineTo(x, top);
    for (let y = Math.ceil(bottom / step) * step; y < top; y += step) c.moveTo(left, y), c.lineTo(right, y);
    c.stroke();
  }

  #paintMap(grid) {
    const { context: c } = this;
    c.save();
    c.translate(grid.x_m, grid.y_m);
    c.rotate(grid.heading_rad);
    c.imageSmoothingEnabled = false;
    c.drawImage(grid.image, 0, 0, grid.columns * grid.resolution_m, grid.rows * grid.resolution_m);
    c.restore();
  }

  // What is seen and not on the map; who moves has an arrow as long as the way of the next second.
  #paintObstacles({ x_m, y_m, dynamic_obstacles }) {
    const { context: c, colours } = this;
    c.fillStyle = colours.range;
    const dot = Math.max(0.04, 3 / this.scale);
    x_m.forEach((x, index) => c.fillRect(x - dot / 2, y_m[index] - dot / 2, dot, dot));
    for (const { x_m: x, y_m: y, vx_m_s, vy_m_s } of dynamic_obstacles) this.#line([[x, y], [x + vx_m_s, y + vy_m_s]], colours.range, 3);
  }

  #line(points, colour, width) {
    const { context: c } = this;
    c.strokeStyle = colour;
    c.lineWidth = width / this.scale;
    c.beginPath();
    for (const [x, y] of points) c.lineTo(x, y);
    c.stroke();
  }

  #paintRobot({ x_m, y_m, heading_rad }) {
    const { context: c, colours, body } = this;
    c.save();
    c.translate(x_m, y_m);
    c.rotate(heading_rad);
    for (const range of this.ranges) this.#paintRange(range);
    c.fillStyle = colours.scan;
    const dot = Math.max(0.02, 2 / this.scale);
    for (const points of this.scans.values()) for (const [x, y] of points) c.fillRect(x - dot / 2, y - dot / 2, dot, dot);
    c.strokeStyle = c.fillStyle = colours.robot;
    c.lineWidth = 2 / this.scale;
    c.beginPath();
    if (body.size) c.rect(-body.size[0] / 2, -body.size[1] / 2, ...body.size);
    else c.arc(0, 0, body.radius, 0, 2 * Math.PI);
    c.stroke();
    c.beginPath();
    for (const [x, y] of [[0.13, 0], [-0.08, 0.08], [-0.03, 0], [-0.08, -0.08]]) c.lineTo(x, y);
    c.fill();
    c.restore();
  }

  #paintRange({ sensor, status, range_m, max_range_m, field_of_view_rad }) {
    const { context: c } = this;
    const mount = this.mounts.get(sensor) ?? { x: 0, y: 0, yaw: 0 };
    const reach = range_m ?? (status === "too_near" ? 0.03 : max_range_m);
    c.save();
    c.translate(mount.x, mount.y);
    c.rotate(mount.yaw);
    c.strokeStyle = this.colours.range;
    c.lineWidth = (range_m === null ? 1 : 3) / this.scale;
    c.setLineDash(range_m === null ? [4 / this.scale, 6 / this.scale] : []);
    const half = Math.max(field_of_view_rad, 0.05) / 2;
    c.beginPath();
    c.arc(0, 0, reach, -half, half);
    c.stroke();
    c.restore();
  }

  #paintAim({ from, to }) {
    const { context: c } = this;
    c.strokeStyle = this.colours.robot;
    c.lineWidth = 3 / this.scale;
    c.beginPath();
    c.arc(...from, 6 / this.scale, 0, 2 * Math.PI);
    c.moveTo(...from);
    c.lineTo(...to);
    c.stroke();
  }

  #paintScaleBar(ratio, height) {
    const { context: c } = this;
    const metres = [0.1, 0.5, 1, 5, 10].find((each) => each * this.scale > 40) ?? 20;
    c.setTransform(ratio, 0, 0, ratio, 0, 0);
    c.fillStyle = this.colours.paper; // the bar may lie on a wall
    c.fillRect(4, height - 32, Math.max(metres * this.scale, 30) + 12, 27);
    c.fillStyle = this.colours.soft;
    c.fillRect(10, height - 12, metres * this.scale, 3);
    c.font = "12px system-ui, sans-serif";
    c.fillText(`${metres} m`, 10, height - 18);
  }

  // A switch or a choice below the view.
  addTool(tool) {
    $("tools").append(tool);
  }

  // A sign of the legend, hidden until there is something of its kind.
  addToLegend(kind, words) {
    const sign = element("span", "", { hidden: true });
    sign.append(element("i", "", { className: kind }), words);
    $("legend").append(" ", sign);
    return sign;
  }

  setFollow(follow) {
    this.follow = follow;
    this.onFollow?.(follow);
    this.draw();
  }
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
