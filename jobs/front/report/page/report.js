// Sections of the report, from the data of the bank ("bank", trusted) and from job and run record (untrusted).

const data = JSON.parse(document.getElementById('data').textContent);
const { bank, job, run } = data;
const kMaxModeRows = 1000, kMaxBars = 32, kMaxRows = 200;
const numbers = (list) => list.map((value) => value ?? NaN); // JSON has no NaN
const modes = Object.fromEntries(Object.entries(bank.modes).map(([key, list]) => [key,
  typeof list[0] === 'string' ? list : numbers(list)]));
const modeCount = modes.heard_hz.length;
const nameMode = (i) => `mode ${i + 1}, ${hz(modes.heard_hz[i])}`;
const t60 = (i) => Math.log(1000) / modes.decay_per_s[i];
const explainMissing = (what) => (isObject(run) ? `the record of the run has no ${what}; it is of an older version, or damaged.`
  : `there is no record of the run, and so no ${what}.`);
const ranksText = () => optional(getCount(run, 'ranks'), (ranks) => `${ranks} rank${ranks === 1 ? '' : 's'}`);

function findLargest(list, format) {
  if (list.length === 0) return undefined;
  const at = list.reduce((best, value, i) => (value > list[best] ? i : best), 0);
  return `${format(list[at])} at ${nameMode(at)}`;
}

// ---- head

const phases = orderPhases(get(run, 'phase_seconds')).map((name) => [name, getAmount(run, 'phase_seconds', name)])
  .filter((phase) => phase[1] !== undefined);
const runSeconds = phases.reduce((sum, phase) => sum + phase[1], 0);
const rankBytes = getList(run, 'peak_bytes_by_rank').every((value) => Number.isFinite(value) && value >= 0)
  ? getList(run, 'peak_bytes_by_rank') : [];
const peakBytes = rankBytes.reduce((sum, value) => sum + value, 0);

/** Phases in the order of a run, unknown ones last. */
function orderPhases(recorded) {
  const known = ['trials', 'read', 'partition', 'assemble', 'factor', 'solve', 'orthogonalise', 'errors', 'write', 'other'];
  const names = isObject(recorded) ? Object.keys(recorded) : [];
  return [...known.filter((name) => names.includes(name)), ...names.filter((name) => !known.includes(name))]
    .slice(0, kMaxBars + known.length);
}

function makeTiles() {
  const tile = (what, value, text) => h('div', { class: 'tile' }, h('div', { class: 'what' }, what), h('div', { class: 'value' }, value),
    h('div', { class: 'remark' }, text));
  const isCorrected = modes.corrected_cents.length > 0, bars = isCorrected ? modes.corrected_cents : modes.body_cents;
  const most = (list) => list.reduce((a, b) => Math.max(a, b));
  return h('div', { class: 'tiles' },
    tile('Modes', whole(modeCount), `${plain(bank.band_hz[0])} to ${plain(bank.band_hz[1])} Hz`),
    tile('Error bar', bars.length === 0 ? '-' : cents(most(bars)),
      bars.length === 0 ? 'unknown' : isCorrected ? 'body, worst mode, corrected' : 'body, worst mode'),
    tile('Residual', modes.residual.length === 0 ? '-' : small(most(modes.residual)), 'worst mode'),
    tile('Time', phases.length === 0 ? '-' : seconds(runSeconds), phases.length === 0 ? 'not recorded' : ranksText()),
    tile('Memory', rankBytes.length === 0 ? '-' : bytes(peakBytes), rankBytes.length === 0 ? 'not recorded' : 'peak of all ranks'),
    tile('Bank', bytes(bank.bytes), `${whole(bank.vertices)} vertices`));
}

