// What the page says of goals.

export const GOAL = {
  planning: "Looking for a way", driving: "Driving", recovering: "Looking for a way out", paused: "Paused",
  reached: "Arrived", unreachable: "There is no way there", blocked: "The way is blocked", cancelled: "Cancelled",
  lost: "The robot does not know where it is", fault: "Ended by a fault", idle: "No goal",
};

// A finger has no pointer that hovers: it proposes, and a button confirms.
const HAS_FINGERS = matchMedia("(hover: none) and (pointer: coarse)").matches;
export const SEND = HAS_FINGERS ? "Tap in the view, then Go here" : "Click in the view";
export const GESTURE = HAS_FINGERS ? "A tap" : "Click and drag";
