"use strict";
/* The step loop in the browser: the same arithmetic in the same order as cosim/compiled/loop.c, and an FMU as in
   fmus/native/face.c. Times are in s; values are in the units of their signals. */

const TIME_TOLERANCE = 1e-9; // [s], as cosim/scenario/plans.py
const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
const doubles = (text) => new Float64Array(bytes(text).buffer);

class Fmu {
  constructor(module, values) {
    this.module = module;
    module.compiled ??= new WebAssembly.Module(bytes(module.code));
    this.calls = new WebAssembly.Instance(module.compiled, { Math }).exports;
    this.memory = new Float64Array(this.calls.memory.buffer);
    const place = (name) => this.calls[name].value / 8;
    [this.inputs, this.outputs, this.outputsEnd] = ["inputs", "outputs", "prepared"].map(place);
    [this.state, this.after, this.h] = ["state", "after", "h"].map(place);
    this.memory.set(values);
    this.stale = true; // what follows from the parameters is not computed
  }

  /* State and outputs that follow from the present parameters and inputs. */
  initialise() {
    this.prepare();
    this.check(this.calls.init());
    this.memory[this.h] = 0;
    this.check(this.calls.step());
  }

  prepare() {
    if (this.stale) this.check(this.calls.prepare());
    this.stale = false;
  }

  check(failed) {
    if (failed) throw new Error("division by zero");
  }

  put(reference, value) {
    if (!this.module.hold_nonfinite || Number.isFinite(value)) this.memory[reference] = value;
  }

  tune(reference, value) {
    this.memory[reference] = value;
    this.stale = true;
  }

  step(h) {
    this.prepare();
    const longest = this.module.max_step;
    const parts = longest > 0 && !(h <= longest * (1 + 1e-9)) ? -Math.floor(-h / longest) : 1;
    this.memory[this.h] = parts > 1 ? h / parts : h;
    for (let k = 0; k < parts; k++) {
      this.check(this.calls.step());
      this.memory.copyWithin(this.state, this.after, this.h);
    }
    for (let k = this.outputs; k < this.outputsEnd; k++)
      if (!Number.isFinite(this.memory[k])) throw new Error("an output is not finite");
  }
}

/* Codes of cosim/scenario/operations.py. */
const [ADD, SET, HOLD, DELAY, WRAP, CONVERT] = [0, 1, 2, 3, 4, 5];

class Operation {
  constructor(data) {
    Object.assign(this, data, { cursor: 0, numbers: doubles(data.numbers), memory: doubles(data.memory) });
    this.acts = data.acts === null ? null : bytes(data.acts);
  }

  apply(table) {
    const { slots, numbers, memory } = this, n = slots.length, call = this.cursor++, first = call * this.stride;
    const acts = !this.acts || this.acts[call];
    if (this.code === ADD && acts) for (let k = 0; k < n; k++) table[slots[k]] += numbers[first + k];
    else if (this.code === SET && acts) for (let k = 0; k < n; k++) table[slots[k]] = numbers[first + k];
    else if (this.code === HOLD) {
      if (acts && this.calls) for (let k = 0; k < n; k++) table[slots[k]] = memory[k];
      else for (let k = 0; k < n; k++) memory[k] = table[slots[k]];
      this.calls = 1;
    } else if (this.code === DELAY) {
      const c = this.calls++, length = this.samples + 1;
      const late = (c <= this.samples ? 0 : (c - this.samples) % length) * n;
      for (let k = 0; k < n; k++) memory[(c % length) * n + k] = table[slots[k]];
      for (let k = 0; k < n; k++) table[slots[k]] = memory[late + k];
    } else if (this.code === WRAP)
      for (const slot of slots) table[slot] += 2 * Math.PI * Math.floor((Math.PI - table[slot]) / (2 * Math.PI));
    else if (this.code === CONVERT)
      for (let k = 0; k < n; k++) table[slots[k]] = numbers[2 * k] * table[this.sources[k]] + numbers[2 * k + 1];
  }
}

/* Events that act on signals, as cosim/master/changes.py. */
class Changes {
  constructor(begun) {
    const pairs = (part) => (part ? part[0].map((slot, k) => [slot, part[1][k]]) : []);
    [this.added, this.fixed] = [new Map(pairs(begun[0])), new Map(pairs(begun[1]))];
  }

