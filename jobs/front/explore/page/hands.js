// Input: pointer and keys to strikes, scrapes, presses and camera motion.
import { add, normalise, scale, subtract, norm } from './geometry.js';

const kScrapePx = 6; // movement that turns a press into a scrape
const kHoldMs = 320; // a longer press damps
const kSwingPxS = 1400; // pointer speed that doubles the speed of the mallet
const kMaxSwing = 3;
const kSwingMs = 60;
const kScrapeEndMs = 60; // a scrape stops after this time without movement
const kTurn = 3.2; // rad per window width
const kKeyStep = 0.035; // / size of the body
const kKeyTurn = 0.09; // rad
const kKeyScrape = { radius: 0.05, hz: 1.7 }; // circle of the key S: radius / size of the body, rate

export class Hands {
  /** gesture: 'strike', 'scrape' or 'press', the initial action of a press. holds(body), in throw mode: true for movable
   * bodies, which like the arrow keys are left to the Thrower. cutRadius(body): of a cut [m]. */
  constructor(view, player) {
    Object.assign(this, { view, player, gesture: 'strike', pointers: new Map(), keys: new Map() });
    const { canvas } = view, on = (name, work) => canvas.addEventListener(name, (event) => work.call(this, event));
    on('pointerdown', this.press);
    on('pointermove', this.moved);
    on('pointerup', this.release);
    on('pointercancel', this.release);
    on('pointerleave', this.leave);
    on('wheel', this.roll);
    on('contextmenu', (event) => event.preventDefault());
    on('keydown', this.key);
    on('keyup', this.keyEnds);
    on('blur', () => this.endKeys());
  }

  indexOf(body) {
    return this.view.bodies.indexOf(body);
  }
  select(place) {
    this.place = place;
    this.view.setCursor(place);
    this.view.dispatchEvent(new CustomEvent('place', { detail: place }));
  }

  strike(place, factor = 1) {
    this.select(place);
    const speed = this.player.speed_m_s * factor;
    this.view.ripple(place, Math.min(1, speed / 3));
    return this.player.strike(this.indexOf(place.body), place, speed);
  }

  // ---- pointers

  press(event) {
    document.documentElement.classList.remove('by-keys');
    this.view.canvas.focus({ preventScroll: true });
    this.view.orbit.stop();
    const hit = event.button === 0 && !event.ctrlKey ? this.view.pick(event.clientX, event.clientY) : null;
    if (hit && this.holds?.(hit.body)) return;
    this.view.canvas.setPointerCapture(event.pointerId);
    const pointer = { x: event.clientX, y: event.clientY, startX: event.clientX, startY: event.clientY, kind: 'turn', trail: this.trail ?? [] };
    this.pointers.set(event.pointerId, pointer);
    if (this.pointers.size > 1) return this.beginPinch();
    if (event.button === 2 || event.button === 1 || event.ctrlKey) pointer.kind = event.shiftKey ? 'pan' : 'turn';
    if (!hit) {
      if (event.shiftKey) pointer.kind = 'pan';
      this.view.canvas.classList.add('turning');
      return;
    }
    Object.assign(pointer, { kind: 'touch', body: hit.body, place: hit, at: performance.now(), pressure: this.findPressure(event) });
    if (this.gesture === 'cut') {
      pointer.kind = 'cut';
      this.cut(hit);
      return;
    }
    if (this.gesture === 'strike') void this.strike(hit, this.findSwing(pointer.trail) * (pointer.pressure ?? 1));
    else {
      this.select(hit);
      this.beginTouch(pointer);
    }
    if (this.gesture !== 'scrape') pointer.hold = setTimeout(() => this.beginTouch(pointer), kHoldMs);
  }

  /** Pen pressure, 0 to 2, 1: normal; undefined without a pressure sensor. */
  findPressure(event) {
    if (event.pointerType === 'mouse' || event.pressure === 0 || event.pressure === 0.5 || event.pressure === 1) return undefined;
    return 2 * event.pressure;
  }

  /** Speed factor of the mallet for a moving pointer: 1 to kMaxSwing. */
  findSwing(trail) {
    const now = performance.now(), recent = trail.filter((point) => now - point.time < kSwingMs);
    if (recent.length < 2) return 1;
    const [first, last] = [recent[0], recent[recent.length - 1]], seconds = (last.time - first.time) / 1000;
    if (seconds <= 0) return 1;
    return Math.min(kMaxSwing, 1 + Math.hypot(last.x - first.x, last.y - first.y) / seconds / kSwingPxS);
  }