function makeHead() {
  const kind = { analytic: 'known modes', imported: 'modes imported from another program' }[bank.element]
    ?? `${bank.element} elements, ${bank.mass} mass`;
  const faults = bank.checks.filter((check) => check.faults.length > 0).length;
  const verdict = faults > 0
    ? h('p', { class: 'verdict bad' }, `This bank is invalid: ${faults} of ${bank.checks.length} checks fail. `,
      h('a', { href: '#checks' }, 'Details'))
    : h('p', { class: `verdict ${bank.proof ? 'good' : 'fair'}` }, `${bank.completeness ?? 'There is no proof that no mode is missing'}.`,
      h('br'),
      `${bank.accuracy}.`);
  return [h('h1', {}, data.title), remark(`${bank.file}, bank of version ${bank.version.join('.')}; ${kind}`), verdict,
    note([...getTexts(run, 'warnings'), ...data.remarks]), makeTiles()];
}

function makePictures() {
  const heading = 'The first modes';
  if (data.picture.reason) return leaveOut('pictures', heading, data.picture.reason);
  return section('pictures', heading, h('p', {},
    h('img', { src: data.picture.file, alt: `The first ${data.picture.modes} modes as deformed bodies, coloured by displacement` })));
}

function makePlay() {
  const heading = 'Play it', page = `${data.explorer}/index.html`;
  if (!data.explorer) return leaveOut('play', heading, 'carillon explore BANK --serve opens a page with the playable body.');
  return section('play', heading, h('p', {}, h('iframe', { src: page, title: 'The playable body', allow: 'autoplay' })),
    h('p', {}, 'It needs a web server: ', h('code', {}, `carillon explore ${data.explorer} --serve`), ' opens it alone. ',
      h('a', { href: page }, 'Whole window')));
}

// ---- modes

/** Sticks over the frequency, as high as the decay time; by number if some modes do not decay. */
function drawModes() {
  const ringsOut = modes.decay_per_s.every((decay) => decay > 0 && Number.isFinite(decay));
  const marks = modes.heard_hz.map((freq, i) => {
    const sum = modes.corrected_cents.length > 0 ? [modes.corrected_cents[i]] : [modes.bound_cents[i], modes.body_cents[i]];
    const error = sum.filter(Number.isFinite).reduce((a, b) => a + b, 0), width = 2 ** (Math.min(error, 12000) / 1200);
    return { x: freq, y: ringsOut ? t60(i) : i + 1, xLow: error > 0 ? freq / width : 0, xHigh: error > 0 ? freq * width : 0,
      title: nameMode(i) + (error > 0 ? ` ± ${cents(error)}` : '') + (ringsOut ? `, T60 ${digits(t60(i), 3)} s` : '') };
  });
  return drawScatter({ title: 'Modes by frequency', xLabel: 'frequency [Hz]',
    yLabel: ringsOut ? 'falls by 60 dB in [s]' : 'number of the mode',
    isLogY: ringsOut, series: [{ name: 'modes', colour: 0, isStick: true, marks }] });
}

function makeModeTable() {
  const cell = (list, i) => (Number.isFinite(list[i]) ? digits(list[i], 2) : '-');
  const part = (list, i) => (list.length > 0 ? digits(list[i], 4) : '-');
  const heads = ['#mode', `#${bank.origin} [Hz]`, `#± ${bank.origin} [cent]`, '#± body [cent]', '#heard [Hz]', '#± body [cent]',
    'correction', '#decay [1/s]', '#of material', '#of radiation', '#of supports', '#T60 [s]', '#residual', '#gain', 'kind',
    ...(modes.facet_cents.length > 0 ? ['#facets in doubt [cent]'] : [])];
  const rows = modes.heard_hz.slice(0, kMaxModeRows).map((heard, i) => [String(i + 1), modes.freq_hz[i].toFixed(2),
    cell(modes.bound_cents, i), cell(modes.body_cents, i), heard.toFixed(2), cell(modes.corrected_cents, i), modes.correction[i] ?? '-',
    digits(modes.decay_per_s[i], 4), digits(modes.material_per_s[i], 4), part(modes.radiation_per_s, i), part(modes.supports_per_s, i),
    digits(t60(i), 3), small(modes.residual[i]), digits(modes.gain[i], 4), modes.kind[i], cell(modes.facet_cents, i)]);
  return h('details', {}, h('summary', {}, 'All modes in numbers'), table(heads, rows),
    rows.length < modeCount ? remark(`The first ${rows.length} of ${modeCount} modes; carillon-bank info --json has all.`) : null,
    remark(`Frequencies are undamped. ± ${bank.origin}: bound of the distance to the exact mode; ± body: estimate of the distance to the `
      + 'mode of the body; heard: frequency as played, with the estimated error of the mesh removed, in air and on supports if the bank '
      + 'has them; decay and T60: as played, with its parts; gain: Pa at 1 m for unit modal velocity; kind: type of motion, if it can be '
      + 'found from the shape; facets in doubt: addition to ± body if the facets were interpreted wrongly.'));
}

