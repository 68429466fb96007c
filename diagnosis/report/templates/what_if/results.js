// The results of all runs: tables of errors, and pictures.

const first = []; // of each run without any tick
const cells = []; // of the table, by run
const forces = []; // cells of the residual force, by run
const body = made("tbody"), forceBody = made("tbody"), gallery = made("div", { class: "gallery" });

const legend = () => made("p", { class: "key note" }, ...Object.entries({ measured: "measured", before: "no tick", now: "as ticked" }).map(
  ([name, text]) => made("span", {}, made("i", { class: name }), text)));

function table(titles, rows) {
  const columns = ["no tick", "learned", "as ticked"], head = (text) => made("th", { scope: "col" }, text);
  const over = (text) => made("th", { scope: "colgroup", colspan: 3 }, text);
  return made("div", { class: "table", tabindex: 0 }, made("table", {}, made("thead", {},
    made("tr", {}, head(""), ...titles.map(over)),
    made("tr", {}, head("run"), ...titles.flatMap(() => columns).map(head))), rows));
}

// Three cells for each of some quantities of a run, in a new row.
function newRow(run, rows, count) {
  const own = Array.from({ length: 3 * count }, () => made("td"));
  rows.append(made("tr", run.train ? {} : { class: "held" },
    made("th", { scope: "row" }, run.name, " ", made("small", {}, run.use)), ...own));
  return own;
}

function fill(cell, value, factor) {
  cell.textContent = shown(factor * value);
  cell.dataset.value = value; // in SI, all digits
}

// Shows a run, with the results of the initial and of the learned model.
function added(run) {
  const row = newRow(run, body, 2), without = answer(run, run.base);
  first.push(without), cells.push(row), forces.push(null);
  gallery.append(trackPicture(run), errorPicture(run));
  run.old.setAttribute("d", lines(run, without.poses));
  FACTORS.forEach((factor, j) => { fill(row[3 * j], without.all[j], factor), fill(row[3 * j + 1], run.after[j], factor); });
  if (!run.force) return;
  const own = forces[forces.length - 1] = newRow(run, forceBody, 3), omega = residualForce(run.force, run.base);
  run.pictures = new ForcePictures(run);
  gallery.append(...run.pictures.figures);
  run.pictures.draw(omega, "before");
  AXES.forEach((_, j) => { fill(own[3 * j], rms(omega, j), 1), fill(own[3 * j + 1], run.force.after[j], 1); });
}

// Predicts all runs by the ticked values, and shows what that gives.
function update() {
  const began = performance.now();
  answers().forEach((found, k) => {
    const run = bench.runs[k];
    run.now.setAttribute("d", lines(run, found.poses));
    const finite = [...found.position, ...first[k].position].filter(Number.isFinite), most = Math.max(...finite, 1e-9);
    run.errors.setAttribute("d", stairs(found.position, most));
    run.firstErrors.setAttribute("d", stairs(first[k].position, most));
    run.most.textContent = shown(1e3 * most);
    FACTORS.forEach((factor, j) => fill(cells[k][3 * j + 2], found.all[j], factor));
    if (!run.force) return;
    const omega = residualForce(run.force, parameters(run, k));
    run.pictures.draw(omega, "now");
    AXES.forEach((_, j) => fill(forces[k][3 * j + 2], rms(omega, j), 1));
  });
  at("results").dataset.milliseconds = (performance.now() - began).toFixed(2);
}
