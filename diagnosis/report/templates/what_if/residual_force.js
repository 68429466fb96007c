// The residual force: the model error over the windows of the weak form, as diagnosis/predictors/weak_form.py has it.

const kernelIntegral = (s) => 35 / 32 * (s - s ** 3 + 0.6 * s ** 5 - s ** 7 / 7);
const kernelMoment = (s) => -35 / 256 * (1 - s * s) ** 4;

// Arrays of a run's force, with the weights of its windows.
function weighted(force) {
  const { arrays } = bench, [time, middle] = [arrays[force.time], arrays[force.middle]], { first, rows } = force;
  const [motion, columns] = [force.motion, force.columns].map((part) => part.map((k) => arrays[k]));
  const known = Array.from(time, (_, k) => motion.some((x) => x[k]));
  const place = Array.from(middle, (center) => time.findIndex((t) => t >= center - 1e-9));
  const there = (j) => place.map((k) => motion[j][k]), psi = there(2), [north, east] = [there(3), there(4)];
  const surge = psi.map((a, k) => Math.cos(a) * north[k] + Math.sin(a) * east[k]);
  const weights = windowWeights(time, middle, force);
  return { time, middle, motion, columns, first, rows, weights, known, north: there(0), east: there(1), psi, surge, after: force.after };
}

// Weights of the samples in each window: of a smooth signal, of its slope, of one that is held.
function windowWeights(time, middle, { half, first, rows }) {
  const weights = [0, 1, 2].map(() => new Float64Array(rows.reduce((sum, n) => sum + n, 0)));
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
  return weights;
}

// Velocity, acceleration by the hull and by the thrusters, of all samples; null: they cannot be computed.
function balanced(f, values) {
  const { time, motion, columns, known } = f, { balance, data } = bench, count = time.length, met = data.start + 3;
  const inputs = memory(balance, "inputs", met + columns.length), state = memory(balance, "state", 9), push = memory(balance, "outputs", 3);
  const [speeds, byHull, water, byThrusters] = [0, 1, 2, 3].map(() => new Float64Array(3 * count));
  memory(balance, "params", data.params.length).set(values);
  if (balance.prepare()) return null;
  for (let k = 0; k < count; k++) {
    for (let j = 0; j < 6; j++) inputs[j] = motion[j][k];
    inputs[6] = time[k];
    balance.init();
    for (let j = 0; j < 3; j++) {
      speeds[3 * k + j] = state[j], byHull[3 * k + j] = state[3 + j], water[3 * k + j] = state[6 + j];
    }
  }
  for (let k = 0; k < count; k++) {
    const part = k + 1 < count && known[k] && known[k + 1] ? 0.5 : 0;
    inputs[6] = time[k];
    for (let j = 3 * k; j < 3 * k + 3; j++) inputs[data.start + j - 3 * k] = water[j] + (part ? part * (water[j + 3] - water[j]) : 0);
    for (let j = 0; j < columns.length; j++) inputs[met + j] = columns[j][k];
    balance.step();
    byThrusters[3 * k] = push[0], byThrusters[3 * k + 1] = push[1], byThrusters[3 * k + 2] = push[2];
  }
  return { speeds, byHull, byThrusters };
}

// Force (X, Y, N) [N, N, N m] of each window, one after the other.
function residualForce(f, values) {
  const { weights: [smooth, slope, held], first, rows } = f, omega = new Float64Array(3 * rows.length), found = balanced(f, values);
  if (!found) return omega.fill(NaN);
  const { speeds, byHull, byThrusters } = found, { inertia } = bench.data;
  for (let w = 0, n = 0; w < rows.length; w++) {
    const sums = [0, 0, 0];
    for (let k = 3 * first[w]; k < 3 * (first[w] + rows[w]); k += 3, n++) {
      for (let j = 0; j < 3; j++) sums[j] += slope[n] * speeds[k + j] - smooth[n] * byHull[k + j] - held[n] * byThrusters[k + j];
    }
    for (let j = 0; j < 3; j++) omega[3 * w + j] = inertia[j][0] * sums[0] + inertia[j][1] * sums[1] + inertia[j][2] * sums[2];
  }
  return omega;
}

// Root mean square of an axis.
function rms(omega, j) {
  let sum = 0;
  for (let k = j; k < omega.length; k += 3) sum += omega[k] * omega[k];
  return Math.sqrt(sum / (omega.length / 3));
}
