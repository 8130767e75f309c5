// Spectrum on a logarithmic axis, with marks for the modes of a body, bright while they ring.
const kLowHz = 20, kHighHz = 20000, kFloorDb = -110, kTopDb = -6;
const kNearPx = 9;
const kMarkDb = 60; // range of the heights of the marks

export class Spectrum extends EventTarget {
  /** canvas, a tip element, and the AnalyserNode. */
  constructor(canvas, tip, meter) {
    super();
    Object.assign(this, { canvas, tip, meter, modes: [], levels_db: null, ringing: null, shown: null });
    this.bins = new Float32Array(meter.frequencyBinCount);
    new ResizeObserver(() => this.draw()).observe(canvas);
    canvas.addEventListener('pointermove', (event) => this.point(event));
    canvas.addEventListener('pointerdown', (event) => this.point(event));
    canvas.addEventListener('pointerleave', () => this.show(null, true));
  }

  setModes(modes) {
    this.modes = modes;
    this.levels_db = null;
    this.draw();
  }
  /** Levels of the modes for a blow at the chosen point, relative to the loudest; null: unknown. */
  setLevels(levels_db) {
    this.levels_db = levels_db;
    this.draw();
  }
  /** Current amplitude of each mode, 0 to 1. */
  setRinging(parts) {
    this.ringing = parts;
  }

  toX(hz) {
    return (Math.log(hz / kLowHz) / Math.log(kHighHz / kLowHz)) * this.canvas.clientWidth;
  }
  toY(decibels) {
    const height = this.canvas.clientHeight - 18;
    return 8 + (height - 8) * Math.min(1, Math.max(0, (kTopDb - decibels) / (kTopDb - kFloorDb)));
  }

  point(event) {
    const x = event.clientX - this.canvas.getBoundingClientRect().left;
    let nearest = null, least = kNearPx;
    this.modes.forEach((mode, i) => {
      const off = Math.abs(this.toX(mode.freq_hz) - x) - (this.levels_db ? Math.max(-40, this.levels_db[i]) / 1e4 : 0);
      if (off < least) [nearest, least] = [i, off];
    });
    this.show(nearest, true);
  }

  /** Marks a mode; `asks`: also sends an event. */
  show(mode, asks = false) {
    if (mode === this.shown) return;
    this.shown = mode;
    this.tip.hidden = mode === null;
    if (mode !== null) {
      const { freq_hz, t60_s } = this.modes[mode], x = this.toX(freq_hz), { clientWidth: width } = this.canvas;
      this.tip.textContent = `mode ${mode + 1} · ${formatHz(freq_hz)} · T60 ${formatSeconds(t60_s)}`;
      this.tip.style.left = `${Math.min(width - 90, Math.max(90, x))}px`;
    }
    if (asks) this.dispatchEvent(new CustomEvent('mode', { detail: mode }));
    this.draw();
  }

  /** Redraws in the next frame. */
  draw() {
    this.waiting ??= requestAnimationFrame(() => {
      this.waiting = undefined;
      this.paint();
    });
  }

  paint() {
    const { canvas, meter } = this, ratio = Math.min(2, devicePixelRatio), width = canvas.clientWidth, height = canvas.clientHeight;
    if (width === 0) return;
    if (canvas.width !== Math.round(width * ratio)) canvas.width = Math.round(width * ratio);
    if (canvas.height !== Math.round(height * ratio)) canvas.height = Math.round(height * ratio);
    const paper = canvas.getContext('2d');
    paper.setTransform(ratio, 0, 0, ratio, 0, 0);
    paper.clearRect(0, 0, width, height);
    this.drawAxis(paper, width, height);
    this.drawSound(paper, meter, width, height);
    this.drawMarks(paper, height);
  }

  drawAxis(paper, width, height) {
    paper.font = '11px system-ui, sans-serif';
    paper.textAlign = 'center';
    for (const [hz, text] of [[50, '50'], [100, '100'], [200, '200'], [500, '500'], [1000, '1 kHz'], [2000, '2'], [5000, '5'], [10000, '10']]) {
      const x = Math.round(this.toX(hz)) + 0.5;
      paper.fillStyle = 'rgba(152, 161, 171, 0.85)';
      paper.fillText(text, x, height - 4);
      paper.fillStyle = 'rgba(255, 255, 255, 0.05)';
      paper.fillRect(x - 0.5, 6, 1, height - 24);
    }
    paper.fillStyle = 'rgba(255, 255, 255, 0.12)';
    paper.fillRect(0, height - 18, width, 1);
  }

  drawSound(paper, meter, width, height) {
    meter.getFloatFrequencyData(this.bins);
    const step = meter.context.sampleRate / meter.fftSize;
    paper.beginPath();
    paper.moveTo(0, height - 18);
    for (let x = 0; x <= width; ++x) {
      const low = kLowHz * (kHighHz / kLowHz) ** (x / width), high = kLowHz * (kHighHz / kLowHz) ** ((x + 1) / width);
      const first = Math.max(1, Math.floor(low / step)), last = Math.min(this.bins.length - 1, Math.max(first, Math.floor(high / step)));
      let loudest = -Infinity;
      for (let k = first; k <= last; ++k) loudest = Math.max(loudest, this.bins[k]);
      paper.lineTo(x, Math.min(height - 18, this.toY(loudest)));
    }
    paper.lineTo(width, height - 18);
    const fill = paper.createLinearGradient(0, 0, 0, height);
    fill.addColorStop(0, 'rgba(127, 196, 214, 0.75)');
    fill.addColorStop(1, 'rgba(127, 196, 214, 0.06)');
    paper.fillStyle = fill;
    paper.fill();
    paper.strokeStyle = 'rgba(160, 216, 230, 0.7)';
    paper.lineWidth = 1;
    paper.stroke();
  }

  drawMarks(paper, height) {
    this.modes.forEach((mode, i) => {
      if (mode.freq_hz < kLowHz || mode.freq_hz > kHighHz) return;
      const x = this.toX(mode.freq_hz), part = this.levels_db ? Math.max(0.06, 1 + this.levels_db[i] / kMarkDb) : 0.3;
      const ring = this.ringing ? this.ringing[i] : 0, isShown = i === this.shown, top = height - 18 - part * (height - 34);
      paper.fillStyle = isShown ? '#ffdf9f' : `rgba(233, 180, 76, ${0.22 + 0.75 * ring})`;
      paper.fillRect(x - (isShown ? 1 : 0.5), top, isShown ? 2 : 1, height - 18 - top);
      if (!isShown && ring < 0.02) return;
      paper.beginPath();
      paper.arc(x, top, isShown ? 4 : 1.5 + 2 * ring, 0, 7);
      paper.fill();
    });
  }
}

export function formatHz(hz) {
  return hz < 1000 ? `${hz.toFixed(1)} Hz` : `${(hz / 1000).toFixed(hz < 10000 ? 3 : 2)} kHz`;
}
export function formatSeconds(seconds) {
  if (!Number.isFinite(seconds)) return '∞';
  return seconds < 1 ? `${(1000 * seconds).toFixed(seconds < 0.01 ? 1 : 0)} ms` : `${seconds.toFixed(seconds < 10 ? 2 : 1)} s`;
}
