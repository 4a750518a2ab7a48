// Puts the page together: tables first, then the view, so that tables are there whatever happens.

const robots = result.robots.map(makeRobot);
for (const robot of robots) robot.before = posesBefore(robot);
const scene = { robots, view: null, chosen: null, boxShown: false, show: () => {} };

function headline() {
  const of = (word) => robots.filter((r) => r.entry.verdict === word).length;
  const all = Object.values(data.n_points).reduce((sum, v) => sum + v, 0);
  const parts = [counted(robots.length - of("refused"), "robot"),
    of("doubtful") && `${of("doubtful")} doubtful`, counted(data.scanners.length, "scan"),
    all && counted(all, "point"), result.rescan && "a cell scanned again",
    result.warnings.length && counted(result.warnings.length, "warning")];
  $("facts").textContent = parts.filter(Boolean).join(" · ");
  const links = [["#scene", "3D"], ["#robots", "Robots"], changes && ["#changes", "What changed"],
    ["#run", "How the run went"]];
  $("nav").append(...links.filter(Boolean).map(([href, name]) => el("a", { href }, name)));
  $("foot").textContent = `Made by Stillpoint ${data.program} from result.json of version ${
    result.version}. Lengths are in metres unless another unit stands beside them; ± is one standard `
    + "deviation.";
}

/** Lines that the view draws: scanners, changed things, the section box. */
function lines() {
  const local = (p) => minus(p, view.origin);
  const scanners = data.scanners.flatMap(({ at }) => {
    const c = local(at);
    const ring = [0, 1, 2, 3].map((i) => plus(c, [0.18 * Math.cos(i * Math.PI / 2),
      0.18 * Math.sin(i * Math.PI / 2), 0]));
    const tips = [plus(c, [0, 0, 0.22]), plus(c, [0, 0, -0.22])];
    return ring.flatMap((p, i) => [p, ring[(i + 1) % 4], p, tips[0], p, tips[1]]);
  });
  const boxes = (key) => (changes?.things || []).flatMap((thing) => thing[key]
    ? boxLines(local(thing[key][0]), local(thing[key][1])) : []);
  scene.sectionLines = { look: { color: [1, 1, 1], on: false }, lines: [] };
  return [{ look: LOOKS.scanner, lines: scanners }, { look: LOOKS.gone, lines: boxes("then") },
    { look: LOOKS.came, lines: boxes("now") }, scene.sectionLines];
}

/** Whether graphics hardware draws. `#webgl` and `#software` at the end of the address choose. */
function hasHardware() {
  const gl = document.createElement("canvas").getContext("webgl2");
  if (!gl || location.hash === "#software") return false;
  const info = gl.getExtension("WEBGL_debug_renderer_info");
  const name = String(gl.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : gl.RENDERER));
  return location.hash === "#webgl" || !/swiftshader|llvmpipe|software|basic render/i.test(name);
}

async function start() {
  const bytes = await unpack();
  scene.cloud = decodePoints(bytes);
  const Drawing = hasHardware() ? Hardware : Software;
  scene.drawing = new Drawing($("canvas"), scene.cloud, decodeMeshes(bytes), robots);
  scene.drawing.boxes = lines();
  scene.view = new View(scene.drawing, robots);
  const standing = robots.filter((r) => r.entry.verdict !== "refused");
  scene.show = (robot) => {
    jointPanel(scene, robot);
    $("posing").open = true;
    scene.view.focus(robot);
  };
  scene.view.onChoose = (robot, isShown) => isShown ? scene.show(robot) : jointPanel(scene, robot);
  scene.view.onStep = (by) => {
    const at = standing.indexOf(scene.chosen);
    if (standing.length) scene.show(standing[(at + by + standing.length) % standing.length]);
  };
  classPanel(scene);
  sectionPanel(scene);
  jointPanel(scene, standing[0] || null);
  scene.view.chosen = null;
  const does = { home: () => scene.view.home(), top: () => scene.view.turnTo(-Math.PI / 2, 1.5, scene.view.isHome),
    front: () => scene.view.turnTo(-Math.PI / 2, 0.15, scene.view.isHome), in: () => scene.view.zoom(0.75),
    out: () => scene.view.zoom(1.33) };
  $("tools").addEventListener("click", (e) => does[e.target.dataset.do]?.());
}

headline();
robotsSection(scene);
changesSection(scene);
runSection();
window.addEventListener("beforeprint", () => {
  document.querySelectorAll("details.robot").forEach((details) => details.fill());
  if (scene.view) $("snapshot").src = $("canvas").toDataURL("image/jpeg", 0.85);
});
start().then(() => { document.documentElement.dataset.state = "ready"; }, (error) => {
  $("view").replaceChildren(el("p", { class: "note" }, `The 3D view cannot be shown: ${error.message}. `
    + "All results are in the tables below."));
  $("panel").hidden = true;
  document.documentElement.dataset.state = "no view";
});
