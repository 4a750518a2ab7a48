// Where the links of a robot are at any posture.

/** A robot of the result: its entry, its tree, and the posture that is shown. */
function makeRobot(entry, at) {
  const body = view.robots[at];
  const tree = body && view.trees[body.tree];
  const xyz = entry.base_pose.xyz.map((v, i) => v - view.origin[i]);
  const robot = { at, entry, body, tree, base: pose(xyz, entry.base_pose.quat_wxyz) };
  if (tree) {
    robot.index = new Map(tree.joints.map((joint, j) => [joint.name, j]));
    robot.found = tree.joints.map((joint) => entry.joints[joint.name]
      ?? entry.passive?.[joint.name] ?? 0);
    robot.values = [...robot.found];
    robot.foundPoses = poses(robot, robot.found);
    robot.poses = robot.foundPoses;
    robot.back = robot.foundPoses.map(inverse);
  }
  return robot;
}

/** Names of the free joints, in the order of the model. */
function jointNames(robot) {
  const names = Object.keys(robot.entry.joints);
  if (!robot.index) return names;
  return names.sort((a, b) => (robot.index.get(a) ?? 0) - (robot.index.get(b) ?? 0));
}

const slidesOf = (robot, name) => (robot.entry.slides || []).includes(name);
const limitsOf = (robot, name) => {
  const joint = robot.tree && robot.tree.joints[robot.index.get(name)];
  if (!joint) return null;
  return joint.limits || (joint.kind === "continuous" ? [-Math.PI, Math.PI] : null);
};

/** The motion of a joint at a value, in the frame of its parent link. */
function jointPose(joint, value) {
  const fixedPart = joint.pose ||= pose(joint.xyz, joint.quat_wxyz);
  if (joint.kind === "fixed" || value === 0) return fixedPart;
  if (joint.kind === "prismatic") {
    return times(fixedPart, pose(joint.axis.map((v) => v * value), [1, 0, 0, 0]));
  }
  const [c, s] = [Math.cos(value / 2), Math.sin(value / 2)];
  return times(fixedPart, pose([0, 0, 0], [c, ...joint.axis.map((v) => v * s)]));
}

/** Poses of all links, in the frame of the view. */
function poses(robot, values, base = robot.base) {
  const out = new Array(robot.tree.links.length).fill(base);
  robot.tree.joints.forEach((joint, j) => {
    out[joint.child] = times(out[joint.parent], jointPose(joint, values[j]));
  });
  return out;
}

/** Sets joints that follow others: by a factor, or in a closed loop. */
function follow(robot, values) {
  robot.tree.joints.forEach((joint, j) => {
    if (joint.mimic) {
      const [driver, factor, offset] = joint.mimic;
      values[j] = factor * values[driver] + offset;
    }
  });
  robot.tree.loops.forEach((loop) => closeLoop(robot, loop, values));
}

/** Newton's method from the values before, so that a loop keeps its branch. */
function closeLoop(robot, loop, values) {
  const { joints } = robot.tree;
  const first = loop.passive.find((j) => joints[j].kind !== "prismatic") ?? loop.passive[0];
  const gaps = () => {
    const at = poses(robot, values, identity());
    const axis = unit(turned(at[joints[first].child], joints[first].axis));
    const across = unit(cross(axis, Math.abs(axis[0]) < 0.9 ? [1, 0, 0] : [0, 1, 0]));
    const other = cross(axis, across);
    return loop.pins.flatMap(({ links: [a, b], points: [p, q] }) => {
      const gap = minus(moved(at[a], p), moved(at[b], q));
      return [dot(gap, across), dot(gap, other)];
    });
  };
  for (let round = 0; round < 20; round++) {
    const now = gaps();
    if (Math.hypot(...now) < 1e-7) return;
    const slopes = loop.passive.map((j) => {
      values[j] += 1e-6;
      const then = gaps();
      values[j] -= 1e-6;
      return then.map((v, i) => (v - now[i]) / 1e-6);
    });
    const rows = slopes.map((a, i) => [
      ...slopes.map((b, k) => a.reduce((sum, v, n) => sum + v * b[n], i === k ? 1e-9 : 0)),
      -a.reduce((sum, v, n) => sum + v * now[n], 0)]);
    const step = solved(rows);
    if (!step) return;
    const most = Math.max(...step.map(Math.abs), 0.3);
    loop.passive.forEach((j, i) => { values[j] += step[i] * 0.3 / most; });
  }
}

/** Moves a joint of a robot in the view. */
function setJoint(robot, name, value) {
  robot.values[robot.index.get(name)] = value;
  follow(robot, robot.values);
  robot.poses = poses(robot, robot.values);
}

function resetJoints(robot) {
  robot.values = [...robot.found];
  robot.poses = robot.foundPoses;
}

/** The posture and place of a robot before the rescan; null where it has not moved. */
function posesBefore(robot) {
  const change = changes?.robots.find((c) => c.now === robot.entry.id && c.change.kind === "moved");
  if (!robot.tree || !change) return null;
  const values = [...robot.found];
  for (const joint of change.joints) {
    if (robot.index.has(joint.joint)) values[robot.index.get(joint.joint)] = joint.then[0];
  }
  follow(robot, values);
  const base = [...robot.base];
  (change.base_shift || [0, 0, 0]).forEach((v, i) => { base[12 + i] -= v; });
  return poses(robot, values, base);
}
