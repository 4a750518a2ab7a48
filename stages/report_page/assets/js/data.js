// The data of the page: texts as JSON, points and meshes as one packed block.

const $ = (id) => document.getElementById(id);
const data = JSON.parse($("data").textContent);
const view = JSON.parse($("view-data").textContent);
/** PNG files as base64, by robot: of those that fit on the page. */
const pictures = JSON.parse($("pictures").textContent);
const result = data.result;
const changes = data.changes;

/** Characters that nobody sees, or that change how others are read, as their numbers. */
const shown = (text) => String(text).replace(/[\p{Cc}\p{Cf}\u2028\u2029]/gu,
  (c) => `\\u{${c.codePointAt(0).toString(16)}}`);

/** An element with attributes and children. Text is never taken for markup. */
function el(tag, attributes, ...children) {
  const svg = /^(svg|g|line|rect|circle|text|path)$/.test(tag);
  const node = svg ? document.createElementNS("http://www.w3.org/2000/svg", tag)
    : document.createElement(tag);
  for (const [name, value] of Object.entries(attributes || {})) {
    if (name.startsWith("on")) node.addEventListener(name.slice(2), value);
    else if (value === true) node.setAttribute(name, "");
    else if (value !== false && value !== null && value !== undefined) {
      node.setAttribute(name, value);
    }
  }
  for (const child of children.flat(9)) {
    if (child !== null && child !== undefined && child !== false) {
      node.append(child instanceof Node ? child : shown(child));
    }
  }
  return node;
}

const fixed = (value, decimals) => {
  if (!Number.isFinite(value)) return "unknown";
  const text = value.toFixed(decimals);
  return /^-[0.]*$/.test(text) ? text.slice(1) : text;
};
const place = (xyz, decimals = 3) => `(${xyz.map((v) => fixed(v, decimals)).join(", ")})`;
const many = (n) => n.toLocaleString("en").replace(/,/g, "\u00a0");
const counted = (n, noun) => `${many(n)} ${noun}${n === 1 ? "" : "s"}`;
/** Joint values in degrees or millimetres, as the program says them. */
const unitOf = (slides) => slides ? { factor: 1e3, symbol: "\u00a0mm" }
  : { factor: 180 / Math.PI, symbol: "°" };
const say = (value, slides) => {
  const unit = unitOf(slides);
  return Number.isFinite(value) ? fixed(value * unit.factor, 3) + unit.symbol : "unknown";
};
const saySigma = (sigma, slides) => {
  const unit = unitOf(slides);
  if (!Number.isFinite(sigma)) return "unknown";
  return fixed(sigma * unit.factor, sigma * unit.factor < 1 ? 3 : 1) + unit.symbol;
};

/** The bytes of the packed block. */
async function unpack() {
  const text = $("packed").textContent;
  let bytes;
  if (Uint8Array.fromBase64) bytes = Uint8Array.fromBase64(text);
  else {
    const binary = atob(text);
    bytes = new Uint8Array(binary.length);
    for (let i = 0; i < binary.length; i++) bytes[i] = binary.charCodeAt(i);
  }
  $("packed").remove();
  const inflated = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate-raw"));
  return new Uint8Array(await new Response(inflated).arrayBuffer());
}

/** Reads numbers of seven bits a byte. */
function reader(bytes, from) {
  let at = from;
  const next = () => {
    let value = 0, shift = 0, byte;
    do {
      byte = bytes[at++];
      value += (byte & 0x7f) * 2 ** shift;
      shift += 7;
    } while (byte > 0x7f);
    return value;
  };
  return { next, signed: () => { const v = next(); return v & 1 ? -(v + 1) / 2 : v / 2; } };
}

/** Every third bit of a place, from its first on: the steps along one axis. */
function steps(place) {
  let v = place & 0x09249249;
  v = (v | v >> 2) & 0x030c30c3;
  v = (v | v >> 4) & 0x0300f00f;
  v = (v | v >> 8) & 0x030000ff;
  return (v | v >> 16) & 0x3ff;
}

/** All points, and where each block of them begins. */
function decodePoints(bytes) {
  const rows = view.blocks;
  let total = 0;
  const blocks = rows.map(([owner, x, y, z, shift, ...counts]) => {
    const edge = owner < 0 ? view.edge.still : view.edge.robot;
    const n = counts.reduce((sum, c) => sum + c, 0);
    const block = { owner, edge, shift, counts, first: total, n,
      corner: [x * edge, y * edge, z * edge] };
    total += n;
    return block;
  });
  const points = new Uint16Array(4 * total);
  const places = reader(bytes, 0), tags = reader(bytes, view.bytes[0]);
  let at = 0;
  for (const block of blocks) {
    for (const count of block.counts) {
      let code = 0;
      for (let i = 0; i < count; i++, at += 4) {
        code += places.next();
        points[at] = steps(code);
        points[at + 1] = steps(code >> 1);
        points[at + 2] = steps(code >> 2);
      }
    }
    const from = 4 * block.first;
    for (let i = 0; i < block.n; i++) points[from + 4 * i + 3] = block.owner === -2 ? 3 : tags.next();
  }
  return { points, blocks, total };
}

/** All sets of bodies: vertices as (x, y, z, link), and corners of triangles. */
function decodeMeshes(bytes) {
  const read = reader(bytes, view.bytes[0] + view.bytes[1]);
  return view.meshes.map((entry) => {
    const vertices = new Uint16Array(4 * entry.n_vertices);
    const last = [0, 0, 0, 0];
    for (let i = 0; i < entry.n_vertices; i++) {
      for (let k = 0; k < 4; k++) vertices[4 * i + (k + 3) % 4] = last[k] += read.signed();
    }
    const corners = new Uint32Array(3 * entry.n_triangles);
    let corner = 0;
    for (let i = 0; i < corners.length; i++) corners[i] = corner += read.signed();
    return { ...entry, vertices, corners };
  });
}
