// What stands beside the view: what is shown, the section box, and the joints of a robot.

/** The switches of what is shown; only of what the result has. */
function classPanel(scene) {
  const { robots, cloud } = scene;
  const with_ = (verdict) => robots.filter((r) => r.tree && r.entry.verdict === verdict).length;
  const things = changes?.things || [];
  const n = {
    unknown: cloud.blocks.some((b) => b.owner === -2), trusted: with_("trusted"),
    doubtful: with_("doubtful"), hanging: robots.some((r) => Number.isInteger(r.body?.hanging)),
    before: robots.filter((r) => r.before).length, scanner: data.scanners.length,
    gone: things.filter((t) => t.then).length, came: things.filter((t) => t.now).length,
  };
  const rows = Object.entries(LOOKS).map(([key, look]) => {
    const many_ = look.kind ? data.n_points[look.kind] : n[key];
    if (!many_) return null;
    return toggle(look.name, look, many_ === true ? "" : many(many_), () => scene.view.wake());
  });
  const labels = { on: true };
  const row = toggle("Names", labels, "", () => {
    scene.view.withLabels = labels.on;
    scene.view.wake();
  });
  $("classes").replaceChildren(...rows.filter(Boolean), row);
}

function toggle(name, look, count, done) {
  const box = el("input", { type: "checkbox", onchange: () => { look.on = box.checked; done(); } });
  box.checked = look.on;
  const swatch = el("span", { class: "swatch" });
  if (look.color) swatch.style.background = `rgb(${look.color.map((v) => Math.round(255 * v)).join()})`;
  return el("label", { class: "toggle" }, box, look.color ? swatch : null, name,
    el("small", {}, count));
}

/** Six sliders for the sides of the section box, in the coordinates of the plant. */
function sectionPanel(scene) {
  const { drawing, view: eyes } = scene;
  const [low, high] = eyes.bounds;
  const start = { low: [...low], high: [high[0], high[1], eyes.ceiling()] };
  const inputs = [];
  const apply = () => {
    const box = { color: [1, 1, 1], on: scene.boxShown };
    scene.sectionLines.look = box;
    scene.sectionLines.lines = boxLines(drawing.low, drawing.high);
    eyes.wake();
  };
  const slider = (axis, isHigh) => {
    const side = isHigh ? drawing.high : drawing.low;
    const name = `${"xyz"[axis]} ${isHigh ? "to" : "from"}`;
    const out = el("output", {});
    const input = el("input", { type: "range", min: low[axis], max: high[axis], step: "any",
      "aria-label": `Section box, ${name}, metres`, oninput: () => set(Number(input.value), true) });
    const set = (value, isMoved) => {
      side[axis] = value;
      out.textContent = `${fixed(value + view.origin[axis], 2)} m`;
      if (!isMoved) input.value = value;
      scene.boxShown ||= isMoved;
      apply();
    };
    inputs.push((all) => set((isHigh ? all.high : all.low)[axis], false));
    return el("div", { class: "slider" }, el("span", {}, name), out, input);
  };
  const sliders = [0, 1, 2].flatMap((axis) => [slider(axis, false), slider(axis, true)]);
  const setAll = (all) => { scene.boxShown = false; inputs.forEach((set) => set(all)); };
  const note = start.high[2] < high[2]
    ? el("p", {}, "What stands above the robots is cut away at first.") : null;
  $("section").replaceChildren(...[note, ...sliders, el("div", { class: "row" },
    el("button", { type: "button", onclick: () => setAll(start) }, "As at first"),
    el("button", { type: "button", onclick: () => setAll({ low, high }) }, "Everything"),
    el("button", { type: "button", onclick: () => {
      if (scene.chosen) setAll(around(scene.chosen, low, high));
    } }, "About the robot"))].filter(Boolean));
  setAll(start);
}

/** A box about what a robot may reach. */
function around(robot, low, high) {
  const at = robot.poses ? robot.poses.map((m) => m.slice(12, 15)) : [robot.base.slice(12, 15)];
  return {
    low: low.map((v, k) => Math.max(v, Math.min(...at.map((p) => p[k])) - 1.2)),
    high: high.map((v, k) => Math.min(v, Math.max(...at.map((p) => p[k])) + 1.2)),
  };
}

/** The chosen robot with a slider for each joint. */
function jointPanel(scene, robot) {
  scene.chosen = robot;
  scene.view.chosen = robot;
  const standing = scene.robots.filter((r) => r.entry.verdict !== "refused");
  if (!robot) {
    $("joints").replaceChildren(el("p", {}, "No robot stands there."));
    return;
  }
  const select = el("select", { "aria-label": "Robot", onchange: () => {
    const next = scene.robots[Number(select.value)];
    jointPanel(scene, next);
    scene.view.focus(next);
  } }, standing.map((r) => el("option", { value: r.at, selected: r === robot },
    `${r.entry.id} ${r.entry.model}`)));
  const names = robot.tree ? jointNames(robot) : [];
  const rows = names.map((name) => jointSlider(scene, robot, name));
  const update = () => rows.forEach((row) => row.update());
  const open = robot.tree?.loops.length === 0 && Object.keys(robot.entry.passive || {})
    .some((name) => !robot.tree.joints[robot.index.get(name)]?.mimic);
  $("joints").replaceChildren(...[
    el("div", { class: "row" }, select,
      el("button", { type: "button", onclick: () => scene.view.focus(robot) }, "Show"),
      el("button", { type: "button", onclick: () => {
        resetJoints(robot);
        update();
        scene.view.wake();
      } }, "As found")),
    el("p", {}, el("span", { class: `badge ${robot.entry.verdict}` }, robot.entry.verdict), " ",
      el("a", { href: `#robot-${robot.at + 1}`, onclick: () => openRobot(robot.at) }, "all of it")),
    open ? el("p", {}, "Its closed loops do not follow: the robot library was not at hand.") : null,
    robot.tree ? null : el("p", {}, "The result holds no model of it."),
    ...rows.map((row) => row.node)].filter(Boolean));
  scene.view.wake();
}

function jointSlider(scene, robot, name) {
  const j = robot.index.get(name);
  const slides = slidesOf(robot, name);
  const [low, high] = limitsOf(robot, name) || [robot.found[j] - 1, robot.found[j] + 1];
  const out = el("output", {});
  const input = el("input", { type: "range", step: "any", min: Math.min(low, robot.found[j]),
    max: Math.max(high, robot.found[j]), "aria-label": `Joint ${shown(name)} of ${robot.entry.id}`,
    oninput: () => {
      setJoint(robot, name, Number(input.value));
      update();
      scene.view.wake();
    } });
  const update = () => {
    const isMoved = robot.values[j] !== robot.found[j];
    out.textContent = isMoved ? say(robot.values[j], slides)
      : `${say(robot.values[j], slides)} ± ${saySigma(robot.entry.sigma[name], slides)}`;
    out.classList.toggle("moved", isMoved);
    if (Number(input.value) !== robot.values[j]) input.value = robot.values[j];
    input.setAttribute("aria-valuetext", out.textContent);
  };
  update();
  return { node: el("div", { class: "slider" }, el("span", {}, name), out, input), update };
}
