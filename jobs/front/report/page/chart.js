// DOM helpers, number formats and SVG charts of the report.
'use strict';

const kWidth = 920, kMaxTitled = 1500, kMaxDecades = 60;
const kSvgTags = new Set(['svg', 'g', 'path', 'rect', 'circle', 'text', 'title']);

/** An element with attributes and children: elements, texts, arrays of these; null and false are skipped. */
function h(tag, attributes, ...children) {
  const element = kSvgTags.has(tag) ? document.createElementNS('http://www.w3.org/2000/svg', tag) : document.createElement(tag);
  for (const [name, value] of Object.entries(attributes ?? {})) element.setAttribute(name, value);
  element.append(...children.flat(Infinity).filter((child) => child !== null && child !== undefined && child !== false));
  return element;
}

// ---- untrusted values

const isObject = (value) => value !== null && typeof value === 'object' && !Array.isArray(value);
const get = (value, ...keys) => keys.reduce((at, key) => (isObject(at) && Object.hasOwn(at, key) ? at[key] : undefined), value);
const getList = (value, ...keys) => (Array.isArray(get(value, ...keys)) ? get(value, ...keys) : []);
const getAmount = (...path) => { const value = get(...path); return Number.isFinite(value) && value >= 0 ? value : undefined; };
const getCount = (...path) => { const value = getAmount(...path); return Number.isInteger(value) && value <= 9e15 ? value : undefined; };
const getText = (...path) => { const value = get(...path); return typeof value === 'string' ? value : undefined; };
const getTexts = (...path) => [...new Set(getList(...path).slice(0, 50).filter((text) => typeof text === 'string'))];

// ---- formats

function digits(value, count) {
  if (Number.isNaN(value)) return 'nan';
  return Number.isFinite(value) ? String(Number(value.toPrecision(count))) : value > 0 ? 'inf' : '-inf';
}
const plain = (value) => digits(value, 6);
const whole = (value) => value.toLocaleString('en-US', { maximumFractionDigits: 0 });
const small = (value) => (Number.isFinite(value) ? value.toExponential(1) : digits(value, 1));
const hz = (value) => `${value.toFixed(2)} Hz`;
const optional = (value, format) => (value === undefined ? '-' : format(value));

function bytes(value) {
  if (value < 1e3) return `${value.toFixed(0)} B`;
  if (value < 1e6) return `${(value / 1e3).toFixed(1)} kB`;
  if (value < 1e9) return `${(value / 1e6).toFixed(1)} MB`;
  return `${value < 1e15 ? (value / 1e9).toFixed(2) : digits(value / 1e9, 3)} GB`;
}

function seconds(value) {
  if (value < 0.0995) return `${(1e3 * value).toFixed(0)} ms`;
  if (value < 99.5) return `${value.toFixed(2)} s`;
  if (!(value < 1e12)) return `${digits(value, 3)} s`;
  const all = Math.round(value);
  return all < 3600 ? `${Math.floor(all / 60)} min ${all % 60} s`
    : `${whole(Math.floor(all / 3600))} h ${Math.floor((all % 3600) / 60)} min`;
}

function cents(value) {
  if (!Number.isFinite(value)) return 'unknown';
  return Math.abs(value) >= 9.95 && Math.abs(value) < 1e7 ? `${value.toFixed(0)} cent` : `${digits(value, 2)} cent`;
}

function percent(share) {
  if (share > 0 && share < 0.0005) return '< 0.1 %';
  return share < 0.0995 ? `${(100 * share).toFixed(1)} %` : `${(100 * share).toFixed(0)} %`;
}

function large(value) {
  let at = 0;
  for (; Math.abs(value) >= 999.5 && at < 6; ++at) value /= 1e3;
  return digits(value, 3) + ['', ' k', ' M', ' G', ' T', ' P', ' E'][at];
}

// ---- tables and sections

