// Buttons that stop: they act at the first contact, whatever else touches the screen, and they stay in sight.

const SAME_CONTACT_MS = 80; // one contact comes as a pointer, as a touch and as a mouse
const CLICK_AFTER_MS = 700; // at the latest, a click follows its release

// Call ``act`` when a finger, a pen or a mouse goes down on the button, and for a click of the keyboard or of a screen reader.
// While one finger scrolls, browsers tell of another one only as a touch; while one mouse button is down, only as a mouse.
export function onContact(button, act) {
  let [acted_ms, ended_ms, isDown] = [-Infinity, -Infinity, false];
  const begin = (event) => {
    if (event.cancelable) event.preventDefault(); // no focus for the button, no second event for the same contact
    isDown = true;
    if (event.timeStamp - acted_ms < SAME_CONTACT_MS) return;
    acted_ms = event.timeStamp;
    act();
  };
  const end = (event) => { if (isDown) [isDown, ended_ms] = [false, event.timeStamp]; };
  for (const name of ["pointerdown", "touchstart", "mousedown"]) button.addEventListener(name, begin, { passive: false });
  for (const name of ["pointerup", "pointercancel", "touchend", "touchcancel", "mouseup", "blur"]) addEventListener(name, end, { capture: true });
  button.addEventListener("contextmenu", (event) => event.preventDefault());
  button.addEventListener("click", (event) => {
    const follows = event.detail > 0 && (isDown || event.timeStamp - ended_ms < CLICK_AFTER_MS);
    if (!follows) act();
  });
}

// Whether a key types into this element. A number has no space in it, so that a space there is none that is typed.
export function isText(element) {
  return Boolean(element?.closest?.("input:not([type=range], [type=checkbox], [type=radio], [type=number]), textarea, [contenteditable]"));
}

// Keep what is fixed at an edge in the part of the page that is seen: browsers fix it to the page as it was before two
// fingers zoomed in, or before the screen's keyboard covered a part of it.
export function keepInSight(fixed, edge) {
  const seen = window.visualViewport;
  if (!seen) return;
  const place = () => {
    fixed.style.transform = "";
    const box = fixed.getBoundingClientRect();
    const down = edge === "bottom" ? Math.min(0, seen.offsetTop + seen.height - box.bottom) : seen.offsetTop;
    const isMoved = seen.scale > 1.01 || Math.abs(down) > 1;
    if (isMoved) fixed.style.transform = `translate(${seen.offsetLeft}px, ${down}px) scale(${1 / seen.scale})`;
  };
  for (const name of ["resize", "scroll"]) seen.addEventListener(name, place);
}
