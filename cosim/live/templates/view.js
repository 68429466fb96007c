/* The page: controls, the picture of the ship, tables, and what is saved. */
const $ = (id) => document.getElementById(id);
const SPEEDS = [1, 2, 5, 10, 20, 50];
const BUDGET = 12; // wall time of the steps between two pictures [ms]; chosen: a picture every 1/60 s
const STILL = matchMedia("(prefers-reduced-motion: reduce)");
const PICTURE = () => (STILL.matches ? 1000 : 0); // shortest time between two pictures [ms]
const TABLES = 500; // time between two updates of the tables [ms]; chosen: they can be read
const MOST_POINTS = 2000; // of a drawn path
const format = (value) => (Number.isFinite(value) ? Number(value.toPrecision(4)).toString() : "–");

function made(tag, text = "", attributes = {}) {
  const element = document.createElement(tag);
  element.textContent = text;
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  return element;
}

class Page {
  constructor(data) {
    this.data = data;
    this.actions = [];
    for (const speed of SPEEDS) $("speed").append(made("option", `${speed} ×`, { value: speed }));
    $("seed").textContent = data.seed;
    this.pathAhead = this.targetAhead();
    this.choices();
    this.restart();
    this.listen();
  }

  restart() {
    this.run = new Simulation(this.data);
    this.actions.length = 0;
    $("actions").replaceChildren();
    $("freeze").setAttribute("aria-pressed", "false");
    for (const select of document.querySelectorAll("select.fmu")) select.selectedIndex = 0;
    this.play(false);
    this.show();
    this.say("Ready. Press Run, or the space bar.");
  }

  /* The target's path where it depends on nothing but time. */
  targetAhead() {
    const slots = this.data.roles.target, owner = this.data.signals[slots[0]]?.split(".")[0];
    const part = this.data.fmus.find((other) => other.name === owner);
    if (!part || part.copies.length || part.on_inputs.length || slots.includes(-1)) return [];
    const fmu = new Fmu(this.data.modules[part.module], doubles(part.values));
    const places = slots.map((slot) => part.got.find((pair) => pair[1] === slot)?.[0]);
    const count = Math.floor(this.data.steps / part.every), stride = Math.ceil(count / MOST_POINTS), path = [];
    fmu.initialise();
    for (let k = 0; k <= count; k++) {
      if (k % stride === 0) path.push(places.slice(0, 2).map((place) => fmu.memory[place]));
      fmu.step(part.h);
    }
    return path;
  }

  choices() {
    for (const { fmu, options } of this.data.alternatives) {
      const part = this.data.fmus[fmu], all = [part, ...options];
      const select = made("select", "", { class: "fmu", id: `fmu${fmu}` });
      all.forEach((option, k) => select.append(made("option", option.module, { value: k })));
      select.addEventListener("change", () => this.act(`${part.name} = ${all[select.value].module}`, () =>
        this.run.replace(fmu, all[select.value])));
      $("choices").append(made("label", part.name, { for: select.id }), select);
    }
    const plant = this.data.fmus.filter((part) => !this.data.alternatives.some((a) => this.data.fmus[a.fmu] === part));
    this.parameters = new Map();
    for (const part of plant) for (const parameter of part.parameters) {
      const name = `${part.name}.${parameter.name}`, unit = parameter.unit ? ` [${parameter.unit}]` : "";
      this.parameters.set(name, { ...parameter, part: this.data.fmus.indexOf(part) });
      $("parameters").append(made("option", `${parameter.description}${unit}`, { value: name }));
    }
    $("freeze").disabled = !this.data.measured.length;
  }

