// Where the robot was a moment ago: what a sensor saw is drawn where the robot was when it saw it.

const KEPT_S = 2;

export class PoseHistory {
  #poses = []; // { stamp_s, x_m, y_m, heading_rad }, the newest last

  add(stamp_s, { x_m, y_m, heading_rad }) {
    const newest_s = this.#poses.at(-1)?.stamp_s;
    if (stamp_s === newest_s) this.#poses.pop();
    else if (stamp_s < newest_s) this.clear(); // the daemon's clock began anew
    this.#poses.push({ stamp_s, x_m, y_m, heading_rad });
    while (this.#poses[0].stamp_s < stamp_s - KEPT_S) this.#poses.shift();
  }

  // Other poses follow, of another map.
  clear() {
    this.#poses = [];
  }

  // The pose at a time, between the two that are nearest to it: the oldest or the newest outside of them, null without any.
  at(stamp_s) {
    const next = this.#poses.findIndex((pose) => pose.stamp_s >= stamp_s);
    if (next <= 0) return this.#poses.at(next) ?? null;
    const [before, after] = this.#poses.slice(next - 1, next + 1);
    const share = (stamp_s - before.stamp_s) / (after.stamp_s - before.stamp_s);
    const turn = after.heading_rad - before.heading_rad;
    const between = (name) => before[name] + share * (after[name] - before[name]);
    return { x_m: between("x_m"), y_m: between("y_m"), heading_rad: before.heading_rad + share * Math.atan2(Math.sin(turn), Math.cos(turn)) };
  }
}
