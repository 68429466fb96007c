// Ticks, sliders and buttons, and the start of all.

// Shows the value of a slider.
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

// Sets all values to those of the learned model, and ticks some choices.
function reset(ticked) {
  for (const s of bench.sliders) s.value = s.after, s.choice.ticked = ticked(s.choice), s.choice.tick.checked = s.choice.ticked, show(s);
  update();
}

function fitTicked() {
  const moved = bench.sliders.filter((s) => s.choice.ticked).length;
  if (!moved) return say("Nothing is ticked.");
  const seconds = fit();
  update();
  return say(`Fitted ${moved} values to the training runs in ${shown(seconds, 2)} s.`);
}

// The model as it is ticked, as a file of SSP 1.0: that of the learned model with other values.
function modelFile() {
  const xml = new DOMParser().parseFromString(bench.data.model, "application/xml"), root = xml.documentElement;
  root.setAttribute("description", "Changed in the page of a report: not checked for soundness");
  const given = new Map([...root.firstElementChild.children].map((element) => [element.getAttribute("name"), element]));
  for (const s of bench.sliders.filter((each) => each.run < 0)) {
    const element = given.get(`${s.part}.${s.name}`), value = s.choice.ticked ? s.value : s.before;
    if (value === s.nominal) element.remove();
    else element.firstElementChild.setAttribute("value", value);
  }
  return new XMLSerializer().serializeToString(xml);
}

function save() {
  const link = made("a", { download: "model.ssv", href: URL.createObjectURL(new Blob([modelFile()], { type: "application/xml" })) });
  link.click();
  URL.revokeObjectURL(link.href);
  say("Saved as model.ssv, not checked for soundness.");
}

function button(text, action) {
  const element = made("button", { type: "button" }, text);
  element.addEventListener("click", action);
  return element;
}

// Where a reader gives runs of his own.
function ownRunBox() {
  const input = made("input", { type: "file", accept: ".csv", multiple: "" }), section = document.getElementById("what-if");
  input.addEventListener("change", () => own(input.files));
  section.addEventListener("dragover", (event) => event.preventDefault());
  section.addEventListener("drop", (event) => { event.preventDefault(), own(event.dataTransfer.files); });
  return made("label", { class: "file" }, "Compare your own run (CSV, or drop it here): ", input,
    made("small", {}, ` columns time, x, y, psi, ${bench.data.csv.columns.join(", ")} in SI units`));
}

function controls({ choices, csv, model }) {
  const effects = choices.filter((c) => c.effect), rest = choices.filter((c) => !c.effect);
  const learned = new Map(choices.map((choice) => [choice, choice.ticked]));
  return [
    ...effects.map(choiceBox),
    ...(rest.length ? [made("details", {}, made("summary", {}, `Coefficients of the ship (${rest.length})`), ...rest.map(choiceBox))] : []),
    button("Initial model", () => reset(() => false)), button("Learned model", () => reset((c) => learned.get(c))),
    button("Fit this", fitTicked), ...(model ? [button("Save model.ssv", save)] : []), ...(csv ? [ownRunBox()] : []),
  ];
}

async function changeTheModel() {
  await load(at("data").textContent);
  const { data, runs } = bench;
  at("controls").append(...controls(data));
  at("results").append(table(["position [mm]", "heading [°]"], body),
    ...(runs.some((run) => run.force) ? [table(AXES.map((axis) => `residual force ${axis}`), forceBody)] : []), legend(), gallery);
  runs.forEach(added);
  update();
  say("");
}

document.getElementById("what-if-open").addEventListener("toggle", () => {
  changeTheModel().catch((error) => say(`The page cannot compute the model here: ${error.message}`));
}, { once: true });
