// The cards of components: each is a module that the daemon serves, and stands where its component says.

import { element } from "./dom.js";
import { CARDS } from "./cards.js";

// Call ``add`` with each card that can be loaded, once it is; one that cannot is left out, and the console says why. They
// stand in the order in which the daemon lists them.
export function addComponents(page, add) {
  for (const { name, module, column, before, for_guests: forGuests } of CARDS) {
    const section = place(name, column, before);
    section.classList.toggle("for-guests", forGuests);
    import(module).then(({ default: Card }) => add(new Card({ ...page, section })))
      .catch((error) => {
        section.remove();
        console.warn(`the card of the component ${name} is left out: ${error}`);
      });
  }
}

// Its section, which the card shows once it has something to say.
function place(name, column, before) {
  const section = element("section", "", { id: `${name}-part`, hidden: true });
  const columns = document.querySelectorAll(".side .column");
  const where = document.getElementById(before);
  if (where) where.before(section);
  else columns[column === "left" ? 0 : columns.length - 1].append(section);
  return section;
}
