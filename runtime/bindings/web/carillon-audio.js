// The sound engine of a web page: struck bodies, synthesised by Carillon in WebAssembly.
//
//   const audio = await CarillonAudio.open();
//   const bank = await audio.addBank(await (await fetch('cup.hdf')).arrayBuffer(), 'cup.hdf');
//   const cup = await audio.addBody({ bank, name: 'cup', position_m: [0, 1, 0] });
//   await cup.hit({ triangle: 12, barycentric: [0.3, 0.3, 0.4], mallet: 'hard-wood' });
//
// SI units; vectors are [x, y, z], z up; rotations are unit quaternions [w, x, y, z] of the frame of the mesh in the world. Invalid
// arguments reject with an Error of one sentence; errors outside of a call are 'error' events. Performance: docs/performance-web.md.

const kNotTurned = [1, 0, 0, 0], kCentre = [1 / 3, 1 / 3, 1 / 3];
const kExact = 0, kSoon = 1;
const kLead_s = 0.15; // lead of a recorded scene's events over its start
const kState = { begin: 0, hold: 1, end: 2 };
const kHandImpedance_n_s_m = 1; // impedance of hand and mallet at the contact; an estimate

/** True if the browser supports WebAssembly SIMD: validates a module with one such instruction. */
function hasSimd() {
  return WebAssembly.validate(Uint8Array.of(0, 97, 115, 109, 1, 0, 0, 0, 1, 5, 1, 96, 0, 1, 123, 3, 2, 1, 0, 10, 10, 1, 8, 0, 65, 0, 253, 15, 253, 98, 11));
}

/** A row of runtime/bindings/web/event_words.hpp. */
function makeRow(kind, time_s, fields) {
  const isExact = time_s !== undefined;
  return Float64Array.of(fields.length + 4, kind, isExact ? kExact : kSoon, isExact ? time_s : 0, ...fields);
}
const makeImpulse = (body, { triangle, barycentric = kCentre, impulse_n_s, duration_s = 0, time_s }) =>
  makeRow(1, time_s, [body, -1, triangle, 0, ...barycentric, ...impulse_n_s, duration_s]);
const makeMotion = (body, { position_m, velocity_m_s = [0, 0, 0], rotation = kNotTurned, time_s }) =>
  makeRow(4, time_s, [body, ...position_m, ...velocity_m_s, ...rotation]);
const makeListener = ({ position_m, velocity_m_s = [0, 0, 0], rotation = kNotTurned, time_s }) =>
  makeRow(5, time_s, [...position_m, ...velocity_m_s, ...rotation]);

/** Rows of at most 16 steps. */
function makeForce(body, { triangle, barycentric = kCentre, step_s, impulse_n_s, time_s }) {
  const rows = [];
  for (let done = 0; done < impulse_n_s.length; done += 16) {
    const steps = impulse_n_s.slice(done, done + 16);
    const row = makeRow(2, time_s, [step_s, body, -1, triangle, done > 0 ? 1 : 0, ...barycentric, ...steps.flat()]);
    row[3] += done * step_s;
    rows.push(...row);
  }
  return Float64Array.from(rows);
}

function rotate([w, a, b, c], x) {
  const t = [2 * (b * x[2] - c * x[1]), 2 * (c * x[0] - a * x[2]), 2 * (a * x[1] - b * x[0])];
  return [x[0] + w * t[0] + b * t[2] - c * t[1], x[1] + w * t[1] + c * t[0] - a * t[2], x[2] + w * t[2] + a * t[1] - b * t[0]];
}

/** Sends requests to another thread and matches their answers. */
class Line {
  constructor(port, onMessage) {
    this.port = port;
    this.count = 0;
    this.waiting = new Map();
    port.onmessage = ({ data }) => {
      const waiting = data.id === undefined ? undefined : this.waiting.get(data.id);
      if (waiting === undefined) return onMessage(data);
      this.waiting.delete(data.id);
      if (data.message !== undefined) waiting.reject(new Error(data.message));
      else waiting.resolve(data.result);
      return undefined;
    };
  }
  ask(message, transfer = []) {
    return new Promise((resolve, reject) => {
      this.waiting.set(++this.count, { resolve, reject });
      this.port.postMessage({ ...message, id: this.count }, transfer);
    });
  }
  tell(message, transfer = []) {
    this.port.postMessage(message, transfer);
  }
}

