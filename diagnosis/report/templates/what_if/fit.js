// The fit: least squares of the predictions of training runs, in which each window counts once, and of priors.

const STEPS = 8, ENOUGH = 1e-4, SECONDS = 1.3; // at most, fall of the cost to end, time for a further step
const SMALL = 1e-3; // of a slider's length: step of a finite difference

const dot = (a, b) => { let sum = 0; for (let k = 0; k < a.length; k++) sum += a[k] * b[k]; return sum; };
const within = (s, x) => Math.min(Math.max(x, s.limits[0] ?? -Infinity), s.limits[1] ?? Infinity);

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

// Residuals in units of the learned model's errors, then offsets from prior means in standard deviations.
function residuals(found, moved, units) {
  const parts = bench.runs.flatMap((run, k) => (run.train ? [[run, found[k].off]] : []));
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

// Errors of the learned model in the training runs, by which residuals are divided.
function trainingErrors() {
  const errors = bench.runs.flatMap((run) => (run.train && run.after.every(Number.isFinite) ? [run.after] : []));
  const [p, h] = [0, 1].map((j) => Math.sqrt(errors.reduce((sum, e) => sum + e[j] * e[j], 0) / errors.length) || 1);
  return [p / Math.SQRT2, p / Math.SQRT2, h];
}

// Moves the ticked values by Gauss-Newton's method; gives the seconds that it took.
function fit() {
  const began = performance.now(), seconds = () => (performance.now() - began) / 1e3, units = trainingErrors();
  const moved = bench.sliders.filter((s) => s.choice.ticked), small = moved.map((s) => SMALL * (s.high - s.low || 1));
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
