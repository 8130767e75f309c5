// The workshop: banks, models, mallet blows, plans and recorded scenes, off the page's thread and the audio thread.
import { Refusal, Wasm } from './carillon-wasm.js';

const kPiece = 12 << 14; // bytes of a surface per message, whole triangles: some tens of microseconds of the audio thread
const kRows = 1 << 15; // words of a recording per message, approximately
const kLogged = 1 << 20; // words of past events kept for the plan

let wasm, engine; // engine: the port to the audio thread
const waiting = new Map(); // messages to the engine by id
let messages = 0, surfaces = 0, models = 0;
const surfaceOf = new Map(); // address -> {surface, bodies: Set}
const made = new Map(); // body -> {address, model}
let log = []; // Float64Array each: past events

/** Sends a message to the audio thread; returns a promise of its answer. */
function ask(message, transfer = []) {
  return new Promise((resolve, reject) => {
    waiting.set(++messages, { resolve, reject });
    engine.postMessage({ ...message, id: messages }, transfer);
  });
}

function letGo(body) {
  const of = made.get(body);
  if (of === undefined) return;
  engine.postMessage({ name: 'web_release_model', numbers: [of.model] });
  const entry = surfaceOf.get(of.address);
  entry.bodies.delete(body);
  if (entry.bodies.size === 0) {
    engine.postMessage({ name: 'web_release_surface', numbers: [entry.surface] });
    surfaceOf.delete(of.address);
  }
  made.delete(body);
}

/** Sends the model of a body, and its surface if the engine lacks it; returns the model's number. */
async function sendModel(body) {
  const { exports } = wasm, address = exports.web_surface_address(body) >>> 0, model = ++models;
  const tables = (wasm.call('web_write_tables', body), wasm.bytes());
  let entry = surfaceOf.get(address);
  if (entry === undefined) {
    const surface = ++surfaces, sizes = [0, 1, 2].map((part) => exports.web_surface_bytes(body, part));
    const columns = exports.web_surface_columns(body);
    entry = { surface, bodies: new Set() };
    surfaceOf.set(address, entry);
    entry.sent = (async () => {
      await ask({ type: 'surface', surface, triangles: sizes[0] / 12, columns, largest: sizes[1] / 4, shape: sizes[2] / 2 });
      for (let part = 0; part < 3; ++part) {
        const from = exports.web_surface_part(body, part) >>> 0;
        for (let done = 0; done < sizes[part]; done += kPiece) {
          const bytes = wasm.copy(Uint8Array, from + done, Math.min(kPiece, sizes[part] - done));
          await ask({ type: 'piece', surface, bytes }, [bytes.buffer]);
        }
      }
    })();
  }
  entry.bodies.add(body);
  await entry.sent;
  await ask({ type: 'model', model, surface: entry.surface, bytes: tables }, [tables.buffer]);
  return { address, model };
}

