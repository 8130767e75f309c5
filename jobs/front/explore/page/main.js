// Main module of the page of carillon explore: loads scene and banks, opens the sound engine, connects view and panel.
import { View } from './view.js';
import { ShownBody, makeLook } from './body.js';
import { Player } from './player.js';
import { Hands } from './hands.js';
import { Panel } from './panel.js';
import { Spectrum } from './spectrum.js';
import { Transport } from './recording.js';
import { Recorder } from './recorder.js';
import { Thrower } from './throw.js';
import { fromDegrees, norm, subtract } from './geometry.js';

const kVersion = 1; // of explore.json
const find = (id) => document.getElementById(id);

/** Shows one error message instead of the page. */
function refuse(error) {
  find('cover').hidden = false;
  find('cover').classList.add('wrong');
  find('card-title').textContent = 'Cannot play this';
  find('card-text').textContent = error.message ?? String(error);
  find('progress').hidden = true;
  document.documentElement.dataset.state = 'failed';
}

/** Fetches a file next to the page; calls progressed(bytes). */
async function fetchBytes(name, progressed = () => {}) {
  let response;
  try {
    response = await fetch(name);
  } catch {
    throw new Error(`${name} cannot be fetched; serve the complete folder: carillon explore FOLDER --serve`);
  }
  if (!response.ok) throw new Error(`${name} is missing (${response.status}); make the folder again with carillon explore`);
  const parts = [];
  let length = 0;
  for (const reader = response.body.getReader(); ; ) {
    const { done, value } = await reader.read();
    if (done) break;
    parts.push(value);
    length += value.length;
    progressed(value.length);
  }
  const bytes = new Uint8Array(length);
  parts.reduce((at, part) => (bytes.set(part, at), at + part.length), 0);
  return bytes.buffer;
}
/** Decompresses a file, unless the server has. */
async function fetchText(name) {
  const bytes = await fetchBytes(name), [first, second] = new Uint8Array(bytes, 0, Math.min(2, bytes.byteLength));
  if (first !== 0x1f || second !== 0x8b) return new TextDecoder().decode(bytes);
  try {
    return await new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream('gzip'))).text();
  } catch {
    throw new Error(`${name} is damaged; make the folder again with carillon explore`);
  }
}
async function fetchJson(name) {
  const text = await fetchText(name);
  try {
    return JSON.parse(text);
  } catch {
    throw new Error(`${name} is damaged: it is not valid JSON; make the folder again with carillon explore`);
  }
}

/** Loads explore.json and the scene. */
async function readFolder() {
  const about = await fetchJson('explore.json');
  if (about.carillon_explore !== kVersion)
    throw new Error(`explore.json has version ${about.carillon_explore}, this page reads version ${kVersion}; make the folder again with carillon explore`);
  const scene = await fetchJson(about.scene);
  if (!Array.isArray(scene.bodies) || scene.bodies.length !== about.bodies?.length)
    throw new Error(`${about.scene} and explore.json do not match; make the folder again with carillon explore`);
  return { about, scene };
}

/** Loads the sound engine. */
async function loadEngine() {
  try {
    return (await import('./audio/carillon-audio.js')).CarillonAudio;
  } catch (error) {
    throw new Error(`the sound engine, audio/carillon-audio.js, cannot be loaded (${error.message}); make the folder again with carillon explore`);
  }
}

/** The two ears of a scene, in the frame of the listener. */
function findEars(scene) {
  const half = 0.5 * (scene.listener?.ear_distance_m ?? 0.2);
  return [[-half, 0, 0], [half, 0, 0]];
}

