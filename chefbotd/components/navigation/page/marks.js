// What is marked on the map, as large at any scale: places with their names, the robot's goal, and the numbers of a list.

import { t } from "../../language.js";

const FONT = "system-ui, sans-serif";

export class Marks {
  places = []; // of the map in use, with their names
  goals = []; // the robot's goals, which it drives to in this order
  route = []; // where the goals of the page's list are

  constructor(view) {
    this.view = view;
    const inPixels = (order) => ({ order, isInPixels: true });
    this.placeLayer = view.addLayer("place", t("navigation.layer.places"), (c, at) => {
      for (const place of this.places) paintPlace(c, view, place.name, at(place));
    }, inPixels(100));
    this.goalLayer = view.addLayer("goal", t("navigation.layer.goals"), (c, at) => this.#paintGoals(c, at), inPixels(110));
  }

  // Take what has changed: places, goals or route.
  show(changed) {
    Object.assign(this, changed);
    if (this.places.length) this.placeLayer.setKnown(true);
    if (this.goals.length || this.route.length) this.goalLayer.setKnown(true);
    this.view.draw();
  }

  #paintGoals(c, at) {
    const { goals, route, view } = this;
    if (goals.length) paintGoal(c, view, at(goals[0]), goals[0].heading_rad);
    const numbered = route.length ? route : goals.length > 1 ? goals : [];
    numbered.forEach((goal, index) => paintNumber(c, view, index + 1, at(goal)));
    c.textAlign = "start";
  }
}

function paintPlace(c, view, name, [x, y]) {
  c.font = `13px ${FONT}`;
  c.lineWidth = 4;
  c.lineJoin = "round";
  c.strokeStyle = view.colour("paper"); // a name may lie on a wall
  c.fillStyle = view.colour("ink");
  c.beginPath();
  c.arc(x, y, 5, 0, 2 * Math.PI);
  c.stroke();
  c.fill();
  c.textAlign = "start";
  c.strokeText(name, x + 15, y + 4); // beside the mark of a goal, too
  c.fillText(name, x + 15, y + 4);
}

// A ring, with an arrow that says how the robot will stand there; null: as it comes.
function paintGoal(c, view, [x, y], heading_rad) {
  c.save();
  c.translate(x, y);
  c.strokeStyle = c.fillStyle = view.colour("robot");
  c.lineWidth = 3;
  c.beginPath();
  c.arc(0, 0, 12, 0, 2 * Math.PI);
  c.stroke();
  if (heading_rad !== null) {
    c.rotate(-heading_rad);
    c.beginPath();
    for (const [ahead, aside] of [[28, 0], [15, 8], [15, -8]]) c.lineTo(ahead, aside);
    c.fill();
  }
  c.restore();
}

function paintNumber(c, view, number, [x, y]) {
  c.font = `bold 12px ${FONT}`;
  c.fillStyle = view.colour("robot");
  c.beginPath();
  c.arc(x, y, 10, 0, 2 * Math.PI);
  c.fill();
  c.fillStyle = view.colour("paper");
  c.textAlign = "center";
  c.fillText(String(number), x, y + 4);
}