function makeModes() {
  if (modeCount === 0) return leaveOut('modes', 'Modes', 'the bank has no modes; its band holds none.');
  const [low, high] = [Math.min, Math.max].map((choose) => modes.heard_hz.reduce((a, b) => choose(a, b)));
  return section('modes', 'Modes',
    h('p', {}, `${whole(modeCount)} modes from ${hz(low)} to ${hz(high)}; the band is ${plain(bank.band_hz[0])} Hz to `
      + `${plain(bank.band_hz[1])} Hz${bank.complete ? '' : ', and some of its modes were omitted'}.`),
    drawModes(), modes.body_cents.length + modes.bound_cents.length > 0 ? remark('Whiskers along the frequency: error bars.') : null,
    makeModeTable());
}

function makeProof() {
  const heading = 'Proof that no mode is missing', { proof } = bank;
  if (!proof) {
    return leaveOut('proof', heading, !bank.complete ? 'the bank has none: only the most audible modes of the band were kept.'
      : bank.version.join('.') === '1.0' ? 'banks of version 1.0 carry none; the band may hold more modes.'
        : 'the bank has none; the band may hold more modes.');
  }
  const count = (list, i) => list.filter((freq) => freq >= proof.cut_hz[i - 1] && freq < proof.cut_hz[i]).length;
  const countHere = (i) => {
    const here = String(count(modes.freq_hz, i)), left = count(proof.below_band_hz, i);
    return left > 0 ? `${here} + ${left} below the band once corrected` : here;
  };
  const rows = proof.cut_hz.slice(0, kMaxModeRows).map((cut, i) => [plain(cut), String(proof.below[i]),
    i > 0 ? String(proof.below[i] - proof.below[i - 1]) : '', i > 0 ? countHere(i) : '', digits(proof.margin[i] ?? NaN, 2)]);
  return section('proof', heading, bank.completeness ? h('p', {}, `${bank.completeness}.`) : null,
    h('p', {}, 'The signs of the pivots of K − σM count the modes below a frequency exactly, independently of the iteration. Between '
      + 'two cuts both must agree.'),
    table(['#below [Hz]', '#counted by inertia', '#counted since the previous cut', '#modes here', '#margin'], rows),
    facts([['worst orthonormality', small(proof.orthonormality ?? NaN), 'largest error of φᵢᵀ M φⱼ = δᵢⱼ'],
      ['worst backward error', small(proof.backward_error ?? NaN), 'of the factorisations behind the counts'],
      ['rigid motions', proof.rigid.slice(0, 24).join(', ') + (proof.rigid.length > 24 ? ' ...' : ''),
        'of each connected part; 6 without fixed nodes'],
      ['groups of degenerate modes', String(proof.clusters), 'their shapes are not unique'], ['method', proof.method]]));
}

function makeSeries(name, colour, list, format) {
  return { name, colour, marks: list.map((y, i) => ({ x: modes.heard_hz[i], y, title: `${nameMode(i)}: ${name} ${format(y)}` })) };
}

