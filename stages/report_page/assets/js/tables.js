// The tables: robots with their joints, what changed, and how the run went.

const cell = (text, cls) => el("td", { class: cls }, text);
const badge = (word) => el("span", { class: `badge ${word}` }, word);
const percent = (share) => Number.isFinite(share) ? `${fixed(100 * share, 0)}\u00a0%` : "unknown";
const millimetres = (v) => Number.isFinite(v) ? `${fixed(1e3 * v, 1)}\u00a0mm` : "unknown";

function table(caption, heads, rows) {
  const head = heads.map((h) => el("th", { scope: "col",
    class: h.startsWith("#") ? "num" : null }, h.replace("#", "")));
  return el("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": caption },
    el("table", {}, el("caption", {}, caption), el("thead", {}, el("tr", {}, head)),
      el("tbody", {}, rows)));
}

const pairs = (list) => el("dl", { class: "pairs" }, list.filter(([, value]) => value !== null
  && value !== undefined).map(([name, value]) => [el("dt", {}, name), el("dd", {}, value)]));

/** Value, deviation and limits of a joint as a bar; the numbers stand beside it. */
function bar(limits, value, sigma, was) {
  if (!limits) return null;
  const [low, high] = [Math.min(limits[0], value), Math.max(limits[1], value)];
  const x = (v) => 100 * (v - low) / (high - low || 1);
  const [from, to] = [clamp(x(value - 2 * sigma), 0, 100), clamp(x(value + 2 * sigma), 0, 100)];
  return el("svg", { class: "bar", viewBox: "-2 0 104 18", preserveAspectRatio: "none",
    "aria-hidden": "true" },
  el("rect", { class: "track", x: 0, y: 6, width: 100, height: 6 }),
  el("rect", { class: "sigma", x: from, y: 3, width: Math.max(0.5, to - from), height: 12 }),
  Number.isFinite(was) ? el("line", { class: "was", x1: x(was), x2: x(was), y1: 1, y2: 17 }) : null,
  el("rect", { class: "at", x: x(value) - 0.7, y: 1, width: 1.4, height: 16 }));
}

/** The standard deviation of a base's place: the largest of its axes. */
const worst = (three) => Math.max(...three.map((v) => v ?? NaN));

function robotsSection(scene) {
  const { robots } = scene;
  const of = (word) => robots.filter((r) => r.entry.verdict === word).length;
  const said = ["trusted", "doubtful", "refused"].filter(of).map((w) => `${of(w)} ${w}`);
  const rows = robots.map((robot) => {
    const { entry } = robot;
    const open = Object.values(entry.certainty || {}).filter((c) => c !== "determined").length;
    const link = el("a", { href: `#robot-${robot.at + 1}`, onclick: () => openRobot(robot.at) },
      entry.id);
    const row = el("tr", {}, el("th", { scope: "row" }, link), cell(entry.model), cell(badge(entry.verdict)),
      cell(entry.base_pose.xyz.map((v) => fixed(v, 3)).join(", "), "num"),
      cell(open ? `${open} of ${Object.keys(entry.joints).length} not well known` : "all determined"),
      cell(fixed(entry.score, 2), "num"), cell(millimetres(entry.rms), "num"),
      cell(el("button", { type: "button", class: "no-print", onclick: () => {
        scene.show(robot);
        $("scene").scrollIntoView({ block: "start" });
      }, "aria-label": `Show ${entry.id} in 3D` }, "Show")));
    row.robot = robot;
    return row;
  });
  const search = el("input", { type: "search", placeholder: "Name or model",
    "aria-label": "Filter robots by name or model", oninput: () => filter() });
  const verdict = el("select", { "aria-label": "Filter robots by verdict", onchange: () => filter() },
    ["all verdicts", "trusted", "doubtful", "refused"].map((w) => el("option", {}, w)));
  const left = el("span", { role: "status" });
  const filter = () => {
    const words = search.value.toLowerCase();
    let n = 0;
    for (const row of rows) {
      const { entry } = row.robot;
      const fits = `${entry.id} ${entry.model}`.toLowerCase().includes(words)
        && (verdict.selectedIndex === 0 || verdict.value === entry.verdict);
      row.hidden = !fits;
      $(`robot-${row.robot.at + 1}`).hidden = !fits;
      n += fits;
    }
    left.textContent = n < rows.length ? `${n} of ${rows.length}` : "";
  };
  $("robots").append(...[
    el("h2", { id: "robots-title" }, `Robots: ${said.join(", ") || "none"}`),
    robots.length > 4 ? el("div", { class: "row no-print" }, search, verdict, left) : null,
    table("Robots. Places are those of their bases, metres.",
      ["Robot", "Model", "Verdict", "#x, y, z [m]", "Joints", "#Score", "#Rms", "In 3D"], rows),
    ...robots.map((robot) => robotDetails(scene, robot))].filter(Boolean));
}