const obey = {
  open({ module, rate_hz, port }) {
    engine = port;
    engine.onmessage = ({ data }) => {
      const { resolve, reject } = waiting.get(data.id) ?? {};
      waiting.delete(data.id);
      if (data.type === 'error') reject?.(new Refusal(data.message));
      else resolve?.(data.result);
    };
    wasm = new Wasm(module);
    wasm.call('web_open_workshop', rate_hz);
    const choices = wasm.json();
    wasm.call('web_instructions');
    return { ...choices, instructions: wasm.text() };
  },
  bank({ bank, bytes, name }) {
    wasm.call('web_add_bank', bank, new Uint8Array(bytes), name);
    const facts = wasm.json();
    wasm.call('web_list_vertices', bank);
    facts.vertices_m = wasm.numbers();
    wasm.call('web_list_triangles', bank);
    facts.triangles = new Uint32Array(wasm.bytes().buffer);
    return facts;
  },
  closeBank({ bank }) {
    wasm.call('web_remove_bank', bank);
  },
  shape({ bank, mode }) {
    wasm.call('web_calc_shape', bank, mode);
    return wasm.numbers();
  },
  density({ bank, mode }) {
    wasm.call('web_calc_density', bank, mode);
    return wasm.numbers();
  },
  /** Makes or remakes a body; returns its facts and its model's number. */
  async body({ body, bank, scene, edits }) {
    wasm.call('web_make_body', body, bank, scene, edits);
    const facts = wasm.json(), before = made.get(body), sent = await sendModel(body);
    if (before !== undefined) {
      const entry = surfaceOf.get(before.address);
      engine.postMessage({ name: 'web_release_model', numbers: [before.model] });
      if (before.address !== sent.address) {
        entry.bodies.delete(body);
        if (entry.bodies.size === 0) {
          engine.postMessage({ name: 'web_release_surface', numbers: [entry.surface] });
          surfaceOf.delete(before.address);
        }
      }
    }
    made.set(body, sent);
    return { ...facts, model: sent.model };
  },
  closeBody({ body }) {
    letGo(body);
    wasm.call('web_remove_made_body', body);
  },
  blow({ body, scene, triangle, barycentric, time_s, number }) {
    wasm.call('web_make_blow', body, scene, triangle, ...barycentric, time_s ?? 0, time_s === undefined ? 0 : 1, number);
    const result = wasm.json(), words = wasm.words();
    obey.log({ words: words.slice() });
    engine.postMessage({ type: 'push', words }, [words.buffer]);
    return result;
  },
  ping({ body, mode, pressure_pa, number }) {
    wasm.call('web_make_ping', body, mode, pressure_pa, number);
    const words = wasm.words();
    engine.postMessage({ type: 'push', words }, [words.buffer]);
  },
  levels({ body, triangle, barycentric }) {
    wasm.call('web_calc_levels', body, triangle, ...barycentric);
    return wasm.numbers();
  },
  /** Logs events of the engine's bodies; events without a time get the time of sending. */
  log({ words, now_s }) {
    if (now_s !== undefined) for (let at = 0; at < words.length; at += words[at]) if (words[at + 2] === 1) words[at + 3] += now_s;
    log.push(words);
    for (let held = log.reduce((sum, { length }) => sum + length, 0); held > kLogged; held -= log.shift().length);
  },
  /** bodies: workshop numbers; numbers: engine numbers, as used in the log. */
  plan({ scene, bodies, numbers }) {
    const place = new Map(numbers.map((number, i) => [number, i])), kBody = [0, 4, 5, 6, 4, 0];
    const rows = [];
    for (const words of log) {
      for (let at = 0; at < words.length; at += words[at]) {
        const row = words.slice(at, at + words[at]), column = kBody[row[1]];
        if (column > 0) {
          if (!place.has(row[column])) continue;
          row[column] = place.get(row[column]);
          if (row[1] < 4) row[column + 1] = place.get(row[column + 1]) ?? -1;
        }
        rows.push(row);
      }
    }
    rows.sort((a, b) => a[3] - b[3]);
    const words = new Float64Array(rows.reduce((sum, { length }) => sum + length, 0));
    let at = 0;
    for (const row of rows) {
      words.set(row, at);
      at += row.length;
    }
    wasm.call('web_make_plan', scene, Int32Array.from(bodies), words);
    return wasm.json();
  },
  recording({ recording, text, name, bodies }) {
    wasm.call('web_add_recording', recording, text, name, Int32Array.from(bodies));
    const facts = wasm.json();
    facts.poses = bodies.map((_, body) => {
      wasm.call('web_list_poses', recording, body);
      return wasm.words();
    });
    return facts;
  },
  planRecording({ recording, scene }) {
    wasm.call('web_plan_recording', scene, recording);
    return wasm.json();
  },
  closeRecording({ recording }) {
    wasm.call('web_remove_recording', recording);
  },
  async play({ recording, playback, bodies, at_s, from_s, lead_s }) {
    wasm.call('web_list_recording', recording);
    const words = wasm.words(), began_s = await ask({ type: 'play', playback, bodies, at_s, from_s, lead_s });
    for (let begin = 0; begin < words.length; ) {
      let end = begin;
      while (end < words.length && end - begin < kRows) end += words[end];
      const piece = words.slice(begin, end);
      await ask({ type: 'played', playback, words: piece }, [piece.buffer]);
      begin = end;
    }
    return began_s;
  },
};

async function answer(data) {
  try {
    const result = await obey[data.type](data);
    if (data.id !== undefined) postMessage({ id: data.id, result });
  } catch (error) {
    const message = error instanceof Refusal ? error.message : `the workshop has failed: ${error.message}; load the page again`;
    postMessage({ id: data.id, message });
  }
}

// Requests to the audio thread are serialised, so versions of a body arrive in order; blows do not wait for them.
const kInTurn = new Set(['body', 'closeBody', 'closeBank', 'play']);
let last = Promise.resolve();
onmessage = ({ data }) => {
  if (kInTurn.has(data.type)) last = last.then(() => answer(data));
  else void answer(data);
};