/** A mode bank. */
export class Bank {
  constructor(audio, id, facts) {
    const { modes, vertices_m, triangles, ...rest } = facts;
    Object.assign(this, { audio, id, modes, vertices_m, triangles, facts: rest });
    for (const name of ['name', 'mode_count', 'vertex_count', 'triangle_count', 'centre_m', 'mass_kg']) this[name] = facts[name];
  }
  /** Change of a mode by cuts at the corners of the triangles, Float32Array(3 T) [cent / (mm m^2)], NaN where doubtful; empty without
   * sensitivities. */
  density(mode) {
    return this.audio.worker.ask({ type: 'density', bank: this.id, mode });
  }
  /** The shape of a mode at every vertex, Float32Array(3 V) [kg^-1/2]. */
  shape(mode) {
    return this.audio.worker.ask({ type: 'shape', bank: this.id, mode });
  }
  close() {
    this.audio.worker.tell({ type: 'closeBank', bank: this.id });
  }
}

/** A lasting contact: a head that rests on, slides over or presses against a body. */
class Touch {
  constructor(body, fields) {
    this.body = body;
    this.id = ++body.audio.touches;
    this.fields = { force_n: 1, slip_m_s: [0, 0, 0], sweep_m_s: undefined, other_sweep_m_s: 0, spin_rad_s: 0, impedance_n_s_m: kHandImpedance_n_s_m };
    this.push('begin', fields);
  }
  push(state, fields = {}) {
    Object.assign(this.fields, fields);
    const { triangle, barycentric = kCentre, normal, force_n, slip_m_s, other_sweep_m_s, spin_rad_s, impedance_n_s_m, mallet, time_s } = this.fields;
    const sweep_m_s = this.fields.sweep_m_s ?? Math.hypot(...slip_m_s), { patches } = this.body;
    const patch_m = this.fields.patch_radius_m ?? (patches[mallet] ?? patches.steel) * Math.cbrt(Math.max(force_n, 1e-6));
    // The upper half of the id distinguishes interactive contacts from recorded ones.
    this.body.audio.push(
      makeRow(3, time_s, [
        0x68616e64, this.id, this.body.number, -1, triangle, kState[state], ...barycentric, ...normal, ...slip_m_s, force_n, sweep_m_s, other_sweep_m_s,
        spin_rad_s, patch_m, impedance_n_s_m,
      ]),
    );
  }
  /** Changes some fields of the contact. */
  move(fields) {
    if (!this.isOver) this.push('hold', fields);
  }
  end() {
    if (!this.isOver) this.push('end', { force_n: 0 });
    this.isOver = true;
  }
}

/** A sounding body. */
export class Body {
  constructor(audio, id, spec) {
    Object.assign(this, { audio, id, spec, name: spec.name, bank: spec.bank });
  }

  /** The body as described in a scene file. */
  describe() {
    const { name, position_m, rotation, fixed, effects, roughness_m, friction, supports = {} } = this.spec;
    const said = { name, bank: 'bank', position_m, quaternion: rotation, fixed, roughness_m, friction, ...supports };
    if (effects !== undefined) said.effects = effects;
    return said;
  }
  makeScene(more = {}) {
    const { radiation, frequencies } = this.spec;
    return JSON.stringify({ ...this.audio.makeScene(), radiation, frequencies, bodies: [this.describe()], ...more });
  }

  /** Makes or remakes the body in the workshop. */
  async make(edits) {
    const facts = await this.audio.worker.ask({ type: 'body', body: this.id, bank: this.bank.id, scene: this.makeScene(), edits: JSON.stringify(edits) });
    this.edits = edits;
    return facts;
  }
  take(facts) {
    for (const name of ['modes', 'cut_cents', 'mass_kg', 'centre_m', 'sounding_modes', 'limited_modes']) this[name] = facts[name];
    this.patches = facts.patch_m;
    this.model = facts.model;
  }