function openRobot(at) {
  const details = $(`robot-${at + 1}`);
  details.hidden = false;
  details.open = true;
}

/** All about one robot; made when it is opened, since a plant may have a hundred. */
function robotDetails(scene, robot) {
  const { entry } = robot;
  const body = el("div", {});
  const details = el("details", { class: "robot", id: `robot-${robot.at + 1}`, ontoggle: () => fill() },
    el("summary", {}, el("h3", {}, `${entry.id} ${entry.model}`), badge(entry.verdict),
      el("span", { class: "where" }, `at ${place(entry.base_pose.xyz)} m`)), body);
  const fill = () => {
    if (!details.open || body.firstChild) return;
    body.append(...robotBody(scene, robot));
  };
  details.fill = () => { details.open = true; fill(); };
  details.open = scene.robots.length <= 3;
  if (details.open) body.append(...robotBody(scene, robot));
  return details;
}

function robotBody(scene, robot) {
  const { entry } = robot;
  const sigma = entry.base_sigma;
  const picture = pictures[entry.id];
  const lines = [
    ["Verdict", [badge(entry.verdict), " ", { trusted: "right as far as the points can tell",
      doubtful: "may be right: a person should look at it",
      refused: "wrong, gone or another robot; it labels no points" }[entry.verdict] || ""]],
    ["Base", `${place(entry.base_pose.xyz, 4)} m, ± ${millimetres(worst(sigma.xyz))}; turned by ${
      turnWords(entry.base_pose.quat_wxyz)}, ± ${saySigma(worst(sigma.rotation), false)}`],
    ["Tip", Number.isFinite(entry.tip_sigma) && entry.tip
      ? `${place(entry.tip.pose.xyz, 4)} m, ± ${millimetres(entry.tip_sigma)} from the base` : null],
    ["Score", `${fixed(entry.score, 3)}: share of its surface that is explained less the share that `
      + "is contradicted"],
    ["Its points", `${millimetres(entry.rms)} (rms) from its surface`],
    ["Next best", runnerUp(entry)],
    ["Equal postures", entry.equals?.length ? `${counted(entry.equals.length, "other posture")} `
      + "explain the points as well" : null],
    ["Alike", entry.alike?.length ? `the points fit these models as well: ${entry.alike.join(", ")}`
      : null],
    ["Tool", entry.tool ? `${entry.tool.model} on ${entry.tool.link}, turned by ${
      say(entry.tool.mount, false)}` : null],
    ["In scans", entry.stands_in?.length ? `${entry.stands_in.join(", ")}; it moved between scans`
      : null],
    ["Space within reach", entry.space ? `${fixed(entry.space.free_m3, 1)} m³ free, ${
      fixed(entry.space.unknown_m3, 1)} m³ unseen` : "not computed"],
    ["Files", robot.body ? [el("code", {}, `robots/${entry.id}/robot.urdf`), ...(picture ? [] : [", ",
      el("a", { href: `pictures/${entry.id}_evidence.png` }, "residuals in colour, by views")])] : null],
  ];
  const why = entry.reasons?.length
    ? [el("h4", {}, entry.verdict === "trusted" ? "Notes" : "Why"),
      el("ul", { class: "reasons" }, entry.reasons.map((r) => el("li", {}, r)))]
    : [el("p", {}, "No remarks.")];
  return [
    el("div", { class: "cols" }, el("div", {}, pairs(lines)), el("div", {}, why, review(entry))),
    el("h4", {}, "Joints"), jointTable(robot),
    picture ? el("details", { class: "residuals" },
      el("summary", {}, "Residuals in colour, by views"),
      el("img", { src: `data:image/png;base64,${picture}`, alt: `${entry.id} from several sides, its points`
        + " in the colours of their distances from its surface. The table of links has numbers." })) : [],
    ...(entry.stays || []).map((stay) => [el("h4", {}, `In scans ${stay.stands_in.join(", ")}: ${
      stay.verdict}`), jointTable({ ...robot, entry: { ...entry, ...stay } })]).flat(),
    el("h4", {}, "Evidence by link"),
    table(`What the scans say about each link of ${entry.id}`,
      ["Link", "#Seen", "#Matched", "#Contradicted", "#Points", "#Rms"],
      (entry.evidence || []).map((e) => el("tr", {}, el("th", { scope: "row" }, e.link),
        cell(percent(e.seen), "num"), cell(percent(e.matched), "num"),
        cell(percent(e.violated), "num"), cell(many(e.n_points), "num"),
        cell(e.n_points ? millimetres(e.rms) : "", "num")))),
  ].flat();
}

