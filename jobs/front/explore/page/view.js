// 3D view: bodies on a dark stage, the point to strike, picking. Draws only after changes.
import * as THREE from './three/three.module.min.js';
import { castRay, rotate, rotateBack, scale, add, norm, normalise, subtract, cross } from './geometry.js';
import { makeStand } from './stand.js';
import { OrbitCamera } from './camera.js';

const kSlowFrameMs = 25; // slower frames reduce the resolution during motion
const kLeastPixels = 0.35;
const kRippleS = 0.55;

/** True for software rendering, which competes with the sound for the CPU. */
function isSoftware() {
  const context = document.createElement('canvas').getContext('webgl2');
  if (!context) throw new Error('this browser draws no WebGL 2; allow it, or use another browser');
  const facts = context.getExtension('WEBGL_debug_renderer_info');
  const name = context.getParameter(facts ? facts.UNMASKED_RENDERER_WEBGL : context.RENDERER);
  context.getExtension('WEBGL_lose_context')?.loseContext();
  return /swiftshader|llvmpipe|software/i.test(name);
}

/** Environment map: soft boxes around the stage. */
function makeSurroundings(renderer, size) {
  const room = new THREE.Scene();
  const add = (color, strength, size, at) => {
    const box = new THREE.Mesh(new THREE.BoxGeometry(...size), new THREE.MeshBasicMaterial({ color: new THREE.Color(color).multiplyScalar(strength) }));
    box.position.set(...at);
    room.add(box);
  };
  const shell = new THREE.SphereGeometry(14, 32, 24), colors = [], low = new THREE.Color(0x262a30), high = new THREE.Color(0x59616c);
  const { position } = shell.attributes;
  for (let i = 0; i < position.count; ++i) {
    const color = low.clone().lerp(high, Math.max(0, Math.min(1, 0.5 + position.getZ(i) / 16)));
    colors.push(color.r, color.g, color.b);
  }
  shell.setAttribute('color', new THREE.Float32BufferAttribute(colors, 3));
  room.add(new THREE.Mesh(shell, new THREE.MeshBasicMaterial({ vertexColors: true, side: THREE.BackSide })));
  add(0xfff1dc, 8, [7, 6, 0.2], [-3, -3, 9.5]); // above
  add(0xfff4e6, 3.2, [5, 0.2, 3.2], [-6.5, -9, 2.5]); // before, to the left
  add(0xcfe0ff, 4.5, [0.2, 7, 5], [-9.6, 2, 3]); // left
  add(0xffdfb8, 4, [0.2, 5, 6], [9.6, -3, 2]); // right
  add(0xbfd4ff, 2.5, [10, 0.2, 2.5], [0, 9.6, 4]); // behind
  add(0xfff4e6, 0.9, [9, 7, 0.2], [2, -7, -7]); // reflection of the floor
  const maker = new THREE.PMREMGenerator(renderer), texture = maker.fromScene(room, 0.035, 0.1, 100, { size }).texture;
  maker.dispose();
  return texture;
}

/** A floor that shows shadows and fades out. */
function makeFloor(size, at, middle) {
  const canvas = document.createElement('canvas');
  canvas.width = canvas.height = 256;
  const paper = canvas.getContext('2d'), fade = paper.createRadialGradient(128, 128, 0, 128, 128, 128);
  fade.addColorStop(0, 'rgba(150, 166, 186, 0.16)');
  fade.addColorStop(0.45, 'rgba(120, 136, 156, 0.07)');
  fade.addColorStop(1, 'rgba(120, 136, 156, 0)');
  paper.fillStyle = fade;
  paper.fillRect(0, 0, 256, 256);
  const floor = new THREE.Group(), plane = new THREE.PlaneGeometry(6 * size, 6 * size);
  const shine = new THREE.Mesh(plane, new THREE.MeshBasicMaterial({ map: new THREE.CanvasTexture(canvas), transparent: true, depthWrite: false }));
  const shade = new THREE.Mesh(plane, new THREE.ShadowMaterial({ opacity: 0.42, depthWrite: false }));
  shade.receiveShadow = true;
  shade.position.z = 1e-4 * size;
  floor.add(shine, shade);
  floor.position.set(middle[0], middle[1], at);
  return floor;
}

