// Geometry of surfaces: rays, barycentric coordinates, smooth normals, named points. No DOM, no three.js.
// A surface is {vertices_m: Float32Array(3 V), triangles: Uint32Array(3 T)}; vectors are [x, y, z]; quaternions [w, x, y, z].

export const subtract = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
export const scale = (s, a) => [s * a[0], s * a[1], s * a[2]];
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
export const norm = (a) => Math.hypot(a[0], a[1], a[2]);
export const normalise = (a) => scale(1 / (norm(a) || 1), a);

/** R(q) a. */
export function rotate(q, a) {
  const [w, ...v] = q;
  const t = scale(2, cross(v, a));
  return add(add(a, scale(w, t)), cross(v, t));
}
/** R(q)^-1 a. */
export const rotateBack = (q, a) => rotate([q[0], -q[1], -q[2], -q[3]], a);
/** q p: first p, then q. */
export function multiply(q, p) {
  const [a, b, c, d] = q, [e, f, g, h] = p;
  return [a * e - b * f - c * g - d * h, a * f + b * e + c * h - d * g, a * g - b * h + c * e + d * f, a * h + b * g - c * f + d * e];
}
/** Rotation about the fixed world axes x, y, z in this order, in degrees: "rotation_deg" of scene files. */
export function fromDegrees(degrees) {
  const about = (axis) => {
    const half = (degrees[axis] * Math.PI) / 360, q = [Math.cos(half), 0, 0, 0];
    q[axis + 1] = Math.sin(half);
    return q;
  };
  return multiply(about(2), multiply(about(1), about(0)));
}
/** Rotation from three orthonormal axes (columns). */
export function fromAxes(x, y, z) {
  const trace = x[0] + y[1] + z[2];
  let q;
  if (trace > 0) q = [1 + trace, y[2] - z[1], z[0] - x[2], x[1] - y[0]];
  else if (x[0] >= y[1] && x[0] >= z[2]) q = [y[2] - z[1], 1 + x[0] - y[1] - z[2], y[0] + x[1], z[0] + x[2]];
  else if (y[1] >= z[2]) q = [z[0] - x[2], y[0] + x[1], 1 - x[0] + y[1] - z[2], z[1] + y[2]];
  else q = [x[1] - y[0], z[0] + x[2], z[1] + y[2], 1 - x[0] - y[1] + z[2]];
  return scale4(1 / Math.hypot(...q), q);
}
const scale4 = (s, q) => q.map((x) => s * x);

const corner = (surface, triangle, c) => {
  const at = 3 * surface.triangles[3 * triangle + c];
  return [surface.vertices_m[at], surface.vertices_m[at + 1], surface.vertices_m[at + 2]];
};

/** The point with these barycentric coordinates in a triangle. */
export function findPoint(surface, triangle, barycentric) {
  let point = [0, 0, 0];
  for (let c = 0; c < 3; ++c) point = add(point, scale(barycentric[c], corner(surface, triangle, c)));
  return point;
}

/** Outward unit normal of a triangle. */
export function findNormal(surface, triangle) {
  const a = corner(surface, triangle, 0);
  return normalise(cross(subtract(corner(surface, triangle, 1), a), subtract(corner(surface, triangle, 2), a)));
}

/** Where a ray meets a surface first: {distance, triangle, barycentric, point, normal}, or null. direction: unit. Both sides count, since
 * sheets are seen from both. Moeller and Trumbore 1997. */
