// What the robot sees: scans and ranges in the view, the list of sensors, and the robot's outline.

import { SHOWN_HZ } from "./connection.js";
import { $, element, text } from "./dom.js";
import { figure, t } from "./language.js";
import { device, range } from "./words.js";
import { scanPoints } from "./view.js";

const NARROW = matchMedia("(max-width: 48rem) and (orientation: portrait)"); // one line has no room for all of it

export class Sensors {
  #lines = new Map();
  #pose = null;
  #isInDoubt = false;

  constructor(connection, view) {
    this.view = view;
    connection.on("odometry", (pose, { stamp_s }) => this.#showPose(pose, stamp_s), SHOWN_HZ);
    connection.on("scan", (scan, { stamp_s }) => {
      view.scans.set(scan.lidar, { points: scanPoints(scan), stamp_s });
      view.scanLayer.setKnown(true);
      view.draw();
    }, SHOWN_HZ);
    connection.on("ranges", ({ ranges }) => {
      view.ranges = ranges;
      if (ranges.length) view.rangeLayer.setKnown(true);
      for (const each of ranges) this.#lines.set(each.sensor, range(each));
      this.#show();
      view.draw();
    }, SHOWN_HZ);
    connection.on("lidars", ({ lidars }) => this.#devices(lidars, "lidar"));
    connection.on("depth_cameras", ({ cameras }) => this.#devices(cameras, "camera"));
  }

  begin(can) {
    $("sensors-part").hidden = !["ranges", "lidars", "depth_cameras"].some((name) => can.has(`topic.${name}`));
  }

  #showPose(pose, stamp_s) {
    this.#pose = pose;
    this.view.setPose(pose, false, stamp_s);
    this.#write();
  }

  // Where nobody knows what the motors do, the last speed that was measured is no speed of now.
  doubt(isInDoubt) {
    if (isInDoubt === this.#isInDoubt) return;
    this.#isInDoubt = isInDoubt;
    this.#write();
  }

  #write() {
    if (!this.#pose) return;
    const { robot } = this.view;
    const turning = NARROW.matches ? "" : `, ${figure(this.#pose.angular_rad_s, 2)} rad/s`;
    const speed = this.#isInDoubt ? t("pose.speed_unknown") : `${figure(this.#pose.linear_m_s, 2)} m/s${turning}`;
    const figures = { x: figure(robot.x_m, 2), y: figure(robot.y_m, 2), degrees: figure((robot.heading_rad * 180) / Math.PI, 0), speed };
    text("pose", t(this.#isInDoubt ? "pose.last" : "pose.now", figures));
  }

  #devices(devices, key) {
    for (const each of devices) this.#lines.set(each[key], device(each));
    this.#show();
  }

  #show() {
    const lines = [...this.#lines].map(([name, words]) => `${name.replaceAll("_", " ")}: ${words}`);
    const items = $("sensors").children;
    if (items.length !== lines.length) $("sensors").replaceChildren(...lines.map(() => element("li")));
    lines.forEach((line, index) => { if (items[index].textContent !== line) items[index].textContent = line; });
  }

  // The outline and the sensors' places, from the robot's description.
  describe({ urdf }) {
    if (!urdf) return;
    const { view } = this;
    const robot = new DOMParser().parseFromString(urdf, "text/xml");
    const numbers = (node, name) => (node?.getAttribute(name) ?? "0 0 0").split(/\s+/).map(Number);
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
}
