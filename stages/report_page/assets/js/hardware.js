// Draws with graphics hardware, by WebGL 2.

const POINT_SHADER = `
in uvec4 a;
uniform mat4 u_clip;
uniform vec3 u_corner, u_low, u_high;
uniform vec2 u_tone;
uniform float u_step, u_size, u_cap;
uniform vec4 u_look[6];
#ifdef MOVES
uniform vec4 u_links[3 * LINKS];
#endif
out vec3 v_color;
void main() {
  vec4 p = vec4(u_corner + (vec3(a.xyz) + 0.5) * u_step, 1.0);
  int tag = int(a.w);
  int look = min(tag, 5);
#ifdef MOVES
  int l = 3 * min(tag >> 1, LINKS - 1);
  p.xyz = vec3(dot(u_links[l], p), dot(u_links[l + 1], p), dot(u_links[l + 2], p));
  look = 4 + (tag & 1);
#endif
  vec4 c = u_look[look];
  gl_Position = u_clip * p;
  gl_PointSize = clamp(u_size / gl_Position.w * (look == 2 || look == 4 ? 0.6 : 1.0), 1.0, u_cap);
  if (c.a < 0.5 || any(lessThan(p.xyz, u_low)) || any(greaterThan(p.xyz, u_high)))
    gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
  v_color = c.rgb * clamp(0.66 + 0.34 * (p.z - u_tone.x) * u_tone.y, 0.55, 1.0);
}`;
const PLAIN_SHADER = `
in vec3 v_color;
out vec4 color;
void main() { color = vec4(v_color, 1.0); }`;
const MESH_SHADER = `
in uvec4 a;
uniform mat4 u_clip;
uniform vec3 u_min;
uniform float u_scale;
uniform vec4 u_links[3 * LINKS];
out vec3 v_at;
void main() {
  vec4 p = vec4(u_min + vec3(a.xyz) * u_scale, 1.0);
  int l = 3 * min(int(a.w), LINKS - 1);
  v_at = vec3(dot(u_links[l], p), dot(u_links[l + 1], p), dot(u_links[l + 2], p));
  gl_Position = u_clip * vec4(v_at, 1.0);
}`;
const LIT_SHADER = `
in vec3 v_at;
uniform vec3 u_eye, u_low, u_high;
uniform vec4 u_color;
out vec4 color;
void main() {
  if (any(lessThan(v_at, u_low)) || any(greaterThan(v_at, u_high))) discard;
  if (u_color.a < 1.0 && (int(gl_FragCoord.x) + int(gl_FragCoord.y)) % 2 == 0) discard;
  vec3 n = normalize(cross(dFdx(v_at), dFdy(v_at)));
  vec3 look = normalize(u_eye - v_at);
  if (dot(n, look) < 0.0) n = -n;
  float light = 0.42 + 0.38 * dot(n, look) + 0.20 * max(0.0, n.z) + 0.1 * n.x;
  color = vec4(u_color.rgb * (u_color.a < 1.0 ? 1.0 + 0.4 * light : light), 1.0);
}`;
const LINE_SHADER = `
in vec3 a;
uniform mat4 u_clip;
uniform vec3 u_color;
out vec3 v_color;
void main() { gl_Position = u_clip * vec4(a, 1.0); v_color = u_color; }`;
const COVER_SHADER = `
out vec2 v_at;
void main() {
  v_at = vec2(gl_VertexID & 1, gl_VertexID >> 1) * 2.0;
  gl_Position = vec4(v_at * 2.0 - 1.0, 0.0, 1.0);
}`;
// Darkens what lies behind its neighbours on the screen, so that points read as surfaces.
const SHADE_SHADER = `
in vec2 v_at;
uniform sampler2D u_picture, u_depth;
uniform vec2 u_pixel;
uniform float u_shade;
out vec4 color;
float away(vec2 at) {
  float d = texture(u_depth, at).r;
  return d == 1.0 ? 12.0 : log2(2.0 * 100.0 / (2000.05 - (2.0 * d - 1.0) * 1999.95));
}
void main() {
  float d = texture(u_depth, v_at).r;
  if (d == 1.0) { color = vec4(mix(vec3(0.09, 0.11, 0.13), vec3(0.19, 0.22, 0.26), v_at.y), 1.0); return; }
  vec3 c = texture(u_picture, v_at).rgb;
  if (u_shade > 0.0) {
    float own = away(v_at), sum = 0.0;
    sum += max(0.0, own - away(v_at + vec2(u_pixel.x, 0.0)));
    sum += max(0.0, own - away(v_at - vec2(u_pixel.x, 0.0)));
    sum += max(0.0, own - away(v_at + vec2(0.0, u_pixel.y)));
    sum += max(0.0, own - away(v_at - vec2(0.0, u_pixel.y)));
    c *= exp(-u_shade * sum);
  }
  color = vec4(c, 1.0);
}`;