function makeErrors() {
  const { body_cents: body, bound_cents: bound, corrected_cents: corrected, facet_cents: facet } = modes;
  if (body.length + bound.length === 0)
    return leaveOut('errors', 'Error bars', 'the bank has none; the distance of its frequencies to those of the body is unknown.');
  const worst = (list) => list.filter(Number.isFinite).reduce((a, b) => Math.max(a, b), 0);
  const isBoundSmall = worst(bound) <= 1e-3 * worst(body);
  const series = [worst(body) > 0 && makeSeries('body (estimate)', 0, body, cents),
    worst(corrected) > 0 && makeSeries('body, corrected', 2, corrected, cents),
    worst(bound) > 0 && !isBoundSmall && makeSeries('mesh (bound)', 1, bound, cents)].filter(Boolean);
  const trials = getList(run, 'accuracy', 'trials').slice(0, 100).map((trial, i) => [String(i + 1), getText(trial, 'element') ?? '-',
    optional(getCount(trial, 'nodes'), whole), optional(getAmount(trial, 'worst_cents'), (value) => digits(value, 3)),
    optional(getAmount(trial, 'cpu_seconds'), seconds)]);
  return section('errors', 'Error bars',
    facts([['body, largest', findLargest(body, cents), 'estimated distance to the mode of the body'],
      ['corrected, largest', findLargest(corrected, cents), 'estimated distance of the corrected frequency to the mode of the body'],
      ['facets in doubt, largest', findLargest(facet, cents),
        'estimated addition if the facets were interpreted wrongly (planes, or samples of a smooth '
        + 'surface), not included in any bar; a surface with finer facets, or "facets": true in the job, resolves it'],
      ['mesh, largest', findLargest(bound, cents), 'bound of the distance to the exact mode of this mesh'],
      ['requested', getAmount(job, 'accuracy_cents') === undefined ? undefined : `${plain(getAmount(job, 'accuracy_cents'))} cent`]]),
    drawScatter({ title: 'Error bars by frequency', xLabel: 'frequency [Hz]', yLabel: 'error bar [cent]', isLogY: true, series }),
    worst(body) > 0 && worst(bound) > 0 && isBoundSmall ? remark('Estimates for the body; the bounds for the mesh are negligible.') : null,
    trials.length > 0 ? [h('h3', {}, 'Trials for the requested accuracy'),
      table(['#trial', 'element', '#nodes', '#worst error bar [cent]', '#CPU time'], trials)] : null);
}

function makeResiduals() {
  if (modeCount === 0) return leaveOut('residuals', 'Residuals', 'the bank has no modes.');
  const tolerance = getAmount(run, 'chosen', 'tolerance') ?? getAmount(job, 'solver', 'tolerance');
  const level = tolerance > 0 ? { y: tolerance, label: 'tolerance of the job' } : { y: 1e-4, label: 'limit of a valid bank' };
  return section('residuals', 'Residuals',
    facts([['largest', findLargest(modes.residual, small), '||Kφ − λMφ|| / (λ ||Mφ||)'],
      ['tolerance', tolerance > 0 ? plain(tolerance) : undefined, 'of the job'],
      ['above the tolerance', getCount(run, 'solver', 'above_tolerance')?.toString(), 'modes limited by rounding'],
      ['orthonormality', getAmount(run, 'solver', 'orthonormality_error')?.toExponential(1), 'largest error']]),
    drawScatter({ title: 'Residuals by frequency', xLabel: 'frequency [Hz]', yLabel: 'residual', isLogY: true, level,
      series: [makeSeries('residual', 0, modes.residual, small)] }));
}

// ---- mesh and run

