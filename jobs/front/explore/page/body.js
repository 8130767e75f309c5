// A drawn body: a lit surface that can be animated in one mode.
import * as THREE from './three/three.module.min.js';
import { add, findBox, findNormal, findPoint, makeCorners, rotate, rotateBack, scale, simplify, subtract } from './geometry.js';

const kBend = 0.045; // largest displacement of the animation / size of the body
const kBendHz = 1.1; // rate of the animation
const kSketchCells = 18; // per size of the body

// How materials look, by group and by name.
const kGroups = {
  metal: { color: 0xc3c8ce, metalness: 1, roughness: 0.27 },
  glass: { color: 0xd5efec, metalness: 0, roughness: 0.06, clearcoat: 1, opacity: 0.5 },
  ceramic: { color: 0xf1ebe1, metalness: 0, roughness: 0.32, clearcoat: 0.7 },
  stone: { color: 0x97928b, metalness: 0, roughness: 0.82 },
  wood: { color: 0xa8764a, metalness: 0, roughness: 0.58, clearcoat: 0.15 },
  plastic: { color: 0xcfd6de, metalness: 0, roughness: 0.42, clearcoat: 0.2 },
  nature: { color: 0xece4d2, metalness: 0, roughness: 0.55 },
};
const kNames = {
  brass: 0xd9b465, bronze: 0xb98a55, 'bell bronze': 0xb98a55, copper: 0xcf8562, gold: 0xf1c968, silver: 0xe3e4e6, 'cast iron': 0x74777b,
  lead: 0x8b8f97, aluminium: 0xd4d8dd, titanium: 0xb5b3b0, tungsten: 0x9a9ca0, rubber: 0x3a3d42, oak: 0xa8764a, spruce: 0xd6b27c, maple: 0xcfa775,
  ebony: 0x42352d, rosewood: 0x6e4030, walnut: 0x75543a, mahogany: 0x86492f, teak: 0x9c7142, marble: 0xe7e5e0, granite: 0x8d8683, slate: 0x565d66,
  concrete: 0xa19f9a, terracotta: 0xc0714f, ice: 0xdff0f6, bone: 0xeee5d0, porcelain: 0xf4f0ea,
};

export function makeLook(material, group) {
  const look = { ...(kGroups[group] ?? kGroups.plastic) };
  if (kNames[material] !== undefined) look.color = kNames[material];
  return look;
}

function makeGeometry({ positions, normals, index }) {
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute('position', new THREE.BufferAttribute(positions, 3));
  geometry.setAttribute('normal', new THREE.BufferAttribute(normals, 3));
  return geometry.setIndex(new THREE.BufferAttribute(index, 1));
}

const kLowers = [0.03, 0.16, 0.6], kRaises = [0.6, 0.03, 0.06], kNeutral = 0.85, kDoubtful = 0.25; // linear RGB

const kBendVertex = `
attribute vec3 bend;
uniform float uBend;
varying float vBend;
`;

export class ShownBody {
  /** surface: {vertices_m, triangles}, frame of the mesh. position_m, rotation: of that frame in the world. */
  constructor({ name, surface, position_m, rotation, centre_m, look, fixed }) {
    Object.assign(this, { name, surface, centre_m, fixed });
    this.box = findBox(surface);
    this.corners = makeCorners(surface);
    this.geometry = makeGeometry(this.corners);
    this.uniforms = { uBend: { value: 0 }, uTint: { value: 0 } };
    this.material = this.makeMaterial(look);
    this.look = look;
    this.mesh = new THREE.Mesh(this.geometry, this.material);
    this.mesh.castShadow = this.mesh.receiveShadow = true;
    this.mesh.matrixAutoUpdate = false;
    this.size = 1;
    this.rest = { position_m, rotation };
    this.setPose(position_m, rotation);
  }

  /** Takes the surface of the body after a cut. */
  setSurface(surface) {
    this.coloured?.geometry.dispose();
    this.geometry.dispose();
    this.coloured = this.sketch = undefined;
    Object.assign(this, { surface, box: findBox(surface), corners: makeCorners(surface), isColoured: false });
    this.geometry = makeGeometry(this.corners);
    this.material.needsUpdate = true;
    this.show();
  }

  makeMaterial(look) {
    const { opacity = 1, ...rest } = look;
    const material = new THREE.MeshPhysicalMaterial({ ...rest, side: THREE.DoubleSide, envMapIntensity: 0.9 });
    if (opacity < 1) Object.assign(material, { transparent: true, opacity, depthWrite: true });
    const hasBend = () => this.geometry.hasAttribute('bend');
    material.customProgramCacheKey = () => (hasBend() ? 'bends' : 'rigid');
    material.onBeforeCompile = (shader) => {
      if (!hasBend()) return;
      Object.assign(shader.uniforms, this.uniforms);
      shader.vertexShader = kBendVertex + shader.vertexShader.replace(
        '#include <begin_vertex>', '#include <begin_vertex>\n  transformed += uBend * bend;\n  vBend = length(bend);');
      shader.fragmentShader = 'varying float vBend;\nuniform float uTint;\n' + shader.fragmentShader.replace(
        '#include <color_fragment>',
        '#include <color_fragment>\n  diffuseColor.rgb = mix(diffuseColor.rgb, mix(vec3(0.05, 0.16, 0.22), vec3(1.0, 0.55, 0.12), vBend), 0.8 * uTint);');
    };
    return material;
  }