/** A rotation as its angle about the vertical, and how far it leans. */
function turnWords([w, i, j, k]) {
  const yaw = Math.atan2(2 * (w * k + i * j), 1 - 2 * (j * j + k * k));
  const lean = Math.acos(clamp(1 - 2 * (i * i + j * j), -1, 1));
  return `${say(yaw, false)} about z${lean > 0.002 ? `, leaning ${say(lean, false)}` : ""}`;
}

function runnerUp(entry) {
  const next = entry.runner_up;
  if (!next) return "nothing else came near";
  const what = next.same_model ? "the same model in another posture" : `model ${next.model}`;
  const clear = !Number.isFinite(next.margin) ? "" : next.margin > 0.5 ? "; beams clearly prefer this one"
    : next.margin > 0.1 ? "; beams prefer this one" : "; beams hardly tell them apart";
  return `${what}, score ${fixed(next.score, 3)}${clear}${Number.isFinite(next.margin)
    ? ` (margin ${fixed(next.margin, 2)})` : ""}`;
}

function jointTable(robot) {
  const { entry } = robot;
  const rows = jointNames(robot).map((name) => {
    const slides = slidesOf(robot, name);
    const limits = limitsOf(robot, name);
    const [value, sigma] = [entry.joints[name], entry.sigma[name]];
    const word = entry.certainty?.[name]
      ?? (entry.determined?.[name] === false ? "undetermined" : "determined");
    const others = entry.equivalents?.[name];
    return el("tr", {}, el("th", { scope: "row" }, name),
      cell(say(value, slides), "num"), cell(`± ${saySigma(sigma, slides)}`, "num"), cell(badge(word)),
      cell(bar(limits, value, sigma)),
      cell(limits ? `${say(limits[0], slides)} to ${say(limits[1], slides)}` : "none", "num"),
      cell(others ? others.map((v) => say(v, slides)).join(", ") : "", "num"));
  });
  const passive = Object.entries(entry.passive || {}).map(([name, value]) => el("tr", {},
    el("th", { scope: "row" }, name), cell(say(value, slidesOf(robot, name)), "num"), cell("", "num"),
    cell("follows"), cell(""), cell(""), cell("")));
  return table(`Joints of ${entry.id} within their limits`,
    ["Joint", "#Value", "#Deviation", "Known", "Within limits", "#Limits", "#Same posture at"],
    [...rows, ...passive]);
}

/** Lines for a review file, with a button that copies them. */
function review(entry) {
  const at = entry.base_pose.xyz.map((v) => fixed(v, 3)).join(", ");
  const text = `[[robot]]\nat = [${at}]\nmodel = ${JSON.stringify(entry.model)}\nverdict = "${
    entry.verdict === "refused" ? "reject" : "accept"}"`;
  const said = el("span", { role: "status" });
  const copy = async () => {
    try {
      await navigator.clipboard.writeText(text + "\n");
      said.textContent = "copied";
    } catch {
      getSelection().selectAllChildren(lines);
      said.textContent = "selected: copy with Ctrl+C";
    }
  };
  const lines = el("pre", { tabindex: 0, "aria-label": `Review lines of ${entry.id}` });
  lines.textContent = text;
  return [el("h4", {}, "For a review file (run --review FILE)"), lines,
    el("div", { class: "row no-print" }, el("button", { type: "button", onclick: copy }, "Copy"), said)];
}

