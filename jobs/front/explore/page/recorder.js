// Records the output as a WAV file of 32-bit floats.

export class Recorder {
  /** The output of an AudioNode with two channels. */
  static async open(context, node) {
    await context.audioWorklet.addModule(new URL('./recorder-worklet.js', import.meta.url));
    const tap = new AudioWorkletNode(context, 'carillon-recorder', { numberOfInputs: 1, numberOfOutputs: 0, channelCount: 2, channelCountMode: 'explicit' });
    node.connect(tap);
    return new Recorder(tap, context.sampleRate);
  }
  constructor(tap, rate_hz) {
    Object.assign(this, { tap, rate_hz });
  }

  start() {
    this.blocks = [];
    this.first = null;
    this.tap.port.onmessage = ({ data }) => {
      this.first ??= data.frame;
      this.blocks.push(data.samples);
    };
    this.tap.port.postMessage('start');
  }

  /** -> {rate_hz, first_s: time of the context of the first frame, samples: Float32Array (channels interleaved)}. */
  async stop() {
    await new Promise((resolve) => {
      const take = this.tap.port.onmessage;
      this.tap.port.onmessage = (event) => (event.data === 'stopped' ? resolve() : take(event));
      this.tap.port.postMessage('stop');
    });
    const samples = new Float32Array(this.blocks.reduce((sum, block) => sum + block.length, 0));
    this.blocks.reduce((at, block) => (samples.set(block, at), at + block.length), 0);
    this.blocks = [];
    return { rate_hz: this.rate_hz, first_s: (this.first ?? 0) / this.rate_hz, samples };
  }
}

export function makeWav({ rate_hz, samples }, channels = 2) {
  const bytes = 4 * samples.length, view = new DataView(new ArrayBuffer(58 + bytes));
  const text = (at, letters) => [...letters].forEach((letter, i) => view.setUint8(at + i, letter.charCodeAt(0)));
  text(0, 'RIFF');
  view.setUint32(4, 50 + bytes, true);
  text(8, 'WAVEfmt ');
  view.setUint32(16, 18, true);
  view.setUint16(20, 3, true); // IEEE float
  view.setUint16(22, channels, true);
  view.setUint32(24, rate_hz, true);
  view.setUint32(28, 4 * channels * rate_hz, true);
  view.setUint16(32, 4 * channels, true);
  view.setUint16(34, 32, true);
  text(38, 'fact');
  view.setUint32(42, 4, true);
  view.setUint32(46, samples.length / channels, true);
  text(50, 'data');
  view.setUint32(54, bytes, true);
  samples.forEach((sample, i) => view.setFloat32(58 + 4 * i, sample, true));
  return new Blob([view], { type: 'audio/wav' });
}