  /** A contact pulse, sin^1.5 of this duration; impulse in the frame of the mesh. Default time_s: as soon as possible. */
  strike(pulse) {
    this.audio.push(makeImpulse(this.number, pulse));
  }
  /** A sampled force: impulse_n_s has one row per step. */
  push(force) {
    this.audio.push(makeForce(this.number, force));
  }
  /** The blow of a mallet, solved with the body's modes. mallet: a name, or the keys of "mallet" in scene files. */
  hit({ triangle, barycentric = kCentre, mallet = 'hard-wood', speed_m_s, direction, time_s }) {
    const head = typeof mallet === 'string' ? { from: mallet } : { ...mallet };
    if (speed_m_s !== undefined) head.speed_m_s = speed_m_s;
    if (direction !== undefined) head.direction = direction;
    const scene = this.makeScene({ strikes: [{ time_s: 1, body: this.name, triangle, mallet: head }] });
    return this.audio.worker.ask({ type: 'blow', body: this.id, scene, triangle, barycentric, time_s, number: this.number });
  }
  /** Starts a lasting contact: {triangle, barycentric, normal, force_n, slip_m_s, mallet, ...}, in the frame of the mesh. */
  touch(fields) {
    return new Touch(this, fields);
  }
  /** Response of each mode to a strike there, Float32Array(m): Pa at 1 m for 1 N s. */
  levels(triangle, barycentric = kCentre) {
    return this.audio.worker.ask({ type: 'levels', body: this.id, triangle, barycentric });
  }

  /** Changes material, size, density, stiffness or damping while it rings. The last request applies; resolves with the new modes. */
  async edit(edits) {
    this.wish = edits;
    this.editing ??= (async () => {
      try {
        // Earlier pending requests resolve with the last one.
        while (this.wish !== undefined) {
          const wish = this.wish;
          this.wish = undefined;
          const centre_m = this.centre_m, facts = await this.make(wish);
          await this.audio.engine.ask({ type: 'swap', body: this.number, model: facts.model });
          this.take(facts);
          if (String(centre_m) !== String(facts.centre_m) && !this.isMoved) this.audio.push(makeMotion(this.number, { position_m: facts.position_m, rotation: facts.rotation }));
        }
      } finally {
        this.editing = undefined;
      }
      return this.modes;
    })();
    return this.editing;
  }

  /** Solo of one mode by its number; null: all modes. */
  solo(mode) {
    this.audio.engine.tell({ name: 'web_set_solo', numbers: [this.number, mode ?? -1] });
  }
  /** Excites one mode at `level` times a quarter of full scale at 1 m. */
  ping(mode, level = 1) {
    const pressure_pa = (0.25 * level) / this.audio.gain_per_pa;
    this.audio.worker.ask({ type: 'ping', body: this.id, mode, pressure_pa, number: this.number }).catch((error) => this.audio.report(error.message));
  }

  /** Sets its centre of mass: {position_m, velocity_m_s, rotation, time_s}. Default time_s: now, along a smooth path. */
  setPosition(motion) {
    this.isMoved = true;
    this.audio.push(makeMotion(this.number, motion));
  }
  /** Includes its modal amplitudes and largest deflection so far [thicknesses; 0 up to half a thickness] in 'state' events. */
  watch(isWatched) {
    this.audio.engine.tell({ type: 'watch', body: this.number, modes: isWatched ? this.bank.mode_count : 0 });
  }
  /** Current modal amplitudes, Float32Array(m) [m kg^1/2]. */
  measure() {
    return this.audio.engine.ask({ type: 'measure', body: this.number, modes: this.bank.mode_count });
  }
  remove() {
    this.audio.engine.tell({ name: 'web_remove_body', numbers: [this.number] });
    this.audio.worker.tell({ type: 'closeBody', body: this.id });
    this.audio.bodies.delete(this);
  }
}

