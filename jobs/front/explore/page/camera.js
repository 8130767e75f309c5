// Orbit camera, z up: drag, pinch, wheel and keys, with inertia.
import * as THREE from './three/three.module.min.js';
import { add, cross, dot, fromAxes, norm, normalise, scale, subtract } from './geometry.js';

const kNearlyUp = 1.5; // rad
const kGlideS = 0.12;
const kNarrowestDeg = 16, kWidestDeg = 50; // vertical angle of view
const kFilled = 0.88; // fraction of the free part of the picture

export class OrbitCamera {
  constructor() {
    this.camera = new THREE.PerspectiveCamera(34, 1, 0.01, 100);
    this.camera.up.set(0, 0, 1);
    this.target = [0, 0, 0];
    this.distance = 2;
    this.azimuth = -Math.PI / 2;
    this.elevation = 0.3;
    this.size = 1;
    this.glide = { azimuth: 0, elevation: 0, zoom: 0 };
    this.covered = { right: 0, below: 0 }; // fractions of the picture covered by controls
  }

  /** Places the camera at a listener. size: of the scene. */
  place(position_m, look_at_m, size) {
    const way = subtract(position_m, look_at_m);
    this.target = [...look_at_m];
    this.size = size;
    this.distance = Math.max(norm(way), 1e-3 * size);
    this.azimuth = Math.atan2(way[1], way[0]);
    this.elevation = Math.asin(Math.max(-1, Math.min(1, way[2] / (norm(way) || 1))));
    this.apply();
  }

  turn(dx, dy, glides = false) {
    this.azimuth -= dx;
    this.elevation = Math.max(-kNearlyUp, Math.min(kNearlyUp, this.elevation + dy));
    if (glides) [this.glide.azimuth, this.glide.elevation] = [-dx / kGlideS, dy / kGlideS];
    this.apply();
  }

  zoom(factor) {
    this.distance = Math.max(0.15 * this.size, Math.min(40 * this.size, this.distance * factor));
    this.apply();
  }

  /** Moves by a fraction of the height of the picture. */
  pan(dx, dy) {
    const { right, up } = this.findAxes(), reach = 2 * this.distance * Math.tan((this.camera.fov * Math.PI) / 360);
    this.target = add(this.target, add(scale(-dx * reach, right), scale(dy * reach, up)));
    this.apply();
  }

  /** Advances the inertia; true while it moves. */
  advance(seconds) {
    const { glide } = this;
    if (Math.hypot(glide.azimuth, glide.elevation) < 1e-3) return false;
    this.azimuth += glide.azimuth * seconds;
    this.elevation = Math.max(-kNearlyUp, Math.min(kNearlyUp, this.elevation + glide.elevation * seconds));
    const left = Math.exp(-seconds / kGlideS);
    glide.azimuth *= left;
    glide.elevation *= left;
    this.apply();
    return true;
  }
  stop() {
    this.glide.azimuth = this.glide.elevation = 0;
  }

  get position_m() {
    const level = Math.cos(this.elevation);
    const way = [level * Math.cos(this.azimuth), level * Math.sin(this.azimuth), Math.sin(this.elevation)];
    return add(this.target, scale(this.distance, way));
  }

  findAxes() {
    const forward = normalise(subtract(this.target, this.position_m));
    const right = [-Math.sin(this.azimuth), Math.cos(this.azimuth), 0];
    return { right, forward, up: cross(right, forward) };
  }

  /** Axes of a level listener: x right, y forward, z up. */
  findListener() {
    const { right } = this.findAxes();
    return { position_m: this.position_m, rotation: fromAxes(right, cross([0, 0, 1], right), [0, 0, 1]) };
  }

  /** covered: {right, below}, fractions covered by controls; the target is centred in the rest. */
  resize(width, height, covered) {
    this.covered = covered;
    this.camera.aspect = width / height;
    if (covered.right > 0 || covered.below > 0)
      this.camera.setViewOffset(width, height, (covered.right * width) / 2, (covered.below * height) / 2, width, height);
    else this.camera.clearViewOffset();
    this.apply();
  }

  /** Widens the angle until all points are visible; moves away if that is not enough. */
  fit(points) {
    const { right, forward, up } = this.findAxes(), eye = this.position_m;
    const [wide, high] = [this.camera.aspect * (1 - this.covered.right), 1 - this.covered.below].map((free) => free * kFilled);
    const calcReach = (from) => {
      let reach = 0;
      for (const point of points) {
        const way = subtract(point, from), ahead = Math.max(1e-6, dot(way, forward));
        reach = Math.max(reach, Math.abs(dot(way, right)) / ahead / wide, Math.abs(dot(way, up)) / ahead / high);
      }
      return reach;
    };
    const widest = Math.tan((kWidestDeg * Math.PI) / 360);
    let back = 0;
    while (calcReach(subtract(eye, scale(back, forward))) > widest && back < 100 * this.size) back += 0.05 * this.size;
    this.distance += back;
    const reach = calcReach(subtract(eye, scale(back, forward)));
    this.camera.fov = Math.max(kNarrowestDeg, (360 / Math.PI) * Math.atan(Math.min(reach, widest)));
    this.apply();
  }

  apply() {
    const { camera } = this, at = this.position_m;
    camera.position.set(...at);
    camera.near = Math.max(0.02 * this.distance, 1e-4 * this.size);
    camera.far = this.distance + 60 * this.size;
    camera.updateProjectionMatrix();
    camera.lookAt(...this.target);
    camera.updateMatrixWorld();
  }

  /** The ray through a point of the picture, coordinates from -1 to 1, y up. */
  findRay(x, y) {
    const origin = new THREE.Vector3(x, y, -1).unproject(this.camera), far = new THREE.Vector3(x, y, 0.5).unproject(this.camera);
    return { origin: this.position_m, direction: normalise(subtract(far.toArray(), origin.toArray())) };
  }
}