  /** Colours the surface by the change of a mode by cuts, at the corners of the triangles: blue lowers, red raises, grey is doubtful. null:
   * the look of its material. */
  colourBy(density) {
    this.isColoured = density !== null;
    if (density) {
      const { index, vertexOf } = this.corners;
      this.coloured ??= {
        geometry: makeGeometry(this.corners).setAttribute('color', new THREE.BufferAttribute(new Float32Array(3 * vertexOf.length), 3)),
        material: new THREE.MeshStandardMaterial({ vertexColors: true, roughness: 0.6, side: THREE.DoubleSide }),
      };
      const { color } = this.coloured.geometry.attributes, most = density.reduce((largest, x) => (Math.abs(x) > largest ? Math.abs(x) : largest), 1e-30);
      for (let i = 0; i < index.length; ++i) {
        const share = density[i] / most, end = share < 0 ? kLowers : kRaises, part = Math.sqrt(Math.abs(share));
        for (let c = 0; c < 3; ++c) color.array[3 * index[i] + c] = Number.isNaN(share) ? kDoubtful : kNeutral + part * (end[c] - kNeutral);
      }
      color.needsUpdate = true;
    }
    this.show();
  }
  /** Geometry and material of the current look: coloured, sketched or as its material. */
  show() {
    const { geometry, material } = this.isColoured ? this.coloured : this.isSketched ? this.makeSketch() : this;
    Object.assign(this.mesh, { geometry, material });
  }
  makeSketch() {
    const { color, opacity = 1 } = this.look;
    this.sketch ??= makeGeometry(makeCorners(simplify(this.surface, kSketchCells)));
    const material = new THREE.MeshLambertMaterial({ color, emissive: color, emissiveIntensity: 0.15, transparent: opacity < 1, opacity });
    return { geometry: this.sketch, material };
  }
  setLook(look) {
    this.look = look;
    this.material.dispose();
    this.material = this.makeMaterial(look);
    this.show();
  }
  /** Draws without reflections and with few triangles, for motion without a graphics card. */
  setSketched(isSketched) {
    this.isSketched = isSketched;
    this.show();
  }

  /** Sets the position of the mesh's origin. */
  setPose(position_m, rotation) {
    Object.assign(this, { position_m, rotation });
    // A scaled body keeps its lowest point.
    const down = rotateBack(rotation, [0, 0, -1]), half = scale(0.5, subtract(this.box.high, this.box.low));
    const reach = Math.abs(down[0]) * half[0] + Math.abs(down[1]) * half[1] + Math.abs(down[2]) * half[2];
    const foot = add(this.box.middle, scale(reach, down));
    const origin = add(position_m, rotate(rotation, scale(1 - this.size, foot)));
    this.origin = origin;
    const [w, x, y, z] = rotation, s = this.size;
    this.mesh.matrix.compose(new THREE.Vector3(...origin), new THREE.Quaternion(x, y, z, w), new THREE.Vector3(s, s, s));
    this.mesh.matrixWorldNeedsUpdate = true;
  }
  /** Sets the position of the centre of mass, as in recorded motions. */
  setCentrePose(position_m, rotation) {
    this.setPose(subtract(position_m, rotate(rotation, this.centre_m)), rotation);
  }
  /** Its centre of mass in the scene [m]. */
  findRestCentre() {
    return add(this.rest.position_m, rotate(this.rest.rotation, this.centre_m));
  }
  setSize(size) {
    this.size = size;
    this.setPose(this.position_m, this.rotation);
  }

  toMesh(point) {
    return scale(1 / this.size, rotateBack(this.rotation, subtract(point, this.origin)));
  }
  toWorld(point) {
    return add(this.origin, rotate(this.rotation, scale(this.size, point)));
  }
  findWorldNormal(triangle) {
    return rotate(this.rotation, findNormal(this.surface, triangle));
  }
  findWorldPoint(place) {
    return this.toWorld(findPoint(this.surface, place.triangle, place.barycentric));
  }

  /** Starts the animation of a mode; shape: (V, 3), or null to stop. */
  bendIn(shape) {
    this.isBent = shape !== null;
    if (shape === null) {
      this.uniforms.uBend.value = this.uniforms.uTint.value = 0;
      return;
    }
    let largest = 0;
    for (let i = 0; i < shape.length; i += 3) largest = Math.max(largest, Math.hypot(shape[i], shape[i + 1], shape[i + 2]));
    const { vertexOf } = this.corners, bend = new Float32Array(3 * vertexOf.length), part = largest > 0 ? 1 / largest : 0;
    for (let i = 0; i < vertexOf.length; ++i)
      for (let c = 0; c < 3; ++c) bend[3 * i + c] = part * shape[3 * vertexOf[i] + c];
    const { geometry } = this, isNew = !geometry.hasAttribute('bend');
    geometry.setAttribute('bend', new THREE.BufferAttribute(bend, 3));
    if (isNew) this.material.needsUpdate = true;
    this.uniforms.uTint.value = 1;
  }
  /** Updates the animation; true while it moves. */
  advance(seconds) {
    if (this.isBent) this.uniforms.uBend.value = kBend * this.box.size * Math.sin(2 * Math.PI * kBendHz * seconds);
    return Boolean(this.isBent);
  }
}