/** A contacts file: a recorded simulation. */
export class Recording {
  constructor(audio, id, bodies, facts) {
    const { poses, ...rest } = facts;
    Object.assign(this, { audio, id, bodies, poses, facts: rest, duration_s: facts.duration_s, playback: 0 });
  }
  /** Plays it from a recording time, at an engine time; default at_s: as soon as possible. Resolves with the start time. */
  async start({ at_s, from_s = 0 } = {}) {
    this.stop();
    const playback = ++this.audio.playbacks, bodies = this.bodies.map((body) => body.number);
    this.playback = playback;
    this.from_s = from_s;
    this.at_s = undefined;
    const began_s = await this.audio.worker.ask({ type: 'play', recording: this.id, playback, bodies, at_s, from_s, lead_s: kLead_s });
    if (this.playback === playback) this.at_s = began_s;
    return began_s;
  }
  /** Contacts end; ringing modes continue. */
  stop() {
    if (this.playback === 0) return;
    this.stopped_s = this.time_s;
    this.audio.engine.tell({ name: 'web_end_playback', numbers: [this.playback] });
    this.playback = 0;
  }
  /** Recording time heard now. */
  get time_s() {
    if (this.playback === 0) return this.stopped_s ?? 0;
    return this.at_s === undefined ? this.from_s : Math.max(this.from_s, this.from_s + this.audio.heard_s - this.at_s);
  }
  /** Pose of a body at a recording time: {position_m of its centre of mass, rotation}, or undefined if not recorded. */
  pose(body, time_s) {
    const rows = this.poses[body], count = rows.length / 8;
    if (count === 0) return undefined;
    let low = 0, high = count; // the first later row
    while (low < high) {
      const middle = (low + high) >> 1;
      if (rows[8 * middle] <= time_s) low = middle + 1;
      else high = middle;
    }
    const a = 8 * Math.max(0, low - 1), b = 8 * Math.min(count - 1, low), span_s = rows[b] - rows[a];
    const u = span_s > 0 ? Math.min(1, Math.max(0, (time_s - rows[a]) / span_s)) : 0;
    const between = (k, sign = 1) => (1 - u) * rows[a + k] + u * sign * rows[b + k];
    const sign = rows[a + 4] * rows[b + 4] + rows[a + 5] * rows[b + 5] + rows[a + 6] * rows[b + 6] + rows[a + 7] * rows[b + 7] < 0 ? -1 : 1;
    const rotation = [4, 5, 6, 7].map((k) => between(k, sign)), size = Math.hypot(...rotation);
    return { position_m: [between(1), between(2), between(3)], rotation: rotation.map((x) => x / size) };
  }
  /** CarillonAudio.plan() of the whole recording. */
  plan() {
    return this.audio.worker.ask({ type: 'planRecording', recording: this.id, scene: this.audio.makePlanScene(this.bodies, this.duration_s) });
  }
  close() {
    this.stop();
    this.audio.worker.tell({ type: 'closeRecording', recording: this.id });
  }
}

/** The engine of a page. Events: 'state', about 30 per second in real time, and 'error', with {message}. */
export class CarillonAudio extends EventTarget {
  /**
   * context: an AudioContext or OfflineAudioContext (a new one). connect: connects to its destination (true). simd: 'auto', true or false.
   * microphones_m: relative to the listener, in its frame, one per channel (two ears 20 cm apart). listener: {position_m, rotation}. gain_per_pa:
   * full scale per pascal (1). max_bodies (64). ground: {roughness_m, friction}. load_share: share of one core, above which the least
   * audible modes fade (0.6; null: no limit, as in an OfflineAudioContext).
   */
  static async open(options = {}) {
    const audio = new CarillonAudio();
    await audio.begin(options);
    return audio;
  }