function makeMesh() {
  const mesh = get(run, 'mesh'), { surface } = bank, number = (key) => optional(getCount(mesh, key), whole);
  const counted = (key, name, text) => [name, getCount(mesh, key) > 0 ? number(key) : undefined, text];
  const angle = getAmount(mesh, 'min_dihedral_deg'), ratio = getAmount(mesh, 'mean_ratio_min');
  const quality = facts([['smallest dihedral angle', angle === undefined ? undefined : `${angle.toFixed(2)}°`,
    angle < 5 ? 'a sliver: under 5°' : 'slivers are under 5°'],
    ['worst mean ratio', ratio?.toFixed(4), '1 is a regular tetrahedron']]);
  const bars = surface ? surface.triangles.map((count, i) => [`${10 * i}° - ${10 * (i + 1)}°`, count,
    `${whole(count)} · ${percent(count / bank.triangles)}`]) : [];
  return section('mesh', 'Mesh', quality ?? h('p', { class: 'missing' }, `Left out: ${explainMissing('quality of the mesh')}`),
    facts([['source', getText(mesh, 'source')], ['nodes', whole(bank.nodes), 'as solved, including mid-side nodes'],
      ['tetrahedra', whole(bank.tets)], ['connected parts', whole(bank.components)],
      ['surface', `${whole(bank.triangles)} triangles`, `${whole(bank.vertices)} vertices`],
      counted('fixed_nodes', 'fixed nodes', 'by the job'),
      ['nodes of the file', getCount(mesh, 'file_nodes') === undefined ? undefined : number('file_nodes')],
      counted('refinements', 'refined', 'times'), counted('reoriented', 'reoriented', 'inverted elements'),
      counted('unreferenced', 'unused', 'nodes of the file'),
      counted('welded', 'merged', 'coincident nodes'), counted('curved', 'curved', 'elements'),
      counted('straightened', 'straightened', 'elements with too much curvature'),
      ['mass', `${plain(bank.mass_kg ?? NaN)} kg`, `${plain(bank.volume_m3 ?? NaN)} m³`]]),
    surface ? [h('h3', {}, 'Triangles of the surface by their smallest angle'),
      drawBars('Triangles of the surface by their smallest angle', bars),
      facts([['edges', `${digits(1e3 * surface.mean_m, 4)} mm on average`,
        `${digits(1e3 * surface.shortest_m, 4)} mm to ${digits(1e3 * surface.longest_m, 4)} mm`],
        ['smallest angle', `${surface.smallest_deg.toFixed(2)}°`, '60° is an equilateral triangle']])] : null,
    note(getTexts(mesh, 'warnings')));
}

function makeTime() {
  const stations = getList(run, 'stations').slice(0, kMaxRows).filter((station) => getText(station, 'name') !== undefined);
  const rows = stations.map((station) => [getText(station, 'name'),
    ...['seconds', 'cpu_seconds'].map((key) => optional(getAmount(station, key), seconds)),
    ...['peak_bytes_largest_rank', 'peak_bytes_all_ranks'].map((key) => optional(getAmount(station, key), bytes))]);
  if (phases.length + rows.length === 0) return leaveOut('time', 'Time', explainMissing('times'));
  const on = getCount(run, 'ranks') === undefined ? '' : ` on ${ranksText()}`;
  return section('time', 'Time',
    phases.length > 0 ? [h('p', {}, `${seconds(runSeconds)} of wall time${on}.`), drawBars('Seconds by phase',
      phases.map(([name, value]) => [name, value, `${seconds(value)} · ${percent(runSeconds > 0 ? value / runSeconds : 0)}`]))] : null,
    rows.length > 0 ? h('details', {}, h('summary', {}, 'Phases of the run'),
      table(['phase', '#wall time', '#CPU, all ranks', '#peak so far, largest rank', '#peak so far, all ranks'], rows)) : null);
}

function makeMemory() {
  const each = Math.ceil(rankBytes.length / kMaxBars), bars = [];
  for (let first = 0; first < rankBytes.length; first += each) {
    const group = rankBytes.slice(first, first + each), most = Math.max(...group);
    bars.push([each === 1 ? `rank ${first}` : `ranks ${first} - ${first + group.length - 1}`, most, bytes(most)]);
  }
  const ranks = getList(run, 'partition', 'ranks');
  const rows = ranks.slice(0, kMaxRows).map((rank, i) => [String(i),
    ...['elements', 'owned_nodes', 'halo_nodes'].map((key) => optional(getCount(rank, key), whole))]);
  if (bars.length + rows.length === 0) return leaveOut('memory', 'Memory', explainMissing('memory'));
  const cut = getCount(run, 'partition', 'edge_cut');
  return section('memory', 'Memory',
    bars.length > 0 ? [h('p', {}, `At most ${bytes(peakBytes)} on all ranks together.`), drawBars('Peak memory by rank', bars),
      each > 1 ? remark('Each bar is the largest of its ranks.') : null] : null,
    rows.length > 0 ? [h('h3', {}, 'Partition of the mesh'),
      facts([['edges cut', cut === undefined ? undefined : whole(cut), 'between the parts'],
        ['balance of elements', getAmount(run, 'partition', 'element_balance')?.toFixed(3), 'largest part / mean'],
        ['balance of nodes', getAmount(run, 'partition', 'node_balance')?.toFixed(3)]]),
      table(['#rank', '#elements', '#own nodes', '#halo nodes'], rows),
      ranks.length > kMaxRows ? remark(`The first ${kMaxRows} of ${ranks.length} ranks.`) : null] : null);
}