  listen() {
    const buttons = { play: () => this.play(!this.playing), end: () => this.toEnd(), again: () => this.restart(),
      freeze: () => this.freeze(), apply: () => this.tune(), save: () => this.save("log.csv", this.run.csv(), "text/csv"),
      record: () => this.save("open.json", this.record(), "application/json") };
    for (const [id, action] of Object.entries(buttons)) $(id).addEventListener("click", action);
    const keys = { " ": buttons.play, f: buttons.freeze, e: buttons.end, r: buttons.again,
      "+": () => this.faster(1), "-": () => this.faster(-1) };
    addEventListener("keydown", (event) => {
      const typing = event.target.matches("input, select, button");
      if (!keys[event.key] || (typing && (event.key === " " || !event.target.matches("button")))) return;
      if (event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      keys[event.key]();
    });
    $("parameter").addEventListener("input", () => this.describe());
    addEventListener("resize", () => this.draw());
  }

  faster(by) {
    const select = $("speed");
    select.selectedIndex = Math.min(Math.max(select.selectedIndex + by, 0), SPEEDS.length - 1);
    this.say(`Speed ${select.value} times real time.`);
  }

  say(text) { $("status").textContent = text; }

  /* A change by the user, which is recorded with its time. */
  act(text, change) {
    const time = this.run.time(this.run.done);
    try { change(); } catch (error) { return this.stop(error); }
    this.actions.push({ time, action: text });
    $("actions").append(made("li", `${time} s: ${text}`));
    this.say(`${text}, from ${time} s on. The run differs from that of cosim.run.`);
    this.show();
  }

  freeze() {
    const on = !this.run.frozen;
    $("freeze").setAttribute("aria-pressed", String(on));
    this.act(on ? "measurement frozen" : "measurement released", () => this.run.freeze(on));
  }

  describe() {
    const parameter = this.parameters.get($("parameter").value);
    $("unit").textContent = parameter ? `${parameter.unit ? `[${parameter.unit}] ` : ""}${parameter.description}` : "";
    if (parameter) $("value").value = this.run.parts[parameter.part].fmu.memory[parameter.reference];
  }

  tune() {
    const name = $("parameter").value, parameter = this.parameters.get(name), value = $("value").valueAsNumber;
    if (!parameter) return this.say("Choose an effect or parameter from the list.");
    const { min, max } = parameter;
    if (!Number.isFinite(value) || value < (min ?? -Infinity) || value > (max ?? Infinity))
      return this.say(`${name} takes a number from ${min ?? "-∞"} to ${max ?? "∞"}.`);
    this.act(`${name} = ${value}`, () => this.run.parts[parameter.part].fmu.tune(parameter.reference, value));
  }

  play(on) {
    this.playing = on && !this.run.finished;
    $("play").textContent = this.playing ? "Pause" : "Run";
    if (!this.playing) return;
    let last = performance.now(), owed = 0, drawn = 0;
    const frame = (now) => {
      if (!this.playing) return;
      owed = Math.min(owed + Math.min(now - last, 250) * 1e-3 * $("speed").value / this.data.step, 1e5);
      last = now;
      const limit = performance.now() + BUDGET;
      while (owed >= 1 && performance.now() < limit && this.advance()) owed--;
      if (performance.now() >= limit) owed = 0; // this computer is slower than that
      if (now - drawn >= PICTURE()) this.draw(), (drawn = now);
      if (now - (this.shown ?? 0) >= TABLES) this.show(), (this.shown = now);
      requestAnimationFrame(frame);
    };
    this.say(`Runs at ${$("speed").value} times real time.`);
    requestAnimationFrame(frame);
  }

  /* One step; whether there may be another. */
  advance() {
    if (this.run.finished) return this.stop();
    try { this.run.step(); } catch (error) { return this.stop(error); }
    return true;
  }

  stop(error) {
    const time = this.run.time(this.run.done);
    this.play(false);
    this.show();
    this.say(error ? `Stopped at ${time} s: ${error.message}.` : `Done: ${time} s.`);
    return false;
  }

  toEnd() {
    this.play(false);
    const part = () => {
      const limit = performance.now() + 4 * BUDGET;
      while (performance.now() < limit) if (!this.advance()) return;
      this.show();
      setTimeout(part);
    };
    part();
  }

  save(name, text, type) {
    const link = made("a", "", { href: URL.createObjectURL(new Blob([text], { type })), download: name });
    link.click();
    this.say(`${name} is saved.`);
  }

  record() {
    const { name, seed, step } = this.data;
    return JSON.stringify({ scenario: name, seed, step, to: this.run.time(this.run.done), actions: this.actions }, null, 1);
  }

  show() {
    const found = metrics(this.run), { run } = this;
    $("time").textContent = run.time(run.done).toFixed(1);
    const row = (label, value, unit, bar, title = "") => {
      const line = made("tr", "", { title });
      line.append(made("th", label, { scope: "row" }), made("td", format(value), { "data-value": value }), made("td", unit));
      if (bar !== null) {
        const cell = made("td"), inner = made("span", "", { class: "bar" });
        inner.style.width = `${50 * Math.min(Math.abs(bar), 1)}%`;
        inner.style.left = bar < 0 ? `${50 - 50 * Math.min(-bar, 1)}%` : "50%";
        cell.append(inner);
        line.append(cell);
      }
      return line;
    };
    $("metrics").replaceChildren(...(found ? this.data.metrics.filter((m) => m.name in found) : [])
      .map((m) => row(m.name, found[m.name], m.unit, null, m.meaning)));
    $("nometrics").hidden = found !== null;
    if (this.data.roles.target.includes(-1)) $("nometrics").textContent = "Metrics need a target, which this scenario lacks.";
    // A command without a unit is a share of the full one; another one without limits fills its bar at its largest.
    this.largest ??= this.data.actuators.map((a) => Math.max(Math.abs(a.min ?? 0), Math.abs(a.max ?? 0)) || (a.unit === "1" ? 1 : 0));
    $("actuators").replaceChildren(...this.data.actuators.map((a, k) => {
      const value = run.table[a.slot];
      this.largest[k] = Math.max(this.largest[k], Math.abs(value) || 0);
      return row(a.name, value, a.unit, value / (this.largest[k] || 1), a.description);
    }));
    const [x, y, psi] = this.data.roles.pose.map((slot) => run.table[slot]);
    $("water").setAttribute("aria-label", `Ship at ${format(x)} m north, ${format(y)} m east, heading ` +
      `${format((psi * 180) / Math.PI)} degrees, after ${run.time(run.done).toFixed(1)} s`);
    this.draw();
  }

  draw() {
    const { run, data } = this, canvas = $("water"), scale = devicePixelRatio || 1;
    const wide = canvas.clientWidth, high = canvas.clientHeight, pen = canvas.getContext("2d");
    canvas.width = wide * scale, canvas.height = high * scale;
    pen.scale(scale, scale);
    const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name);
    const stride = Math.ceil((run.done + 1) / MOST_POINTS), trails = { pose: [], target: [] };
    for (const role of ["pose", "target"]) {
      const [north, east] = data.roles[role];
      if (north < 0) continue;
      for (let k = 0; k <= run.done; k += stride) trails[role].push([run.at(k, north), run.at(k, east)]);
      trails[role].push([run.table[north], run.table[east]]);
    }
    const length = data.outline?.length ?? 1, points = [...trails.pose, ...trails.target, ...this.pathAhead];
    const span = (k) => [Math.min(...points.map((p) => p[k])) - length, Math.max(...points.map((p) => p[k])) + length];
    const [[south, north], [west, east]] = [span(0), span(1)];
    const unit = Math.min(wide / (east - west), high / (north - south)); // pixels in a metre
    const at = ([x, y]) => [wide / 2 + unit * (y - (east + west) / 2), high / 2 - unit * (x - (north + south) / 2)];
    const line = (path, name, dashes, width) => {
      pen.beginPath();
      path.forEach((p, k) => pen[k ? "lineTo" : "moveTo"](...at(p)));
      Object.assign(pen, { strokeStyle: colour(name), lineWidth: width });
      pen.setLineDash(dashes);
      pen.stroke();
    };
    line(this.pathAhead.length ? this.pathAhead : trails.target, "--target", [5, 5], 1);
    line(trails.pose, "--ship", [], 2);
    const hull = (slots, name, filled) => {
      const [x, y, psi] = slots.map((slot) => run.table[slot]), [c, s] = [Math.cos(psi), Math.sin(psi)];
      const corners = data.outline?.corners ?? [[0.5, 0], [-0.5, 0.2], [-0.5, -0.2]];
      const larger = Math.max(1, 16 / (unit * length)); // at least 16 pixels long
      line([...corners, corners[0]].map(([a, b]) => [x + larger * (c * a - s * b), y + larger * (s * a + c * b)]), name, [], 1.5);
      if (filled) Object.assign(pen, { fillStyle: colour("--hull") }).fill();
    };
    if (!data.roles.target.includes(-1)) hull(data.roles.target, "--target", false);
    hull(data.roles.pose, "--ship", true);
    this.arrow(pen, at, unit, line);
    const metres = 10 ** Math.floor(Math.log10(wide / unit / 3));
    line([[south + 12 / unit, west + 12 / unit], [south + 12 / unit, west + 12 / unit + metres]], "--text", [], 2);
    Object.assign(pen, { fillStyle: colour("--text"), font: "13px sans-serif" });
    const [left, bottom] = at([south + 12 / unit, west + 12 / unit]);
    pen.fillText(`${metres} m`, left, bottom - 6);
  }

  /* The commanded force in surge and sway, from the ship on. */
  arrow(pen, at, unit, line) {
    const { roles } = this.data, table = this.run.table;
    if ([...roles.force, ...roles.pose].includes(-1)) return;
    const [x, y, psi] = roles.pose.map((slot) => table[slot]), [X, Y] = roles.force.map((slot) => table[slot]);
    this.strongest = Math.max(this.strongest ?? 0, Math.hypot(X, Y) || 0);
    const size = 40 / unit / (this.strongest || 1); // 40 pixels for the largest force so far
    line([[x, y], [x + size * (Math.cos(psi) * X - Math.sin(psi) * Y), y + size * (Math.sin(psi) * X + Math.cos(psi) * Y)]],
      "--force", [], 3);
  }
}

async function open() {
  const stream = new Blob([bytes($("data").textContent.trim())]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Page(JSON.parse(await new Response(stream).text()));
}

const page = open();
page.catch((error) => {
  $("status").textContent = `This browser cannot run the page: ${error.message}`;
});
