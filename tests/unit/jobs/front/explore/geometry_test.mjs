// The geometry of the page against closed forms. Run by node --test.
import assert from 'node:assert/strict';
import { test } from 'node:test';
import * as geometry from '../../../../../jobs/front/explore/page/geometry.js';

const near = (a, b, tolerance = 1e-6) => a.forEach((x, i) => assert.ok(Math.abs(x - b[i]) <= tolerance, `${a} is not ${b}`));

/** A ball of radius r: an octahedron divided `levels` times. */
function makeBall(r, levels) {
  let faces = [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
  const points = [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], middles = new Map();
  const middle = (a, b) => {
    const key = `${Math.min(a, b)},${Math.max(a, b)}`;
    if (!middles.has(key)) {
      middles.set(key, points.length);
      points.push(geometry.normalise(geometry.add(points[a], points[b])));
    }
    return middles.get(key);
  };
  for (let level = 0; level < levels; ++level)
    faces = faces.flatMap(([a, b, c]) => {
      const [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
      return [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]];
    });
  return { vertices_m: Float32Array.from(points.flat(), (x) => r * x), triangles: Uint32Array.from(faces.flat()) };
}
const kBox = {
  vertices_m: Float32Array.from([0, 1, 2, 3, 4, 5, 6, 7].flatMap((k) => [k & 1, (k >> 1) & 1, (k >> 2) & 1])),
  triangles: Uint32Array.from([0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4, 2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5]),
};

test('a ray meets a ball where the quadratic equation says', () => {
  const ball = makeBall(0.3, 5), origin = [1.1, -0.7, 0.9];
  for (const aim of [[0, 0, 0], [0.1, 0.05, -0.12], [-0.2, 0.1, 0.1]]) {
    const direction = geometry.normalise(geometry.subtract(aim, origin));
    const b = geometry.dot(origin, direction), c = geometry.dot(origin, origin) - 0.09, expected = -b - Math.sqrt(b * b - c);
    const hit = geometry.castRay(ball, origin, direction);
    assert.ok(Math.abs(hit.distance - expected) < 2e-3, `${hit.distance} ${expected}`);
    near(geometry.findPoint(ball, hit.triangle, hit.barycentric), hit.point, 1e-6);
    assert.ok(Math.abs(hit.barycentric.reduce((sum, x) => sum + x) - 1) < 1e-12 && Math.min(...hit.barycentric) >= 0);
    near(hit.normal, geometry.normalise(hit.point), 0.06);
  }
  assert.equal(geometry.castRay(ball, origin, geometry.normalise([1, 0.2, 0])), null);
});

test('the nearer of two walls is met', () => {
  const hit = geometry.castRay(kBox, [0.3, 0.4, -2], [0, 0, 1]);
  assert.equal(hit.distance, 2);
  near(hit.normal, [0, 0, -1]);
  near(geometry.castRay(kBox, [0.3, 0.4, 0.5], [1, 0, 0]).point, [1, 0.4, 0.5]);
});

test('rotations turn about the fixed axes of the world, x first', () => {
  near(geometry.rotate(geometry.fromDegrees([90, 0, 0]), [0, 1, 0]), [0, 0, 1]);
  near(geometry.rotate(geometry.fromDegrees([90, 90, 0]), [0, 1, 0]), [1, 0, 0]); // y to z, and then z to x
  near(geometry.rotate(geometry.fromDegrees([0, 0, 90]), [1, 0, 0]), [0, 1, 0]);
  const q = geometry.fromDegrees([20, -75, 130]), v = [0.3, -2, 0.7];
  near(geometry.rotateBack(q, geometry.rotate(q, v)), v, 1e-12);
  for (const turn of [[0, 0, 0], [170, 10, 5], [10, 170, -20], [5, 20, 175]]) {
    const p = geometry.fromDegrees(turn), axes = [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map((axis) => geometry.rotate(p, axis));
    const again = geometry.fromAxes(...axes);
    assert.ok(Math.abs(Math.abs(again.reduce((sum, x, i) => sum + x * p[i], 0)) - 1) < 1e-12, `${again} ${p}`);
  }
});

test('corners are smooth on a ball and sharp on a box', () => {
  const ball = makeBall(2, 4), smooth = geometry.makeCorners(ball);
  for (let i = 0; i < smooth.positions.length; i += 3) {
    const at = geometry.normalise([...smooth.positions.slice(i, i + 3)]);
    assert.ok(geometry.dot(at, [...smooth.normals.slice(i, i + 3)]) > 0.999);
  }
  assert.equal(smooth.vertexOf.length, ball.vertices_m.length / 3, 'a corner per vertex');
  const sharp = geometry.makeCorners(kBox);
  assert.equal(sharp.vertexOf.length, 24);
  sharp.index.forEach((corner, i) => {
    near([...sharp.normals.slice(3 * corner, 3 * corner + 3)], geometry.findNormal(kBox, Math.floor(i / 3)));
    assert.equal(sharp.vertexOf[corner], kBox.triangles[i]);
  });
  sharp.vertexOf.forEach((vertex, i) => near([...sharp.positions.slice(3 * i, 3 * i + 3)], [...kBox.vertices_m.slice(3 * vertex, 3 * vertex + 3)]));
});

test('a simplified surface is near the surface and has few triangles', () => {
  const ball = makeBall(2, 4), few = geometry.simplify(ball, 6);
  assert.ok(few.triangles.length < 0.2 * ball.triangles.length && few.triangles.length > 100, `${few.triangles.length} of ${ball.triangles.length}`);
  for (let i = 0; i < few.vertices_m.length; i += 3) assert.ok(Math.abs(geometry.norm([...few.vertices_m.slice(i, i + 3)]) - 2) < 0.2);
  let outwards = 0;
  for (let i = 0; i < few.triangles.length / 3; ++i) {
    const [a, b, c] = [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map((at) => geometry.findPoint(few, i, at));
    outwards += geometry.dot(a, geometry.cross(b, c)) / 6;
  }
  assert.ok(Math.abs(outwards / ((4 / 3) * Math.PI * 8) - 1) < 0.1, `the volume is ${outwards}`);
  assert.equal(geometry.simplify(kBox, 6).triangles.length, kBox.triangles.length);
});

test('named places lie on the sides that they name, also of a body that is turned', () => {
  const sides = { top: [0, 0, 1], front: [0, -1, 0], left: [-1, 0, 0], right: [1, 0, 0], back: [0, 1, 0], bottom: [0, 0, -1] };
  for (const rotation of [[1, 0, 0, 0], geometry.fromDegrees([90, 0, 180]), geometry.fromDegrees([0, 90, 0])]) {
    const places = geometry.findNamedPlaces(makeBall(0.5, 4), rotation, { triangle: 7, corner: 2 });
    assert.deepEqual(places.map(({ name }) => name), ['loudest point', ...Object.keys(sides)]);
    assert.deepEqual(places[0].barycentric, [0, 0, 1]);
    for (const { name, triangle, barycentric } of places.slice(1)) {
      const point = geometry.rotate(rotation, geometry.findPoint(makeBall(0.5, 4), triangle, barycentric));
      assert.ok(geometry.dot(geometry.normalise(point), sides[name]) > 0.95, `${name} ${point}`);
    }
  }
});
