// The control panel: points and mallets, edits of the body, modes, effects, listener and volume.
import { makeChoice, makeList, makeSlider } from './lists.js';
import { findNamedPlaces } from './geometry.js';
import { makeLook } from './body.js';
import { formatHz, formatSeconds } from './spectrum.js';
import { makeWav, Recorder } from './recorder.js';

const find = (id) => document.getElementById(id);
const kEditS = 0.06; // interval of edits while a slider moves
const kPlanS = 0.5;
const kWaitS = 0.3; // between looks for a body that is computed

/** Two significant digits, without an exponent. */
const short = (value) => Number(value.toPrecision(2)).toString();
const describeCents = (cents) => (!Number.isFinite(cents) ? '–' : cents < 0.1 ? '< 0.1' : short(cents));
/** Rates [1/s] and times [s], with the digits of carillon-bank info. */
const formatFigure = (value, digits) => (value === null ? '–' : Number.isFinite(value) ? Number(value.toPrecision(digits)).toString() : '∞');
const times = (value) => (value === 1 ? 'unchanged' : `× ${value < 1 ? value.toFixed(2) : value.toFixed(value < 10 ? 2 : 0)}`);

const describeChange = (cents) => `${cents >= 0 ? '+' : ''}${cents.toFixed(2)} cents`;

/** The result in a file that says is_running until it is there. */
async function waitForResult(file) {
  for (;;) {
    const answer = await fetch(file, { cache: 'no-store' });
    if (!answer.ok) throw new Error(`${file} cannot be read (${answer.status})`);
    const result = await answer.json();
    if (!result.is_running) return result;
    await new Promise((resolve) => setTimeout(resolve, 1000 * kWaitS));
  }
}

export class Panel {
  constructor(page) {
    Object.assign(this, page); // about, player, view, hands, spectrum
    this.current = 0;
    this.makeBodies();
    this.makeStrike();
    this.makeEdit();
    this.makeModes();
    this.makeSound();
    find('title').textContent = document.title = this.about.title;
    find('about').textContent = `${this.about.made_by}. This page computes the sound itself.`;
    this.select(0, true);
  }

  get body() {
    return this.player.bodies[this.current];
  }
  say(text) {
    find('status').textContent = text;
  }

  // ---- bodies

  makeBodies() {
    this.bodies = makeList(find('bodies'), { focused: (index) => this.select(index), chosen: () => this.hands.place && this.hands.strike(this.hands.place) });
    this.bodies.fill(this.player.bodies.map(({ name }) => ({ text: name })));
    find('bodies-part').hidden = this.player.bodies.length < 2;
    this.view.addEventListener('place', ({ detail: place }) => {
      if (!place) return;
      const index = this.view.bodies.indexOf(place.body);
      if (index !== this.current) this.select(index, false, false);
      this.places.mark(this.body.places.findIndex(({ triangle, barycentric }) => triangle === place.triangle && barycentric === place.barycentric));
      void this.showLevels();
    });
    this.view.addEventListener('first', () => this.goTo(0));
    this.view.addEventListener('edge', () => this.say('visible edge of the body'));
  }

  /** moves: also moves the point to strike. */
  select(index, isQuiet = false, moves = true) {
    this.leaveMode();
    this.current = index;
    this.bodies.mark(index);
    const { body } = this;
    body.places ??= findNamedPlaces(body.surface, body.shown.rotation, body.about.loudest);
    this.places.fill(body.places.map(({ name }) => ({ text: name })));
    if (moves) this.goTo(0, isQuiet);
    for (const [name, slider] of Object.entries(this.sliders)) slider.reset(body.edit[name]);
    find('material').value = body.edit.material;
    this.player.bodies.forEach((other, i) => other.sound.watch(i === index));
    void this.showDensity();
    this.showModes();
    this.showFacts();
    find('view').setAttribute('aria-label', `${body.name}, ${body.sound.modes.length} modes`);
  }

  showFacts() {
    const { bank, about } = this.body, size = (100 * this.body.shown.box.size * this.body.shown.size).toPrecision(3);
    find('facts').textContent = `${bank.mode_count} modes · ${size} cm across`;
    find('details').hidden = !about.change;
    find('change').textContent = about.change ? `The bank is ${about.change}.` : '';
  }

  // ---- strikes

