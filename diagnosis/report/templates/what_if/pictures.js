// Pictures: tracks, errors of windows, and the residual force.

const SVG = "http://www.w3.org/2000/svg";
const POINTS = 24; // of a window's line in a picture
const WIDE = 600, HIGH = 160, LEFT = 48, STRIP = 80; // of pictures over time, and of one axis in them
const AXES = ["X [N]", "Y [N]", "N [N·m]"], BINS = 16; // of the residual force, and of the surge speed

const shown = (x, digits = 3) => (Number.isFinite(x) ? String(Number(x.toPrecision(digits))).replace("-", "−") : "–");

function made(name, attributes = {}, ...content) {
  const element = name.startsWith("svg:") ? document.createElementNS(SVG, name.slice(4)) : document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  element.append(...content);
  return element;
}

function figure(viewBox, label, caption, ...parts) {
  return made("figure", {}, made("svg:svg", { viewBox, role: "img", "aria-label": label }, ...parts), made("figcaption", {}, caption));
}

// The path of a line through places that are north and east.
function pathOf(north, east, digits) {
  return Array.from(north, (x, k) => `${k ? "L" : "M"}${east[k].toFixed(digits)} ${(-x).toFixed(digits)}`).join("");
}

// Lines of the predictions of all windows in a picture: north up, east to the right.
function lines(run, poses) {
  const every = Math.max(1, Math.floor(run.steps / POINTS)), text = [];
  for (let w = 0; w < run.windows; w++) {
    let word = "M";
    for (let n = 0; n <= run.steps; n += every) {
      const p = 3 * (w * (run.steps + 1) + n);
      if (!(Math.abs(poses[p]) + Math.abs(poses[p + 1]) < run.far)) break;
      text.push(word, poses[p + 1].toFixed(run.digits), " ", (-poses[p]).toFixed(run.digits));
      word = "L";
    }
  }
  return text.join("");
}

function trackPicture(run) {
  const [north, east] = run.track;
  const low = [Math.min(...east), -Math.max(...north)], high = [Math.max(...east), -Math.min(...north)];
  const size = Math.max(high[0] - low[0], high[1] - low[1], 1e-9), edge = 0.06 * size;
  run.far = 1e3 * (size + Math.abs(low[0]) + Math.abs(low[1]) + Math.abs(high[0]) + Math.abs(high[1]));
  run.digits = Math.max(0, 3 - Math.floor(Math.log10(size)));
  const box = [low[0] - edge, low[1] - edge, high[0] - low[0] + 2 * edge, Math.max(high[1] - low[1], 0.3 * size) + 2 * edge];
  run.now = made("svg:path", { class: "now" }), run.old = made("svg:path", { class: "before" });
  return figure(box.join(" "), `Track of ${run.name}, measured and predicted`,
    `${run.name}: tracks, north up; ${shown(size)} m along the longer side.`,
    made("svg:path", { class: "measured", d: pathOf(north, east, run.digits) }), run.old, run.now);
}

// Errors of windows [m] over their number, as steps.
function stairs(values, most) {
  const each = (WIDE - LEFT) / values.length;
  return values.map((x, w) => {
    const y = HIGH - (HIGH - 14) * Math.min(Number.isFinite(x) ? x / most : 1, 1);
    return `${w ? "L" : "M"}${(LEFT + w * each).toFixed(1)} ${y.toFixed(1)}h${each.toFixed(1)}`;
  }).join("");
}

function errorPicture(run) {
  run.errors = made("svg:path", { class: "now" }), run.firstErrors = made("svg:path", { class: "before" });
  run.most = made("svg:text", { x: LEFT - 4, y: 20, "text-anchor": "end" });
  return figure(`0 0 ${WIDE} ${HIGH + 2}`, `Position error of each window of ${run.name}`,
    `${run.name}: position error of each window, in time [mm].`,
    made("svg:path", { class: "axis", d: `M${LEFT} 0V${HIGH}H${WIDE}` }), run.most,
    made("svg:text", { x: LEFT - 4, y: HIGH, "text-anchor": "end" }, "0"), run.firstErrors, run.errors);
}

