// Rigid bodies of a page: they fall, strike, slide and rest, are pushed and held, and sound by a CarillonAudio.
//
//   const world = await World.open(audio, { bodies: [{ body: cup, bank: bytes }, { body: shelf, bank: bytes, fixed: true }] });
//   await world.push(cup, [0, 0, 0.1]);
//   await world.grab(cup), await world.drag(cup, [0, 0, 0.4], 0.1), await world.release(cup);
//   draw(world.pose(cup));
//
// SI units, as in carillon-audio.js. The world is simulated on a worker, look_ahead_s ahead of the sound: actions are heard that much
// later. Invalid arguments reject with an Error of one sentence.

const kGround = { height_m: 0, young_modulus_pa: 30e9, poisson_ratio: 0.2, restitution: 0.5, friction: 0.5, rolling_resistance: 1e-3, density_kg_m3: 2400, roughness_m: 20e-6 };
const kStill = [0, 0, 0], kKept = 4096; // poses of a body that wait to be asked for
const kKeys = { ArrowLeft: [-1, 0, 0], ArrowRight: [1, 0, 0], ArrowUp: [0, 1, 0], ArrowDown: [0, -1, 0], PageUp: [0, 0, 1], PageDown: [0, 0, -1] };

export class World {
  /**
   * bodies: [{body, bank: bytes of its bank, fixed, absent, velocity_m_s, angular_velocity_rad_s, restitution (0.5), friction (0.4),
   * rolling_resistance (0.001), roughness_m}]; each body of the audio starts where it was added. ground: keys of kGround, or null: none. modes: impacts include modes
   * while the physics is ahead of the sound. masking: inaudible hits are omitted. moved: called after new poses.
   */
  static async open(audio, { bodies, ground = {}, gravity_m_s2 = [0, 0, -9.81], look_ahead_s = 0.1, modes = true, masking = true, moved = () => {} }) {
    const world = new World();
    Object.assign(world, { audio, numbers: new Map(), paths: bodies.map(() => []), ids: 0, waiting: new Map(), moved });
    const url = new URL('./carillon-physics.wasm', import.meta.url), answer = await fetch(url);
    if (!answer.ok) throw new Error(`${url.pathname} cannot be read (${answer.status}); make the page's folder again`);
    const module = await WebAssembly.compile(await answer.arrayBuffer());
    const banks = [], described = bodies.map(({ body, bank, ...more }, n) => {
      const { position_m, rotation } = body.spec;
      world.numbers.set(body, n);
      if (!banks.some(({ bytes }) => bytes === bank)) banks.push({ bytes: bank, name: body.bank.name });
      const { velocity_m_s = kStill, angular_velocity_rad_s = kStill, restitution = 0.5, friction = 0.4, rolling_resistance = 1e-3, roughness_m = 2e-6 } = more;
      const { fixed = false, absent = false } = more;
      const numbers = [...position_m, ...rotation, ...velocity_m_s, ...angular_velocity_rad_s, restitution, friction, rolling_resistance, roughness_m, +fixed, +absent];
      return { bank: banks.findIndex(({ bytes }) => bytes === bank), name: body.name, numbers, number: body.number };
    });
    const floor = { ...kGround, ...ground }, row = [...gravity_m_s2, +(ground !== null), ...Object.keys(kGround).map((key) => floor[key]), +modes, +masking];
    world.thread = new Worker(new URL('./carillon-physics.js', import.meta.url), { type: 'module' });
    world.thread.onmessage = ({ data }) => world.take(data);
    const failed = new Promise((_, reject) => {
      world.thread.onerror = (event) => reject(new Error(`the worker of the physics cannot be started: ${event.message ?? 'unknown'}`));
    });
    const between = new MessageChannel(), playback = ++audio.playbacks;
    audio.engine.tell({ type: 'port', port: between.port1 }, [between.port1]);
    const message = { type: 'open', module, port: between.port2, banks, bodies: described, world: row, playback, look_ahead_s, isLive: !(audio.context instanceof OfflineAudioContext) };
    world.at_s = await Promise.race([world.ask(message, [between.port2]), failed]);
    return world;
  }

