// What pointers do in the view. A mouse aims by a click or a drag. A finger or a pen moves the view: a tap only proposes a
// pose, which a button confirms, so that a swipe that scrolls sends no robot off. Two always pan and zoom, and so does the wheel.
// Keys do what a finger does: with Shift the arrows move the map, and Enter is a tap on the cross in the middle.

const TAP_PX = 10;
const DOT_PX = 28; // a finger that begins so near to the proposed dot turns its heading
const HEADING_PX = 12;
const STEP_PX = 20; // of the map under the cross, by a key
const STEPS = { ArrowRight: [1, 0], ArrowLeft: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };

export class Gestures {
  #pointers = new Map();
  #tap = null; // where the finger went down, while it may still be a tap
  #aims = false;

  constructor(view) {
    this.view = view;
    const { canvas } = view;
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      view.zoom(Math.exp(-event.deltaY / 400), ...at(event));
    }, { passive: false });
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("pointerdown", (event) => this.#down(event));
    canvas.addEventListener("pointermove", (event) => this.#move(event));
    for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, (event) => this.#up(event));
    canvas.addEventListener("keydown", (event) => this.#press(event));
    for (const name of ["focus", "blur"]) canvas.addEventListener(name, () => view.draw());
  }

  // What was aimed at is not wanted any more.
  cancel() {
    this.#tap = null;
    this.#aims = false;
    this.#propose(null);
  }

  #press(event) {
    const { view } = this;
    if (event.key === "+" || event.key === "-") view.zoom(event.key === "+" ? 1.25 : 0.8);
    if (event.shiftKey && STEPS[event.key]) {
      event.preventDefault();
      const [right, up] = STEPS[event.key];
      this.#pan(-STEP_PX * right, STEP_PX * up, 1);
      view.draw();
    }
    if (event.key !== "Enter" || event.repeat || view.gesture === "pan") return;
    event.preventDefault();
    const place = view.toWorld(...view.middle);
    this.#propose({ from: place, to: place });
  }

  #down(event) {
    const { view } = this;
    view.canvas.setPointerCapture(event.pointerId);
    this.#pointers.set(event.pointerId, at(event));
    const isAlone = this.#pointers.size === 1 && view.gesture !== "pan";
    this.#tap = null;
    const place = view.toWorld(...at(event));
    if (event.pointerType === "mouse") {
      this.#aims = isAlone && event.button === 0 && !event.shiftKey;
      this.#propose(null);
      view.aim = this.#aims ? { from: place, to: place } : null;
      return;
    }
    this.#aims = isAlone && view.aim !== null && this.#apart(view.aim.from, place) < DOT_PX;
    if (isAlone && !this.#aims) this.#tap = at(event);
  }

  #move(event) {
    const before = this.#pointers.get(event.pointerId);
    if (!before) return;
    const { view } = this;
    const now = at(event);
    if (this.#tap && Math.hypot(now[0] - this.#tap[0], now[1] - this.#tap[1]) < TAP_PX) return;
    this.#tap = null;
    this.#pointers.set(event.pointerId, now);
    if (this.#aims && view.aim) view.aim.to = view.toWorld(...now);
    else this.#pan(now[0] - before[0], now[1] - before[1], this.#pointers.size);
    if (this.#pointers.size === 2) this.#pinch([...this.#pointers.values()], now, before);
    view.draw();
  }

  #up(event) {
    if (!this.#pointers.delete(event.pointerId)) return;
    const { view } = this;
    const isDone = event.type === "pointerup";
    if (event.pointerType === "mouse") {
      const pose = this.#aims ? this.#pose() : null;
      this.#aims = false;
      view.aim = null;
      if (pose && isDone) view.onPose(pose);
    } else if (this.#tap && isDone) {
      const place = view.toWorld(...this.#tap);
      this.#propose({ from: place, to: place });
    } else if (this.#aims) {
      this.#propose(view.aim);
    }
    this.#tap = null;
    if (this.#pointers.size === 0) this.#aims = false;
    view.draw();
  }

  #propose(aim) {
    this.view.aim = aim;
    this.view.onProposal(aim && this.#pose());
    this.view.draw();
  }

  #pose() {
    const { aim } = this.view;
    if (!aim) return null;
    const { from: [x, y], to: [toX, toY] } = aim;
    const isTurned = this.#apart(aim.from, aim.to) > HEADING_PX;
    return { x_m: x, y_m: y, heading_rad: isTurned ? Math.atan2(toY - y, toX - x) : null };
  }

  #apart(one, other) {
    return Math.hypot(one[0] - other[0], one[1] - other[1]) * this.view.scale;
  }

  #pan(right, down, fingers) {
    if (!right && !down) return;
    const { view } = this;
    view.setFollow(false);
    const [dx, dy] = view.toStep(right / fingers, -down / fingers);
    view.centre = [view.centre[0] - dx, view.centre[1] - dy];
  }

  #pinch([one, other], now, before) {
    const still = one === now ? other : one;
    const apart = (point) => Math.hypot(point[0] - still[0], point[1] - still[1]);
    if (apart(before) > 10) this.view.zoom(apart(now) / apart(before), (now[0] + still[0]) / 2, (now[1] + still[1]) / 2);
  }
}

const at = (event) => [event.offsetX, event.offsetY];