  async begin({ context = new AudioContext(), connect = true, simd = 'auto', microphones_m = [[-0.1, 0, 0], [0.1, 0, 0]], listener, gain_per_pa = 1,
    max_bodies = 64, ground = {}, load_share = 0.6 }) {
    const isOffline = typeof OfflineAudioContext !== 'undefined' && context instanceof OfflineAudioContext;
    Object.assign(this, { context, gain_per_pa, ground, bodies: new Set(), touches: 0, playbacks: 0, ids: 0, offset_s: 0 });
    this.listener = { position_m: [0, -1.5, 0.5], rotation: kNotTurned, ...listener };
    if (!context.audioWorklet) throw new Error('the browser has no AudioWorklet for this page; open it by https or from localhost');
    // Bundlers include files of literal URLs; the module without SIMD is not included.
    const [module] = await Promise.all([
      this.compile(new URL('./carillon.wasm', import.meta.url), simd === 'auto' ? hasSimd() : simd),
      context.audioWorklet.addModule(new URL('./carillon-worklet.js', import.meta.url)),
    ]);

    const channels = microphones_m.length;
    this.node = new AudioWorkletNode(context, 'carillon', {
      numberOfInputs: 0, numberOfOutputs: 1, outputChannelCount: [channels], channelCountMode: 'explicit', channelInterpretation: 'discrete',
      processorOptions: {
        module, microphones_m, max_bodies, gain_per_pa, ground: { roughness_m: ground.roughness_m ?? 20e-6, friction: ground.friction ?? 0.5 },
        load_share: isOffline ? null : load_share, reports: !isOffline,
      },
    });
    await new Promise((resolve, reject) => {
      this.node.onprocessorerror = () => reject(new Error('the audio worklet cannot be created'));
      this.engine = new Line(this.node.port, (data) => {
        if (data.type === 'open') resolve();
        else if (data.type === 'state') this.hear(data);
        else if (data.type === 'error') {
          reject(new Error(data.message));
          this.report(data.message);
        }
      });
    });
    this.node.onprocessorerror = () => this.report('the audio worklet has failed; load the page again');

    const thread = new Worker(new URL('./carillon-worker.js', import.meta.url), { type: 'module' }), between = new MessageChannel();
    this.worker = new Line(thread, (data) => this.report(data.message ?? 'the workshop has failed; load the page again'));
    const failed = new Promise((_, reject) => {
      thread.onerror = (event) => reject(new Error(`the worker of the sound engine cannot be started: ${event.message ?? 'unknown'}`));
    });
    this.engine.tell({ type: 'port', port: between.port1 }, [between.port1]);
    const opened = this.worker.ask({ type: 'open', module, rate_hz: context.sampleRate, port: between.port2 }, [between.port2]);
    const { mallets, materials, effects, instructions } = await Promise.race([opened, failed]);
    Object.assign(this, { mallets, materials, effects, instructions, thread });
    this.push(makeListener({ ...this.listener, time_s: 0 }));
    if (connect) this.node.connect(context.destination);
  }

  /** withSimd: the URL of the module with SIMD; the one without is in the same folder. */
  async compile(withSimd, isSimd) {
    const url = isSimd ? withSimd : new URL('carillon-plain.wasm', withSimd), answer = await fetch(url);
    const remedy = isSimd ? "make the page's folder again" : 'this browser has no WebAssembly SIMD: build the target carillon_page_plain';
    if (!answer.ok) throw new Error(`${url.pathname} cannot be read (${answer.status}); ${remedy}`);
    return WebAssembly.compile(await answer.arrayBuffer());
  }

  report(message) {
    this.dispatchEvent(new CustomEvent('error', { detail: { message } }));
  }
  hear(state) {
    const { time_s, context_time_s, load, peak_pa, counters } = state;
    this.offset_s = context_time_s - time_s;
    this.counters_ = counters;
    const bodies = state.bodies.map(({ body, amplitudes, deflection_thicknesses }) => {
      const of = [...this.bodies].find(({ number }) => number === body);
      return { id: of?.id, body: of, awake: amplitudes.some((x) => x > 0), amplitudes, deflection_thicknesses };
    });
    this.dispatchEvent(new CustomEvent('state', { detail: { time_s, context_time_s, load, peak_pa, counters, bodies } }));
  }

  /** Engine time in seconds, as used by events. */
  get time_s() {
    return this.context.currentTime - this.offset_s;
  }
  /** Engine time of the sound at the loudspeakers now. */
  get heard_s() {
    const stamp = this.context.getOutputTimestamp?.(), { contextTime = this.context.currentTime, performanceTime = 0 } = stamp ?? {};
    const since_s = performanceTime > 0 ? (performance.now() - performanceTime) / 1000 : 0;
    return Math.min(this.context.currentTime, contextTime + since_s) - this.offset_s;
  }