  ask(message, transfer = []) {
    return new Promise((resolve, reject) => {
      this.waiting.set(++this.ids, { resolve, reject });
      this.thread.postMessage({ ...message, id: this.ids }, transfer);
    });
  }
  take({ id, result, message, poses, failed }) {
    for (const [body, ...pose] of poses ?? []) {
      const path = this.paths[body];
      if (path.push(pose) > kKept) path.splice(0, kKept / 2);
    }
    if (poses !== undefined) this.moved();
    if (failed !== undefined) this.audio.report(failed);
    const { resolve, reject } = this.waiting.get(id) ?? {};
    this.waiting.delete(id);
    if (message !== undefined) reject?.(new Error(message));
    else resolve?.(result);
  }
  act(type, body, more = {}) {
    const number = this.numbers.get(body);
    if (number === undefined) return Promise.reject(new Error('this body is not one of the world'));
    return this.ask({ type, body: number, ...more });
  }

  /** An impulse [N s] at a point of the world [m], or at the centre of mass. */
  push(body, impulse_n_s, at_m) {
    return this.act('push', body, { impulse_n_s, at_m });
  }
  /** Holds a body at a point of the world, or at its centre of mass, by a spring: {at_m, frequency_hz, damping_ratio, max_force_n}. */
  grab(body, spring = {}) {
    return this.act('grab', body, spring);
  }
  /** Moves the held point evenly to a target within a time. */
  drag(body, target_m, over_s) {
    return this.act('drag', body, { target_m, over_s });
  }
  release(body) {
    return this.act('release', body);
  }
  /** Puts an absent body into the world: position of its mesh frame. */
  add(body, { position_m, rotation = [1, 0, 0, 0], velocity_m_s = kStill, angular_velocity_rad_s = kStill }) {
    return this.act('add', body, { numbers: [...position_m, ...rotation, ...velocity_m_s, ...angular_velocity_rad_s] });
  }
  remove(body) {
    return this.act('remove', body);
  }

  /**
   * Mouse, pen, fingers and keys of an element move bodies; returns a function that ends it. pick(event): {body, at_m} under the pointer, or
   * undefined. place(event, at_m): the point of the world where the pointer has moved to, for one held at at_m. Each pointer holds one body
   * and throws it when it leaves. Keys push a body to speed_m_s. keys(event): direction of the push, or undefined (default:
   * arrow and page keys, along the axes of the world); chosen(): the body (default: the last one held).
   */
  follow(element, { pick, place, speed_m_s = 1, keys = ({ key }) => kKeys[key], chosen }) {
    const held = new Map(), ends = new AbortController();
    let last;
    const quietly = (work) => void work.catch(({ message }) => this.audio.report(message));
    const on = (type, act) => element.addEventListener(type, act, { signal: ends.signal });
    on('pointerdown', (event) => {
      const picked = pick(event);
      if (picked === undefined) return;
      event.preventDefault();
      element.setPointerCapture?.(event.pointerId);
      last = picked.body;
      held.set(event.pointerId, { ...picked, moved_ms: event.timeStamp });
      quietly(this.grab(picked.body, { at_m: picked.at_m }));
    });
    on('pointermove', (event) => {
      const of = held.get(event.pointerId);
      if (of === undefined) return;
      of.at_m = place(event, of.at_m);
      const over_s = Math.min(0.1, Math.max(0.004, (event.timeStamp - of.moved_ms) / 1000));
      of.moved_ms = event.timeStamp;
      quietly(this.drag(of.body, of.at_m, over_s));
    });
    for (const type of ['pointerup', 'pointercancel'])
      on(type, (event) => {
        const of = held.get(event.pointerId);
        if (held.delete(event.pointerId)) quietly(this.release(of.body));
      });
    on('keydown', (event) => {
      const direction = keys(event), body = chosen ? chosen() : last;
      if (direction === undefined || body === undefined) return;
      event.preventDefault();
      quietly(this.push(body, direction.map((x) => x * speed_m_s * body.mass_kg)));
    });
    return () => ends.abort();
  }

  /** Time of the world that is heard now [s]. */
  get time_s() {
    return this.audio.heard_s - this.at_s;
  }
  /** Pose of a body at the time heard now: {position_m of its centre of mass, rotation}; undefined before the start. */
  pose(body) {
    const path = this.paths[this.numbers.get(body)], now_s = this.time_s;
    while (path.length > 1 && path[1][0] <= now_s) path.shift();
    return path.length === 0 ? undefined : { position_m: path[0].slice(1, 4), rotation: path[0].slice(4, 8) };
  }
  /** Resolves when the physics is look_ahead_s ahead of the engine. An OfflineAudioContext must be suspended for it at least that often. */
  settled() {
    return this.ask({ type: 'settle' });
  }
  close() {
    void this.ask({ type: 'close' }).then(() => this.thread.terminate());
  }
}