  beginTouch(pointer) {
    clearTimeout(pointer.hold);
    if (pointer.touch) return;
    pointer.touch = this.player.touch(this.indexOf(pointer.body), pointer.place);
    pointer.velocity = [0, 0, 0];
  }

  moved(event) {
    if (event.pointerType === 'mouse' || this.pointers.size === 0) {
      const now = performance.now();
      this.trail = [...(this.trail ?? []).filter((point) => now - point.time < kSwingMs), { x: event.clientX, y: event.clientY, time: now }];
    }
    const pointer = this.pointers.get(event.pointerId);
    if (!pointer) return this.hover(event);
    const dx = event.clientX - pointer.x, dy = event.clientY - pointer.y;
    [pointer.x, pointer.y] = [event.clientX, event.clientY];
    if (this.pinch) return this.movePinch();
    const { clientWidth: width, clientHeight: height } = this.view.canvas;
    if (pointer.kind === 'turn') {
      this.view.orbit.turn((kTurn * dx) / width, (kTurn * dy) / width, true);
      this.turned();
    } else if (pointer.kind === 'pan') {
      this.view.orbit.pan(dx / height, dy / height);
      this.turned();
    } else if (pointer.kind === 'cut') {
      const hit = this.view.pick(event.clientX, event.clientY);
      if (hit?.body !== pointer.body || norm(subtract(hit.point, pointer.place.point)) < 0.5 * this.cutRadius(hit.body)) return;
      pointer.place = hit;
      this.cut(hit);
    } else {
      this.scrape(event, pointer);
    }
  }

  /** Removes material at a place, as the panel says. */
  cut(place) {
    this.select(place);
    this.view.dispatchEvent(new CustomEvent('cut', { detail: place }));
  }

  scrape(event, pointer) {
    if (!pointer.touch && Math.hypot(event.clientX - pointer.startX, event.clientY - pointer.startY) < kScrapePx) return;
    this.beginTouch(pointer);
    const hit = this.view.pick(event.clientX, event.clientY), now = performance.now();
    if (!hit || hit.body !== pointer.body) return;
    const seconds = Math.max(1e-3, (now - (pointer.movedAt ?? now - 16)) / 1000);
    pointer.movedAt = now;
    const velocity = scale(1 / seconds, subtract(hit.point, pointer.place.point));
    pointer.velocity = add(scale(0.5, pointer.velocity), scale(0.5, velocity));
    pointer.place = hit;
    this.select(hit);
    pointer.touch.move({ ...hit, velocity_m_s: pointer.velocity, force: this.findPressure(event) ?? 1 });
    clearTimeout(pointer.still);
    pointer.still = setTimeout(() => {
      pointer.velocity = [0, 0, 0];
      pointer.touch?.move({ ...pointer.place, velocity_m_s: [0, 0, 0] });
    }, kScrapeEndMs);
  }

  release(event) {
    const pointer = this.pointers.get(event.pointerId);
    if (!pointer) return;
    this.pointers.delete(event.pointerId);
    this.pinch = this.pointers.size > 1 ? this.pinch : undefined;
    clearTimeout(pointer.hold);
    clearTimeout(pointer.still);
    pointer.touch?.end();
    pointer.touch = undefined;
    this.view.canvas.classList.remove('turning');
    this.view.draw();
  }

  leave() {
    if (this.pointers.size === 0) this.view.canvas.classList.remove('over');
  }

  hover(event) {
    if (this.hovering || event.buttons !== 0) return;
    this.hovering = true;
    requestAnimationFrame(() => {
      this.hovering = false;
      const hit = this.view.pick(event.clientX, event.clientY);
      this.view.canvas.classList.toggle('over', hit !== null);
      if (hit) this.view.setCursor(hit);
      else if (this.place) this.view.setCursor(this.place);
    });
  }

  beginPinch() {
    for (const pointer of this.pointers.values()) {
      clearTimeout(pointer.hold);
      pointer.touch?.end();
      Object.assign(pointer, { touch: undefined, kind: 'turn' });
    }
    this.pinch = this.findPinch();
  }
  findPinch() {
    const [a, b] = [...this.pointers.values()];
    return { x: (a.x + b.x) / 2, y: (a.y + b.y) / 2, apart: Math.max(10, Math.hypot(a.x - b.x, a.y - b.y)) };
  }
  movePinch() {
    const now = this.findPinch(), { clientWidth: width } = this.view.canvas;
    this.view.orbit.zoom(this.pinch.apart / now.apart);
    this.view.orbit.turn((kTurn * (now.x - this.pinch.x)) / width, (kTurn * (now.y - this.pinch.y)) / width);
    this.pinch = now;
    this.turned();
  }

