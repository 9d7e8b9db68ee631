// Draws lines over time on a canvas. Lines of one unit share a scale; each unit has its own.

import { figure } from "../../language.js";

const COLOURS = ["--accent", "--scan", "--good", "--warn"];
const DASHES = [[], [7, 4], [2, 3], [9, 3, 2, 3]];
const [MARGIN, LABEL] = [6, 12];

// The least and the most of each unit's lines, a little apart where they are the same.
export function scalesOf(series) {
  const scales = new Map();
  for (const { unit, points } of series) {
    const values = points.map(([, value]) => value).filter((value) => value !== null);
    if (!values.length) continue;
    const [least, most] = values.reduce(([low, high], value) => [Math.min(low, value), Math.max(high, value)], scales.get(unit) ?? [Infinity, -Infinity]);
    scales.set(unit, [least, most]);
  }
  for (const [unit, [least, most]] of scales) if (least === most) scales.set(unit, [least - (Math.abs(least) || 1) / 10, most + (Math.abs(most) || 1) / 10]);
  return scales;
}

// ``series`` are lines with their ``points`` between two times; ``cursor_s`` is the time that is looked at (null: none).
export function draw(canvas, series, [from_s, to_s], cursor_s, words) {
  const ratio = devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  Object.assign(canvas, { width: width * ratio, height: height * ratio });
  const c = canvas.getContext("2d");
  c.scale(ratio, ratio);
  const style = getComputedStyle(canvas);
  const scales = scalesOf(series);
  const x = (stamp_s) => width * (stamp_s - from_s) / (to_s - from_s);
  series.forEach(({ unit, points }, index) => {
    const [least, most] = scales.get(unit) ?? [0, 1];
    const y = (value) => height - LABEL - MARGIN - (value - least) / (most - least) * (height - 2 * (LABEL + MARGIN));
    c.strokeStyle = style.getPropertyValue(COLOURS[index % COLOURS.length]);
    c.setLineDash(DASHES[index % DASHES.length]);
    c.lineWidth = 1.5;
    trace(c, points, x, y);
  });
  c.setLineDash([]);
  c.fillStyle = style.getPropertyValue("--soft");
  c.font = "11px system-ui, sans-serif";
  [...scales].slice(0, 2).forEach(([unit, bounds], index) => {
    c.textAlign = index ? "right" : "left";
    bounds.toReversed().forEach((value, row) => c.fillText(`${short(value)} ${unit}`, index ? width - 4 : 4, row ? height - 3 : LABEL - 1));
  });
  c.textAlign = "center";
  c.fillText(words, width / 2, height / 2);
  if (cursor_s === null) return;
  c.strokeStyle = style.getPropertyValue("--ink");
  c.lineWidth = 1;
  c.beginPath();
  c.moveTo(x(cursor_s), 0);
  c.lineTo(x(cursor_s), height - LABEL);
  c.stroke();
}

// Of many values in a column of pixels the first, the least, the most and the last are drawn.
function trace(c, points, x, y) {
  c.beginPath();
  let [column, low, high, last] = [null, 0, 0, null];
  const finish = () => {
    if (column === null) return;
    for (const value of [low, high, last]) c.lineTo(column, y(value));
  };
  for (const [stamp_s, value] of points) {
    const place = Math.max(Math.round(x(stamp_s)), 0);
    if (value === null) {
      finish();
      column = last = null;
    } else if (place === column) [low, high, last] = [Math.min(low, value), Math.max(high, value), value];
    else {
      finish();
      if (last === null) c.moveTo(place, y(value));
      [column, low, high, last] = [place, value, value, value];
    }
  }
  finish();
  c.stroke();
}

// A number with as many digits as say something.
export function short(value) {
  if (value === null) return "–";
  const size = Math.abs(value);
  if (size >= 1e6 || (size > 0 && size < 1e-4)) return value.toExponential(2);
  return figure(value, size >= 1000 ? 0 : size >= 100 ? 1 : size >= 1 ? 2 : 4);
}
