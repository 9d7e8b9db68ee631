// The cards of components: each is a module that the daemon serves, and stands in the panel that its component says.

import { element } from "./dom.js";
import { CARDS } from "./cards.js";
import { ready } from "./language.js";

// Call ``add`` with each card that can be loaded, once it is; one that cannot is left out, and the console says why. The
// promise ends with the last of them.
export function addComponents(page, panels, add) {
  return Promise.all(CARDS.map(({ name, module, style, panel, title, order, for_guests: forGuests }) => {
    const section = panels.add(`${name}-part`, { panel, title, order, forGuests });
    if (style) document.head.append(element("link", "", { rel: "stylesheet", href: style }));
    return ready.then(() => import(module)).then(({ default: Card }) => add(new Card({ ...page, section })))
      .catch((error) => {
        section.remove();
        console.warn(`the card of the component ${name} is left out: ${error}`);
      });
  }));
}