  makeStrike() {
    this.places = makeList(find('places'), {
      focused: (index) => this.goTo(index),
      chosen: () => this.hands.strike(this.hands.place),
    });
    const names = this.player.audio.mallets.map(({ name }) => name);
    const start = Math.max(0, names.indexOf(this.player.mallet));
    this.player.mallet = names[start];
    this.mallets = makeChoice(find('mallets'), names.map((name) => name.replace('-', ' ')), (index) => {
      this.player.mallet = names[index];
      this.say(`mallet: ${names[index]}`);
    }, start);
    this.view.addEventListener('mallet', ({ detail: index }) => this.mallets.choose(index));
    makeSlider(find('speed'), (x) => 10 ** x, (v) => `${short(v)} m/s`, (v) => (this.player.speed_m_s = v));
    makeSlider(find('force'), (x) => 10 ** x, (v) => `${short(v)} N`, (v) => (this.player.force_n = v));
    const gestures = ['strike', 'scrape', 'press'], isSensitive = this.player.bodies.some(({ bank }) => bank.facts.sensitive_modes > 0);
    if (isSensitive) gestures.push('cut');
    makeChoice(find('gesture'), gestures.map((name) => name[0].toUpperCase() + name.slice(1)), (index) => {
      this.hands.gesture = gestures[index];
      void this.showDensity();
    });
    if (isSensitive) this.makeCuts();
    this.player.addEventListener('done', ({ detail }) => this.showDone(detail));
  }

  // ---- cuts

  makeCuts() {
    [this.depth_mm, this.radius] = [0.05, 0.1]; // as the sliders begin
    makeSlider(find('depth'), (x) => x, (v) => `${v.toFixed(3)} mm`, (v) => (this.depth_mm = v));
    makeSlider(find('radius'), (x) => x, (v) => `${(100 * v).toFixed(0)} %`, (v) => (this.radius = v));
    this.hands.cutRadius = (shown) => this.radius * shown.box.size * shown.size;
    this.view.addEventListener('cut', ({ detail: place }) => {
      const { body } = this;
      if (!(body.bank.facts.sensitive_modes > 0)) return this.say(`the bank of ${body.name} has no sensitivities`);
      body.edit.cuts.push([...body.shown.toMesh(place.point), this.radius * body.shown.box.size, 1e-3 * this.depth_mm]);
      this.edit();
    });
    find('again').addEventListener('click', () => {
      find('again').disabled = true;
      this.computeAgain(this.current).catch((error) => this.sayAgain(error.message)).finally(() => this.showCutChange());
    });
  }
  sayAgain(text) {
    find('again-state').textContent = text;
    this.say(text);
  }

