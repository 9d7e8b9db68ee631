// Wheel speeds against their targets over the last seconds.

const SPAN_S = 8;
const LEAST_RAD_S = 2;

export class Plot {
  constructor(canvas) {
    this.canvas = canvas;
    this.samples = [];
  }

  add(stamp_s, wheels) {
    this.samples.push({ stamp_s, ...wheels });
    while (this.samples.length && this.samples[0].stamp_s < stamp_s - SPAN_S) this.samples.shift();
    this.pending ??= requestAnimationFrame(() => {
      this.pending = null;
      this.#paint();
    });
  }

  #paint() {
    const { canvas, samples } = this;
    const ratio = devicePixelRatio || 1;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    canvas.width = width * ratio;
    canvas.height = height * ratio;
    const c = canvas.getContext("2d");
    c.scale(ratio, ratio);
    const style = getComputedStyle(canvas);
    const most = Math.max(LEAST_RAD_S, ...samples.flatMap((s) => [...s.velocity_rad_s, ...s.target_rad_s].map((v) => Math.abs(v ?? 0))));
    const last = samples.at(-1).stamp_s;
    const point = (stamp_s, value) => [width * (1 - (last - stamp_s) / SPAN_S), height / 2 - (value / most) * (height / 2 - 4)];
    c.strokeStyle = style.getPropertyValue("--line");
    c.strokeRect(0, height / 2, width, 0);
    samples[0].name.forEach((_, wheel) => {
      const colour = style.getPropertyValue(["--accent", "--scan", "--good", "--warn"][wheel % 4]);
      for (const [key, dash] of [["target_rad_s", [4, 4]], ["velocity_rad_s", []]]) {
        c.strokeStyle = colour;
        c.setLineDash(dash);
        c.beginPath();
        for (const sample of samples) c.lineTo(...point(sample.stamp_s, sample[key][wheel] ?? 0));
        c.stroke();
      }
    });
    c.fillStyle = style.getPropertyValue("--soft");
    c.font = "11px system-ui, sans-serif";
    c.fillText(`±${most.toFixed(1)} rad/s; dashed: target`, 4, 12);
  }
}
