// Passes its input to the page in groups of blocks.
const kFrames = 4096;

class RecorderProcessor extends AudioWorkletProcessor {
  constructor() {
    super();
    this.port.onmessage = ({ data }) => {
      if (data === 'stop') {
        this.flush();
        this.port.postMessage('stopped');
      }
      this.runs = data === 'start';
    };
    this.samples = new Float32Array(2 * kFrames);
    this.filled = 0;
  }
  flush() {
    if (this.filled > 0) this.port.postMessage({ frame: this.frame, samples: this.samples.slice(0, 2 * this.filled) });
    this.filled = 0;
  }
  process([input]) {
    if (!this.runs) return true;
    const count = input[0]?.length ?? 128;
    if (this.filled === 0) this.frame = currentFrame;
    for (let i = 0; i < count; ++i) {
      this.samples[2 * (this.filled + i)] = input[0]?.[i] ?? 0;
      this.samples[2 * (this.filled + i) + 1] = (input[1] ?? input[0])?.[i] ?? 0;
    }
    this.filled += count;
    if (this.filled + 128 > kFrames) this.flush();
    return true;
  }
}
registerProcessor('carillon-recorder', RecorderProcessor);