/** heads: texts, those of number columns begin with '#'. */
function table(heads, rows) {
  if (rows.length === 0) return null;
  const isNumber = heads.map((head) => head.startsWith('#'));
  const cell = (tag, content, i) => h(tag, isNumber[i] ? { class: 'n' } : {}, content);
  return h('div', { class: 'table' }, h('table', {},
    h('thead', {}, h('tr', {}, heads.map((head, i) => cell('th', head.replace(/^#/, ''), i)))),
    h('tbody', {}, rows.map((row) => h('tr', {}, heads.map((_, i) => cell('td', row[i] ?? '', i)))))));
}

/** rows: [name, value, remark]; rows with an undefined value are skipped. */
function facts(rows) {
  const shown = rows.filter((row) => row[1] !== undefined && row[1] !== null);
  return shown.length === 0 ? null : h('div', { class: 'table' },
    h('table', { class: 'facts' }, h('tbody', {}, shown.map(([name, value, remark]) =>
    h('tr', {}, h('th', {}, name), h('td', { class: 'n' }, value), h('td', { class: 'remark' }, remark ?? ''))))));
}

const remark = (...text) => h('p', { class: 'remark' }, ...text);
const note = (texts) => (texts.length === 0 ? null : h('div', { class: 'note' }, h('ul', {}, texts.map((text) => h('li', {}, text)))));
const section = (id, heading, ...content) => h('section', { id }, h('h2', {}, heading), ...content);
const leaveOut = (id, heading, reason) =>
  h('section', { id, class: 'missing' }, h('h2', {}, heading), h('p', { class: 'missing' }, `Left out: ${reason}`));

// ---- charts

/** bars: [label, value, text]. */
function drawBars(title, bars) {
  if (bars.length === 0) return null;
  const row = 27, left = 170, right = 180, most = Math.max(...bars.map((bar) => bar[1]));
  const draw = ([label, value, text], i) => {
    const top = row * i + 2, width = most > 0 ? (kWidth - left - right) * (value / most) : 0;
    return [h('text', { x: left - 10, y: top + 17, 'text-anchor': 'end' }, label.length > 40 ? `${label.slice(0, 39)}…` : label),
      h('rect', { class: 'c0', x: left, y: top + 3, width: Math.max(width, 1).toFixed(2), height: 18, rx: 2 }),
      h('text', { class: 'value', x: (left + width + 8).toFixed(1), y: top + 17 }, text)];
  };
  const view = { viewBox: `0 0 ${kWidth} ${row * bars.length + 4}`, role: 'img', 'aria-label': title };
  return h('div', { class: 'chart' }, h('svg', view, bars.map(draw)));
}

/** Maps values of an axis {low, high, isLog} to pixels, with ticks at 1, 2 and 5 times powers of ten. */
class Scale {
  constructor(isLog, low, high, from, to) {
    Object.assign(this, { isLog, from, to });
    high = this.turn(high);
    low = isLog ? Math.max(this.turn(low), high - kMaxDecades) : low;
    const room = Math.max(high - low, isLog ? 0.3 : Math.max(Math.abs(high), 1e-300) * 1e-3), middle = (low + high) / 2;
    this.low = middle - 0.53 * room;
    this.high = middle + 0.53 * room;
  }

  turn(value) { return this.isLog ? Math.log10(Math.max(value, Number.MIN_VALUE)) : value; }

  place(value) {
    const share = (this.turn(value) - this.low) / (this.high - this.low);
    return this.from + Math.min(1, Math.max(0, share)) * (this.to - this.from);
  }

  findTicks() {
    const ticks = [], span = this.high - this.low;
    if (this.isLog) {
      const every = Math.max(1, Math.ceil(span / 8)), factors = span < 0.7 ? [1, 2, 3, 4, 5, 6, 7, 8, 9] : span < 4 ? [1, 2, 5] : [1];
      for (let power = Math.floor(this.low); power <= Math.ceil(this.high); ++power) {
        if (power % every !== 0) continue;
        ticks.push(...factors.map((factor) => factor * 10 ** power).filter((tick) => tick >= 10 ** this.low && tick <= 10 ** this.high));
      }
    } else {
      const power = 10 ** Math.floor(Math.log10(span / 5)), step = power * [1, 2, 5, 10].find((factor) => factor * power >= span / 5);
      for (let i = Math.ceil(this.low / step); i * step <= this.high && ticks.length < 20; ++i) ticks.push(i * step);
    }
    return ticks;
  }
}

function formatTick(value) {
  if (value === 0) return '0';
  if (Math.abs(value) >= 999.5 && Math.abs(value) < 999.5e3) return `${digits(value / 1e3, 4)}k`;
  return Math.abs(value) >= 0.00095 && Math.abs(value) < 1000 ? digits(value, 4) : value.toExponential(0).replace('e+', 'e');
}

function drawAxes(x, y, labels, box) {
  const texts = [];
  let last = -1e9;
  for (const tick of x.findTicks()) {
    if (x.place(tick) - last < 34) continue;
    last = x.place(tick);
    texts.push(h('text', { x: last.toFixed(1), y: box.bottom + 17, 'text-anchor': 'middle' }, formatTick(tick)));
  }
  last = 1e9;
  for (const tick of y.findTicks()) {
    if (last - y.place(tick) < 15) continue;
    last = y.place(tick);
    texts.push(h('text', { x: box.left - 7, y: (last + 4).toFixed(1), 'text-anchor': 'end' }, formatTick(tick)));
  }
  return [h('g', { class: 'grid' },
    x.findTicks().map((tick) => h('path', { d: `M${x.place(tick).toFixed(1)} ${box.top}V${box.bottom}` })),
    y.findTicks().map((tick) => h('path', { d: `M${box.left} ${y.place(tick).toFixed(1)}H${box.right}` }))),
  h('g', { class: 'tick' }, texts,
    h('text', { x: box.right, y: box.bottom + 34, 'text-anchor': 'end' }, labels.x),
    h('text', { transform: `translate(13 ${(box.top + box.bottom) / 2}) rotate(-90)`, 'text-anchor': 'middle' }, labels.y))];
}

function drawMarks(marks, one, x, y, box) {
  const at = (mark) => `M${x.place(mark.x).toFixed(1)} ${y.place(mark.y).toFixed(1)}`;
  const path = (kind, pieces) => (pieces.length === 0 ? null : h('path', { class: `${kind} c${one.colour}`, d: pieces.join('') }));
  const whisker = (mark) => {
    const top = (y.place(mark.y) - 3).toFixed(1);
    return `M${x.place(mark.xLow).toFixed(1)} ${top}v6m0 -3H${x.place(mark.xHigh).toFixed(1)}m0 -3v6`;
  };
  const circle = (mark) => h('circle', { cx: x.place(mark.x).toFixed(1), cy: y.place(mark.y).toFixed(1), r: 3 },
    h('title', {}, mark.title));
  return [path('stick', one.isStick ? marks.map((mark) => `${at(mark)}V${box.bottom}`) : []),
    path('bar', marks.filter((mark) => mark.xHigh > mark.xLow).map(whisker)),
    path('dots', marks.length > kMaxTitled ? marks.map((mark) => `${at(mark)}h0`) : []),
    marks.length > 0 && marks.length <= kMaxTitled ? h('g', { class: `dot c${one.colour}` }, marks.map(circle)) : null];
}

/** Marks {x, y, xLow, xHigh, title} over a logarithmic x axis; series: {name, colour, isStick, marks}; level: {y, label} or undefined. */
function drawScatter({ title, xLabel, yLabel, isLogY, series, level }) {
  const isOnX = (value) => Number.isFinite(value) && value > 0, isOnY = (value) => Number.isFinite(value) && (value > 0 || !isLogY);
  const placed = series.map((one) => one.marks.filter((mark) => isOnX(mark.x) && isOnY(mark.y)));
  const all = placed.flat(), lost = series.reduce((sum, one) => sum + one.marks.length, 0) - all.length;
  if (all.length === 0) return null;
  const across = all.flatMap((mark) => [mark.x, mark.xLow, mark.xHigh]).filter(isOnX);
  const up = [...all.map((mark) => mark.y), ...(level ? [level.y] : [])].filter(isOnY);
  const least = (values) => values.reduce((a, b) => Math.min(a, b)), most = (values) => values.reduce((a, b) => Math.max(a, b));
  const box = { left: 64, right: kWidth - 14, top: 12, bottom: 250 };
  const x = new Scale(true, least(across), most(across), box.left, box.right),
    y = new Scale(isLogY, least(up), most(up), box.bottom, box.top);
  const line = level ? [h('path', { class: 'level', d: `M${box.left} ${y.place(level.y).toFixed(1)}H${box.right}` }),
    h('text', { class: 'level', x: box.right - 4, y: (y.place(level.y) - 5).toFixed(1), 'text-anchor': 'end' }, level.label)] : [];
  return [h('div', { class: 'chart' }, h('svg', { viewBox: `0 0 ${kWidth} ${box.bottom + 40}`, role: 'img', 'aria-label': title },
    drawAxes(x, y, { x: xLabel, y: yLabel }, box), line, series.map((one, i) => drawMarks(placed[i], one, x, y, box)))),
  series.length < 2 ? null : h('p', { class: 'legend' }, series.map((one) => [h('span', { class: `key c${one.colour}` }), `${one.name} `])),
  lost > 0 ? remark(`${lost} without a place on these axes.`) : null];
}