/** A screen that things are drawn to, with a depth that can be read. */
class Target {
  constructor(gl) { Object.assign(this, { gl, width: 0, height: 0 }); }

  fit(width, height) {
    const { gl } = this;
    if (width === this.width && height === this.height) return;
    [this.picture, this.depth].forEach((t) => t && gl.deleteTexture(t));
    this.frame ||= gl.createFramebuffer();
    const texture = (inner, format, type) => {
      const t = gl.createTexture();
      gl.bindTexture(gl.TEXTURE_2D, t);
      gl.texImage2D(gl.TEXTURE_2D, 0, inner, width, height, 0, format, type, null);
      for (const [name, value] of [[gl.TEXTURE_MIN_FILTER, gl.NEAREST],
        [gl.TEXTURE_MAG_FILTER, gl.NEAREST], [gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE],
        [gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE]]) gl.texParameteri(gl.TEXTURE_2D, name, value);
      return t;
    };
    this.picture = texture(gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE);
    this.depth = texture(gl.DEPTH_COMPONENT24, gl.DEPTH_COMPONENT, gl.UNSIGNED_INT);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.frame);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, this.picture, 0);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.TEXTURE_2D, this.depth, 0);
    Object.assign(this, { width, height });
  }
}

class Hardware extends Picture {
  constructor(canvas, cloud, meshes, robots) {
    super(canvas, cloud, meshes, robots);
    const gl = canvas.getContext("webgl2", { antialias: false, depth: false, alpha: false,
      preserveDrawingBuffer: true, powerPreference: "high-performance" });
    const links = Math.max(1, ...robots.filter((r) => r.tree).map((r) => r.tree.links.length));
    const room = Math.floor((gl.getParameter(gl.MAX_VERTEX_UNIFORM_VECTORS) - 24) / 3);
    Object.assign(this, { gl, nLinks: Math.min(links, room), isSlow: false });
    const define = `#define LINKS ${this.nLinks}\n`;
    this.stillProgram = this.program(POINT_SHADER, PLAIN_SHADER);
    this.movingProgram = this.program("#define MOVES\n" + define + POINT_SHADER, PLAIN_SHADER);
    this.meshProgram = this.program(define + MESH_SHADER, LIT_SHADER);
    this.lineProgram = this.program(LINE_SHADER, PLAIN_SHADER);
    this.shadeProgram = this.program(COVER_SHADER, SHADE_SHADER);
    this.pointArray = this.vertexArray(cloud.points);
    this.meshes.forEach((mesh) => this.addMesh(mesh));
    this.lineBuffer = gl.createBuffer();
    this.lineArray = gl.createVertexArray();
    gl.bindVertexArray(this.lineArray);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.lineBuffer);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
    this.emptyArray = gl.createVertexArray();
    this.targets = { moving: new Target(gl), resting: new Target(gl) };
  }

  program(vertex, fragment) {
    const { gl } = this;
    const program = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, "#version 300 es\nprecision highp float;\nprecision highp int;\n"
        + text);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.bindAttribLocation(program, 0, "a");
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) {
      throw new Error(gl.getProgramInfoLog(program));
    }
    const own = { program, at: {} };
    const n = gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS);
    for (let i = 0; i < n; i++) {
      const name = gl.getActiveUniform(program, i).name;
      own.at[name.replace("[0]", "")] = gl.getUniformLocation(program, name);
    }
    return own;
  }

  vertexArray(values) {
    const { gl } = this;
    const array = gl.createVertexArray();
    gl.bindVertexArray(array);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, values, gl.STATIC_DRAW);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribIPointer(0, 4, gl.UNSIGNED_SHORT, 0, 0);
    return array;
  }

  /** Corners of a body, then those of its coarse form. */
  addMesh(mesh) {
    const { gl } = this;
    mesh.array = this.vertexArray(mesh.vertices);
    const all = new Uint32Array(mesh.corners.length + mesh.coarse.length);
    all.set(mesh.corners);
    all.set(mesh.coarse, mesh.corners.length);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, all, gl.STATIC_DRAW);
  }

  /** Begins a picture: then points, in one or several pieces, then all else. */
  begin(name, width, height) {
    const { gl } = this;
    const target = this.targets[name];
    target.fit(width, height);
    gl.bindFramebuffer(gl.FRAMEBUFFER, target.frame);
    gl.clearColor(0, 0, 0, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
  }

  open({ frame, width, height }) {
    const { gl } = this;
    gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
    gl.viewport(0, 0, width, height);
    gl.enable(gl.DEPTH_TEST);
  }

  use(program, camera) {
    const { gl } = this;
    gl.useProgram(program.program);
    gl.uniformMatrix4fv(program.at.u_clip, false, camera.clip);
    if (program.at.u_low) {
      gl.uniform3fv(program.at.u_low, this.low);
      gl.uniform3fv(program.at.u_high, this.high);
    }
    return program.at;
  }

  /** Rows of the upper part of matrices, link after link. */
  links(at, matrices) {
    const rows = new Float32Array(12 * this.nLinks);
    matrices.slice(0, this.nLinks).forEach((m, l) => {
      for (let r = 0; r < 3; r++) for (let c = 0; c < 4; c++) rows[12 * l + 4 * r + c] = m[4 * c + r];
    });
    this.gl.uniform4fv(at.u_links, rows);
  }

  addPoints(name, rows, camera, focal, cap) {
    const { gl } = this;
    this.open(this.targets[name]);
    const looks = new Float32Array(POINT_LOOKS.flatMap((name) =>
      [...LOOKS[name].color, LOOKS[name].on ? 1 : 0]));
    gl.bindVertexArray(this.pointArray);
    for (const isRobot of [false, true]) {
      const own = rows.filter((row) => row.n && (row.block.owner >= 0) === isRobot);
      if (!own.length) continue;
      const at = this.use(isRobot ? this.movingProgram : this.stillProgram, camera);
      gl.uniform4fv(at.u_look, looks);
      gl.uniform2fv(at.u_tone, this.tone);
      gl.uniform1f(at.u_cap, cap);
      let robot = null;
      for (const row of own) {
        if (isRobot && row.robot !== robot) {
          robot = row.robot;
          const isFound = !robot.tree || robot.poses === robot.foundPoses;
          this.links(at, isFound ? new Array(this.nLinks).fill(identity())
            : robot.poses.map((m, l) => times(m, robot.back[l])));
        }
        gl.uniform3fv(at.u_corner, row.block.corner);
        gl.uniform1f(at.u_step, row.block.edge / 1024);
        gl.uniform1f(at.u_size, row.size * focal * 1.5);
        gl.drawArrays(gl.POINTS, row.block.first, row.n);
      }
    }
  }

  finish(name, camera, focal, isQuick) {
    const { gl } = this;
    this.open(this.targets[name]);
    const at = this.use(this.meshProgram, camera);
    gl.uniform3fv(at.u_eye, camera.eye);
    for (const body of this.bodies(camera, focal, isQuick)) {
      const { mesh, isCoarse, matrices, color, alpha } = body;
      this.links(at, matrices);
      gl.uniform3fv(at.u_min, mesh.min);
      gl.uniform1f(at.u_scale, mesh.scale);
      gl.uniform4fv(at.u_color, [...color, alpha]);
      gl.bindVertexArray(mesh.array);
      gl.drawElements(gl.TRIANGLES, isCoarse ? mesh.coarse.length : mesh.corners.length,
        gl.UNSIGNED_INT, isCoarse ? 4 * mesh.corners.length : 0);
    }
    this.drawLines(camera);
  }

  /** Lines: lists of places in the view's frame, two for each line. */
  drawLines(camera) {
    const { gl } = this;
    const at = this.use(this.lineProgram, camera);
    gl.bindVertexArray(this.lineArray);
    for (const { look, lines } of this.boxes) {
      if (!look.on || !lines.length) continue;
      gl.bindBuffer(gl.ARRAY_BUFFER, this.lineBuffer);
      gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(lines.flat()), gl.STREAM_DRAW);
      gl.uniform3fv(at.u_color, look.color);
      gl.drawArrays(gl.LINES, 0, lines.length);
    }
  }

  /** Brings what was drawn to the canvas. */
  show(name, shade) {
    const { gl, canvas, targets: { [name]: target } } = this;
    if (canvas.width !== target.width || canvas.height !== target.height) {
      Object.assign(canvas, { width: target.width, height: target.height });
    }
    const at = this.shadeProgram.at;
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.disable(gl.DEPTH_TEST);
    gl.useProgram(this.shadeProgram.program);
    gl.bindVertexArray(this.emptyArray);
    [target.picture, target.depth].forEach((texture, i) => {
      gl.activeTexture(gl.TEXTURE0 + i);
      gl.bindTexture(gl.TEXTURE_2D, texture);
    });
    gl.uniform1i(at.u_picture, 0);
    gl.uniform1i(at.u_depth, 1);
    gl.uniform2f(at.u_pixel, 1.4 / target.width, 1.4 / target.height);
    gl.uniform1f(at.u_shade, shade);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    gl.activeTexture(gl.TEXTURE0);
  }

  /** Calls `done` with the time that the drawing took since `from`, once it is finished. */
  whenDrawn(from, done) {
    const { gl } = this;
    const fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    gl.flush();
    const look = () => {
      if (gl.getSyncParameter(fence, gl.SYNC_STATUS) !== gl.SIGNALED && !gl.isContextLost()) {
        setTimeout(look, 1);
        return;
      }
      gl.deleteSync(fence);
      done(performance.now() - from);
    };
    setTimeout(look, 0);
  }
}