export class View extends EventTarget {
  constructor(canvas) {
    super();
    this.canvas = canvas;
    this.isPlain = isSoftware();
    document.documentElement.classList.toggle('plain', this.isPlain);
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: !this.isPlain, alpha: true });
    this.renderer.toneMapping = THREE.ACESFilmicToneMapping;
    this.renderer.toneMappingExposure = 1.05;
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = this.isPlain ? THREE.PCFShadowMap : THREE.VSMShadowMap;
    this.renderer.shadowMap.autoUpdate = false;
    this.scene = new THREE.Scene();
    this.scene.environment = makeSurroundings(this.renderer, this.isPlain ? 64 : 256);
    this.key = new THREE.DirectionalLight(0xfff1de, 1.9);
    this.key.castShadow = true;
    this.key.shadow.mapSize.setScalar(this.isPlain ? 512 : 1024);
    this.key.shadow.radius = 7;
    this.key.shadow.blurSamples = 16;
    this.key.shadow.bias = -1e-3;
    const rim = new THREE.DirectionalLight(0x9ec9ff, 0.7);
    rim.position.set(2, 3, 1.5);
    this.scene.add(this.key, this.key.target, rim);
    this.orbit = new OrbitCamera();
    this.bodies = [];
    this.movers = new Set(); // animation functions of time [s], removed when they return false
    this.pixels = 1;
    this.makeMarks();
    new ResizeObserver(() => this.resize()).observe(canvas);
    this.canvas.addEventListener('webglcontextlost', (event) => event.preventDefault());
  }

  makeMarks() {
    const ring = (inner, outer, color, opacity) => new THREE.Mesh(
      new THREE.RingGeometry(inner, outer, 48),
      new THREE.MeshBasicMaterial({ color, opacity, transparent: true, depthTest: true, depthWrite: false, side: THREE.DoubleSide }));
    this.cursor = ring(0.75, 1, 0xffe3a8, 0.95);
    this.cursor.renderOrder = 2;
    this.cursor.visible = false;
    this.scene.add(this.cursor);
    this.ripples = [0, 1, 2, 3].map(() => {
      const mark = ring(0.86, 1, 0xe9b44c, 0);
      mark.visible = false;
      mark.renderOrder = 2;
      this.scene.add(mark);
      return mark;
    });
  }

  addBody(body) {
    this.bodies.push(body);
    this.scene.add(body.mesh);
  }

  /** Bounding box of all bodies in the world. */
  listCorners() {
    const ends = (body, k) => [0, 1, 2].map((c) => (k & (1 << c) ? body.box.high[c] : body.box.low[c]));
    return this.bodies.flatMap((body) => [0, 1, 2, 3, 4, 5, 6, 7].map((k) => body.toWorld(ends(body, k))));
  }

  /** Adapts light and floor to all bodies. ground_m: height of the floor, or null. */
  settle(ground_m) {
    const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    for (const at of this.listCorners()) at.forEach((x, c) => ([low[c], high[c]] = [Math.min(low[c], x), Math.max(high[c], x)]));
    this.middle = scale(0.5, add(low, high));
    this.size = norm(subtract(high, low));
    const floor = (this.floor_m = ground_m ?? low[2]);
    this.scene.add((this.floor = makeFloor(Math.max(this.size, 2 * (this.middle[2] - floor)), floor - 1e-3 * this.size, this.middle)));
    this.floor.visible = ground_m !== null || high[2] - low[2] < 4 * Math.max(high[0] - low[0], high[1] - low[1]);
    this.stands = new THREE.Group();
    for (const body of this.bodies) {
      const stand = body.fixed ? makeStand(body, floor) : null;
      if (stand) this.stands.add(stand);
    }
    this.scene.add(this.stands);
    this.hasFloor = this.floor.visible;
    this.key.position.set(...add(this.middle, scale(2.2 * this.size, normalise([-0.55, -0.6, 1.1]))));
    this.key.target.position.set(...this.middle);
    this.isReady = true;
    this.setLoose(false);
  }

  /** isLoose: bodies have left their stands for the floor, and shadows reach farther. */
  setLoose(isLoose) {
    const reach = (isLoose ? 1.5 : 0.75) * this.size, { camera } = this.key.shadow;
    Object.assign(camera, { left: -reach, right: reach, top: reach, bottom: -reach, near: 0.2 * this.size, far: 5 * this.size });
    camera.updateProjectionMatrix();
    this.stands.visible = !isLoose;
    this.floor.visible = isLoose || this.hasFloor;
    this.shadowPose = undefined;
    this.setSketched(isLoose && this.isPlain);
    this.draw();
  }

  /** Draws without shadows and reflections and with few triangles, fast enough for software rendering. */
  setSketched(isSketched) {
    if (isSketched === Boolean(this.isSketched)) return;
    this.isSketched = isSketched;
    this.floor.children[1].visible = !isSketched;
    for (const body of this.bodies) body.setSketched(isSketched);
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (width === 0 || height === 0) return;
    const panel = document.getElementById('panel').getBoundingClientRect();
    const isBeside = panel.height > 0.8 * height, chart = document.getElementById('spectrum').getBoundingClientRect();
    const covered = { right: isBeside ? panel.width / width : 0, below: Math.max(0, height - chart.top) / height };
    this.renderer.setPixelRatio(Math.min(2, devicePixelRatio) * this.pixels);
    this.renderer.setSize(width, height, false);
    this.orbit.resize(width, height, covered);
    if (this.isReady) this.paint();
  }

  /** Redraws in the next frame. */
  draw() {
    if (this.isWaiting || !this.isReady) return;
    this.isWaiting = true;
    requestAnimationFrame((now) => this.frame(now));
  }
  /** Calls mover(seconds since the page began) for each frame until it returns false. */
  move(mover) {
    this.movers.add(mover);
    this.draw();
  }

  frame(now) {
    this.isWaiting = false;
    const passed = Math.min(0.1, (now - (this.lastFrame ?? now)) / 1000);
    this.lastFrame = now;
    let moves = this.orbit.advance(passed);
    if (moves) this.dispatchEvent(new Event('turned'));
    for (const body of this.bodies) moves = body.advance(now / 1000) || moves;
    for (const mover of [...this.movers]) {
      if (mover(now / 1000)) moves = true;
      else this.movers.delete(mover);
    }
    this.paint();
    this.govern(now, moves);
    if (moves) this.draw();
    else this.lastFrame = undefined;
  }

  paint() {
    if (this.cursorPlace) this.placeMark(this.cursor, this.cursorPlace, 0.011);
    const pose = this.bodies.map(({ mesh, uniforms }) => `${mesh.matrix.elements} ${uniforms.uBend.value}`).join();
    this.renderer.shadowMap.needsUpdate = !this.isSketched && pose !== this.shadowPose; // only after motion
    if (!this.isSketched) this.shadowPose = pose;
    this.renderer.render(this.scene, this.orbit.camera);
  }

  /** Reduced resolution on slow machines during motion. */
  govern(now, moves) {
    const took_ms = now - (this.governed ?? now);
    this.governed = moves ? now : undefined;
    this.took_ms = 0.7 * (this.took_ms ?? took_ms) + 0.3 * took_ms;
    let pixels = this.pixels;
    if (moves && this.took_ms > kSlowFrameMs) pixels = Math.max(kLeastPixels, 0.6 * pixels);
    if (!moves) pixels = 1;
    if (pixels === this.pixels) return;
    this.pixels = pixels;
    this.took_ms = undefined;
    clearTimeout(this.sharpening);
    if (moves) this.resize();
    else this.sharpening = setTimeout(() => this.resize(), 150);
  }

  /** Picking: {body, triangle, barycentric, point, normal} with point and normal in the world, or null. */
  pick(clientX, clientY) {
    const { origin, direction } = this.findRay(clientX, clientY);
    return this.cast(origin, direction);
  }
  findRay(clientX, clientY) {
    const box = this.canvas.getBoundingClientRect();
    return this.orbit.findRay((2 * (clientX - box.left)) / box.width - 1, 1 - (2 * (clientY - box.top)) / box.height);
  }
  cast(origin, direction, only = null) {
    let nearest = null;
    for (const body of only ? [only] : this.bodies) {
      const hit = castRay(body.surface, body.toMesh(origin), rotateBack(body.rotation, direction));
      if (!hit) continue;
      const distance = hit.distance * body.size;
      if (nearest && nearest.distance <= distance) continue;
      const { triangle, barycentric } = hit;
      nearest = { body, triangle, barycentric, distance, point: add(origin, scale(distance, direction)), normal: rotate(body.rotation, hit.normal) };
    }
    return nearest;
  }

  /** Projects a world point to the window. */
  project(point) {
    const at = new THREE.Vector3(...point).project(this.orbit.camera), box = this.canvas.getBoundingClientRect();
    return { x: box.left + ((at.x + 1) / 2) * box.width, y: box.top + ((1 - at.y) / 2) * box.height };
  }

  setCursor(place) {
    this.cursorPlace = place;
    this.cursor.visible = place !== null;
    this.draw();
  }

  placeMark(mark, place, size) {
    const { body, triangle } = place, point = body.findWorldPoint(place);
    const normal = body.findWorldNormal(triangle), away = norm(subtract(this.orbit.position_m, point));
    mark.position.set(...add(point, scale(0.003 * away, normal)));
    const side = normalise(Math.abs(normal[2]) < 0.9 ? cross([0, 0, 1], normal) : cross([1, 0, 0], normal));
    const up = cross(normal, side);
    mark.quaternion.setFromRotationMatrix(new THREE.Matrix4().makeBasis(...[side, up, normal].map((v) => new THREE.Vector3(...v))));
    mark.scale.setScalar(size * away);
  }

  /** Animates a ring around a struck point. strength: 0 to 1. */
  ripple(place, strength) {
    const mark = this.ripples.shift(), began = performance.now() / 1000;
    this.ripples.push(mark);
    mark.visible = true;
    this.move((now) => {
      const part = (now - began) / kRippleS;
      mark.visible = part < 1;
      this.placeMark(mark, place, 0.008 + 0.06 * (0.4 + 0.6 * strength) * Math.sqrt(Math.max(0, part)));
      mark.material.opacity = 0.85 * (1 - part) ** 2;
      return part < 1;
    });
  }
}
