// What the page says of goals.

import { figure, named, t } from "../../language.js";

export const goal = (state) => named("navigation.state", state);

// A finger has no pointer that hovers: it proposes, and a button confirms.
export const HAS_FINGERS = matchMedia("(hover: none) and (pointer: coarse)").matches;
export const GESTURE = t(HAS_FINGERS ? "navigation.tap" : "navigation.click");

// Where a pose is, in the words of an id.
export const position = (id, { x_m, y_m }, more = {}) => t(id, { x: figure(x_m, 2), y: figure(y_m, 2), ...more });