async function addBodies({ about, scene }, audio, view, player) {
  const progress = find('progress'), banks = new Map();
  let loaded = 0;
  progress.max = about.bodies.reduce((sum, { bank_bytes }) => sum + bank_bytes, 0);
  for (const [i, said] of scene.bodies.entries()) {
    if (!banks.has(said.bank)) {
      find('card-text').textContent = `loading ${said.name}`;
      const bytes = await fetchBytes(said.bank, (count) => (progress.value = loaded += count));
      banks.set(said.bank, await audio.addBank(bytes, said.bank));
    }
    const bank = banks.get(said.bank), surface = { vertices_m: bank.vertices_m, triangles: bank.triangles };
    const position_m = said.position_m ?? [0, 0, 0], rotation = said.quaternion ?? fromDegrees(said.rotation_deg ?? [0, 0, 0]);
    const look = makeLook(about.bodies[i].material, about.bodies[i].group);
    const shown = new ShownBody({
      name: said.name, surface, position_m, rotation, centre_m: bank.centre_m, look, fixed: said.fixed ?? false,
    });
    const sound = await audio.addBody({
      bank, name: said.name, position_m, rotation, fixed: said.fixed ?? false, effects: said.effects ?? scene.effects ?? 'auto',
      roughness_m: said.roughness_m, friction: said.friction, radiation: scene.radiation, frequencies: scene.frequencies,
      supports: { on: said.on, joint: said.joint, loss: said.loss, supports: said.supports, held: said.held },
    });
    view.addBody(shown);
    player.bodies.push({ name: said.name, file: said.bank, bank, surface, shown, sound, look, about: about.bodies[i] });
  }
}

/** View from the listener of the scene, with all bodies visible. */
function placeView(scene, view) {
  const { listener = {} } = scene, position = listener.position_m ?? listener.path?.[0].slice(1) ?? [0, -1.5, 0.5];
  const away = norm(subtract(view.middle, position)), facing = listener.facing;
  const target = listener.look_at_m ?? (facing ? position.map((x, c) => x + (away * facing[c]) / norm(facing)) : view.middle);
  view.orbit.place(position, target, view.size);
  view.orbit.fit(view.listCorners());
}

async function begin() {
  find('card-text').textContent = 'opening the sound engine';
  find('progress').hidden = false;
  const folder = await readFolder(), { about, scene } = folder;
  document.title = find('title').textContent = about.title;
  const context = new AudioContext({ latencyHint: 'interactive', sampleRate: scene.sample_rate_hz ?? 48000 });
  const ground = scene.ground ? { roughness_m: scene.ground.roughness_m, friction: scene.ground.friction } : undefined;
  const CarillonAudio = await loadEngine();
  const audio = await CarillonAudio.open({
    context, connect: false, microphones_m: findEars(scene), gain_per_pa: about.gain_per_pa, max_bodies: Math.max(1, scene.bodies.length), ground,
  });
  const view = new View(find('view')), player = new Player(audio, about.gain_per_pa);
  await addBodies(folder, audio, view, player);
  view.settle(scene.ground ? scene.ground.height_m ?? 0 : null);
  placeView(scene, view);
  const spectrum = new Spectrum(find('chart'), find('tip'), player.meter), hands = new Hands(view, player);
  const panel = new Panel({ about, player, view, hands, spectrum });

  const listen = () => {
    const listener = view.orbit.findListener();
    panel.showEars(norm(subtract(listener.position_m, view.orbit.target)));
    if (find('follow').checked) audio.setListener(listener);
  };
  view.addEventListener('turned', listen);
  find('follow').addEventListener('change', listen);
  listen();
  audio.addEventListener('state', ({ detail }) => panel.hear(detail));
  audio.addEventListener('error', ({ detail }) => panel.say(detail.message));
  if (about.contacts) {
    const recording = await audio.addRecording(await fetchText(about.contacts), player.bodies.map(({ sound }) => sound));
    const elements = { section: find('transport'), play: find('play'), position: find('position'), clock: find('clock') };
    var transport = new Transport(recording, player, view, elements);
  }
  find('fold').addEventListener('click', () => {
    const isFolded = document.documentElement.classList.toggle('folded');
    find('fold').setAttribute('aria-expanded', String(!isFolded));
    view.resize();
  });
  const thrower = new Thrower({ scene, audio, player, view, hands, panel, transport });
  // For scripts and tests.
  window.carillon = { about, scene, audio, player, view, hands, panel, transport, thrower, Recorder };
  find('cover').hidden = true;
  document.documentElement.dataset.state = 'ready';
  panel.say(`${about.title} is ready`);
  view.draw();
}

begin().catch(refuse);
window.addEventListener('unhandledrejection', ({ reason }) => {
  if (document.documentElement.dataset.state !== 'ready') return;
  find('status').textContent = reason?.message ?? String(reason);
});
