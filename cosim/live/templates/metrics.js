/* Metrics of a run as cosim/results/performance.py defines them, (4.54)-(4.63). */
const WINDOW_TOLERANCE = 1e-9; // [s]

function metrics(run) {
  const { roles, power, from, to } = run.data;
  const needed = Object.values(roles).flat();
  const last = run.time(run.done);
  const low = (from ?? -Infinity) - WINDOW_TOLERANCE, high = (to ?? Infinity) + WINDOW_TOLERANCE;
  if (needed.includes(-1) || last < low) return null;
  const squares = { e_pos: 0, cross: 0, heading: 0 };
  const found = { e_pos_max: 0, ISE: 0, IAE: 0, W: 0, I_tau_dot: 0, energy: 0 };
  let before = null, rows = 0;
  for (let k = 0; k <= run.done; k++) {
    const t = run.time(k);
    if (t < low || t > high) continue;
    const values = (role) => roles[role].map((slot) => run.at(k, slot));
    const [x, y, psi] = values("pose"), [xt, yt, psit] = values("target"), nu = values("velocity");
    const tau = values("force");
    const e = -Math.sin(psit) * (x - xt) + Math.cos(psit) * (y - yt);
    const angle = psi - psit, heading = angle - 2 * Math.PI * Math.ceil((angle - Math.PI) / (2 * Math.PI));
    const distance = Math.hypot(xt - x, yt - y);
    const now = {
      t, tau, ISE: e * e, IAE: Math.abs(e), W: Math.abs(tau[0] * nu[0] + tau[1] * nu[1] + tau[2] * nu[2]),
      energy: power.reduce((sum, slot) => sum + run.at(k, slot), 0),
    };
    squares.e_pos += distance * distance;
    squares.cross += e * e;
    squares.heading += heading * heading;
    found.e_pos_max = Math.max(found.e_pos_max, distance);
    if (before) {
      for (const name of ["ISE", "IAE", "W", "energy"])
        found[name] += 0.5 * (now[name] + before[name]) * (t - before.t);
      found.I_tau_dot += Math.hypot(...tau.map((force, axis) => force - before.tau[axis]));
    } else found.from = t;
    found.to = t;
    before = now;
    rows++;
  }
  if (rows < 2) return null;
  if (!power.length) delete found.energy;
  const { IAE, W, I_tau_dot: wear } = found;
  return {
    ...found,
    e_pos_rms: Math.sqrt(squares.e_pos / rows),
    cross_track_rms: Math.sqrt(squares.cross / rows),
    heading_rms: Math.sqrt(squares.heading / rows),
    IAEW: IAE * W, IAEWWT: IAE * W * wear, IWWT: W * wear,
  };
}