  /** Solves a body without the spots cut from it; by the server, else the page says by which command. */
  async computeAgain(index) {
    const body = this.player.bodies[index], { cuts } = body.edit, request = JSON.stringify({ bank: body.file, cuts }), begun = performance.now();
    body.isComputed = true;
    this.sayAgain(`computing ${body.name} …`);
    try {
      const answer = await fetch('recut', { method: 'POST', headers: { 'Content-Type': 'application/json' }, body: request }).catch(() => null);
      if (!answer || [403, 404, 405, 501, 503].includes(answer.status)) return this.offerCuts(body, request);
      const said = await answer.json();
      if (said.error) throw new Error(said.error);
      const done = await waitForResult(said.result);
      if (done.error) throw new Error(done.error);
      const file = `${said.folder}/bank.hdf`, before = body.sound.modes.length;
      await this.player.takeBank(index, await (await fetch(file)).arrayBuffer(), file);
      const seconds = ((performance.now() - begun) / 1000).toFixed(1), lost = before - body.sound.modes.length;
      const modes = lost === 0 ? '' : `; ${Math.abs(lost)} modes ${lost > 0 ? 'fewer' : 'more'}`;
      this.sayAgain(`computed in ${seconds} s: mode 1 ${describeChange(done.modes[0].cents)}${modes}; files in ${said.folder}`);
      body.places = undefined;
      if (index === this.current) this.select(index, true);
    } finally {
      body.isComputed = false;
    }
  }
  /** Where nothing solves: a file with the cuts, and the command that takes it. */
  offerCuts(body, request) {
    const name = body.file.replace(/^.*\//, '').replace(/\.hdf$/, ''), file = `${name}-cuts.json`, link = find('again-file');
    if (link.href) URL.revokeObjectURL(link.href);
    Object.assign(link, { href: URL.createObjectURL(new Blob([request], { type: 'application/json' })), download: file, textContent: file });
    link.click();
    find('again-command').querySelector('code').textContent = `carillon tune ${name}.hdf --cuts ${file} -o ${name}-cut`;
    find('again-command').hidden = false;
    this.sayAgain('this server computes nothing; run this command next to the bank, and open the new one with carillon explore:');
  }

  /** Colours the selected body by the density of the mode at hand while the gesture is to cut. */
  async showDensity() {
    const isCutting = this.hands.gesture === 'cut', { body } = this;
    find('cuts').hidden = !isCutting;
    for (const other of this.player.bodies) if (!isCutting || other !== body) other.shown.colourBy(null);
    if (isCutting && body.bank.facts.sensitive_modes > 0) {
      const mode = Math.min(this.cutMode ?? 0, body.bank.facts.sensitive_modes - 1), density = await body.bank.density(mode);
      if (this.hands.gesture === 'cut' && this.body === body) body.shown.colourBy(density);
      find('cut-mode').textContent = mode + 1;
    }
    this.showCutChange();
    this.view.draw();
  }
  /** Change of the coloured mode by all cuts. */
  showCutChange() {
    const { edit, sound } = this.body, cents = sound.cut_cents?.[this.cutMode ?? 0] ?? 0, count = edit.cuts.length;
    find('cut-change').textContent = count > 0 ? `${count} cut${count > 1 ? 's' : ''}: ${describeChange(cents)}` : '';
    find('again').disabled = count === 0 || Boolean(this.body.isComputed);
  }

  goTo(index, isQuiet = false) {
    const { body } = this, place = body.places[index];
    if (!place) return;
    this.places.mark(index);
    const normal = body.shown.findWorldNormal(place.triangle);
    this.hands.select({ body: body.shown, triangle: place.triangle, barycentric: place.barycentric, normal, point: body.shown.findWorldPoint(place) });
    if (!isQuiet) this.say(`${body.name}, ${place.name}`);
  }

  showDone(done) {
    find('hint').classList.add('gone');
    let text;
    if (done.kind === 'strike') {
      const parts = [`${done.mallet.replace('-', ' ')} at ${short(done.speed_m_s)} m/s`];
      if (done.contact_s > 0) parts.push(`contact time ${short(1000 * done.contact_s)} ms`);
      if (done.peak_n > 0) parts.push(`peak force ${short(done.peak_n)} N`);
      text = parts.join(', ');
      this.say(`struck ${done.name}: ${text}`);
    } else {
      text = `${done.kind === 'scrape' ? 'scraped' : 'pressed'} with ${short(done.force_n)} N for ${done.seconds.toFixed(1)} s`;
      this.say(`${done.name}: ${text}`);
    }
    find('last').textContent = text;
    this.askPlan();
  }

  // ---- the body

  makeEdit() {
    const select = find('material'), option = (value, text) => Object.assign(document.createElement('option'), { value, textContent: text });
    select.append(option('', 'unchanged'));
    const groups = new Map();
    for (const { name, group = '' } of this.player.audio.materials) {
      if (!groups.has(group)) groups.set(group, Object.assign(document.createElement('optgroup'), { label: group || 'materials' }));
      groups.get(group).append(option(name, name));
    }
    select.append(...groups.values());
    for (const body of this.player.bodies) body.edit = { material: '', size: 0, damping: 0, stiffness: 0, density: 0, cuts: [] };
    const double = (x) => 2 ** x, changed = (name) => () => {
      this.body.edit[name] = Number(find(name).value);
      this.edit();
    };
    this.sliders = {};
    for (const name of ['size', 'damping', 'stiffness', 'density']) this.sliders[name] = makeSlider(find(name), double, times, changed(name));
    select.addEventListener('change', () => {
      this.body.edit.material = select.value;
      this.edit();
    });
    find('reset').addEventListener('click', () => {
      this.body.edit = { material: '', size: 0, damping: 0, stiffness: 0, density: 0, cuts: [] };
      for (const slider of Object.values(this.sliders)) slider.reset();
      select.value = '';
      this.edit();
    });
  }
  /** Takes back the edits of all bodies. */
  reset() {
    const { current } = this;
    this.player.bodies.forEach(({ edit }, index) => {
      if (Object.values(edit).every((value) => !value || value.length === 0)) return;
      this.select(index, true, false);
      find('reset').click();
    });
    this.select(current, true, false);
  }

  /** Applies the values of the sliders, at most once every kEditS. */
  edit() {
    const body = this.body, { material, size, damping, stiffness, density, cuts } = body.edit;
    body.shown.setSize(2 ** size);
    const row = this.player.audio.materials.find(({ name }) => name === material);
    body.shown.setLook(row ? makeLook(row.name, row.group) : body.look);
    this.view.draw();
    clearTimeout(body.editing);
    body.editing = setTimeout(async () => {
      const wish = { size_scale: 2 ** size, damping_scale: 2 ** damping, stiffness_scale: 2 ** stiffness, density_scale: 2 ** density };
      if (material) wish.material = material;
      if (cuts.length > 0) wish.cuts = cuts;
      try {
        await body.sound.edit(wish);
        find('edited').textContent = '';
      } catch (error) {
        find('edited').textContent = error.message;
        this.say(error.message);
      }
      if (body === this.body) {
        this.showCutChange();
        this.showModes();
        this.showFacts();
      }
    }, 1000 * kEditS);
  }

  // ---- modes

  makeModes() {
    const element = find('modes');
    this.modes = makeList(element, {
      focused: (index) => this.enterMode(index),
      chosen: (index) => this.enterMode(index),
      left: () => this.leaveMode(),
    });
    element.addEventListener('pointerover', (event) => {
      const item = event.target.closest('li');
      if (item) this.enterMode([...element.children].indexOf(item));
    });
    element.addEventListener('pointerleave', () => this.leaveMode());
    this.spectrum.addEventListener('mode', ({ detail: mode }) => (mode === null ? this.leaveMode() : this.enterMode(mode)));
  }

  showModes() {
    const { modes } = this.body.sound;
    this.modes.fill(modes.map(({ freq_hz, t60_s, error_cents, facet_cents = 0 }, i) => {
      const cents = describeCents(error_cents), facets = facet_cents > 0 ? `, facets in doubt ${describeCents(facet_cents)} cents more` : '';
      return {
        cells: [freq_hz.toFixed(1), formatSeconds(t60_s), cents],
        label: `mode ${i + 1}: ${formatHz(freq_hz)}, T60 ${formatSeconds(t60_s)}, error bar ${cents} cents${facets}`,
      };
    }));
    this.spectrum.setModes(modes);
    this.showDecay(0);
    void this.showLevels();
  }

  /** Decay of a mode and its parts. Radiation unknown to the bank is included in the material. */
  showDecay(index) {
    const mode = this.body.sound.modes[index];
    if (!mode) return;
    const parts = [mode.decay_per_s, mode.material_per_s, mode.radiation_per_s, mode.supports_per_s];
    const t60 = (rate) => (rate === null ? null : Math.log(1000) / rate);
    const makeRow = (name, cells) => {
      const row = document.createElement('tr');
      row.append(Object.assign(document.createElement('th'), { scope: 'row', textContent: name }));
      row.append(...cells.map((text) => Object.assign(document.createElement('td'), { textContent: text })));
      return row;
    };
    find('decay').caption.textContent = `Decay of mode ${index + 1}`;
    find('decay').tBodies[0].replaceChildren(
      makeRow('1/s', parts.map((rate, i) => formatFigure(rate, i === 0 ? 4 : 3))),
      makeRow('T60 [s]', parts.map((rate) => formatFigure(t60(rate), 3))),
    );
  }

  async showLevels() {
    const { place } = this.hands, { sound } = this.body;
    if (!place || !sound.levels || place.body !== this.body.shown || this.isLevelling) return;
    this.isLevelling = true;
    const levels = await sound.levels(place.triangle, place.barycentric);
    this.isLevelling = false;
    const loudest = Math.max(...levels);
    this.spectrum.setLevels(Array.from(levels, (level) => 20 * Math.log10(Math.max(1e-6, level / loudest))));
  }

  async enterMode(mode) {
    if (mode === this.mode) return;
    this.modes.item(this.mode)?.classList.remove('shown');
    this.mode = mode;
    this.modes.item(mode)?.classList.add('shown');
    this.spectrum.show(mode);
    this.showDecay(mode);
    const { body, current } = this;
    this.cutMode = mode;
    if (this.hands.gesture === 'cut') return this.showDensity();
    this.player.solo(current, mode);
    const shape = await body.bank.shape(mode);
    if (this.mode !== mode || this.body !== body) return;
    body.shown.bendIn(shape);
    this.view.draw();
  }
  leaveMode() {
    if (this.mode === undefined) return;
    this.modes.item(this.mode)?.classList.remove('shown');
    this.mode = undefined;
    this.spectrum.show(null);
    this.player.solo(this.current, null);
    this.body.shown.bendIn(null);
    this.view.draw();
  }

  // ---- sound

  makeSound() {
    makeSlider(find('volume'), (x) => x, (v) => `${v > 0 ? '+' : ''}${v.toFixed(0)} dB`, (v) => this.player.setVolume(v));
    const button = find('record');
    button.addEventListener('click', async () => {
      const isOn = button.getAttribute('aria-pressed') === 'true';
      button.setAttribute('aria-pressed', String(!isOn));
      button.textContent = isOn ? 'Record' : 'Stop';
      if (!isOn) {
        await this.player.wake();
        this.recorder ??= await Recorder.open(this.player.audio.context, this.player.audio.node);
        this.recorder.start();
        find('recorded').textContent = 'recording';
        return;
      }
      const taken = await this.recorder.stop();
      const link = Object.assign(document.createElement('a'), { href: URL.createObjectURL(makeWav(taken)), download: 'explorer.wav', textContent: 'explorer.wav' });
      find('recorded').replaceChildren(link, ` ${(taken.samples.length / 2 / taken.rate_hz).toFixed(1)} s`);
      this.say('the recording is ready');
    });
    this.askPlan();
  }

  /** Shows the effect selection, at most once every kPlanS. */
  askPlan() {
    if (this.planning) return;
    this.planning = setTimeout(async () => {
      this.planning = undefined;
      this.showPlan(await this.player.audio.plan());
    }, 1000 * kPlanS);
  }
  showPlan(plan) {
    const effects = plan?.bodies?.[this.current]?.effects ?? {};
    find('plan').replaceChildren(...Object.entries(effects).flatMap(([name, { on, why }]) => {
      const term = Object.assign(document.createElement('dt'), { textContent: name.replaceAll('_', ' '), className: on ? 'on' : '' });
      term.append(Object.assign(document.createElement('span'), { className: 'for-ears', textContent: on ? ': on' : ': off' }));
      return [term, Object.assign(document.createElement('dd'), { textContent: why })];
    }));
  }

  /** At each report of the sound engine. */
  hear({ peak_pa, bodies, load, counters }) {
    const peak = peak_pa * this.player.gain_per_pa * 10 ** (this.player.volume_db / 20);
    find('level').style.transform = `scaleX(${Math.max(0, Math.min(1, 1 + Math.log10(Math.max(1e-4, peak)) / 3)).toFixed(3)})`;
    const heard = bodies?.find(({ amplitudes }) => amplitudes);
    if (heard) this.showRinging(heard.amplitudes);
    if (heard && heard.body === this.body.sound) this.showBending(heard.deflection_thicknesses);
    this.spectrum.draw();
    this.load = load;
    this.counters = counters;
  }
  /** Velocity amplitudes from amplitudes [m kg^1/2], so that high modes count. */
  showRinging(amplitudes) {
    const { modes } = this.body.sound, speeds = Array.from(amplitudes, (a, i) => a * (modes[i]?.freq_hz ?? 0) * (modes[i]?.gain ?? 1));
    this.loudest = Math.max(0.97 * (this.loudest ?? 0), ...speeds, 1e-30);
    this.spectrum.setRinging(speeds.map((speed) => Math.max(0, 1 + Math.log10(Math.max(1e-9, speed / this.loudest)) / 3)));
  }
  /** Deflection / thickness as in the warning of carillon-render; 0: linear range. */
  showBending(thicknesses) {
    const text = thicknesses > 0 ? `${this.body.name} has bent by ${short(thicknesses)} times its thickness. Linear modes hold up to 0.5 of it: `
      + 'the sound is approximate. Strike more softly, or compute its bank with "nonlinear".' : '';
    if (find('bent').textContent === text) return;
    Object.assign(find('bent'), { textContent: text, hidden: text === '' });
    this.say(text);
  }
  showEars(distance_m) {
    find('ears').textContent = `distance ${distance_m.toFixed(2)} m, delay ${(1000 * distance_m / 343).toFixed(1)} ms`;
  }
}
