// Predictions of the windows, and their errors.

// Poses of all windows of a run.
function predicted(run, values) {
  const { prediction, params, step, outputs, state, after } = bench;
  const width = run.given.length, start = bench.data.start, length = 3 * (run.steps + 1);
  const poses = new Float64Array(length * run.windows).fill(Infinity);
  params.set(values);
  if (prediction.prepare()) return poses;
  for (let w = 0; w < run.windows; w++) {
    let row = w * run.steps, to = w * length;
    for (let j = 0; j < start; j++) run.inputs[j] = run.begin[start * w + j];
    for (let j = 0; j < width; j++) run.inputs[start + j] = run.given[j][row];
    if (prediction.init()) continue;
    for (step[0] = 0; !prediction.step(); step[0] = run.h) {
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

function answer(run, values) {
  const poses = predicted(run, values);
  return { poses, ...compared(run, poses) };
}

const answers = () => bench.runs.map((run, k) => answer(run, parameters(run, k)));
