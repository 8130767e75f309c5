// Throw mode: bodies are grabbed, thrown and dropped in a world of rigid bodies, loaded at first use.
import { add, dot, norm, scale, subtract } from './geometry.js';

const kReach = 2.5; // distance / size of the scene at which bodies are brought back
const kStill_ms = 700; // drawing goes on after the last pose: the sound is later
const kPush = 0.3; // height of a throw by key / size of the scene

const find = (id) => document.getElementById(id);

/** Per body: true if it can be thrown. In a scene of fixed bodies only, all can. */
export function listMovable({ bodies }) {
  const free = bodies.map(({ fixed = false }) => !fixed);
  return free.includes(true) ? free : free.map(() => true);
}

export class Thrower {
  /** page: {scene, audio, player, view, hands, panel, transport}. Scenes with joints or cords have no button: the page has no physics for them. */
  constructor(page) {
    Object.assign(this, page, { movable: listMovable(page.scene), away: new Set(), isPhone: matchMedia('(pointer: coarse)').matches });
    find('throwing').hidden = Boolean(this.scene.joints?.length || this.scene.cords?.length);
    find('throw').addEventListener('click', () => void (this.isOn ? this.stop() : this.start()));
    find('back').addEventListener('click', () => this.putBack());
    this.strikeHint = find('hint').innerHTML;
  }

  get isOn() {
    return this.hands.holds !== undefined;
  }

  async start() {
    const button = find('throw');
    if (button.disabled) return;
    button.disabled = true;
    try {
      await this.player.wake();
      if (this.world === undefined) await this.open();
    } catch (error) {
      this.note(`Cannot throw these bodies: ${error.message}`);
      return;
    } finally {
      button.disabled = false;
    }
    this.hands.holds = (body) => this.movable[this.hands.indexOf(body)];
    this.unfollow = this.world.follow(this.view.canvas, {
      pick: (event) => this.pick(event),
      place: (event, at_m) => this.place(event, at_m),
      keys: (event) => this.findDirection(event),
      chosen: () => this.findChosen(),
      speed_m_s: Math.sqrt(2 * 9.81 * kPush * this.view.size),
    });
    button.setAttribute('aria-pressed', 'true');
    find('hint').textContent = this.isPhone ? 'Drag a body and let go · one finger for each' : 'Drag a body and let go · arrow keys push it';
    find('hint').classList.remove('gone');
    this.panel.say('throwing: arrow keys push the body, Page Up throws it up, Enter strikes it');
  }
  stop() {
    this.unfollow();
    this.hands.holds = undefined;
    find('throw').setAttribute('aria-pressed', 'false');
    find('hint').innerHTML = this.strikeHint;
    this.panel.say('striking');
  }

  async open() {
    this.note('preparing the bodies …');
    this.transport?.pause();
    this.panel.reset();
    const { scene, audio, player, view } = this, banks = new Map();
    const { World } = await import('./audio/carillon-world.js');
    for (const { bank } of scene.bodies)
      if (!banks.has(bank)) banks.set(bank, await (await fetch(bank)).arrayBuffer()); // as the browser has it
    const bodies = scene.bodies.map(({ bank, velocity_m_s, angular_velocity_rad_s, restitution, friction, roughness_m }, i) => ({
      body: player.bodies[i].sound, bank: banks.get(bank), fixed: !this.movable[i], velocity_m_s, angular_velocity_rad_s, restitution, friction, roughness_m,
    }));
    const world = await World.open(audio, {
      bodies, ground: { ...scene.ground, height_m: view.floor_m }, gravity_m_s2: scene.gravity_m_s2,
      modes: !this.isPhone && (scene.quality?.modes_in_impacts ?? true), moved: () => this.follow(),
    });
    this.world = world;
    this.setOpen(true);
    this.note(this.isPhone ? 'Phone: impacts without the modes of the bodies.' : '');
    this.follow();
  }
  /** Ends the world; the bodies are where the scene has them. */
  putBack() {
    if (this.isOn) this.stop();
    this.world.close();
    this.world = undefined;
    for (const { shown, sound, bank } of this.player.bodies) {
      shown.setPose(shown.rest.position_m, shown.rest.rotation);
      sound.setPosition({ position_m: shown.toWorld(bank.centre_m), rotation: shown.rest.rotation });
    }
    this.setOpen(false);
    this.note('');
    this.transport?.show(0);
    this.view.draw();
  }
  /** Hides edits and the recording while the world is open: they hold for the poses of the scene. */
  setOpen(isOpen) {
    find('back').hidden = !isOpen;
    find('edit').hidden = isOpen;
    if (this.transport) find('transport').hidden = isOpen;
    this.view.setLoose(isOpen);
  }
  note(text) {
    find('thrown').textContent = text;
    if (text !== '') this.panel.say(text);
  }

