// The audio thread: carillon.wasm renders, this file forwards messages and measures time.
import { Refusal, Wasm } from './carillon-wasm.js';

const kStateS = 1 / 30, kKeepS = 0.1;

class CarillonProcessor extends AudioWorkletProcessor {
  constructor({ processorOptions }) {
    super();
    const { module, microphones_m, max_bodies, ground, gain_per_pa, load_share, reports } = processorOptions;
    this.channels = microphones_m.length;
    this.loadShare = load_share;
    this.reports = reports;
    this.watched = new Map(); // body -> number of modes
    this.peak = 0;
    this.gain_per_pa = gain_per_pa;
    this.counts = { quanta: 0, over_budget: 0, gaps: 0, worst_ms: 0 };
    this.busy_ms = 0;
    this.loads = []; // {time_s, busy_ms}
    this.port.onmessage = ({ data }) => this.take(data, this.port);
    this.try(() => {
      this.wasm = new Wasm(module);
      this.wasm.call('web_open', sampleRate, Float64Array.from(microphones_m.flat()), max_bodies, ground.roughness_m, ground.friction);
      this.wasm.call('web_set_gain', gain_per_pa);
      this.port.postMessage({ type: 'open' });
    }, this.port);
  }

  /** Runs a request. A Refusal is reported; any other error is a trap, which stops and silences the engine. */
  try(work, port, id) {
    try {
      const result = work();
      if (id !== undefined) port.postMessage({ type: 'answer', id, result });
      return result;
    } catch (error) {
      const isRefused = error instanceof Refusal;
      if (!isRefused) this.dead = true;
      port.postMessage({ type: 'error', id, message: isRefused ? error.message : `the sound engine has failed: ${error.message}; load the page again` });
      return undefined;
    }
  }

  take(data, port) {
    if (data.type === 'port') {
      data.port.onmessage = (event) => this.take(event.data, data.port);
      return;
    }
    if (this.dead) {
      if (data.id !== undefined) port.postMessage({ type: 'error', id: data.id, message: 'the sound engine has failed; load the page again' });
      return;
    }
    this.try(() => this.obey(data), port, data.id);
  }

  obey(data) {
    const { wasm } = this;
    switch (data.type) {
      case 'push': // words: Float64Array
        if (wasm.call('web_push', data.words) > 0) throw new Refusal(wasm.text());
        return undefined;
      case 'surface':
        wasm.call('web_begin_surface', data.surface, data.triangles, data.columns, data.largest, data.shape);
        return undefined;
      case 'piece':
        wasm.call('web_add_to_surface', data.surface, data.bytes);
        return undefined;
      case 'model':
        wasm.call('web_add_model', data.model, data.surface, data.bytes);
        return undefined;
      case 'body':
        return wasm.call('web_add_body', data.model, Float64Array.from(data.pose), data.effects);
      case 'swap':
        wasm.call('web_swap_model', data.body, data.model);
        return undefined;
      case 'play': {
        const at_s = data.at_s ?? wasm.exports.web_horizon_s() + data.lead_s;
        wasm.call('web_begin_playback', data.playback, Int32Array.from(data.bodies), at_s, data.from_s);
        return at_s;
      }
      case 'played':
        wasm.call('web_add_to_playback', data.playback, data.words);
        return undefined;
      case 'watch':
        if (data.modes > 0) this.watched.set(data.body, data.modes);
        else this.watched.delete(data.body);
        return undefined;
      case 'gain':
        this.gain_per_pa = data.per_pa;
        wasm.call('web_set_gain', data.per_pa);
        return undefined;
      case 'budget':
        this.loadShare = data.load_share;
        wasm.call('web_set_budget', data.mode_samples_per_s);
        return undefined;
      case 'count':
        return this.count();
      case 'measure':
        return this.measure(data.body, data.modes);
      case 'settle':
        return wasm.exports.web_time_s();
      case 'fail': // tests of a trap
        throw new Error('as asked');
      default: // of one number or two
        wasm.call(data.name, ...data.numbers);
        return undefined;
    }
  }

  count() {
    const { wasm } = this;
    wasm.call('web_count');
    const [strikes, refused, late, faults, overflows, resets, mode_samples, faded, underruns, zeroed, budget] = wasm.words();
    return { strikes, refused, late, faults, overflows, resets, mode_samples, faded, underruns, zeroed, budget, busy_ms: this.busy_ms, ...this.counts };
  }
  measure(body, modes) {
    this.wasm.call('web_measure', body, modes);
    return this.wasm.numbers();
  }

  process(_, outputs) {
    const out = outputs[0], frames = out[0].length, quantum_ms = (1000 * frames) / sampleRate;
    if (this.dead || this.wasm === undefined) return true;
    if (this.expected !== undefined && this.expected !== currentFrame) ++this.counts.gaps;
    this.expected = currentFrame + frames;
    // The mean over millisecond clock steps is right even for short work.
    const began_ms = Date.now();
    try {
      const { exports } = this.wasm;
      if (exports.web_process(out.length, frames) === -1) throw new Error(this.wasm.text());
      for (let c = 0; c < out.length; ++c) out[c].set(new Float32Array(exports.memory.buffer, exports.web_channel(c) >>> 0, frames));
    } catch (error) {
      this.dead = true;
      for (const channel of out) channel.fill(0);
      this.port.postMessage({ type: 'error', message: `the sound engine has failed: ${error.message}; load the page again` });
      return true;
    }
    const took_ms = Math.max(0, Date.now() - began_ms);
    this.busy_ms += took_ms;
    ++this.counts.quanta;
    if (took_ms > quantum_ms + 1) ++this.counts.over_budget;
    this.counts.worst_ms = Math.max(this.counts.worst_ms, took_ms);
    if (this.reports) {
      for (const channel of out) for (let n = 0; n < frames; ++n) this.peak = Math.max(this.peak, Math.abs(channel[n]));
      this.report(currentTime + frames / sampleRate);
    }
    return true;
  }

  /** State of the engine for display, 30 times a second. */
  report(now_s) {
    if (this.loadShare !== null && now_s - (this.kept_s ?? 0) >= kKeepS) {
      this.kept_s = now_s;
      this.wasm.call('web_keep_load', this.loadShare, this.busy_ms / 1000);
      this.loads.push({ now_s, busy_ms: this.busy_ms });
      if (this.loads.length > 11) this.loads.shift();
    }
    if (now_s - (this.reported_s ?? 0) < kStateS) return;
    this.reported_s = now_s;
    const first = this.loads[0], last = this.loads[this.loads.length - 1];
    const load = this.loads.length > 1 ? (last.busy_ms - first.busy_ms) / 1000 / (last.now_s - first.now_s) : 0;
    const bodies = [];
    for (const [body, modes] of this.watched) {
      bodies.push({ body, amplitudes: this.measure(body, modes), deflection_thicknesses: this.wasm.exports.web_deflection(body) });
    }
    const time_s = this.wasm.exports.web_time_s();
    this.port.postMessage({ type: 'state', time_s, context_time_s: now_s, load, peak_pa: this.peak / (this.gain_per_pa || 1), bodies, counters: this.count() });
    this.peak = 0;
  }
}

registerProcessor('carillon', CarillonProcessor);