  begin(slot, action, value, table) {
    if (action === "reset") [this.added, this.fixed].forEach((map) => map.delete(slot));
    else if (action === "bias") this.added.set(slot, value);
    else this.fixed.set(slot, action === "hold" ? table[slot] : value);
  }

  apply(table) {
    for (const [slot, value] of this.added) table[slot] += value;
    for (const [slot, value] of this.fixed) table[slot] = value;
  }
}

class Simulation {
  constructor(data) {
    this.data = data;
    this.width = data.signals.length;
    const slots = data.alternatives.flatMap((a) => a.options.flatMap((o) => o.put.map((pair) => pair[1])));
    this.table = new Float64Array(Math.max(this.width, ...slots.map((slot) => slot + 1)));
    this.table.set(doubles(data.row));
    this.parts = data.fmus.map((part) => ({
      ...part,
      fmu: new Fmu(data.modules[part.module], doubles(part.values)),
      onInputs: part.on_inputs.map((o) => new Operation(o)),
      onOutputs: part.on_outputs.map((o) => new Operation(o)),
      changes: part.changes.map((begun) => new Changes(begun)),
    }));
    this.parts.forEach((part) => part.fmu.initialise());
    this.events = [...data.events];
    this.frozen = null; // slot -> value of each measurement that is frozen
    this.done = 0;
    this.rows = new Float64Array(0);
    this.keepRow();
  }

  get finished() { return this.done >= this.data.steps; }
  time(k) { return Number((k * this.data.step).toFixed(12)); } // as Master.time

  keepRow() {
    const first = this.done * this.width;
    if (first >= this.rows.length) {
      const larger = new Float64Array(Math.max(1000 * this.width, 2 * this.rows.length));
      larger.set(this.rows);
      this.rows = larger;
    }
    this.rows.set(this.table.subarray(0, this.width), first);
  }

  at(k, slot) { return this.rows[k * this.width + slot]; }

  step() {
    this.beginEvents(this.time(this.done));
    const k = this.done + 1, due = this.parts.filter((part) => k % part.every === 0);
    if (this.data.jacobi) due.forEach((part) => this.exchange(part));
    for (const part of due) {
      if (!this.data.jacobi) this.exchange(part);
      this.advance(part);
    }
    this.done = k;
    this.keepRow();
  }

  exchange(part) {
    const { table } = this;
    for (const [target, source, count] of part.copies)
      for (let k = 0; k < count; k++) table[target + k] = table[source + k];
    for (const operation of part.onInputs) operation.apply(table);
    part.changes[0].apply(table);
    if (this.frozen) for (const [slot, value] of this.frozen) table[slot] = value;
    for (const [reference, slot] of part.put) part.fmu.put(reference, table[slot]);
  }

  advance(part) {
    part.fmu.step(part.h);
    this.read(part);
    for (const operation of part.onOutputs) operation.apply(this.table);
    part.changes[1].apply(this.table);
  }

  read(part) {
    for (const [reference, slot] of part.got) this.table[slot] = part.fmu.memory[reference];
  }

  beginEvents(t) {
    while (this.events.length && this.events[0].time <= t + TIME_TOLERANCE) {
      const { fmu, kind, place, action, value, original } = this.events.shift(), part = this.parts[fmu];
      if (kind === "input") part.changes[0].begin(place, action, value, this.table);
      else if (kind === "output") part.changes[1].begin(place, action, value, this.table);
      else part.fmu.tune(place, action === "reset" ? original : action === "bias" ? original + value : value);
    }
  }

  freeze(on) {
    this.frozen = on ? new Map(this.data.measured.map((slot) => [slot, this.table[slot]])) : null;
  }

  /* Another FMU in the place of one: it begins with the present values of its inputs. */
  replace(index, option) {
    const part = this.parts[index];
    for (const [, slot] of part.got) this.table[slot] = NaN;
    const { copies, put, got, module, values } = option;
    Object.assign(part, { copies, put, got, fmu: new Fmu(this.data.modules[module], doubles(values)) });
    for (const [target, source] of part.copies) this.table[target] = this.table[source];
    for (const [reference, slot] of part.put) part.fmu.put(reference, this.table[slot]);
    part.fmu.initialise();
    this.read(part);
  }

  csv() {
    const { logged, signals, every } = this.data;
    const lines = [["time", ...logged.map((slot) => signals[slot])].join(",")];
    for (let k = 0; k <= this.done; k += every)
      lines.push([this.time(k), ...logged.map((slot) => this.at(k, slot))].join(","));
    return lines.join("\n") + "\n";
  }
}
