// The stand or thread of a fixed body: drawn only, silent.
import * as THREE from './three/three.module.min.js';
import { add, dot, norm, rotate, scale, subtract } from './geometry.js';

const kFlat = 0.2; // thickness / width of a plate; width / length of a rod
const kLevelDeg = 20, kUprightDeg = 70; // tilt limits: plate with legs, plate between posts
const kInset = 0.94; // position of supports / distance to the corners
const kThread = 0.35; // length of a thread / length of the rod

const material = new THREE.MeshStandardMaterial({ color: 0x4a4440, roughness: 0.7, metalness: 0.1 });
const thread = new THREE.LineBasicMaterial({ color: 0x9aa3ad, transparent: true, opacity: 0.55 });

/** Axes of a body's bounding box in the world, longest first, with half lengths. */
function findAxes(body) {
  const half = scale(0.5 * body.size, subtract(body.box.high, body.box.low));
  return [0, 1, 2]
    .map((c) => ({ way: rotate(body.rotation, [0, 1, 2].map((k) => (k === c ? 1 : 0))), half: half[c] }))
    .sort((a, b) => b.half - a.half);
}

/** Support point of the surface in a world direction. */
function findFarthest(body, way) {
  const { vertices_m: v } = body.surface;
  let farthest = -Infinity, found = null;
  for (let i = 0; i < v.length; i += 3) {
    const at = body.toWorld([v[i], v[i + 1], v[i + 2]]), reach = dot(at, way);
    if (reach > farthest) [farthest, found] = [reach, at];
  }
  return found;
}

function makeLeg(from, floor, radius) {
  const height = from[2] - floor, leg = new THREE.Mesh(new THREE.CylinderGeometry(radius, 0.75 * radius, height, 20), material);
  leg.rotation.x = Math.PI / 2;
  leg.position.set(from[0], from[1], floor + height / 2);
  leg.castShadow = leg.receiveShadow = true;
  return leg;
}

/** The stand of a body above a floor of this height, or null. */
export function makeStand(body, floor) {
  const [long, middle, short] = findAxes(body), centre = body.toWorld(body.box.middle);
  const stand = new THREE.Group(), lowest = findFarthest(body, [0, 0, -1])[2];
  if (lowest - floor < 0.05 * norm([long.half, middle.half, short.half])) return null;
  if (middle.half < kFlat * long.half) {
    if (Math.abs(long.way[2]) < 0.7) return null;
    const top = add(centre, scale(Math.sign(long.way[2]) * long.half, long.way));
    const line = new THREE.BufferGeometry().setFromPoints([new THREE.Vector3(...top), new THREE.Vector3(...add(top, [0, 0, 2 * kThread * long.half]))]);
    stand.add(new THREE.Line(line, thread));
    return stand;
  }
  if (short.half > kFlat * middle.half) return null;
  const tilt = (180 / Math.PI) * Math.acos(Math.min(1, Math.abs(short.way[2]))), thick = Math.max(0.006, 0.035 * middle.half);
  const corners = [[1, 1], [1, -1], [-1, 1], [-1, -1]].map(([a, b]) => {
    const at = findFarthest(body, add(scale(a, long.way), scale(b, middle.way)));
    return add(add(centre, scale(kInset, subtract(at, centre))), [0, 0, -short.half - 0.5 * thick]);
  });
  if (tilt > kLevelDeg && tilt < kUprightDeg) return null;
  const ends = tilt < kLevelDeg ? corners : corners.sort((a, b) => a[2] - b[2]).slice(0, 2);
  for (const at of ends) stand.add(makeLeg(at, floor, thick));
  return stand;
}