export function castRay(surface, origin, direction) {
  const { vertices_m: v, triangles: t } = surface;
  const [ox, oy, oz] = origin, [dx, dy, dz] = direction;
  let nearest = Infinity, found = -1, u1 = 0, u2 = 0;
  for (let i = 0; i < t.length; i += 3) {
    const a = 3 * t[i], b = 3 * t[i + 1], c = 3 * t[i + 2];
    const ax = v[a], ay = v[a + 1], az = v[a + 2];
    const ex = v[b] - ax, ey = v[b + 1] - ay, ez = v[b + 2] - az, fx = v[c] - ax, fy = v[c + 1] - ay, fz = v[c + 2] - az;
    const px = dy * fz - dz * fy, py = dz * fx - dx * fz, pz = dx * fy - dy * fx;
    const determinant = ex * px + ey * py + ez * pz;
    if (determinant === 0) continue;
    const inverse = 1 / determinant, sx = ox - ax, sy = oy - ay, sz = oz - az;
    const first = (sx * px + sy * py + sz * pz) * inverse;
    if (first < 0 || first > 1) continue;
    const qx = sy * ez - sz * ey, qy = sz * ex - sx * ez, qz = sx * ey - sy * ex;
    const second = (dx * qx + dy * qy + dz * qz) * inverse;
    if (second < 0 || first + second > 1) continue;
    const distance = (fx * qx + fy * qy + fz * qz) * inverse;
    if (distance > 0 && distance < nearest) [nearest, found, u1, u2] = [distance, i / 3, first, second];
  }
  if (found < 0) return null;
  return {
    distance: nearest,
    triangle: found,
    barycentric: [1 - u1 - u2, u1, u2],
    point: add(origin, scale(nearest, direction)),
    normal: findNormal(surface, found),
  };
}

/** Lowest and highest coordinates of a surface. */
export function findBox(surface) {
  const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
  surface.vertices_m.forEach((x, i) => {
    low[i % 3] = Math.min(low[i % 3], x);
    high[i % 3] = Math.max(high[i % 3], x);
  });
  return { low, high, middle: scale(0.5, add(low, high)), size: norm(subtract(high, low)) };
}

/** Named points of a body, as seen by a listener in front of it, for use without a pointer. rotation: of the body in the world.
 * loudest: {triangle, corner}. Each: {name, triangle, barycentric}. */
export function findNamedPlaces(surface, rotation, loudest) {
  const box = findBox(surface), places = [];
  if (loudest) {
    const barycentric = [0, 0, 0];
    barycentric[loudest.corner] = 1;
    places.push({ name: 'loudest point', triangle: loudest.triangle, barycentric });
  }
  const sides = { top: [0, 0, 1], front: [0, -1, 0], left: [-1, 0, 0], right: [1, 0, 0], back: [0, 1, 0], bottom: [0, 0, -1] };
  for (const [name, side] of Object.entries(sides)) {
    const outwards = rotateBack(rotation, side);
    // A little off the middle, where symmetric bodies have nodal lines of many modes.
    const aside = scale(0.03 * box.size, normalise(cross(outwards, [0.36, 0.48, 0.8])));
    const hit = castRay(surface, add(add(box.middle, aside), scale(2 * box.size, outwards)), scale(-1, outwards));
    if (hit) places.push({ name, triangle: hit.triangle, barycentric: hit.barycentric });
  }
  return places;
}

/** Corners for drawing: smooth where neighbouring triangles meet at less than the crease, sharp elsewhere.
 * -> {positions, normals: Float32Array(3 N), vertexOf: Uint32Array(N), index: Uint32Array(3 T)}; N: distinct corners. */