  /** Draws the bodies while they move, and kStill_ms longer. */
  follow() {
    this.moved_ms = performance.now();
    if (this.isFollowing) return;
    this.isFollowing = true;
    this.view.move(() => {
      const { world, player } = this;
      this.isFollowing = world !== undefined && performance.now() - this.moved_ms < kStill_ms;
      if (world === undefined) return false;
      player.bodies.forEach(({ sound, shown }, i) => {
        const pose = this.movable[i] ? world.pose(sound) : undefined;
        if (pose === undefined) return;
        shown.setCentrePose(pose.position_m, pose.rotation);
        if (norm(subtract(pose.position_m, this.view.middle)) > kReach * this.view.size) void this.bringBack(i);
      });
      return this.isFollowing;
    });
  }
  /** Drops a body that is far away onto the middle of the scene, from the lowest free height. */
  async bringBack(i) {
    if (this.away.has(i)) return;
    this.away.add(i);
    const { shown, sound } = this.player.bodies[i], { middle, floor_m, size } = this.view, { rotation } = shown.rest, { world } = this;
    const offset = subtract(shown.rest.position_m, shown.findRestCentre());
    await world.remove(sound);
    for (let height = 0.6; height < 5; height += 0.2) {
      const position_m = add([middle[0], middle[1], floor_m + height * size], offset);
      if (await world.add(sound, { position_m, rotation }).then(() => true, () => false)) break;
    }
    setTimeout(() => this.away.delete(i), 1000); // until its new pose is current
  }

  // ---- hands

  pick(event) {
    if (event.button !== 0 || event.ctrlKey) return undefined;
    const hit = this.view.pick(event.clientX, event.clientY);
    if (!hit || !this.hands.holds(hit.body)) return undefined;
    find('hint').classList.add('gone');
    this.hands.select(hit);
    return { body: this.player.bodies[this.hands.indexOf(hit.body)].sound, at_m: hit.point };
  }
  /** Point under the pointer at the same depth as before, not below the floor [m]. */
  place(event, at_m) {
    const { origin, direction } = this.view.findRay(event.clientX, event.clientY), { forward } = this.view.orbit.findAxes();
    const away = dot(subtract(at_m, origin), forward) / dot(direction, forward);
    const [x, y, z] = add(origin, scale(away, direction));
    return [x, y, Math.max(this.view.floor_m, z)];
  }
  /** Direction of a push by key: horizontal ones are those of the view. */
  findDirection({ key, shiftKey }) {
    const { right } = this.view.orbit.findAxes(), away = [-right[1], right[0], 0], up = [0, 0, 1];
    const directions = {
      ArrowLeft: scale(-1, right), ArrowRight: right, ArrowUp: away, ArrowDown: scale(-1, away), PageUp: up, PageDown: scale(-1, up),
    };
    return shiftKey ? undefined : directions[key];
  }
  findChosen() {
    const index = this.hands.place ? this.hands.indexOf(this.hands.place.body) : -1;
    return this.movable[index] ? this.player.bodies[index].sound : undefined;
  }
}
