// Runs of the reader's own, in windows as the report's; each starts from a parabola through the poses about it.

// Rows of a CSV file in which all columns are numbers: time, x, y, psi, then commands.
function rowsOf(name, text) {
  const [names, ...rows] = text.trim().split(/\r?\n/).map((line) => line.split(",").map((cell) => cell.trim()));
  const wanted = ["time", "x", "y", "psi", ...bench.data.csv.columns], places = wanted.map((column) => names.indexOf(column));
  const missing = wanted.filter((_, k) => places[k] < 0);
  if (missing.length) throw new Error(`${name} has no column ${missing.join(", ")}`);
  return rows.map((row) => places.map((k) => (row[k] ? Number(row[k]) : NaN))).filter((row) => row.every(Number.isFinite));
}

// What the thrusters are commanded, of a force or of commands.
function allocated(values) {
  const { allocation, data, runs } = bench;
  if (!data.csv.force) return values;
  memory(allocation, "inputs", 3).set(values);
  allocation.step();
  return [...memory(allocation, "outputs", runs[0].given.length / 2)];
}

// The mean over a time of each signal, which is held from its sample to the next.
function heldMeans(time, rows) {
  const sums = [rows[0].map(() => 0)];
  time.slice(1).forEach((t, k) => sums.push(sums[k].map((sum, j) => sum + (t - time[k]) * rows[k][j])));
  let row = 0;
  const integral = (t, j) => {
    while (row > 0 && time[row] > t) row--;
    while (row + 1 < time.length && time[row + 1] <= t) row++;
    return sums[row][j] + (t - time[row]) * rows[row][j];
  };
  return (from, to, j) => (integral(to, j) - integral(from, j)) / (to - from);
}

// Pose and rates at a sample, by a parabola through the poses about it.
function motionAt(table, time, row) {
  const { reach } = bench.data.csv, psi = table[row][3];
  const near = [...time.keys()].filter((k) => Math.abs(time[k] - time[row]) <= reach);
  const powers = near.map((k) => [1, (time[k] - time[row]) / reach, ((time[k] - time[row]) / reach) ** 2]);
  const poses = near.map((k) => [table[k][1], table[k][2], psi + wrapped(table[k][3] - psi)]);
  const H = [0, 1, 2].map((i) => [0, 1, 2].map((j) => powers.reduce((sum, p) => sum + p[i] * p[j], 0)));
  const fits = [0, 1, 2].map((j) => solved(H, [0, 1, 2].map((i) => powers.reduce((sum, p, k) => sum + p[i] * poses[k][j], 0))));
  return [...fits.map((c) => c[0]), ...fits.map((c) => c[1] / reach)];
}

// The rows of each window, of those with a first sample and half of all samples.
function windowsOf(time, period) {
  const { length } = bench.data.csv, found = [];
  for (let n = 0; time[0] + (n + 1) * length <= time[time.length - 1] + 1.25 * period; n++) {
    const low = time[0] + n * length - 0.25 * period, inside = [...time.keys()].filter((k) => time[k] >= low && time[k] < low + length);
    if (2 * inside.length * period >= length && time[inside[0]] <= low + period) found.push(inside);
  }
  return found;
}

// A run from a file.
function ownRun(name, text) {
  const table = rowsOf(name, text), time = table.map(([t]) => t), { length, longest } = bench.data.csv;
  const gaps = time.slice(1).map((t, k) => t - time[k]), period = [...gaps].sort((a, b) => a - b)[gaps.length >> 1];
  const windows = period > 0 && time[time.length - 1] - time[0] + period > length ? windowsOf(time, period) : [];
  if (!windows.length) throw new Error(`${name} has no window of ${shown(length)} s`);
  const h = period / Math.ceil(period / longest - 1e-6), steps = Math.ceil(length / h - 1e-6);
  const shares = table.map((row) => allocated(row.slice(4))), mean = heldMeans(time, shares), kept = windows.flat();
  const starts = windows.map((inside) => time[inside[0]]), each = Array.from({ length: steps }, (_, k) => k * h);
  const given = shares[0].map((_, j) => starts.flatMap((start) => each.map((t) => mean(start + t, start + t + h, j))));
  const run = {
    name, use: "own", train: false, h, steps, windows: windows.length, base: bench.runs[0].base, given: [...given, ...given],
    begin: windows.flatMap(([row]) => [...motionAt(table, time, row), time[row]]), samples: windows.map((inside) => inside.length),
    measured: [1, 2, 3].map((j) => kept.map((k) => table[k][j])), track: [1, 2].map((j) => table.map((row) => row[j])), after: [NaN, NaN],
  };
  return placed(run, windows.flatMap((inside, w) => inside.map((k) => time[k] - starts[w])));
}

async function own(files) {
  try {
    for (const each of files) {
      const run = ownRun(each.name, await each.text());
      bench.runs.push(run), added(run), say(`${each.name}: ${run.windows} windows compared.`);
    }
  } catch (error) {
    say(error.message);
  }
  update();
}
