// What is marked on the map, as large at any scale: places with their names, the robot's goal, and the numbers of a list.

const FONT = "system-ui, sans-serif";

export function paintMarks(view, ratio, size) {
  const { context: c, colours, goals, route } = view;
  const at = ({ x_m, y_m }) => [0, 1].map((axis) => size[axis] / 2 + (axis ? -1 : 1) * ([x_m, y_m][axis] - view.centre[axis]) * view.scale);
  c.setTransform(ratio, 0, 0, ratio, 0, 0);
  for (const place of view.places) paintPlace(c, colours, place.name, at(place));
  if (goals.length) paintGoal(c, colours, at(goals[0]), goals[0].heading_rad);
  const numbered = route.length ? route : goals.length > 1 ? goals : [];
  numbered.forEach((goal, index) => paintNumber(c, colours, index + 1, at(goal)));
  c.textAlign = "start";
}

function paintPlace(c, colours, name, [x, y]) {
  c.font = `13px ${FONT}`;
  c.lineWidth = 4;
  c.lineJoin = "round";
  c.strokeStyle = colours.paper; // a name may lie on a wall
  c.fillStyle = colours.ink;
  c.beginPath();
  c.arc(x, y, 5, 0, 2 * Math.PI);
  c.stroke();
  c.fill();
  c.textAlign = "start";
  c.strokeText(name, x + 15, y + 4); // beside the mark of a goal, too
  c.fillText(name, x + 15, y + 4);
}

// A ring, with an arrow that says how the robot will stand there; null: as it comes.
function paintGoal(c, colours, [x, y], heading_rad) {
  c.save();
  c.translate(x, y);
  c.strokeStyle = c.fillStyle = colours.robot;
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

function paintNumber(c, colours, number, [x, y]) {
  c.font = `bold 12px ${FONT}`;
  c.fillStyle = colours.robot;
  c.beginPath();
  c.arc(x, y, 10, 0, 2 * Math.PI);
  c.fill();
  c.fillStyle = colours.paper;
  c.textAlign = "center";
  c.fillText(String(number), x, y + 4);
}
