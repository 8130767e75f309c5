// Bodies in the sound engine, strikes and contacts, and a log of them for the panel and for scripts.
import { findNormal, findPoint, rotateBack, scale } from './geometry.js';

const kKneeShare = 0.85; // fraction of full scale above which the output is compressed

/** Soft clipper: linear up to the knee, then towards full scale. */
function makeLimiter(context) {
  const limiter = new WaveShaperNode(context), points = 4097, curve = new Float32Array(points), reach = 4;
  for (let i = 0; i < points; ++i) {
    const x = (reach * (2 * i - points + 1)) / (points - 1), size = Math.abs(x), over = (size - kKneeShare) / (1 - kKneeShare);
    curve[i] = size <= kKneeShare ? x : Math.sign(x) * (kKneeShare + (1 - kKneeShare) * Math.tanh(over));
  }
  limiter.curve = curve;
  const before = new GainNode(context, { gain: 1 / reach });
  before.connect(limiter);
  return { before, limiter };
}

export class Player extends EventTarget {
  /** audio: CarillonAudio, not connected. gain_per_pa: gain of the page. */
  constructor(audio, gain_per_pa) {
    super();
    this.audio = audio;
    this.gain_per_pa = gain_per_pa;
    this.bodies = []; // in the order of the scene
    this.log = []; // actions {kind, body, triangle, barycentric, ...}, newest last
    this.mallet = 'hard-wood';
    this.speed_m_s = 1;
    this.force_n = 1;
    this.volume_db = 0;
    const { context } = audio, { before, limiter } = makeLimiter(context);
    this.meter = new AnalyserNode(context, { fftSize: 8192, smoothingTimeConstant: 0.55, minDecibels: -120, maxDecibels: 0 });
    audio.node.connect(before);
    audio.node.connect(this.meter);
    limiter.connect(context.destination);
  }

  setVolume(decibels) {
    this.volume_db = decibels;
    this.audio.setGain(this.gain_per_pa * 10 ** (decibels / 20));
  }

  /** Must be called from a user gesture. */
  async wake() {
    if (this.audio.context.state === 'suspended') await this.audio.context.resume();
  }

  note(entry) {
    this.log.push(entry);
    if (this.log.length > 200) this.log.shift();
    this.dispatchEvent(new CustomEvent('done', { detail: entry }));
  }

  /** A blow of the mallet. place: {triangle, barycentric}. Returns its contact data. */
  async strike(index, place, speed_m_s = this.speed_m_s) {
    const body = this.bodies[index], { triangle, barycentric } = place;
    const entry = { kind: 'strike', body: index, name: body.name, triangle, barycentric, mallet: this.mallet, speed_m_s };
    entry.point_m = findPoint(body.surface, triangle, barycentric);
    void this.wake();
    Object.assign(entry, await body.sound.hit({ triangle, barycentric, mallet: this.mallet, speed_m_s }));
    this.note(entry);
    return entry;
  }

  /** The mallet's head lies on the body and moves over it. -> {move({triangle, barycentric, velocity_m_s, force}), end()}. velocity_m_s: of
   * the head over the surface, in the world; force: a factor of the pressure. */
  touch(index, place) {
    const body = this.bodies[index];
    void this.wake();
    const describe = ({ triangle, barycentric, velocity_m_s = [0, 0, 0], force = 1 }) => ({
      triangle,
      barycentric,
      normal: findNormal(body.surface, triangle),
      force_n: this.force_n * force,
      slip_m_s: scale(-1, rotateBack(body.shown.rotation, velocity_m_s)), // this surface against the head
      sweep_m_s: Math.hypot(...velocity_m_s),
      mallet: this.mallet,
    });
    const touch = body.sound.touch(describe(place)), began = performance.now();
    let farthest = 0;
    return {
      move: (to) => {
        farthest = Math.max(farthest, Math.hypot(...(to.velocity_m_s ?? [0, 0, 0])));
        touch.move(describe(to));
      },
      end: () => {
        touch.end();
        const kind = farthest > 0 ? 'scrape' : 'press';
        this.note({ kind, body: index, name: body.name, seconds: (performance.now() - began) / 1000, fastest_m_s: farthest, force_n: this.force_n });
      },
    };
  }

  /** Gives a body another bank, of the same body without its cuts. file: where it is in the folder. */
  async takeBank(index, bytes, file) {
    const body = this.bodies[index], bank = await this.audio.addBank(bytes, file), { cuts, ...edits } = body.sound.edits;
    const isSame = String(bank.triangles) === String(body.surface.triangles);
    body.sound.bank = bank;
    await body.sound.edit(edits);
    Object.assign(body, { bank, file, surface: { vertices_m: bank.vertices_m, triangles: bank.triangles } });
    body.edit.cuts = [];
    body.about = { ...body.about, change: null, loudest: isSame ? body.about.loudest : undefined };
    body.shown.setSurface(body.surface);
  }

  /** One mode alone, or all again (null). */
  solo(index, mode) {
    const { sound } = this.bodies[index];
    sound.solo(mode);
    if (mode === null) return;
    void this.wake();
    sound.ping(mode, 1);
  }
}