// A picture with a line for each axis of the residual force, before and now.
class Strips {
  constructor(label, caption) {
    this.axes = AXES.map((axis, j) => {
      const middle = STRIP * (j + 0.5), title = made("svg:text", { x: 2, y: middle - 24 }, axis), most = made("svg:text", { x: 2, y: middle - 8 });
      const [before, now] = ["before", "now"].map((name) => made("svg:path", { class: name }));
      return { before, now, most, parts: [made("svg:path", { class: "axis", d: `M${LEFT} ${middle}H${WIDE}` }), title, most, before, now] };
    });
    this.figure = figure(`0 0 ${WIDE} ${3 * STRIP}`, label, caption, ...this.axes.flatMap(({ parts }) => parts));
  }

  // Draws values y of axis j at x, shares of the width; the strip ends at the size `most`.
  draw(x, y, j, most, when) {
    this.axes[j][when].setAttribute("d", x.map((place, k) => {
      const height = STRIP * (j + 0.5) - 0.46 * STRIP * Math.min(Math.max(y[k] / most, -1), 1);
      return Number.isFinite(height) ? `${k ? "L" : "M"}${(LEFT + (WIDE - LEFT) * place).toFixed(1)} ${height.toFixed(1)}` : "";
    }).join(""));
    if (when === "before") this.axes[j].most.textContent = `±${shown(most, 2)}`;
  }
}

const range = (x) => [Math.min(...x), Math.max(...x)];

// The residual force of a run: each axis over time and over surge speed, and arrows at its places.
class ForcePictures {
  constructor(run) {
    const f = run.force, [from, to] = range(f.surge), [begin, end] = range(f.middle);
    this.force = f, this.digits = run.digits;
    this.time = Array.from(f.middle, (t) => (t - begin) / (end - begin || 1));
    this.bins = f.surge.map((u) => Math.min(Math.floor(BINS * (u - from) / (to - from || 1)), BINS - 1));
    this.size = Math.max(...[f.north, f.east].map((x) => range(x)[1] - range(x)[0]), 1e-9);
    this.over = new Strips(`Residual force over time, ${run.name}`, `${run.name}: residual force from ${shown(begin)} to ${shown(end)} s.`);
    this.by = new Strips(`Residual force by surge speed, ${run.name}`, `${run.name}: mean residual force by surge speed, ${shown(from)} to ${shown(to)} m/s.`);
    this.arrows = { before: made("svg:path", { class: "before" }), now: made("svg:path", { class: "now" }) };
    const box = [Math.min(...f.east) - 0.15 * this.size, -Math.max(...f.north) - 0.15 * this.size, 1.3 * this.size, 1.3 * this.size];
    const map = figure(box.join(" "), `Residual force at its places, ${run.name}`, `${run.name}: residual force at its places, north up.`,
      made("svg:path", { class: "measured", d: pathOf(f.north, f.east, run.digits) }), this.arrows.before, this.arrows.now);
    this.figures = [this.over.figure, this.by.figure, map];
  }

  // Draws a force (X, Y, N of each window); the one "before" decides the scales.
  draw(omega, when) {
    const axes = AXES.map((_, j) => Array.from(this.time, (__, w) => omega[3 * w + j]));
    if (when === "before") {
      this.most = axes.map((y) => Math.max(...y.map(Math.abs), 1e-9));
      this.length = 0.12 * this.size / Math.max(...axes[0].map((x, w) => Math.hypot(x, axes[1][w])), 1e-9);
    }
    axes.forEach((y, j) => {
      const [places, means] = this.means(y);
      this.over.draw(this.time, y, j, this.most[j], when);
      this.by.draw(places, means, j, this.most[j], when);
    });
    this.arrows[when].setAttribute("d", this.force.psi.map((a, w) => this.arrow(a, w, axes[0][w], axes[1][w])).join(""));
  }

  // Middles of the bins of surge speed that have windows, and the mean of y in each.
  means(y) {
    const sums = new Float64Array(BINS), counts = new Float64Array(BINS);
    this.bins.forEach((k, w) => { sums[k] += y[w], counts[k]++; });
    const filled = [...counts.keys()].filter((k) => counts[k]);
    return [filled.map((k) => (k + 0.5) / BINS), filled.map((k) => sums[k] / counts[k])];
  }

  // The force of window w at heading a, from its place.
  arrow(a, w, X, Y) {
    if (!Number.isFinite(X + Y)) return "";
    const c = this.length * Math.cos(a), s = this.length * Math.sin(a), { north, east } = this.force;
    const [x, y, dx, dy] = [east[w], -north[w], s * X + c * Y, s * Y - c * X].map((value) => value.toFixed(this.digits));
    return `M${x} ${y}l${dx} ${dy}`;
  }
}