function makeWork() {
  const work = get(run, 'work'), solver = get(run, 'solver'), names = orderPhases(work).filter((name) => isObject(work[name]));
  const isProfiled = names.some((name) => getAmount(work, name, 'messages') !== undefined);
  const columns = [['flops', large, '#operations'], ...(isProfiled ? [['messages', large, '#messages'], ['bytes', bytes, '#bytes'],
    ['collectives', large, '#collectives'], ['collective_bytes', bytes, '#bytes of collectives']] : [])];
  const count = (key) => (getCount(solver, key) === undefined ? undefined : whole(getCount(solver, key))),
    flops = getAmount(solver, 'factor_flops');
  const content = [facts([['factorisation', getText(solver, 'factorisation')], ['ordering', getText(solver, 'ordering')],
    ['entries of a factor', count('factor_entries'), 'numbers of 8 bytes'],
    ['operations of a factorisation', flops === undefined ? undefined : `${large(flops)}${flops < 1000 ? ' ' : ''}flop`],
    ['factorisations', count('factorisations'), 'including those of the proof'], ['solves', count('solves'), 'right-hand sides']]),
  names.length > 0 ? [h('h3', {}, 'Counted on all ranks, by phase'), table(['phase', ...columns.map((column) => column[2])],
    names.map((name) => [name, ...columns.map(([key, format]) => optional(getAmount(work, name, key), format))]))] : null];
  return content.every((part) => part === null) ? leaveOut('work', 'Work', explainMissing('work')) : section('work', 'Work', content);
}

function makeSize() {
  return section('size', 'Size of the bank',
    h('p', {}, `${bytes(bank.bytes)} in total, ${whole(bank.bytes)} bytes: ${whole(bank.vertices)} vertices of the surface, `
      + `${whole(modeCount)} modes.`),
    drawBars('Bytes by part of the bank',
      bank.parts.map(([name, value]) => [name, value, `${bytes(value)} · ${percent(value / Math.max(1, bank.bytes))}`])));
}

function makeChecks() {
  const rows = bank.checks.flatMap((check) => (check.faults.length === 0
    ? [[h('span', { class: 'ok' }, 'ok'), check.property, check.figure]]
    : check.faults.map((fault) => [h('span', { class: 'fault' }, 'FAULT'), check.property, fault])));
  return section('checks', 'Checks', table(['', 'property', 'figure'], rows),
    remark('As in carillon-bank check, which counts modes from 0.'));
}

function makeJob() {
  if (!isObject(job)) return leaveOut('job', 'Job', 'neither the file of the resolved job nor the bank has it.');
  const text = JSON.stringify(job, null, 2);
  return section('job', 'Job', h('pre', {}, text.length > 200000 ? `${text.slice(0, 200000)}…` : text));
}

function makeProgram() {
  const versions = Object.keys(isObject(get(run, 'versions')) ? run.versions : {}).slice(0, kMaxBars);
  const content = facts([['program', getText(run, 'program')], ['revision', getText(run, 'git')],
    ['finished', getText(run, 'finished_utc'), 'UTC'],
    ['ranks', getCount(run, 'ranks')?.toString()], ...versions.map((name) => [name, getText(run, 'versions', name)])]);
  return content ? section('program', 'Program and libraries', content)
    : leaveOut('program', 'Program and libraries', explainMissing('versions'));
}

document.title = data.title;
document.querySelector('header').replaceChildren(...makeHead().filter(Boolean));
document.querySelector('main').append(makePictures(), makePlay(), makeModes(), makeProof(), makeErrors(), makeResiduals(), makeMesh(),
  makeTime(), makeMemory(), makeWork(), makeSize(), makeChecks(), makeJob(), makeProgram());
