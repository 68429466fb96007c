"use strict";
// Predicts the windows of a report again while a reader moves values of the model. All text of the data becomes
// text of the page, never HTML. Units are SI: m, rad, s. An array of poses is x, y, psi of one step after the other.

const NODES = 4; // of the interpolation between steps, as in the report
const FACTORS = [1e3, 180 / Math.PI]; // mm, degrees

// What the page computes with: the header of the data, its arrays, the modules prediction, allocation and balance
// with places in the memory of the first, the runs, and the sliders that can be moved.
const bench = {};

const at = (id) => document.getElementById(`what-if-${id}`);
const say = (text) => { at("status").textContent = text; };
const wrapped = (angle) => angle + 2 * Math.PI * Math.floor((Math.PI - angle) / (2 * Math.PI));
const memory = (module, name, count) => new Float64Array(module.memory.buffer, module[name].value, count);

async function inflated(text) {
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Response(stream).arrayBuffer();
}

// An array whose bytes of the same weight lie next to each other: every bit, or second differences modulo 2^32.
function restored(mixed, { count, scale }) {
  const width = scale ? 4 : 8, rows = new Uint8Array(width * count);
  for (let k = 0; k < count; k++) for (let j = 0; j < width; j++) rows[width * k + j] = mixed[count * j + k];
  if (!scale) return new Float64Array(rows.buffer);
  let slope = 0, value = 0;
  return Float64Array.from(new Int32Array(rows.buffer), (x) => {
    slope = (slope + x) | 0;
    value = (value + slope) | 0;
    return scale * value;
  });
}

// Fills the bench with what diagnosis/report/what_if.py has written.
async function load(text) {
  const buffer = await inflated(text), sizes = new Uint32Array(buffer, 0, 4);
  let place = sizes.byteLength;
  const part = (size) => new Uint8Array(buffer, (place += size) - size, size);
  const [head, ...codes] = Array.from(sizes, part), data = JSON.parse(new TextDecoder().decode(head));
  const made = await Promise.all(codes.map((code) => WebAssembly.instantiate(code, { Math })));
  const [prediction, allocation, balance] = made.map(({ instance }) => instance.exports);
  const arrays = data.arrays.map((entry) => restored(part((entry.scale ? 4 : 8) * entry.count), entry));
  Object.assign(bench, {
    data, arrays, prediction, allocation, balance,
    params: memory(prediction, "params", data.params.length), step: memory(prediction, "h", 1),
    outputs: memory(prediction, "outputs", 3), state: memory(prediction, "state", 7), after: memory(prediction, "after", 7),
  });
  bench.runs = data.runs.map(withArrays);
  for (const choice of data.choices) choice.sliders.forEach((s) => { s.choice = choice, s.value = s.after; });
  bench.sliders = data.choices.filter((choice) => !choice.fixed).flatMap((choice) => choice.sliders);
}

// A run of the data with its arrays in place of their numbers.
function withArrays(run) {
  const { arrays } = bench;
  const [given, measured, track] = [run.given, run.measured, run.track].map((part) => part.map((k) => arrays[k]));
  const force = run.force && run.force.rows.length ? weighted(run.force) : null;
  const after = run.after.map((error) => error ?? Infinity); // null: the learned model diverges
  return placed({ ...run, after, given, measured, track, force, begin: arrays[run.begin] }, arrays[run.since]);
}

// A run with places of its samples among the steps, by the time [s] of each since its window began.
function placed(run, since) {
  const inputs = memory(bench.prediction, "inputs", bench.data.start + run.given.length), nodes = Math.min(NODES, run.steps + 1);
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

// The parameters of a run by the ticks and the values of sliders.
function parameters(run, k) {
  const values = [...run.base];
  for (const s of bench.sliders) if (s.choice.ticked && (s.run < 0 || s.run === k)) values[s.param] += s.value - s.before;
  return values;
}