  roll(event) {
    event.preventDefault();
    this.view.orbit.zoom(Math.exp((event.deltaMode === 1 ? 16 : 1) * event.deltaY * 0.0011));
    this.turned();
  }

  turned() {
    this.view.dispatchEvent(new Event('turned'));
    this.view.draw();
  }

  // ---- keys

  key(event) {
    const arrows = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
    document.documentElement.classList.add('by-keys');
    if (event.ctrlKey || event.metaKey || event.altKey) {
      if (event.key === 'Home') this.view.dispatchEvent(new Event('first'));
      return;
    }
    const arrow = arrows[event.key];
    if (arrow && event.shiftKey) {
      this.view.orbit.turn(-kKeyTurn * arrow[0], kKeyTurn * arrow[1]);
      this.turned();
    } else if (arrow) {
      if (this.holds) return;
      this.step(...arrow);
    } else if (event.key === '+' || event.key === '=' || event.key === '-') {
      this.view.orbit.zoom(event.key === '-' ? 1.12 : 1 / 1.12);
      this.turned();
    } else if (event.key === 'Enter' || event.key === ' ') {
      if (this.place && !event.repeat) void this.strike(this.place);
    } else if (event.key.toLowerCase() === 'c') {
      if (this.place) this.cut(this.place);
    } else if (event.key.toLowerCase() === 's' || event.key.toLowerCase() === 'p') {
      if (this.place && !event.repeat) this.beginKey(event.key.toLowerCase());
    } else if (/^[1-9]$/.test(event.key)) {
      this.view.dispatchEvent(new CustomEvent('mallet', { detail: Number(event.key) - 1 }));
    } else {
      return;
    }
    event.preventDefault();
  }

  /** Moves the point to strike by a step on the screen. */
  step(dx, dy) {
    if (!this.place) return this.view.dispatchEvent(new Event('first'));
    const { body } = this.place, { right, up } = this.view.orbit.findAxes(), eye = this.view.orbit.position_m;
    const from = body.findWorldPoint(this.place), step = kKeyStep * body.box.size * body.size;
    for (const part of [1, 0.5, 0.25]) {
      const to = add(from, add(scale(part * step * dx, right), scale(part * step * dy, up)));
      const hit = this.view.cast(eye, normalise(subtract(to, eye)), body);
      if (hit) return this.select(hit);
    }
    this.view.dispatchEvent(new Event('edge'));
  }

  beginKey(key) {
    const { place } = this, { body } = place, touch = this.player.touch(this.indexOf(body), place), began = performance.now() / 1000;
    const held = { touch };
    this.keys.set(key, held);
    if (key === 'p') return;
    const { right, up } = this.view.orbit.findAxes(), eye = this.view.orbit.position_m, centre = body.findWorldPoint(place);
    const radius = kKeyScrape.radius * body.box.size * body.size;
    let last = centre, lastTime = began;
    held.timer = setInterval(() => {
      const now = performance.now() / 1000, turn = 2 * Math.PI * kKeyScrape.hz * (now - began);
      const to = add(centre, add(scale(radius * Math.sin(turn), right), scale(radius * (1 - Math.cos(turn)), up)));
      const hit = this.view.cast(eye, normalise(subtract(to, eye)), body);
      if (!hit || norm(subtract(hit.point, last)) > radius) return;
      touch.move({ ...hit, velocity_m_s: scale(1 / Math.max(1e-3, now - lastTime), subtract(hit.point, last)) });
      [last, lastTime] = [hit.point, now];
      this.view.setCursor(hit);
    }, 16);
  }
  keyEnds(event) {
    this.endKey(event.key.toLowerCase());
  }
  endKey(key) {
    const held = this.keys.get(key);
    if (!held) return;
    clearInterval(held.timer);
    held.touch.end();
    this.keys.delete(key);
    this.view.setCursor(this.place);
  }
  endKeys() {
    for (const key of [...this.keys.keys()]) this.endKey(key);
  }
}
