// Shows that the comparison of pictures can fail: breaks the page of a result in one way after the
// other, and says which check finds it. Ends with 1 if one stays unnoticed.
//
//   NODE_PATH=DIR/node_modules CHROMIUM=/usr/bin/chromium node scripts/report_breaks.mjs OUT/report.html OUT/result.json [PART OF A NAME]
import { createHash } from "node:crypto";
import { createRequire } from "node:module";
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { pathToFileURL } from "node:url";
import { Pictures, ground, rest } from "./report_pictures.mjs";

const require = createRequire(join(process.env.NODE_PATH || ".", "x.js"));
const { chromium } = require("playwright-core");

/** What is broken, the text of the page, and what stands there instead. */
const BREAKS = [
  ["nothing is broken", "", ""],
  ["a switch does nothing", "look.on = box.checked; done();", "done();"],
  ["hiding the floor hides what is fixed, too", "!looks.some((i) =>", "!looks.every((i) =>"],
  ["attached points are drawn as robots", "isRobot ? 4 + (tag & 1) : tag", "isRobot ? 4 : tag"],
  ["the legend has other colours", "rgb(${look.color.map(", "rgb(${[...look.color].reverse().map("],
  ["names stay when they are switched off", "scene.view.withLabels = labels.on;", ""],
  ["names lie over one another", "&& !taken.some(", "&& ![].some("],
  ["names lie over the buttons", "(x + half < buttons.left || y - 14 > buttons.bottom)", "true"],
  ["turning back goes on", "this.yaw -= dx * 0.006", "this.yaw -= Math.abs(dx) * 0.006"],
  ["the view is not brought back", "this.turnTo(-0.9, 0.72, true);", "this.turnTo(-0.9, 0.72);"],
  ["a click chooses another robot", "this.onChoose?.(robot, false)", "this.onStep?.(1)"],
  ["a joint moves all robots", "setJoint(robot, name, Number(input.value));",
    "scene.robots.forEach((r) => r.index?.has(name) && setJoint(r, name, Number(input.value)));"],
  ["a joint moves the next robot", "setJoint(robot, name, Number(input.value));",
    "setJoint(scene.robots[(robot.at + 1) % scene.robots.length], name, Number(input.value));"],
  ["a robot's points stay where they were", "p.xyz = vec3(dot(u_links[l], p)", "p.xyz = p.xyz + 0.0 * vec3(dot(u_links[l], p)",
    "const isMoved = robot?.tree && robot.poses !== robot.foundPoses;\n      const clips", "const isMoved = false;\n      const clips"],
  ["\"As found\" leaves the posture", "resetJoints(robot);", ""],
  ["the section box cuts nothing", "side[axis] = value;", ""],
  ["no dark colours", "@media (prefers-color-scheme: dark)", "@media (prefers-color-scheme: none)"],
];

/** The page with texts replaced, and with the digests of its changed script and style. */
function broken(html, [, ...pairs]) {
  let [style] = html.split("<style>")[1].split("</style>");
  const at = html.lastIndexOf("<script>") + 8;
  let script = html.slice(at, html.indexOf("</script>", at));
  const before = [style, script];
  for (let i = 0; i < pairs.length; i += 2) {
    const [from, to] = pairs.slice(i, i + 2);
    if (!(style + script).includes(from)) throw new Error(`the page does not have "${from}"`);
    [style, script] = [style, script].map((text) => text.replace(from, () => to));
  }
  const digest = (text) => `'sha256-${createHash("sha256").update(text).digest("base64")}'`;
  const head = html.slice(0, at).replace(before[0], () => style)
    .replace(digest(before[0]), () => digest(style)).replace(digest(before[1]), () => digest(script));
  return head + script + html.slice(at + before[1].length);
}

const [page_, result_, only = ""] = process.argv.slice(2);
const [html, result] = [readFileSync(page_, "utf8"), JSON.parse(readFileSync(result_, "utf8"))];
const folder = mkdtempSync(join(tmpdir(), "report_breaks"));
const browser = await chromium.launch({ executablePath: process.env.CHROMIUM || "/usr/bin/chromium",
  args: ["--no-sandbox", "--enable-unsafe-swiftshader", "--disable-gpu"] });
let unnoticed = 0;
for (const one of BREAKS.filter(([what], i) => i === 0 || what.includes(only))) {
  const file = join(folder, "report.html");
  writeFileSync(file, broken(html, one));
  const context = await browser.newContext({ viewport: { width: 1280, height: 800 }, colorScheme: "dark", offline: true });
  const page = await context.newPage();
  page.setDefaultTimeout(20_000);
  const found = [];
  const check = (isRight, what, detail = "") => isRight || found.push(`${what} (${detail})`);
  try {
    await page.goto(pathToFileURL(file).href);
    await page.waitForFunction(() => document.documentElement.dataset.state === "ready");
    await rest(page);
    await ground(page, "dark", check);
    await new Pictures(page, "1280", result, check).all();
  } catch (error) {
    if (!browser.isConnected()) throw error;
    found.push(String(error).split("\n")[0]);
  }
  await context.close();
  const isRight = (found.length > 0) === (one !== BREAKS[0]);
  unnoticed += !isRight;
  console.log(`${isRight ? "ok    " : "FAILED"} ${one[0]}: ${found.length} found; ${found.slice(0, 2).join("; ")}`);
}
await browser.close();
rmSync(folder, { recursive: true });
console.log(unnoticed ? `${unnoticed} unnoticed` : "all are noticed");
process.exit(unnoticed ? 1 : 0);