function changesSection(scene) {
  if (!changes) return;
  const words = { same: "as it stood", moved: "moved", exchanged: "another model", appeared: "new",
    gone: "gone" };
  const joints = changes.robots.flatMap((change) => change.joints.filter((j) => j.is_change)
    .map((j) => ({ ...j, robot: change.now || change.then })));
  const rows = changes.robots.map((change) => {
    const shift = change.base_shift;
    const by = shift && change.change.kind !== "same"
      ? `${place(shift.map((v) => 1e3 * v), 1)} mm, ${say(change.base_turn, false)}` : "";
    return el("tr", {}, el("th", { scope: "row" }, change.now || change.then), cell(change.model),
      cell([words[change.change.kind] || change.change.kind,
        change.change.was ? `, was ${change.change.was}` : "",
        change.was_missed ? " (the earlier result had missed it)" : ""]),
      cell(by), cell((change.verdicts || []).map((v) => v || "–").join(" → ")),
      cell(change.not_compared.join(", ")));
  });
  const jointRows = joints.map((j) => {
    const robot = scene.robots.find((r) => r.entry.id === j.robot);
    const limits = robot?.index?.has(j.joint) ? limitsOf(robot, j.joint) : null;
    return el("tr", {}, el("th", { scope: "row" }, `${j.robot} ${j.joint}`),
      cell(`${say(j.then[0], j.slides)} ± ${saySigma(j.then[1], j.slides)}`, "num"),
      cell(`${say(j.now[0], j.slides)} ± ${saySigma(j.now[1], j.slides)}`, "num"),
      cell(say(j.change, j.slides), "num"), cell(bar(limits, j.now[0], j.now[1], j.then[0])));
  });
  const movedBy = ({ shift, motion, shift_unknown: unknown }) => {
    if (!shift) return unknown ? `unknown: ${unknown}` : "";
    if (!motion) return place(shift, 2);
    const turn = motion.turn_deg === null ? "" : `, turned by ${fixed(motion.turn_deg, 1)}°`;
    return `${place(shift)} ± ${place(motion.sigma)}${turn}`;
  };
  const things = changes.things.map((thing, k) => {
    const [low, high] = thing.now || thing.then;
    return el("tr", {}, el("th", { scope: "row" }, `T${k + 1}`), cell(thing.change),
      cell(minus(high, low).map((v) => fixed(v, 2)).join(" × "), "num"),
      cell(place(low.map((v, i) => (v + high[i]) / 2), 2), "num"),
      cell(movedBy(thing), "num"));
  });
  const unseen = changes.fixed_not_compared || [];
  const frame = changes.frame
    ? `The new scans are in another frame, ${changes.frame.by}.` : "";
  $("changes").hidden = false;
  $("changes").append(...[
    el("h2", { id: "changes-title" }, "What changed"),
    el("p", {}, `Compared with ${changes.base}. ${frame}`),
    table("Robots of the cell, before and now",
      ["Robot", "Model", "Now", "Base moved by", "Verdicts", "Not compared"], rows),
    joints.length ? [el("h3", {}, "Joints that moved"),
      table("Joints that moved; in the bar the red line is where it stood",
        ["Joint", "#Before", "#Now", "#Change", "Within limits"], jointRows)] : null,
    el("h3", {}, "Other things"),
    changes.things.length ? table("Things that are new, gone or moved; metres",
      ["Thing", "Change", "#Size [m]", "#Middle [m]", "#Moved by [m]"], things)
      : el("p", {}, "Nothing else changed as far as the new scans show."),
    unseen.length ? el("p", {}, `${counted(unseen.length, "place")} of what stands still could not be `
      + `compared: no new beam got there. The largest is ${fixed(unseen[0].volume_m3, 2)} m³ at ${
        place(unseen[0].bounds[0].map((v, i) => (v + unseen[0].bounds[1][i]) / 2), 1)} m.`) : null,
    changes.not_compared?.length ? el("p", {}, `Robots that the new scans hardly see: ${
      changes.not_compared.join(", ")}.`) : null].flat().filter(Boolean));
}

