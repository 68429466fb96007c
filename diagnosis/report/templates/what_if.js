"use strict";
// Predicts the windows of a report again while a reader moves values of the model. All text of the data becomes
// text of the page, never HTML. Units are SI: m, rad, s. An array of poses is x, y, psi of one step after the other.
async function changeTheModel() {
  const NODES = 4; // of the interpolation between steps, as in the report
  const POINTS = 24; // of a window's line in a picture
  const STEPS = 8, ENOUGH = 1e-4, SECONDS = 1.3; // of a fit: at most, fall of the cost to end, time for a further step
  const SMALL = 1e-3; // of a slider's length: step of a finite difference
  const FACTORS = [1e3, 180 / Math.PI]; // mm, degrees
  const SVG = "http://www.w3.org/2000/svg";
  const at = (id) => document.getElementById(`what-if-${id}`);
  const say = (text) => { at("status").textContent = text; };

  // The data.

  async function unpacked(text) {
    const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
    const buffer = await new Response(stream).arrayBuffer();
    const sizes = new Uint32Array(buffer, 0, 4);
    let place = sizes.byteLength;
    const [head, ...modules] = Array.from(sizes, (size) => new Uint8Array(buffer, (place += size) - size, size));
    const data = JSON.parse(new TextDecoder().decode(head));
    const made = await Promise.all(modules.map((module) => WebAssembly.instantiate(module, { Math })));
    const arrays = data.arrays.map(({ count, scale }) => {
      const width = scale ? 4 : 8;
      const mixed = new Uint8Array(buffer, place, width * count);
      place += width * count;
      const rows = new Uint8Array(width * count);
      for (let k = 0; k < count; k++) for (let j = 0; j < width; j++) rows[width * k + j] = mixed[count * j + k];
      if (!scale) return new Float64Array(rows.buffer);
      let slope = 0, value = 0; // second differences, modulo 2^32
      return Float64Array.from(new Int32Array(rows.buffer), (x) => {
        slope = (slope + x) | 0;
        value = (value + slope) | 0;
        return scale * value;
      });
    });
    return { data, arrays, modules: made.map(({ instance }) => instance.exports) };
  }

  const { data, arrays, modules: [exports, allocation, balance] } = await unpacked(at("data").textContent);
  const memory = (name, count, of = exports) => new Float64Array(of.memory.buffer, of[name].value, count);
  const params = memory("params", data.params.length), step = memory("h", 1), outputs = memory("outputs", 3);
  const state = memory("state", 7), after = memory("after", 7);

  // A run with places of its samples among the steps, by the time [s] of each since its window began.
  function placed(run, since) {
    const inputs = memory("inputs", data.start + run.given.length), nodes = Math.min(NODES, run.steps + 1);
    const first = new Int32Array(since.length), shares = new Float64Array(NODES * since.length);
    since.forEach((t, k) => {
      const place = t / run.h;
      first[k] = Math.min(Math.max(Math.floor(place + 1e-6) - 1, 0), Math.max(run.steps + 1 - NODES, 0));
      for (let n = 1; n < nodes; n++) {
        let share = 1;
        for (let j = 0; j < nodes; j++) if (j !== n) share *= (place - first[k] - j) / (n - j);
        shares[NODES * k + n] = share;
      }
    });
    return { ...run, inputs, nodes, first, shares };
  }

  const kernelIntegral = (s) => 35 / 32 * (s - s ** 3 + 0.6 * s ** 5 - s ** 7 / 7);
  const kernelMoment = (s) => -35 / 256 * (1 - s * s) ** 4;

  const runs = data.runs.map((run) => {
    const [given, measured, track] = [run.given, run.measured, run.track].map((part) => part.map((k) => arrays[k]));
    const force = run.force && run.force.rows.length ? weighted(run.force) : null;
    return placed({ ...run, given, measured, track, force, begin: arrays[run.begin] }, arrays[run.since]);
  });

  // Predictions.

  const wrapped = (angle) => angle + 2 * Math.PI * Math.floor((Math.PI - angle) / (2 * Math.PI));

  // Poses of all windows of a run.
  function predicted(run, values) {
    const width = run.given.length, start = data.start, length = 3 * (run.steps + 1);
    const poses = new Float64Array(length * run.windows).fill(Infinity);
    params.set(values);
    if (exports.prepare()) return poses;
    for (let w = 0; w < run.windows; w++) {
      let row = w * run.steps, to = w * length;
      for (let j = 0; j < start; j++) run.inputs[j] = run.begin[start * w + j];
      for (let j = 0; j < width; j++) run.inputs[start + j] = run.given[j][row];
      if (exports.init()) continue;
      for (step[0] = 0; !exports.step(); step[0] = run.h) {
        poses[to] = outputs[0], poses[to + 1] = outputs[1], poses[to + 2] = outputs[2];
        if ((to += 3) === (w + 1) * length) break;
        for (let j = 0; j < 7; j++) state[j] = after[j];
        for (let j = 0; j < width; j++) run.inputs[start + j] = run.given[j][row];
        row++;
      }
    }
    return poses;
  }

  // Measured less predicted pose at each sample, and their root mean squares by window and over all.
  function compared(run, poses) {
    const { first, shares, nodes, samples } = run, [x, y, psi] = run.measured;
    const off = new Float64Array(3 * first.length), position = [], heading = [];
    const all = [0, 0];
    for (let w = 0, k = 0; w < run.windows; w++) {
      let squares = 0, turns = 0;
      for (const end = k + samples[w]; k < end; k++) {
        const p = 3 * (w * (run.steps + 1) + first[k]);
        let px = poses[p], py = poses[p + 1], turn = poses[p + 2];
        for (let n = 1; n < nodes; n++) {
          const share = shares[NODES * k + n];
          px += share * (poses[p + 3 * n] - poses[p]);
          py += share * (poses[p + 3 * n + 1] - poses[p + 1]);
          turn += share * wrapped(poses[p + 3 * n + 2] - poses[p + 2]);
        }
        const dx = off[3 * k] = x[k] - px, dy = off[3 * k + 1] = y[k] - py, d = off[3 * k + 2] = wrapped(psi[k] - turn);
        squares += dx * dx + dy * dy, turns += d * d;
      }
      position.push(Math.sqrt(squares / samples[w])), heading.push(Math.sqrt(turns / samples[w]));
      all[0] += squares, all[1] += turns;
    }
    return { off, position, heading, all: all.map((sum) => Math.sqrt(sum / first.length)) };
  }

  // The residual force: the model error over the windows of the weak form, as diagnosis/predictors/weak_form.py has it.

  // Arrays of a run's force, with the weights of its windows: of a smooth signal, of its slope, of one that is held.
  function weighted(force) {
    const [time, middle] = [arrays[force.time], arrays[force.middle]], { half, first, rows } = force;
    const [motion, columns] = [force.motion, force.columns].map((part) => part.map((k) => arrays[k]));
    const size = rows.reduce((sum, n) => sum + n, 0), weights = [0, 1, 2].map(() => new Float64Array(size));
    const limited = (x) => Math.min(Math.max(x, -1), 1);
    const span = (center, row) => {
      const a = time[Math.max(row, 0)], b = time[Math.min(row + 1, time.length - 1)];
      const low = limited((a - center) / half), high = limited((b - center) / half), length = b > a ? b - a : 1;
      const area = kernelIntegral(high) - kernelIntegral(low);
      return [area, (half * (kernelMoment(high) - kernelMoment(low)) + (center - a) * area) / length, length];
    };
    middle.forEach((center, w) => {
      const to = rows.slice(0, w).reduce((sum, n) => sum + n, 0);
      for (let n = 0; n < rows[w]; n++) {
        const [area, share, length] = span(center, first[w] + n), [before, old, last] = span(center, first[w] + n - 1);
        weights[0][to + n] = area - share + old;
        weights[1][to + n] = before / last - area / length;
        weights[2][to + n] = area;
      }
    });
    const known = Array.from(time, (_, k) => motion.some((x) => x[k]));
    const place = Array.from(middle, (center) => time.findIndex((t) => t >= center - 1e-9));
    const at = (j) => place.map((k) => motion[j][k]), psi = at(2), [north, east] = [at(3), at(4)];
    const surge = psi.map((a, k) => Math.cos(a) * north[k] + Math.sin(a) * east[k]);
    return { time, middle, motion, columns, first, rows, weights, known, north: at(0), east: at(1), psi, surge, after: force.after };
  }

  // Force (X, Y, N) [N, N, N m] of each window, one after the other.
  function residualForce(f, values) {
    const { time, motion, columns, weights, known, first, rows } = f, count = time.length, start = data.start, met = start + 3;
    const inputs = memory("inputs", met + columns.length, balance), at = memory("state", 9, balance), push = memory("outputs", 3, balance);
    const speeds = new Float64Array(3 * count), rates = new Float64Array(3 * count), flows = new Float64Array(3 * count);
    const pushes = new Float64Array(3 * count), omega = new Float64Array(3 * rows.length);
    memory("params", data.params.length, balance).set(values);
    if (balance.prepare()) return omega.fill(NaN);
    for (let k = 0; k < count; k++) {
      for (let j = 0; j < 6; j++) inputs[j] = motion[j][k];
      inputs[6] = time[k];
      balance.init();
      for (let j = 0; j < 3; j++) {
        speeds[3 * k + j] = at[j], rates[3 * k + j] = at[3 + j], flows[3 * k + j] = at[6 + j];
      }
    }
    for (let k = 0; k < count; k++) {
      const part = k + 1 < count && known[k] && known[k + 1] ? 0.5 : 0;
      inputs[6] = time[k];
      for (let j = 3 * k; j < 3 * k + 3; j++) inputs[start + j - 3 * k] = flows[j] + (part ? part * (flows[j + 3] - flows[j]) : 0);
      for (let j = 0; j < columns.length; j++) inputs[met + j] = columns[j][k];
      balance.step();
      pushes[3 * k] = push[0], pushes[3 * k + 1] = push[1], pushes[3 * k + 2] = push[2];
    }
    const [smooth, slope, held] = weights;
    for (let w = 0, n = 0; w < rows.length; w++) {
      let u = 0, v = 0, r = 0;
      for (let k = 3 * first[w]; k < 3 * (first[w] + rows[w]); k += 3, n++) {
        const a = smooth[n], b = slope[n], c = held[n];
        u += b * speeds[k] - a * rates[k] - c * pushes[k];
        v += b * speeds[k + 1] - a * rates[k + 1] - c * pushes[k + 1];
        r += b * speeds[k + 2] - a * rates[k + 2] - c * pushes[k + 2];
      }
      for (let j = 0; j < 3; j++) omega[3 * w + j] = data.inertia[j][0] * u + data.inertia[j][1] * v + data.inertia[j][2] * r;
    }
    return omega;
  }

  function rms(omega, j) {
    let sum = 0;
    for (let k = j; k < omega.length; k += 3) sum += omega[k] * omega[k];
    return Math.sqrt(sum / (omega.length / 3));
  }

  const sliders = [];
  for (const choice of data.choices) {
    choice.sliders.forEach((s) => { s.choice = choice, s.value = s.after; });
    if (!choice.fixed) sliders.push(...choice.sliders);
  }

  // The parameters of a run by the ticks and the values of sliders.
  function parameters(run, k) {
    const values = [...run.base];
    for (const s of sliders) if (s.choice.ticked && (s.run < 0 || s.run === k)) values[s.param] += s.value - s.before;
    return values;
  }

  function answer(run, values) {
    const poses = predicted(run, values);
    return { poses, ...compared(run, poses) };
  }

  const answers = () => runs.map((run, k) => answer(run, parameters(run, k)));

  // The fit: least squares of the predictions of training runs, in which each window counts once, and of priors.

  // Residuals in units of the learned model's errors, then offsets from prior means in standard deviations.
  function residuals(found, moved, units) {
    const parts = runs.flatMap((run, k) => (run.train ? [[run, found[k].off]] : []));
    const all = new Float64Array(parts.reduce((n, [, off]) => n + off.length, moved.length));
    let to = 0;
    for (const [run, off] of parts) {
      for (let w = 0, k = 0; w < run.windows; w++) {
        const root = Math.sqrt(run.samples[w]);
        for (const end = k + 3 * run.samples[w]; k < end; k++) all[to++] = off[k] / (units[k % 3] * root);
      }
    }
    for (const s of moved) all[to++] = s.std ? (s.value - s.before) / s.std : 0;
    return all;
  }

  const dot = (a, b) => { let sum = 0; for (let k = 0; k < a.length; k++) sum += a[k] * b[k]; return sum; };

  // x of H x = g, H symmetric and positive, by Cholesky's factor.
  function solved(H, g) {
    const q = g.length, L = H.map((row) => [...row]), x = [...g];
    for (let i = 0; i < q; i++) {
      for (let j = 0; j <= i; j++) {
        let sum = L[i][j];
        for (let k = 0; k < j; k++) sum -= L[i][k] * L[j][k];
        L[i][j] = i === j ? Math.sqrt(sum) : sum / L[j][j];
      }
      x[i] = (x[i] - L[i].slice(0, i).reduce((sum, l, k) => sum + l * x[k], 0)) / L[i][i];
    }
    for (let i = q - 1; i >= 0; i--) {
      for (let k = i + 1; k < q; k++) x[i] -= L[k][i] * x[k];
      x[i] /= L[i][i];
    }
    return x;
  }

  const within = (s, x) => Math.min(Math.max(x, s.limits[0] ?? -Infinity), s.limits[1] ?? Infinity);

  // Moves the ticked values by Gauss-Newton's method; gives the seconds that it took.
  function fit() {
    const began = performance.now(), seconds = () => (performance.now() - began) / 1e3;
    const moved = sliders.filter((s) => s.choice.ticked), small = moved.map((s) => SMALL * (s.high - s.low || 1));
    const errors = runs.flatMap((run) => (run.train ? [run.after] : []));
    const [p, h] = [0, 1].map((j) => Math.sqrt(errors.reduce((sum, e) => sum + e[j] * e[j], 0) / errors.length) || 1);
    const units = [p / Math.SQRT2, p / Math.SQRT2, h];
    const missed = () => residuals(answers(), moved, units);
    let left = missed(), cost = dot(left, left);
    for (let n = 0; n < STEPS && seconds() < SECONDS; n++) {
      const slopes = moved.map((s, j) => {
        const value = s.value;
        s.value = within(s, value + small[j]) === value ? value - small[j] : within(s, value + small[j]);
        const other = missed(), change = s.value - value;
        s.value = value;
        return other.map((x, k) => (left[k] - x) / change * small[j]);
      });
      const H = slopes.map((a) => slopes.map((b) => dot(a, b)));
      H.forEach((row, j) => { row[j] += 1e-9 * row[j] + 1e-12; });
      const values = moved.map((s) => s.value), move = solved(H, slopes.map((a) => dot(a, left))), before = cost;
      for (let share = 1; share > 0.05; share /= 4) {
        moved.forEach((s, j) => { s.value = within(s, values[j] + share * move[j] * small[j]); });
        const tried = missed(), value = dot(tried, tried);
        if (value < cost) { left = tried, cost = value; break; }
        moved.forEach((s, j) => { s.value = values[j]; });
      }
      if (!(cost < (1 - ENOUGH) * before)) break;
    }
    moved.forEach(show);
    return seconds();
  }

  // The model as it is ticked, as a file of SSP 1.0: that of the learned model with other values.
  function file() {
    const xml = new DOMParser().parseFromString(data.model, "application/xml"), root = xml.documentElement;
    root.setAttribute("description", "Changed in the page of a report: not checked for soundness");
    const given = new Map([...root.firstElementChild.children].map((element) => [element.getAttribute("name"), element]));
    for (const s of sliders.filter((each) => each.run < 0)) {
      const element = given.get(`${s.part}.${s.name}`), value = s.choice.ticked ? s.value : s.before;
      if (value === s.nominal) element.remove();
      else element.firstElementChild.setAttribute("value", value);
    }
    return new XMLSerializer().serializeToString(xml);
  }

  function save() {
    const link = made("a", { download: "model.ssv", href: URL.createObjectURL(new Blob([file()], { type: "application/xml" })) });
    link.click();
    URL.revokeObjectURL(link.href);
    say("Saved as model.ssv, not checked for soundness.");
  }

  // What is shown.

  const shown = (x, digits = 3) => (Number.isFinite(x) ? String(Number(x.toPrecision(digits))).replace("-", "−") : "–");

  function made(name, attributes = {}, ...content) {
    const element = name.startsWith("svg:") ? document.createElementNS(SVG, name.slice(4)) : document.createElement(name);
    for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
    element.append(...content);
    return element;
  }

  const key = () => made("p", { class: "key note" }, ...["measured", "before", "now"].map((name) =>
    made("span", {}, made("i", { class: name }), { measured: "measured", before: "no tick", now: "as ticked" }[name])));

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
    const whole = Array.from(north, (x, k) => `${k ? "L" : "M"}${east[k].toFixed(run.digits)} ${(-x).toFixed(run.digits)}`);
    run.now = made("svg:path", { class: "now" }), run.old = made("svg:path", { class: "before" });
    const picture = made("svg:svg", { viewBox: box.join(" "), role: "img", "aria-label": `Track of ${run.name}, measured and predicted` },
      made("svg:path", { class: "measured", d: whole.join("") }), run.old, run.now);
    return made("figure", {}, picture, made("figcaption", {}, `${run.name}: tracks, north up; ${shown(size)} m along the longer side.`));
  }

  // Errors of windows [m] over their number, as steps.
  const WIDE = 600, HIGH = 160, LEFT = 48;
  function steps(values, most) {
    const each = (WIDE - LEFT) / values.length;
    return values.map((x, w) => {
      const y = HIGH - (HIGH - 14) * Math.min(Number.isFinite(x) ? x / most : 1, 1);
      return `${w ? "L" : "M"}${(LEFT + w * each).toFixed(1)} ${y.toFixed(1)}h${each.toFixed(1)}`;
    }).join("");
  }

  function errorPicture(run) {
    run.errors = made("svg:path", { class: "now" }), run.firstErrors = made("svg:path", { class: "before" });
    run.most = made("svg:text", { x: LEFT - 4, y: 20, "text-anchor": "end" });
    const picture = made("svg:svg", { viewBox: `0 0 ${WIDE} ${HIGH + 2}`, role: "img", "aria-label": `Position error of each window of ${run.name}` },
      made("svg:path", { class: "axis", d: `M${LEFT} 0V${HIGH}H${WIDE}` }), run.most,
      made("svg:text", { x: LEFT - 4, y: HIGH, "text-anchor": "end" }, "0"), run.firstErrors, run.errors);
    return made("figure", {}, picture, made("figcaption", {}, `${run.name}: position error of each window, in time [mm].`));
  }

  // The residual force of a run in pictures: each axis over time and over surge speed, and arrows at its places.

  const AXES = ["X [N]", "Y [N]", "N [N·m]"], BINS = 16, STRIP = 80;

  function strips(label, caption) {
    const lines = AXES.map((axis, j) => {
      const low = made("svg:path", { class: "before" }), high = made("svg:path", { class: "now" });
      const middle = STRIP * (j + 0.5), text = made("svg:text", { x: 2, y: middle - 24 }, axis), most = made("svg:text", { x: 2, y: middle - 8 });
      return { low, high, most, parts: [made("svg:path", { class: "axis", d: `M${LEFT} ${middle}H${WIDE}` }), text, most, low, high] };
    });
    const picture = made("svg:svg", { viewBox: `0 0 ${WIDE} ${3 * STRIP}`, role: "img", "aria-label": label }, ...lines.flatMap(({ parts }) => parts));
    return { lines, figure: made("figure", {}, picture, made("figcaption", {}, caption)) };
  }

  function forcePictures(run) {
    const f = run.force, range = (x) => [Math.min(...x), Math.max(...x)];
    const [from, to] = range(f.surge), bin = f.surge.map((u) => Math.min(Math.floor(BINS * (u - from) / (to - from || 1)), BINS - 1));
    const [begin, end] = range(f.middle), size = Math.max(...[f.north, f.east].map((x) => range(x)[1] - range(x)[0]), 1e-9);
    f.over = strips(`Residual force over time, ${run.name}`, `${run.name}: residual force from ${shown(begin)} to ${shown(end)} s.`);
    f.by = strips(`Residual force by surge speed, ${run.name}`, `${run.name}: mean residual force by surge speed, ${shown(from)} to ${shown(to)} m/s.`);
    f.arrows = [made("svg:path", { class: "before" }), made("svg:path", { class: "now" })];
    const box = [Math.min(...f.east) - 0.15 * size, -Math.max(...f.north) - 0.15 * size, 1.3 * size, 1.3 * size];
    const map = made("svg:svg", { viewBox: box.join(" "), role: "img", "aria-label": `Residual force at its places, ${run.name}` },
      made("svg:path", { class: "measured", d: f.east.map((x, k) => `${k ? "L" : "M"}${x.toFixed(run.digits)} ${(-f.north[k]).toFixed(run.digits)}`).join("") }), ...f.arrows);
    const place = made("figure", {}, map, made("figcaption", {}, `${run.name}: residual force at its places, north up.`));
    f.draw = (omega, now) => {
      const axis = (j) => Array.from(f.middle, (_, w) => omega[3 * w + j]), name = now ? "high" : "low";
      if (!now) {
        f.most = AXES.map((_, j) => Math.max(...axis(j).map(Math.abs), 1e-9));
        f.length = 0.12 * size / Math.max(...axis(0).map((x, w) => Math.hypot(x, omega[3 * w + 1])), 1e-9);
      }
      const line = (x, y, j) => x.map((at, k) => {
        const height = STRIP * (j + 0.5) - 0.46 * STRIP * Math.min(Math.max(y[k] / f.most[j], -1), 1);
        return Number.isFinite(height) ? `${k ? "L" : "M"}${(LEFT + (WIDE - LEFT) * at).toFixed(1)} ${height.toFixed(1)}` : "";
      }).join("");
      AXES.forEach((_, j) => {
        const y = axis(j), sums = new Float64Array(BINS), counts = new Float64Array(BINS), filled = [];
        bin.forEach((k, w) => { sums[k] += y[w], counts[k]++; });
        counts.forEach((n, k) => { if (n) filled.push(k); });
        f.over.lines[j][name].setAttribute("d", line(Array.from(f.middle, (t) => (t - begin) / (end - begin || 1)), y, j));
        f.by.lines[j][name].setAttribute("d", line(filled.map((k) => (k + 0.5) / BINS), filled.map((k) => sums[k] / counts[k]), j));
        if (!now) for (const picture of [f.over, f.by]) picture.lines[j].most.textContent = `±${shown(f.most[j], 2)}`;
      });
      f.arrows[now ? 1 : 0].setAttribute("d", f.psi.map((a, w) => {
        const [X, Y] = [f.length * omega[3 * w], f.length * omega[3 * w + 1]], c = Math.cos(a), s = Math.sin(a);
        return Number.isFinite(X + Y) ? `M${f.east[w].toFixed(run.digits)} ${(-f.north[w]).toFixed(run.digits)}l${(s * X + c * Y).toFixed(run.digits)} ${(s * Y - c * X).toFixed(run.digits)}` : "";
      }).join(""));
    };
    return [f.over.figure, f.by.figure, place];
  }

  const first = []; // of each run without any tick
  const cells = []; // of the table, by run
  const forces = []; // cells of the residual force, by run
  const body = made("tbody"), forceBody = made("tbody"), gallery = made("div", { class: "gallery" });

  function table(titles, rows) {
    const columns = ["no tick", "learned", "as ticked"], head = (text) => made("th", { scope: "col" }, text);
    const over = (text) => made("th", { scope: "colgroup", colspan: 3 }, text);
    return made("div", { class: "table", tabindex: 0 }, made("table", {}, made("thead", {},
      made("tr", {}, head(""), ...titles.map(over)),
      made("tr", {}, head("run"), ...titles.flatMap(() => columns).map(head))), rows));
  }

  function newRow(run, rows, count) {
    const cells = Array.from({ length: 3 * count }, () => made("td"));
    rows.append(made("tr", run.train ? {} : { class: "held" },
      made("th", { scope: "row" }, run.name, " ", made("small", {}, run.use)), ...cells));
    return cells;
  }

  function added(run) {
    const row = newRow(run, body, 2), without = answer(run, run.base);
    first.push(without), cells.push(row), forces.push(null);
    gallery.append(trackPicture(run), errorPicture(run));
    run.old.setAttribute("d", lines(run, without.poses));
    FACTORS.forEach((factor, j) => { fill(row[3 * j], without.all[j], factor), fill(row[3 * j + 1], run.after[j], factor); });
    if (!run.force) return;
    const own = forces[forces.length - 1] = newRow(run, forceBody, 3), omega = residualForce(run.force, run.base);
    gallery.append(...forcePictures(run));
    run.force.draw(omega, false);
    AXES.forEach((_, j) => { fill(own[3 * j], rms(omega, j), 1), fill(own[3 * j + 1], run.force.after[j], 1); });
  }

  function fill(cell, value, factor) {
    cell.textContent = shown(factor * value);
    cell.dataset.value = value; // in SI, all digits
  }

  function update() {
    const began = performance.now(), found = answers();
    found.forEach((answer, k) => {
      const run = runs[k];
      run.now.setAttribute("d", lines(run, answer.poses));
      const finite = [...answer.position, ...first[k].position].filter(Number.isFinite), most = Math.max(...finite, 1e-9);
      run.errors.setAttribute("d", steps(answer.position, most));
      run.firstErrors.setAttribute("d", steps(first[k].position, most));
      run.most.textContent = shown(1e3 * most);
      FACTORS.forEach((factor, j) => fill(cells[k][3 * j + 2], answer.all[j], factor));
      if (!run.force) return;
      const omega = residualForce(run.force, parameters(run, k));
      run.force.draw(omega, true);
      AXES.forEach((_, j) => fill(forces[k][3 * j + 2], rms(omega, j), 1));
    });
    at("results").dataset.milliseconds = (performance.now() - began).toFixed(2);
    return found;
  }

  // Runs of the reader's own, in windows as the report's; each starts from a parabola through the poses about it.

  function ownRun(name, text) {
    const [names, ...rows] = text.trim().split(/\r?\n/).map((line) => line.split(",").map((cell) => cell.trim()));
    const wanted = ["time", "x", "y", "psi", ...data.csv.columns], places = wanted.map((column) => names.indexOf(column));
    const missing = wanted.filter((_, k) => places[k] < 0);
    if (missing.length) throw new Error(`${name} has no column ${missing.join(", ")}`);
    const table = rows.map((row) => places.map((k) => (row[k] ? Number(row[k]) : NaN))).filter((row) => row.every(Number.isFinite));
    const time = table.map(([t]) => t), gaps = time.slice(1).map((t, k) => t - time[k]);
    const period = [...gaps].sort((a, b) => a - b)[gaps.length >> 1], { length, longest, reach } = data.csv;
    if (!(period > 0 && time[time.length - 1] - time[0] + period > length)) throw new Error(`${name} has no window of ${shown(length)} s`);
    const h = period / Math.ceil(period / longest - 1e-6), steps = Math.ceil(length / h - 1e-6);
    const shares = table.map((row) => allocated(row.slice(4)));
    // Integral of each share over time, which is held from its sample to the next.
    const sums = [shares[0].map(() => 0)];
    gaps.forEach((gap, k) => sums.push(sums[k].map((sum, j) => sum + gap * shares[k][j])));
    let row = 0;
    const integral = (t, j) => {
      while (row > 0 && time[row] > t) row--;
      while (row + 1 < time.length && time[row + 1] <= t) row++;
      return sums[row][j] + (t - time[row]) * shares[row][j];
    };
    const begin = [], given = [...shares[0], ...shares[0]].map(() => []), samples = [], since = [], kept = [];
    for (let n = 0; time[0] + (n + 1) * length <= time[time.length - 1] + 1.25 * period; n++) {
      const low = time[0] + n * length - 0.25 * period, inside = [...time.keys()].filter((k) => time[k] >= low && time[k] < low + length);
      if (2 * inside.length * period < length || time[inside[0]] > low + period) continue;
      const start = time[inside[0]], near = [...time.keys()].filter((k) => Math.abs(time[k] - start) <= reach);
      const powers = near.map((k) => [1, (time[k] - start) / reach, ((time[k] - start) / reach) ** 2]);
      const H = [0, 1, 2].map((i) => [0, 1, 2].map((j) => powers.reduce((sum, p) => sum + p[i] * p[j], 0)));
      const poses = near.map((k) => [table[k][1], table[k][2], table[inside[0]][3] + wrapped(table[k][3] - table[inside[0]][3])]);
      const fits = [0, 1, 2].map((j) => solved(H, [0, 1, 2].map((i) => powers.reduce((sum, p, k) => sum + p[i] * poses[k][j], 0))));
      begin.push(...fits.map((c) => c[0]), ...fits.map((c) => c[1] / reach), start);
      for (let j = 0; j < shares[0].length; j++) for (let k = 0; k < steps; k++) {
        const mean = (integral(start + (k + 1) * h, j) - integral(start + k * h, j)) / h;
        given[j].push(mean), given[shares[0].length + j].push(mean);
      }
      samples.push(inside.length), since.push(...inside.map((k) => time[k] - start)), kept.push(...inside);
    }
    if (!samples.length) throw new Error(`${name} has no window of ${shown(length)} s`);
    const measured = [1, 2, 3].map((j) => kept.map((k) => table[k][j])), track = [1, 2].map((j) => table.map((each) => each[j]));
    const run = { name, use: "own", train: false, h, steps, windows: samples.length, base: runs[0].base, begin, given, samples, measured, track, after: [NaN, NaN] };
    return placed(run, since);
  }

  // What the thrusters are commanded, of a force or of commands.
  function allocated(values) {
    if (!data.csv.force) return values;
    memory("inputs", 3, allocation).set(values);
    allocation.step();
    return [...memory("outputs", (runs[0].given.length / 2), allocation)];
  }

  async function own(files) {
    try {
      for (const each of files) {
        const run = ownRun(each.name, await each.text());
        runs.push(run), added(run), say(`${each.name}: ${run.windows} windows compared.`);
      }
    } catch (error) {
      say(error.message);
    }
    update();
  }

  // Controls.

  function show(s) {
    s.input.value = s.value;
    s.output.textContent = `${shown(s.value, 4)} ${s.unit === "1" ? "" : s.unit}`;
    s.input.setAttribute("aria-valuetext", s.output.textContent);
  }

  function sliderRow(s) {
    const [low, high] = [Math.min(s.low, s.after), Math.max(s.high, s.after)];
    const part = (x) => 100 * Math.min(Math.max((x - low) / (high - low || 1), 0), 1);
    const mark = (kind, from, to) => {
      const element = made("span", { class: kind });
      element.style.left = `${part(from)}%`, element.style.width = `${part(to) - part(from)}%`;
      return element;
    };
    s.input = made("input", { type: "range", min: low, max: high, step: "any", "aria-label": `${s.name} [${s.unit}], ${s.description}` });
    s.output = made("output");
    s.input.addEventListener("input", () => {
      s.value = Number(s.input.value), s.choice.ticked = s.choice.tick.checked = true;
      show(s), update();
    });
    const slide = made("span", { class: "slide" }, s.input, mark("mark estimate", s.after, s.after));
    if (s.ci95) slide.append(mark("mark", ...s.ci95));
    slide.title = s.ci95 ? `learned: ${shown(s.after, 4)}, 95 %: ${shown(s.ci95[0])} to ${shown(s.ci95[1])}` : `learned: ${shown(s.after, 4)}`;
    show(s);
    return made("div", { class: "value" }, made("span", { title: s.description }, s.name), slide, s.output);
  }

  function choiceBox(choice) {
    choice.tick = made("input", { type: "checkbox" });
    choice.tick.checked = choice.ticked, choice.tick.disabled = Boolean(choice.fixed);
    choice.tick.addEventListener("change", () => { choice.ticked = choice.tick.checked, update(); });
    const label = made("label", {}, choice.tick, " ", choice.name, " ", made("small", {}, choice.note));
    const rows = choice.fixed ? [made("small", {}, choice.fixed)] : choice.sliders.map(sliderRow);
    return made("fieldset", {}, made("legend", {}, label), ...rows);
  }

  function reset(ticked) {
    for (const s of sliders) s.value = s.after, s.choice.ticked = ticked(s.choice), s.choice.tick.checked = s.choice.ticked, show(s);
    update();
  }

  const button = (text, action) => {
    const element = made("button", { type: "button" }, text);
    element.addEventListener("click", action);
    return element;
  };

  const learned = new Map(data.choices.map((choice) => [choice, choice.ticked]));
  const effects = data.choices.filter((c) => c.effect), rest = data.choices.filter((c) => !c.effect);
  at("controls").append(...effects.map(choiceBox));
  if (rest.length) at("controls").append(made("details", {}, made("summary", {}, `Coefficients of the ship (${rest.length})`), ...rest.map(choiceBox)));
  at("controls").append(
    button("Initial model", () => reset(() => false)), button("Learned model", () => reset((c) => learned.get(c))),
    button("Fit this", () => {
      const moved = sliders.filter((s) => s.choice.ticked).length;
      if (!moved) return say("Nothing is ticked.");
      const seconds = fit();
      update();
      return say(`Fitted ${moved} values to the training runs in ${shown(seconds, 2)} s.`);
    }), ...(data.model ? [button("Save model.ssv", save)] : []));
  if (data.csv) {
    const input = made("input", { type: "file", accept: ".csv", multiple: "" });
    input.addEventListener("change", () => own(input.files));
    at("controls").append(made("label", { class: "file" }, "Compare your own run (CSV, or drop it here): ", input,
      made("small", {}, ` columns time, x, y, psi, ${data.csv.columns.join(", ")} in SI units`)));
    const section = document.getElementById("what-if");
    section.addEventListener("dragover", (event) => event.preventDefault());
    section.addEventListener("drop", (event) => { event.preventDefault(), own(event.dataTransfer.files); });
  }
  at("results").append(table(["position [mm]", "heading [°]"], body),
    ...(data.runs.some((run) => run.force) ? [table(AXES.map((axis) => `residual force ${axis}`), forceBody)] : []), key(), gallery);
  runs.forEach(added);
  update();
  say("");
}

document.getElementById("what-if-open").addEventListener("toggle", () => {
  changeTheModel().catch((error) => {
    document.getElementById("what-if-status").textContent = `The page cannot compute the model here: ${error.message}`;
  });
}, { once: true });