  /** Sends events to the audio thread and the log of plans. */
  push(words) {
    if (words[1] > 0 && words[1] < 4) this.worker.tell({ type: 'log', words: words.slice(), now_s: this.time_s });
    this.engine.tell({ type: 'push', words }, [words.buffer]);
  }

  /** bytes: a complete bank file. */
  async addBank(bytes, name = 'bank') {
    const buffer = bytes instanceof ArrayBuffer ? bytes : bytes.slice().buffer, id = ++this.ids;
    return new Bank(this, id, await this.worker.ask({ type: 'bank', bank: id, bytes: buffer, name }, bytes instanceof ArrayBuffer ? [] : [buffer]));
  }

  /** {bank, name, position_m of the mesh's origin, rotation, fixed, effects, roughness_m, friction, radiation, frequencies, supports}, most of
   * them as scene files have them. */
  async addBody(spec) {
    const id = ++this.ids;
    const body = new Body(this, id, { name: `body ${id}`, position_m: [0, 0, 0], rotation: kNotTurned, fixed: false, ...spec });
    const facts = await body.make(spec.edits ?? {});
    body.take(facts);
    const { position_m, rotation, silence_pa, roughness_m, friction, seed_high, seed_low } = facts;
    const pose = [...position_m, ...rotation, silence_pa, roughness_m, friction, seed_high, seed_low];
    body.number = await this.engine.ask({ type: 'body', model: facts.model, pose, effects: facts.effects });
    this.bodies.add(body);
    return body;
  }

  /** text: a contacts file; bodies: its bodies, in its order. */
  async addRecording(text, bodies, name = 'contacts file') {
    const id = ++this.ids;
    return new Recording(this, id, bodies, await this.worker.ask({ type: 'recording', recording: id, text, name, bodies: bodies.map((body) => body.id) }));
  }

  makeScene() {
    return { duration_s: 3600, sample_rate_hz: this.context.sampleRate };
  }
  makePlanScene(bodies, duration_s) {
    const names = new Set(), described = bodies.map((body) => {
      const said = body.describe();
      while (names.has(said.name)) said.name += "'";
      names.add(said.name);
      return said;
    });
    const facing = rotate(this.listener.rotation, [0, 1, 0]), { position_m } = this.listener;
    return JSON.stringify({ ...this.makeScene(), duration_s: Math.min(3600, Math.max(0.01, duration_s)), listener: { position_m, facing }, bodies: described });
  }
  /** Effects needed by the bodies after the events so far, with reasons: {bodies: [{name, effects: {modal: {on, why}, ...}}]}. */
  plan() {
    const bodies = [...this.bodies], numbers = bodies.map(({ number }) => number);
    if (bodies.length === 0) return Promise.resolve({ bodies: [] });
    return this.worker.ask({ type: 'plan', scene: this.makePlanScene(bodies, this.time_s), bodies: bodies.map(({ id }) => id), numbers });
  }

  /** Sets the ears: {position_m, velocity_m_s, rotation, time_s}; x right, y forward, z up. Default time_s: now, along a smooth path. */
  setListener(listener) {
    this.listener = { ...this.listener, ...listener };
    this.push(makeListener(listener));
  }
  setGain(per_pa) {
    this.gain_per_pa = per_pa;
    this.engine.tell({ type: 'gain', per_pa });
  }
  /** Limit of work per second of sound: modes times samples. load_share (see open()) adjusts the budget continuously. */
  setBudget(mode_samples_per_s, load_share = null) {
    this.engine.tell({ type: 'budget', mode_samples_per_s, load_share });
  }

  /** Resolves when the audio thread has received all messages sent so far. */
  async settled() {
    await this.engine.ask({ type: 'settle' });
  }
  /** Counters: strikes, refused, late, faults, overflows, resets, mode_samples, faded, underruns, zeroed, budget, and by the
   * clock quanta, over_budget, gaps, worst_ms, busy_ms. */
  counters() {
    return this.engine.ask({ type: 'count' });
  }
  close() {
    this.thread.terminate();
    this.node.disconnect();
    this.node.port.close();
  }
}