function runSection() {
  const { inputs, stages, warnings, review: entries, rescan } = result;
  const n = data.n_points;
  const all = Object.values(n).reduce((sum, v) => sum + v, 0);
  const words = { fixed: "fixed", floor: "floor", link: "robots", attachment: "attached to robots",
    uncertain: "uncertain, counts as fixed" };
  const kinds = Object.keys(words).filter((kind) => n[kind]).map((kind) => el("tr", {},
    el("th", { scope: "row" }, words[kind]), cell(many(n[kind]), "num"),
    cell(`${fixed(100 * n[kind] / all, 2)}\u00a0%`, "num")));
  const said = { ingest: "inputs read → points", cluster: "points → bodies above the floor",
    fit: "bodies → robots", label: "points → points that move" };
  $("run").append(...[
    el("h2", { id: "run-title" }, "How the run went"),
    data.is_partial ? el("p", { class: "note" }, "Parts were left out: see the warnings.") : null,
    warnings.length ? el("ul", { class: "warnings note" }, warnings.map((w) => el("li", {}, w)))
      : el("p", {}, "No warnings."),
    entries?.length ? [el("h3", {}, "Review"), table("What the review file did",
      ["Entry", "Effect"], entries.map((e) => el("tr", {}, el("th", { scope: "row" }, e.entry),
        cell([e.did, e.needs_look ? " – look at it again" : ""]))))] : null,
    el("h3", {}, "Inputs"),
    table("Files that were read",
      ["File", "Format", "#Size", "#Scans", "#Points", "#Dropped", "Unit", "Notes"],
      inputs.map((input) => el("tr", {}, el("th", { scope: "row", class: "path" }, input.path), cell(input.format),
        cell(`${fixed(input.n_bytes / 1e6, 1)}\u00a0MB`, "num"), cell(input.n_scans, "num"),
        cell(many(input.n_points), "num"), cell(many(input.n_dropped), "num"),
        cell(input.units?.text || ""), cell((input.notes || []).join("; "))))),
    rescan?.scans?.length ? [el("h3", {}, "Registration of the new scans"), table(
      "How far each new scan was off, at the middle of the cell",
      ["Scan", "#Shift", "#Rms before", "#Rms after"],
      rescan.scans.map((s) => el("tr", {}, el("th", { scope: "row" }, s.scan),
        cell(`${place(s.shift.map((v) => 1e3 * v), 2)} mm`, "num"), cell(millimetres(s.rms[0]), "num"),
        cell(millimetres(s.rms[1]), "num"))))] : null,
    el("div", { class: "cols" },
      kinds.length ? el("div", {}, el("h3", {}, "Points"), table("Points of the plant by class",
        ["Class", "#Points", "#Share"], kinds)) : null,
      el("div", {}, el("h3", {}, "Stages"), table("What went into each stage, and what came out",
        ["Stage", "What", "#In", "#Out"], stages.map((s) => el("tr", {}, el("th", { scope: "row" }, s.name),
          cell(said[s.name] || ""), cell(many(s.n_in), "num"), cell(many(s.n_out), "num")))))),
    data.run.length ? [el("h3", {}, "Times, rates and memory"), table("What the run took",
      ["Of", "What"], data.run.map(([about, words]) => el("tr", {},
        el("th", { scope: "row" }, about.trim()), cell(words.trim()))))]
      : el("p", {}, "Times, rates, memory and what was used again differ from run to run: ",
        el("code", {}, "stillpoint report OUT"), " prints them, and ",
        el("code", {}, "report OUT --page FILE"), " makes a page with them."),
    data.summary ? el("details", {}, el("summary", {}, "Summary as on the terminal"),
      el("pre", {}, data.summary.split("\n").map((line) => [line, el("br")]))) : null,
  ].flat().filter(Boolean));
}
