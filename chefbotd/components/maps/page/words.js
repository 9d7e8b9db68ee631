// What the page says of maps, and of where the robot is on them.

import { knows, named, t } from "../../language.js";

export const located = (state) => named("maps.located", state);

// What is done with a map that is being made; nothing where none is.
export const mapping = (state) => (knows(`maps.mapping.${state}`) ? t(`maps.mapping.${state}`) : "");
