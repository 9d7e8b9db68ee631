// What the page says of maps, and of where the robot is on them.

export const LOCATED = {
  unknown: "It is not known where the robot is.",
  searching: "The robot looks for where it is. Drive a bit.",
  localized: "The robot knows where it is.",
  uncertain: "The robot is not sure where it is.",
  lost: "The robot does not know where it is. Drive a bit, or say where it is.",
};

export const MAPPING = { mapping: "Making a map", paused: "Making of the map is paused", finishing: "Finishing the map", idle: "" };