export function makeCorners(surface, creaseDegrees = 38) {
  const { vertices_m: v, triangles: t } = surface;
  const count = t.length / 3, flat = new Float32Array(3 * count), least = Math.cos((creaseDegrees * Math.PI) / 180);
  const starts = new Uint32Array(v.length / 3 + 1);
  for (const vertex of t) ++starts[vertex + 1];
  for (let i = 1; i < starts.length; ++i) starts[i] += starts[i - 1];
  const around = new Uint32Array(t.length), filled = starts.slice(0, -1), areas = new Float32Array(count);
  for (let i = 0; i < count; ++i) {
    const a = 3 * t[3 * i], b = 3 * t[3 * i + 1], c = 3 * t[3 * i + 2];
    const n = cross([v[b] - v[a], v[b + 1] - v[a + 1], v[b + 2] - v[a + 2]], [v[c] - v[a], v[c + 1] - v[a + 1], v[c + 2] - v[a + 2]]);
    areas[i] = norm(n);
    flat.set(normalise(n), 3 * i);
    for (let k = 0; k < 3; ++k) around[filled[t[3 * i + k]]++] = i;
  }
  const normals = [], vertexOf = [], index = new Uint32Array(t.length);
  const latest = new Int32Array(v.length / 3).fill(-1), before = []; // corners of a vertex, linked
  for (let i = 0; i < t.length; ++i) {
    const vertex = t[i], own = Math.floor(i / 3), nx = flat[3 * own], ny = flat[3 * own + 1], nz = flat[3 * own + 2];
    let x = 0, y = 0, z = 0;
    for (let k = starts[vertex]; k < starts[vertex + 1]; ++k) {
      const other = around[k], ox = flat[3 * other], oy = flat[3 * other + 1], oz = flat[3 * other + 2];
      if (other !== own && nx * ox + ny * oy + nz * oz < least) continue;
      x += areas[other] * ox;
      y += areas[other] * oy;
      z += areas[other] * oz;
    }
    const length = Math.hypot(x, y, z) || 1, normal = [x / length, y / length, z / length];
    let same = latest[vertex];
    while (same >= 0 && dot(normal, normals[same]) < 1 - 1e-6) same = before[same];
    if (same < 0) {
      same = vertexOf.push(vertex) - 1;
      normals.push(normal);
      before.push(latest[vertex]);
      latest[vertex] = same;
    }
    index[i] = same;
  }
  const positions = vertexOf.flatMap((vertex) => [v[3 * vertex], v[3 * vertex + 1], v[3 * vertex + 2]]);
  return { positions: Float32Array.from(positions), normals: Float32Array.from(normals.flat()), vertexOf: Uint32Array.from(vertexOf), index };
}

/** Simplified surface by vertex clustering: vertices of a cell with similar normals become their mean. cells: per size of the body. */
export function simplify(surface, cells) {
  const { vertices_m: v, triangles: t } = surface, { low, size } = findBox(surface), step = size / cells;
  const normals = new Float32Array(v.length);
  for (let i = 0; i < t.length; i += 3) {
    const [a, b, c] = [0, 1, 2].map((k) => corner(surface, i / 3, k)), n = cross(subtract(b, a), subtract(c, a));
    for (let k = 0; k < 3; ++k) for (let axis = 0; axis < 3; ++axis) normals[3 * t[i + k] + axis] += n[axis];
  }
  const merged = new Map(), sums = [], target = new Uint32Array(v.length / 3);
  for (let i = 0; i < target.length; ++i) {
    const at = [0, 1, 2].map((axis) => v[3 * i + axis]), n = [0, 1, 2].map((axis) => normals[3 * i + axis]), least = 0.3 * norm(n);
    const key = at.map((x, axis) => `${Math.floor((x - low[axis]) / step)} ${Math.abs(n[axis]) > least ? Math.sign(n[axis]) : 0}`).join();
    if (!merged.has(key)) merged.set(key, sums.push([0, 0, 0, 0]) - 1);
    target[i] = merged.get(key);
    const sum = sums[target[i]];
    at.forEach((x, axis) => (sum[axis] += x));
    ++sum[3];
  }
  const triangles = [];
  for (let i = 0; i < t.length; i += 3) {
    const [a, b, c] = [target[t[i]], target[t[i + 1]], target[t[i + 2]]];
    if (a !== b && b !== c && c !== a) triangles.push(a, b, c);
  }
  return { vertices_m: Float32Array.from(sums.flatMap(([x, y, z, count]) => [x / count, y / count, z / count])), triangles: Uint32Array.from(triangles) };
}
