// The physics: carillon-physics.wasm steps a world ahead of the sound, and its events go to the audio thread as a recording without end.
import { Refusal, Wasm } from './carillon-wasm.js';

const kStep_s = 0.004, kPause_ms = 4;

let wasm, engine; // engine: the port to the audio thread
let playback, look_ahead_s, isLive, at_s, reached_s = 0, isOpen = false; // at_s: the world's start in engine time
const waiting = new Map(); // messages to the engine by id
let messages = 0;

/** Sends a message to the audio thread; returns a promise of its answer. */
function ask(message, transfer = []) {
  return new Promise((resolve, reject) => {
    waiting.set(++messages, { resolve, reject });
    engine.postMessage({ ...message, id: messages }, transfer);
  });
}

/** Advances by one slice; events go to the audio thread, the poses among them to the page. */
function advance() {
  wasm.call('web_advance_world', reached_s + kStep_s);
  const words = wasm.words(), end = words.length - 1, poses = [];
  reached_s = words[end];
  for (let at = 0; at < end; at += words[at]) if (words[at + 1] === 4) poses.push([words[at + 4], words[at + 3], ...words.slice(at + 5, at + 8), ...words.slice(at + 11, at + 15)]);
  if (poses.length > 0) postMessage({ poses });
  if (end === 0) return;
  const events = words.slice(0, end);
  engine.postMessage({ type: 'played', playback, words: events }, [events.buffer]);
}

/** Advances to the look-ahead beyond the engine. In real time impacts are rigid while less than a third of the look-ahead is left. */
async function catchUp() {
  const now_s = (await ask({ type: 'settle' })) - at_s, began_ms = performance.now();
  while (isOpen && reached_s < now_s + look_ahead_s) {
    const left_s = reached_s - now_s - (performance.now() - began_ms) / 1000;
    if (isLive) wasm.call('web_allow_modal_impacts', +(left_s > look_ahead_s / 3));
    advance();
  }
}

async function keepAhead() {
  try {
    await catchUp();
    if (isOpen) setTimeout(keepAhead, kPause_ms);
  } catch (error) {
    postMessage({ failed: `the physics has failed: ${error.message}` });
  }
}

const toRow = (values = []) => Float64Array.from(values);

const obey = {
  /** banks: bytes; bodies: {bank: number in the list, name, numbers, number in the engine}; world: a row (world.hpp). */
  async open({ module, port, banks, bodies, world, ...rest }) {
    engine = port;
    engine.onmessage = ({ data }) => {
      const { resolve, reject } = waiting.get(data.id) ?? {};
      waiting.delete(data.id);
      if (data.type === 'error') reject?.(new Refusal(data.message));
      else resolve?.(data.result);
    };
    ({ playback, look_ahead_s, isLive } = rest);
    wasm = new Wasm(module);
    wasm.call('web_open_world');
    for (const [n, { bytes, name }] of banks.entries()) wasm.call('web_add_bank', n, new Uint8Array(bytes), name);
    for (const { bank, name, numbers } of bodies) wasm.call('web_add_world_body', bank, toRow(numbers), name);
    wasm.call('web_start_world', toRow(world));
    at_s = await ask({ type: 'play', playback, bodies: bodies.map(({ number }) => number), from_s: 0, lead_s: look_ahead_s });
    isOpen = true;
    void keepAhead();
    return at_s;
  },
  push: ({ body, impulse_n_s, at_m }) => void wasm.call('web_push_body', body, toRow(impulse_n_s), toRow(at_m)),
  grab: ({ body, at_m, frequency_hz = 4, damping_ratio = 1, max_force_n = 0 }) =>
    void wasm.call('web_grab_body', body, toRow(at_m), frequency_hz, damping_ratio, max_force_n),
  drag: ({ body, target_m, over_s = 0.02 }) => void wasm.call('web_drag_body', body, toRow(target_m), over_s),
  release: ({ body }) => void wasm.call('web_release_grab', body),
  add: ({ body, numbers }) => void wasm.call('web_enter_body', body, toRow(numbers)),
  remove: ({ body }) => void wasm.call('web_take_out_body', body),
  settle: catchUp,
  close() {
    isOpen = false;
    engine.postMessage({ name: 'web_end_playback', numbers: [playback] });
  },
};

onmessage = async ({ data }) => {
  try {
    postMessage({ id: data.id, result: await obey[data.type](data) });
  } catch (error) {
    postMessage({ id: data.id, message: error instanceof Refusal ? error.message : `the physics has failed: ${error.message}` });
  }
};
